// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/request_schedule.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

constexpr uint64_t kSecond = 1'000'000'000, kFrame = kSecond / 10;
const Schedule kTenth(10, 1);

std::vector<NamedView> views(std::initializer_list<double> times) {
  std::vector<NamedView> views;
  for (const double time : times) {
    views.emplace_back();
    views.back().time = time;
  }
  return views;
}

TEST(RequestSchedule, OneRequestAFrameForEver) {
  RequestSchedule schedule(kTenth);
  EXPECT_FALSE(schedule.from_file());
  EXPECT_FALSE(schedule.end());
  for (uint64_t i = 0; i < 3; i++) {
    const auto slot = schedule.next();
    ASSERT_TRUE(slot);
    EXPECT_EQ(slot->pts, i * kFrame);
    EXPECT_EQ(slot->duration, kFrame);
    EXPECT_EQ(slot->target_time, slot->pts);
    EXPECT_FALSE(slot->view);
    schedule.advance(*slot);
  }
  schedule.seek(kSecond + 1);
  EXPECT_EQ(schedule.next()->pts, kSecond + kFrame);
}

TEST(RequestSchedule, AnotherRateGoesOnFromTheNextFrame) {
  RequestSchedule schedule(kTenth);
  for (int i = 0; i < 3; i++) schedule.advance(*schedule.next());
  EXPECT_TRUE(schedule.set_rate(Schedule(20, 1)));
  EXPECT_EQ(schedule.next()->pts, 3 * kFrame);
  EXPECT_EQ(schedule.next()->duration, kFrame / 2);
  schedule.advance(*schedule.next());
  EXPECT_TRUE(schedule.set_rate(Schedule(5, 1)));
  EXPECT_EQ(schedule.next()->pts, 4 * kFrame) << "the next instant of that rate";
}

TEST(RequestSchedule, AListOfViewsHasOneRate) {
  RequestSchedule schedule(kTenth, views({0, 0, 0}), false);
  EXPECT_TRUE(schedule.set_rate(Schedule(20, 1)));
  EXPECT_EQ(schedule.end(), 3 * kFrame / 2);
  schedule.advance(*schedule.next());
  EXPECT_FALSE(schedule.set_rate(kTenth)) << "its views are stamped by number";
  EXPECT_EQ(schedule.next()->pts, kFrame / 2);
  RequestSchedule path(kTenth, views({0, 1, 3}), false);
  path.advance(*path.next());
  EXPECT_TRUE(path.set_rate(Schedule(20, 1)));
  EXPECT_EQ(path.next()->pts, kSecond) << "the file's time";
}

TEST(RequestSchedule, AFileEnds) {
  RequestSchedule schedule(kTenth, views({0, 0.5}), false);
  EXPECT_TRUE(schedule.from_file());
  const auto first = schedule.next();
  ASSERT_TRUE(first && first->view);
  schedule.advance(*first);
  const auto second = schedule.next();
  EXPECT_EQ(second->pts, kSecond / 2);
  EXPECT_EQ(schedule.end(), second->pts + second->duration);
  schedule.advance(*second);
  EXPECT_FALSE(schedule.next());
  EXPECT_FALSE(schedule.next_live(kSecond, 0, 0));
  EXPECT_FALSE(RequestSchedule(kTenth, views({0, 0.5}), true).end());
}

// A request that was made while the pipeline had no base time yet is stamped with the time of the clock.
TEST(RequestSchedule, AStampOfAnotherBaseTimeSilencesNobody) {
  constexpr uint64_t kBase = 1000 * kSecond;
  RequestSchedule schedule(kTenth);
  schedule.advance(*schedule.next_live(kBase, 0, 0));
  const auto slot = schedule.next_live(kBase + kSecond, kBase, 0);
  ASSERT_TRUE(slot);
  EXPECT_EQ(slot->target_time, kBase + kSecond);
  EXPECT_EQ(slot->pts, kSecond);
}

TEST(RequestSchedule, LiveItIsTheNewestInstantThatIsOldEnough) {
  constexpr uint64_t kBase = 1000 * kSecond, kDelay = 30'000'000;
  RequestSchedule schedule(kTenth);
  const auto slot = schedule.next_live(kBase + 5 * kFrame + kDelay + 1, kBase, kDelay);
  ASSERT_TRUE(slot);
  EXPECT_EQ(slot->target_time, kBase + 5 * kFrame);
  EXPECT_EQ(slot->pts, 5 * kFrame);
  schedule.advance(*slot);
  EXPECT_EQ(schedule.next_live(kBase + 5 * kFrame + kDelay + 2, kBase, kDelay)->pts, 6 * kFrame) << "none twice";
  EXPECT_EQ(schedule.next_live(kBase + 9 * kFrame + kDelay, kBase, kDelay)->pts, 9 * kFrame)
      << "those that have passed are left out";
  EXPECT_EQ(RequestSchedule(kTenth).next_live(kBase, kBase, kDelay)->pts, 0u) << "none before the stream begins";
}

TEST(RequestSchedule, AheadOfItsTurnARequestAsksForWhatIsThere) {
  constexpr uint64_t kBase = 1000 * kSecond, kDelay = 30'000'000;
  const RequestSchedule schedule(kTenth);
  const RequestSlot slot = *schedule.next_live(kBase + 5 * kFrame + kDelay, kBase, kDelay);
  const uint64_t now = kBase + 5 * kFrame + kDelay - 10;
  const RequestSlot early = schedule.ahead_of_turn(slot, now, kBase, kDelay);
  EXPECT_EQ(early.target_time, kBase + 4 * kFrame);
  EXPECT_EQ(early.pts, 5 * kFrame - 10);
  EXPECT_EQ(early.duration, slot.duration);
}

TEST(RequestSchedule, ATurnIsPassedOnce) {
  RequestSchedule schedule(kTenth);
  const uint64_t turn = schedule.turn();
  schedule.pass(turn);
  schedule.pass(turn);
  EXPECT_EQ(schedule.next()->pts, kFrame);
}

}  // namespace
}  // namespace lf
