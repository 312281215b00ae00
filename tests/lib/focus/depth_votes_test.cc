// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_selection.h"

#include "support/test.h"

namespace lf {
namespace {

constexpr double kNearest = 10, kBin = kNearest / 1024;
constexpr int kNodes = 1000;

// Rounds of a map of kNodes nodes; each round has a number of votes for an inverse distance.
struct Votes {
  struct At {
    double inverse;
    int nodes;
  };
  void add(const std::vector<At>& told) {
    FocalMap map;
    map.columns = kNodes;
    map.rows = 1;
    map.farthest = 0;
    map.nearest = kNearest;
    map.levels.assign(kNodes, 255);  // arbitrary level of nodes without evidence
    DepthSelection choice;
    choice.informed.assign(kNodes, 0);
    choice.least.assign(kNodes, std::numeric_limits<float>::infinity());
    std::fill_n(choice.least.begin(), seen, 1.f);
    size_t node = 0;
    for (const At& at : told)
      for (int k = 0; k < at.nodes; k++, node++) {
        map.levels[node] = map.level_of(at.inverse);
        choice.informed[node] = 1;
      }
    votes.add(map, choice);
  }
  // Expects a range from `farthest` to `nearest`, up to quantisation and one bin at each end.
  void expect(double farthest, double nearest) const {
    constexpr double kBound = kNearest / 255 / 2 + kBin;
    const std::optional<DepthRange> range = votes.range();
    ASSERT_TRUE(range.has_value());
    EXPECT_NEAR(range->farthest, farthest, kBound);
    EXPECT_NEAR(range->nearest, nearest, kBound);
    EXPECT_LT(range->farthest, range->nearest);
  }
  DepthVotes votes{kNearest};
  int seen = kNodes;
};

TEST(DepthVotes, RangeIsUnknownWithoutVotes) {
  Votes v;
  EXPECT_FALSE(v.votes.range().has_value());
  v.add({});
  EXPECT_FALSE(v.votes.range().has_value());
  v.add({{2, 10}});
  EXPECT_FALSE(v.votes.range().has_value()) << "too few of the nodes";
  v.add({{2, 20}});
  v.expect(2, 2);
  v.votes.clear();
  EXPECT_FALSE(v.votes.range().has_value());
}

// Most of a view may lie outside the cameras' coverage.
TEST(DepthVotes, CountOnlyVisibleNodes) {
  Votes v;
  v.seen = 150;
  v.add({{2, 1}});
  EXPECT_FALSE(v.votes.range().has_value()) << "one of 150";
  v.add({{2, 5}});
  v.expect(2, 2);
}

// A search with nodes that vote.
struct Search {
  static constexpr int kColumns = 60, kRows = 40;
  Search() {
    map.columns = kColumns;
    map.rows = kRows;
    map.farthest = 0;
    map.nearest = kNearest;
    map.levels.assign(kColumns * kRows, map.level_of(1));
    choice.informed.assign(kColumns * kRows, 0);
    choice.least.assign(kColumns * kRows, 1.f);
    choice.cost.assign(kSweep, 1);
    for (size_t i = 0; i < choice.informed.size(); i += 2) choice.informed[i] = 1;
  }
  void put(int x, int y, double inverse) {
    const size_t node = static_cast<size_t>(y) * kColumns + x;
    choice.informed[node] = 1;
    map.levels[node] = map.level_of(inverse);
  }
  std::optional<DepthRange> range() const {
    constexpr double kSmallest = 3;  // nodes at 1 m
    DepthVotes votes(kNearest, kSmallest);
    votes.add(map, choice);
    return votes.range();
  }
  FocalMap map;
  DepthSelection choice;
};

// Single nodes get random depths by chance. A real object is at least as large as a cell of the array and has one
// depth.
TEST(DepthVotes, ScatteredNearVotesAreIgnored) {
  Search chance;
  int at = 0;
  for (int y = 1; y < Search::kRows; y += 3)
    for (int x = 1; x < Search::kColumns; x += 4) chance.put(x, y, 2.5 * std::pow(1.15, at++ * 7 % 10));
  EXPECT_GT(at, 0.1 * Search::kColumns * Search::kRows / 2) << "more than outliers";
  ASSERT_TRUE(chance.range());
  EXPECT_NEAR(chance.range()->nearest, 1, 0.1);
  Search thing;
  for (int y = 10; y < 24; y++)
    for (int x = 20; x < 34; x++) thing.put(x, y, 4);
  ASSERT_TRUE(thing.range());
  EXPECT_NEAR(thing.range()->nearest, 4, 0.1);
}

TEST(DepthVotes, CoverTheScene) {
  Votes v;
  v.add({{1, 100}, {2, 100}, {4, 100}});
  v.expect(1, 4);
  v.add({{6, 300}});
  v.expect(1, 6);
}

TEST(DepthVotes, OutliersAreIgnored) {
  Votes few;
  few.add({{0.5, 39}, {2, 422}, {3, 500}, {9, 39}});
  few.expect(2, 3);
  Votes more;
  more.add({{0.5, 41}, {2, 418}, {3, 500}, {9, 41}});
  more.expect(0.5, 9);
}

// After n rounds without it, an old observation has weight 0.8^n against (1 - 0.8^n) / 0.2 of the new ones: 5 % for n =
// 7, and 3.9 % for n = 8.
TEST(DepthVotes, OldVotesFade) {
  Votes v;
  v.add({{8, 500}});
  for (int n = 1; n <= 20; n++) {
    v.add({{2, 500}});
    v.expect(2, n <= 7 ? 8 : 2);
  }
}

TEST(DepthVotes, VotesAreLimitedToTheNearestDepth) {
  Votes v;
  v.votes = DepthVotes(kNearest / 2);
  v.add({{1, 100}, {9, 100}});
  const std::optional<DepthRange> range = v.votes.range();
  ASSERT_TRUE(range.has_value());
  EXPECT_DOUBLE_EQ(range->nearest, kNearest / 2);
}

// An object at a quarter of the distance covers sixteen times the area.
TEST(DepthVotes, TooSmallNearObjectsAreIgnored) {
  constexpr double kSmallest = 4;  // nodes at 1 m
  for (const auto& [nearest, nodes, is_there] :
       {std::tuple{2., 55, false}, {2., 75, true}, {4., 230, false}, {4., 290, true}, {8., 480, false}}) {
    Votes v;
    v.votes = DepthVotes(kNearest, kSmallest);
    for (int round = 0; round < 5; round++) v.add({{1, 300}, {nearest, nodes}});
    v.expect(1, is_there ? nearest : 1);
  }
}

// Small objects still extend the far end of the range.
TEST(DepthVotes, DistantObjectsMayBeSmall) {
  Votes v;
  v.votes = DepthVotes(kNearest, 4);
  v.add({{0.5, 45}, {2, 400}});
  v.expect(0.5, 2);
}

}  // namespace
}  // namespace lf
