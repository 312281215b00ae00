// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/camera_trials.h"

#include <gtest/gtest.h>

#include "lib/focus/array_of_walls.h"

namespace lf {
namespace {

struct Tried {
  test::ArrayOfWalls walls;
  View view = walls.view(60);
  std::vector<Trial> trials{{Trial::Kind::kBlurred, 0}, {Trial::Kind::kPlane, 250}};
  std::vector<std::vector<uint8_t>> levels;
  RenderJob job{walls.rig, walls.mesh, trial_view(view), walls.own};
  Tried() {
    for (const Trial& trial : trials) levels.push_back(trial_levels(*view.focus.map, trial));
  }
  std::vector<Moments> no_sums() const {
    std::vector<Moments> sums(trials.size());
    for (Moments& sum : sums) sum.reset(view.focus.map->columns, view.focus.map->rows);
    return sums;
  }
};

TEST(CameraTrials, AddUpToTheMoments) {
  const Tried tried;
  std::vector<Source> sources;
  for (const CameraIndex camera : tried.job.cameras()) sources.push_back(tried.walls.sources()[camera]);
  std::vector<Moments> sums = tried.no_sums();
  const std::vector<CameraTrials> seen = sample_trials(tried.job, sources, tried.levels);
  ASSERT_GE(seen.size(), 3u);
  for (const CameraTrials& camera : seen)
    EXPECT_TRUE(add_camera_trials(tried.job, tried.walls.rig.cameras[camera.camera], camera, tried.levels, sums));
  const std::vector<Moments> expected = tried.walls.moments(tried.view, tried.trials, tried.walls.own);
  for (size_t t = 0; t < sums.size(); t++) {
    EXPECT_EQ(sums[t].weight, expected[t].weight);
    EXPECT_EQ(sums[t].luma, expected[t].luma);
    EXPECT_EQ(sums[t].square, expected[t].square);
  }
}

TEST(CameraTrials, ThatDoNotFitAreNotAdded) {
  const Tried tried;
  const CameraIndex index = tried.job.cameras()[0];
  const CameraTrials good = sample_trials(tried.job, {{tried.walls.sources()[index]}}, tried.levels).at(0);
  std::vector<Moments> sums = tried.no_sums();
  const auto adds = [&](auto change) {
    CameraTrials bad = good;
    change(bad);
    return add_camera_trials(tried.job, tried.walls.rig.cameras[index], bad, tried.levels, sums);
  };
  EXPECT_FALSE(adds([](CameraTrials& c) { c.luma.pop_back(); }));
  EXPECT_FALSE(adds([](CameraTrials& c) { c.rect.x0++; }));
  EXPECT_FALSE(adds([](CameraTrials& c) { c.camera = 999; }));
  for (const Moments& sum : sums) EXPECT_EQ(sum.weight, std::vector<uint16_t>(sum.weight.size(), 0));
  EXPECT_TRUE(adds([](CameraTrials&) {}));
}

}  // namespace
}  // namespace lf
