// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/process.h"
#include "support/test.h"

#include <future>

namespace lf::serve {
namespace {

TEST(Log, LinesArePrintableAndShort) {
  EXPECT_EQ(printable("view 1 opens"), "view 1 opens");
  EXPECT_EQ(printable("a\nb\x1b[31m\xc3\xa4"), "a?b?[31m??");
  EXPECT_EQ(printable(std::string(1000, 'x')).size(), kLongestLine);
}

TEST(Log, LimitsTheRateOfLines) {
  testing::internal::CaptureStdout();
  for (int i = 0; i < 3 * kLinesAtOnce; i++) say("line");
  const std::string said = testing::internal::GetCapturedStdout();
  EXPECT_LT(std::count(said.begin(), said.end(), '\n'), 2 * kLinesAtOnce);
}

using std::chrono::milliseconds;

constexpr milliseconds kSoon{10}, kPatience{20000};

TEST(Teardowns, HangingTeardownDoesNotBlockOthers) {
  std::promise<void> hang;
  std::atomic<int> ended = 0;
  Teardowns departures;
  EXPECT_TRUE(departures.wait(kSoon));
  departures.add([until = hang.get_future().share()] { until.wait(); });
  for (int i = 0; i < 20; i++) departures.add([&] { ended++; });
  while (departures.size() > 1) std::this_thread::yield();
  EXPECT_EQ(ended, 20);
  EXPECT_FALSE(departures.wait(kSoon));
  hang.set_value();
  EXPECT_TRUE(departures.wait(kPatience));
}

TEST(Teardowns, FinishedTeardownsReleaseTheirObjects) {
  const auto held = std::make_shared<int>(7);
  Teardowns departures;
  departures.add([held] {});
  ASSERT_TRUE(departures.wait(kPatience));
  EXPECT_EQ(held.use_count(), 1);
}

TEST(Teardowns, HangingTeardownOutlivesTheObject) {
  std::promise<void> hang;
  const auto held = std::make_shared<int>(7);
  {
    Teardowns departures;
    departures.add([held, until = hang.get_future().share()] { until.wait(); });
  }
  EXPECT_EQ(held.use_count(), 2);
  hang.set_value();
  while (held.use_count() > 1) std::this_thread::yield();
}

}  // namespace
}  // namespace lf::serve
