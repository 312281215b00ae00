// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/depth_confidence.h"

#include <limits>
#include <random>

#include "focus/depth_selection.h"
#include "focus/still_focus.h"
#include "scene/objects.h"
#include "scene/scene.h"
#include "scene/trace.h"
#include "support/photographs.h"
#include "support/rigs.h"
#include "support/test.h"
#include "view/depth_image.h"

namespace lf {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Random rounds, compared with the formula in double precision.
TEST(DepthConfidence, MatchesTheFormula) {
  std::mt19937 random(1);
  const auto number = [&](double most) { return std::uniform_real_distribution<double>(0, most)(random); };
  FocalMap map{.columns = 9, .rows = 7};
  const size_t nodes = 63;
  constexpr double kApart = 7.5;
  DepthConfidence confidence;
  EXPECT_FALSE(confidence.map());
  std::vector<double> others(nodes, 0);
  for (int round = 0; round < 20; round++) {
    const size_t hypotheses = 1 + static_cast<size_t>(number(8));
    std::vector<std::vector<uint8_t>> levels(hypotheses, std::vector<uint8_t>(nodes));
    std::vector<std::vector<float>> costs(hypotheses, std::vector<float>(nodes));
    std::vector<float> evidence(nodes);
    for (size_t i = 0; i < nodes; i++) evidence[i] = static_cast<float>(number(1.2));
    for (size_t t = 0; t < hypotheses; t++)
      for (size_t i = 0; i < nodes; i++) {
        levels[t][i] = static_cast<uint8_t>(number(20));
        costs[t][i] = number(1) < 0.1 ? kInfinity : static_cast<float>(number(t == 0 ? 4 : 20));
      }
    confidence.add({map, levels, costs, evidence, kApart});
    ASSERT_EQ(confidence.map()->columns, map.columns);
    for (size_t i = 0; i < nodes; i++) {
      double sum = 0, count = 0;
      for (size_t t = 1; t < hypotheses; t++)
        if (std::abs(levels[t][i] - levels[0][i]) > kApart && costs[t][i] < kInfinity) sum += costs[t][i], count++;
      if (count > 0) others[i] = others[i] > 0 ? (4 * others[i] + sum) / (4 + count) : sum / count;
      const double deviation = costs[0][i];
      const double expected = deviation < kInfinity && others[i] > 0
                                  ? std::clamp(evidence[i] * (1 - (deviation + kLumaNoise) / others[i]), 0., 1.)
                                  : 0;
      ASSERT_NEAR(confidence.map()->levels[i] / 255., expected, 0.501 / 255 + 1e-4) << round << ", " << i;
    }
  }
  map.columns = 3;
  const std::vector<std::vector<uint8_t>> levels(2, std::vector<uint8_t>(21, 0));
  const std::vector<std::vector<float>> costs(2, std::vector<float>(21, 1));
  confidence.add({map, levels, costs, std::vector<float>(21, 1), kApart});
  EXPECT_EQ(confidence.map()->levels, std::vector<uint8_t>(21, 0)) << "another size begins anew, and no other depth";
}

// The depths of the built-in scene along the view's axis, from the same intersections that its pictures show.
std::vector<double> true_depths(const View& view, double time) {
  const scene::Objects objects = scene::objects_at(time);
  std::vector<double> depths;
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const Vec3 ray(*view.lens.unproject({x, y}), 1);
      const double length = glm::length(ray);
      const scene::Hit hit =
          intersect_scene(objects, {scene::V3(view.pose.position), scene::V3(view.pose.rotation() * ray / length)});
      depths.push_back(hit.t / length);
    }
  return depths;
}

struct DepthCase {
  const char* name;
  int side;      // cameras in a row
  double pitch;  // distance of the cameras, relative to kScenePitch
  Vec3 eye;
  bool has_maps = false;  // depth maps instead of the search
  bool is_irregular = false;
};

class SceneDepthTest : public testing::TestWithParam<DepthCase> {};

// The acceptance criterion: where the confidence is above one half, the median error is at most half a pixel of the
// disparity between neighbouring cameras.
TEST_P(SceneDepthTest, ConfidentDepthsAreRight) {
  const DepthCase& c = GetParam();
  Rig rig = scene_rig(c.side, c.side, 320, 240);
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
    Camera& camera = rig.cameras[i];
    camera.pose.position *= c.pitch;
    if (c.is_irregular) camera.pose.position += Vec3(0.03 * std::sin(5. * i), 0.03 * std::cos(7. * i), 0);
  }
  if (c.is_irregular) rig.topology = {};
  const std::vector<Image> images = test::scene_images(rig, 0, 2);
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  View view{.width = 320, .height = 240, .lens = rig.cameras[0].lens, .pose = {c.eye}};
  view.focus.plane = focal_plane_at(view.pose, 2);
  const DepthEstimator::Settings settings{.mode = FocusMode::kSurface};
  std::optional<ArrayDepth> maps;
  if (c.has_maps) maps = estimate_depths(rig, test::all_cameras(rig), {{view}}, image_of, settings);
  std::shared_ptr<const FocalMap> confidence;
  const View focused = focus_still(rig, build_mesh(rig), view, image_of, settings, kSettledRounds, nullptr,
                                   maps ? &*maps : nullptr, &confidence);
  ASSERT_TRUE(focused.focus.map);
  ASSERT_TRUE(confidence);

  const DepthImage found = depth_image(focused);
  const std::vector<double> truth = true_depths(view, 0);
  const double pixels = rig.cameras[0].lens.fx() * kScenePitch * c.pitch;  // of disparity, for 1/m
  std::vector<double> all, confident;
  std::vector<float> row(static_cast<size_t>(view.width));
  for (int y = 0; y < view.height; y++) {
    confidence->inverse_row(0, 1, y, view.width, row.data());
    for (int x = 0; x < view.width; x++) {
      const size_t i = static_cast<size_t>(y) * view.width + x;
      all.push_back(pixels * std::abs(1 / found.depths[i] - 1 / truth[i]));
      if (row[static_cast<size_t>(x)] > 0.5f) confident.push_back(all.back());
    }
  }
  const double share = static_cast<double>(confident.size()) / static_cast<double>(all.size());
  const auto quantile = [](std::vector<double> values, double part) {
    std::ranges::sort(values);
    return values[static_cast<size_t>(part * static_cast<double>(values.size() - 1))];
  };
  std::printf("%s: %.0f %% of the pixels are confident; errors of p50 %.3f, p90 %.3f pixels, of all: %.3f, %.3f\n",
              c.name, 100 * share, quantile(confident, 0.5), quantile(confident, 0.9), quantile(all, 0.5),
              quantile(all, 0.9));
  EXPECT_GT(share, 0.2);
  EXPECT_LE(quantile(confident, 0.5), 0.5);
  EXPECT_LE(quantile(confident, 0.9), quantile(all, 0.9)) << "confident depths are better";
}

INSTANTIATE_TEST_SUITE_P(Arrays, SceneDepthTest,
                         testing::Values(DepthCase{"grid of 5x5", 5, 1, {0.017, -0.012, 0}},
                                         DepthCase{"4x4, in front of the array", 4, 1, {0.01, 0.02, 0.3}},
                                         DepthCase{"grid of 5x5 with maps", 5, 1, {0.017, -0.012, 0}, true},
                                         DepthCase{"4x4, irregular and wide", 4, 4, {0.03, -0.01, 0}, true, true}),
                         [](const auto& info) { return "Case" + std::to_string(info.index); });

}  // namespace
}  // namespace lf
