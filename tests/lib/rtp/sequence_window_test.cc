// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/sequence_window.h"

#include <gtest/gtest.h>

#include <vector>

namespace lf::rtp {
namespace sequence_window_test {

using enum SequenceWindow::Verdict;

SequenceWindow::Verdict add(SequenceWindow& window, int sequence, uint32_t timestamp = 7) {
  return window.add(static_cast<uint16_t>(sequence), timestamp);
}

TEST(SequenceWindow, CountsGapsUntilTheyAreFilled) {
  SequenceWindow window;
  for (const int s : {65533, 65534, 1, 3}) EXPECT_EQ(add(window, s), kNew);  // around the end
  EXPECT_EQ(window.lost(), 3u);                                              // 65535, 0, 2
  EXPECT_EQ(add(window, 2), kNew);
  EXPECT_EQ(add(window, 65535), kNew);
  EXPECT_EQ(window.lost(), 1u);
  EXPECT_EQ(add(window, 65532), kNew);  // from before the first: was never missing
  EXPECT_EQ(window.lost(), 1u);
}

TEST(SequenceWindow, KnowsDuplicates) {
  SequenceWindow window;
  for (int s = 0; s < 3 * SequenceWindow::kSize; s++) {
    EXPECT_EQ(add(window, s), kNew);
    EXPECT_EQ(add(window, s), kDuplicate);
    for (const int back : {1, 5, SequenceWindow::kSize - 1})
      EXPECT_TRUE(s < back || add(window, s - back) == kDuplicate);
  }
  EXPECT_EQ(window.lost(), 0u);
}

TEST(SequenceWindow, ALongGap) {
  SequenceWindow window;
  add(window, 0);
  EXPECT_EQ(add(window, 2000), kNew);
  EXPECT_EQ(window.lost(), 1999u);
  for (int s = 2000 - SequenceWindow::kSize + 1; s < 2000; s++) EXPECT_EQ(add(window, s), kNew);
  EXPECT_EQ(window.lost(), 1999u - SequenceWindow::kSize + 1);
}

TEST(SequenceWindow, ASenderThatBeginsAnew) {
  for (const int from : {30000, 100 - SequenceWindow::kSize - 5, -20000}) {
    SequenceWindow window;
    add(window, 100);
    EXPECT_EQ(add(window, from), kNew);  // may be a stray one
    EXPECT_EQ(add(window, from + 1), kRestarted);
    EXPECT_EQ(add(window, from + 1), kDuplicate);
    EXPECT_EQ(add(window, from + 3), kNew);
    EXPECT_EQ(window.lost(), 1u);
  }
  // A stray packet changes nothing.
  SequenceWindow window;
  add(window, 100);
  EXPECT_EQ(add(window, 30000), kNew);
  EXPECT_EQ(add(window, 101), kNew);
  EXPECT_EQ(add(window, 30001), kNew);
  EXPECT_EQ(add(window, 100), kDuplicate);
  EXPECT_EQ(window.lost(), 0u);
}

TEST(SequenceWindow, TheSameNumberAtAnotherTimeIsAnotherPacket) {
  SequenceWindow window;
  for (int s = 100; s < 120; s++) add(window, s, 1000);
  EXPECT_EQ(add(window, 105, 9000), kRestarted);
  EXPECT_EQ(add(window, 106, 9000), kNew);
  EXPECT_EQ(add(window, 105, 9000), kDuplicate);
  EXPECT_EQ(window.lost(), 0u);
}

}  // namespace sequence_window_test
}  // namespace lf::rtp
