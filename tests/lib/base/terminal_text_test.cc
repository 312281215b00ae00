// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/terminal_text.h"
#include "support/test.h"

namespace lf {
namespace {

using namespace std::string_literals;

TEST(TerminalText, KeepsPrintableText) {
  for (const char* text :
       {"", "camera 1: good\n\ttab", "Kamera f\xc3\xbcr \xe2\x82\xac \xf0\x9f\x93\xb7", "\xc2\xa0"}) {
    EXPECT_EQ(terminal_text(text), text);
    EXPECT_EQ(has_control_characters(text), std::string(text).find('\n') != std::string::npos);
  }
}

TEST(TerminalText, ReplacesControlCharactersAndInvalidBytes) {
  EXPECT_EQ(terminal_text("\x1b[2J\r\b\x7f\0."s), "?[2J????.");
  EXPECT_EQ(terminal_text("\xc2\x9b"
                          "2J\xc2\x80\xc2\x9f"),
            "?2J??")
      << "C1 as UTF-8";
  EXPECT_EQ(terminal_text("\x9b"
                          "2J \xc2"),
            "?2J ?")
      << "C1 as bytes";
  EXPECT_EQ(terminal_text("\xc0\x9b\xe0\x80\x9b\xf0\x80\x80\x9b"), "?????????") << "too long forms";
  EXPECT_TRUE(has_control_characters("a\xc2\x85"));
  EXPECT_TRUE(has_control_characters("a\x7f"));
}

}  // namespace
}  // namespace lf
