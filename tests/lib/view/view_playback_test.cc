// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_playback.h"

#include <gtest/gtest.h>

#include "view/navigator.h"

namespace lf {
namespace {

constexpr uint64_t kSecond = 1'000'000'000;

std::vector<NamedView> views_at(const std::vector<double>& times) {
  std::vector<NamedView> views;
  for (double time : times) {
    Viewpoint v;
    v.pose.position.x = static_cast<double>(views.size());
    views.push_back({"v", time, make_view(v, 32, 24)});
  }
  return views;
}

struct Shown {
  double x;
  uint64_t time, duration, target;
  bool operator==(const Shown&) const = default;
};
void PrintTo(const Shown& s, std::ostream* out) {
  *out << "{" << s.x << " at " << s.time << " for " << s.duration << ", target " << s.target << "}";
}

std::vector<Shown> play(const ViewPlayback& playback, uint64_t limit) {
  std::vector<Shown> shown;
  for (uint64_t n = 0; n < limit; n++) {
    const auto item = playback.item(n);
    if (!item) break;
    shown.push_back({item->view->pose.position.x, item->time, item->duration, item->target_time});
  }
  return shown;
}

TEST(ViewPlayback, AListIsShownOneViewPerPeriod) {
  const ViewPlayback playback(views_at({2, 2, 2}), Schedule(4, 1), false);
  EXPECT_FALSE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, 0, 250000000, 2 * kSecond},
                                                    {1, 250000000, 250000000, 2 * kSecond},
                                                    {2, 500000000, 250000000, 2 * kSecond}}));
  EXPECT_EQ(playback.duration(), 750000000u);
}

TEST(ViewPlayback, APathIsShownAtItsTimes) {
  const ViewPlayback playback(views_at({1, 1.5, 3}), Schedule(4, 1), false);
  EXPECT_TRUE(playback.has_times());
  EXPECT_EQ(play(playback, 99), (std::vector<Shown>{{0, kSecond, kSecond / 2, kSecond},
                                                    {1, 3 * kSecond / 2, 3 * kSecond / 2, 3 * kSecond / 2},
                                                    {2, 3 * kSecond, 3 * kSecond / 2, 3 * kSecond}}));
  EXPECT_EQ(playback.duration(), 7 * kSecond / 2);
}

TEST(ViewPlayback, LoopedTimesGoOnGrowing) {
  const ViewPlayback path(views_at({1, 2}), Schedule(4, 1), true);
  EXPECT_EQ(play(path, 5), (std::vector<Shown>{{0, 1 * kSecond, kSecond, 1 * kSecond},
                                               {1, 2 * kSecond, kSecond, 2 * kSecond},
                                               {0, 3 * kSecond, kSecond, 3 * kSecond},
                                               {1, 4 * kSecond, kSecond, 4 * kSecond},
                                               {0, 5 * kSecond, kSecond, 5 * kSecond}}));
  const ViewPlayback list(views_at({0, 0}), Schedule(1, 1), true);
  EXPECT_EQ(play(list, 3),
            (std::vector<Shown>{{0, 0, kSecond, 0}, {1, kSecond, kSecond, 0}, {0, 2 * kSecond, kSecond, 0}}));
}

TEST(ViewPlayback, EqualTimesAtTheEndStillTakeAPeriod) {
  const ViewPlayback playback(views_at({0, 1, 1}), Schedule(2, 1), true);
  EXPECT_EQ(playback.item(3)->time, 3 * kSecond / 2);
}

TEST(ViewPlayback, FindsTheFirstViewFromATimeOn) {
  const ViewPlayback playback(views_at({1, 2, 2, 3}), Schedule(4, 1), false);
  EXPECT_EQ(playback.first_at(0), 0u);
  EXPECT_EQ(playback.first_at(kSecond), 0u);
  EXPECT_EQ(playback.first_at(kSecond + 1), 1u);
  EXPECT_EQ(playback.first_at(3 * kSecond), 3u);
  EXPECT_EQ(playback.first_at(3 * kSecond + 1), 4u);
  EXPECT_FALSE(playback.item(4));
}

}  // namespace
}  // namespace lf
