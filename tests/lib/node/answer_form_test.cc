// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/answer_form.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

View view_of(int width, int height) {
  View view;
  view.width = width;
  view.height = height;
  return view;
}

TEST(AnswerForm, TheCodecFollowsLinkAndQuality) {
  using wire::Codec;
  const struct {
    CodecChoice choice;
    bool in_process;
    int quality;
    Codec codec;
  } cases[] = {
      {CodecChoice::kAuto, true, 90, Codec::kRaw16}, {CodecChoice::kAuto, false, 90, Codec::kJpeg},
      {CodecChoice::kAuto, false, 0, Codec::kRaw},   {CodecChoice::kJpeg, true, 90, Codec::kJpeg},
      {CodecChoice::kJpeg, true, 0, Codec::kRaw},    {CodecChoice::kRaw16, false, 90, Codec::kRaw16},
      {CodecChoice::kRaw, true, 90, Codec::kRaw},
  };
  for (const auto& c : cases) {
    const AnswerForm form = choose_form(view_of(80, 60), c.choice, c.in_process, c.quality);
    EXPECT_EQ(form.codec, c.codec);
    EXPECT_EQ(form.quality, c.codec == Codec::kJpeg ? c.quality : 0);
  }
}

TEST(AnswerForm, EmptyPixelsAreSparedWhereBytesCount) {
  const View view = view_of(640, 480);
  const auto spare = [&](CodecChoice choice, bool in_process) {
    return choose_form(view, choice, in_process, 90).spare_pixels;
  };
  EXPECT_LT(spare(CodecChoice::kRaw16, false), spare(CodecChoice::kJpeg, false));
  EXPECT_LT(spare(CodecChoice::kJpeg, false), spare(CodecChoice::kAuto, true));
}

}  // namespace
}  // namespace lf
