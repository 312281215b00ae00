// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/array_depth.h"

#include <stdexcept>

#include "lib/focus/array_of_walls.h"
#include "support/test.h"

namespace lf {
namespace {

class ArrayDepthTest : public testing::Test {
 protected:
  ArrayDepth estimate(const CameraSet& cameras, const ParallelFor& parallel = serial_for) const {
    return {walls_.rig, cameras, images_, 0, 1.2, parallel};
  }
  View view() const {
    View view = walls_.view(0);
    view.focus.map = nullptr;
    return view;
  }
  // Returns the share of nodes within 10 % of the true inverse distance, in nodes beside the step between the walls.
  static double share_right(const View& view, const FocalMap& map) {
    int right = 0, all = 0;
    for (int j = 2; j < map.rows - 2; j++)
      for (int i = 2; i < map.columns - 2; i++) {
        const Vec2 pixel = {map.step * i + 1.5, map.step * j + 1.5};
        const double x = view.pose.position.x + 1.5 * view.lens.unproject(pixel)->x;
        if (std::abs(x) < 0.06) continue;
        const double inverse = x > 0 ? 1 / 1.5 : 1 / 3.;
        all++;
        right += std::abs(map.inverse_of(map.levels[static_cast<size_t>(j) * map.columns + i]) / inverse - 1) < 0.1;
      }
    return right / static_cast<double>(all);
  }

  const test::ArrayOfWalls walls_;
  const MatchedImages images_ = [this](CameraIndex i) { return walls_.images[i].view(); };
};

TEST_F(ArrayDepthTest, FindsTheSurfaceOfAView) {
  const ArrayDepth depth = estimate(walls_.own);
  EXPECT_LT(depth.range().farthest, 1 / 3.);
  EXPECT_GT(depth.range().farthest, 0.15);
  EXPECT_GT(depth.range().nearest, 1 / 1.5);
  EXPECT_LT(depth.range().nearest, 0.9);
  const FocalMap map = depth.surface(view());
  EXPECT_EQ(map.columns, 40);
  EXPECT_EQ(map.rows, 30);
  EXPECT_EQ(map.from, plane_through(view().pose.position, Vec3(0, 0, 1)));
  EXPECT_GT(share_right(view(), map), 0.97);
}

TEST_F(ArrayDepthTest, CamerasThatAreLeftOutAreNotNeeded) {
  CameraSet cameras = walls_.own;
  std::erase(cameras, 4u);
  const ArrayDepth depth = {walls_.rig, cameras,
                            [this](CameraIndex i) {
                              EXPECT_NE(i, 4u);
                              return walls_.images[i].view();
                            },
                            0, 1.2};
  EXPECT_GT(share_right(view(), depth.surface(view())), 0.95);
}

TEST_F(ArrayDepthTest, TwoCamerasAreEnough) { EXPECT_GT(share_right(view(), estimate({3, 4}).surface(view())), 0.8); }

TEST_F(ArrayDepthTest, DoesNotDependOnThreads) {
  const ParallelFor backwards = [](size_t count, const std::function<void(size_t)>& task) {
    for (size_t i = count; i-- > 0;) task(i);
  };
  const FocalMap map = estimate(walls_.own).surface(view());
  EXPECT_EQ(estimate(walls_.own, backwards).surface(view(), backwards), map);
  EXPECT_EQ(estimate(walls_.own, parallel_for_all_processors()).surface(view()), map);
}

TEST_F(ArrayDepthTest, EachStepDoublesTheResolution) {
  ArrayDepth depth = ArrayDepth::coarse(walls_.rig, walls_.own, images_, 0, 1.2);
  int steps = 0;
  for (; !depth.is_finest(walls_.rig); steps++) depth = depth.finer(walls_.rig, images_);
  EXPECT_EQ(steps, 1);
  depth = depth.finer(walls_.rig, images_);  // the full resolution, for stills
  EXPECT_EQ(depth.surface(view()), estimate(walls_.own).surface(view()));
}

TEST_F(ArrayDepthTest, QuickDepthsAreCompletedByUpdates) {
  const ArrayDepth coarse = ArrayDepth::coarse(walls_.rig, walls_.own, images_, 0, 1.2);
  const CameraSet first = {3, 4, 5};
  ArrayDepth quick = coarse.quick_finer(walls_.rig, first, images_);
  ASSERT_TRUE(quick.is_finest(walls_.rig));
  EXPECT_FALSE(quick.is_complete());
  EXPECT_GT(share_right(view(), quick.surface(view())), 0.95);
  const FocalMap complete = coarse.finer(walls_.rig, images_).surface(view());
  EXPECT_NE(quick.surface(view()), complete);
  const MatchedImages no_images = [](CameraIndex) -> ImageView { throw std::logic_error("the images are known"); };
  size_t updates = 0;
  for (bool is_same = false; !is_same && updates < 20; updates++) {
    ArrayDepth next = quick.updated(walls_.rig, walls_.own, walls_.own, no_images);
    is_same = next.shares_all(quick);
    quick = std::move(next);
  }
  EXPECT_EQ(updates, 1 + (walls_.own.size() + ArrayDepth::kCompleted - 1) / ArrayDepth::kCompleted);
  EXPECT_TRUE(quick.is_complete());
  EXPECT_GE(share_right(view(), quick.surface(view())) + 0.005, share_right(view(), complete));
}

TEST_F(ArrayDepthTest, NewImagesCompleteQuickDepths) {
  std::vector<Image> inverted = walls_.images;
  for (Image& image : inverted)
    for (uint8_t& value : image.data()) value = 255 - value;
  const MatchedImages images = [&](CameraIndex i) { return inverted[i].view(); };
  ArrayDepth depth = ArrayDepth::coarse(walls_.rig, walls_.own, images_, 0, 1.2);
  depth = depth.quick_finer(walls_.rig, {3, 4, 5}, images_).updated(walls_.rig, walls_.own, {}, images);
  EXPECT_TRUE(depth.is_complete());
  for (int i = 0; i < 3; i++) depth = depth.updated(walls_.rig, walls_.own, {}, images);
  EXPECT_TRUE(depth.updated(walls_.rig, walls_.own, {}, images).shares_all(depth));
  const FocalMap complete = ArrayDepth(walls_.rig, walls_.own, images, 0, 1.2).surface(view());
  EXPECT_GE(share_right(view(), depth.surface(view())) + 0.005, share_right(view(), complete));
}

TEST_F(ArrayDepthTest, DistancesAreFromThePlaneOfTheMap) {
  const ArrayDepth depth = estimate(walls_.own);
  View from_behind = view();
  from_behind.pose.position.z = -0.5;
  FocalMap like = FocalMap::for_view(160, 120, 8);
  like.from = {{0, 0, 1}, 0};
  const FocalMap map = depth.surface(from_behind, like);
  EXPECT_EQ(map.step, 8);
  EXPECT_EQ(map.from, like.from);
  const auto inverse_at = [&](int x, int y) {
    return map.inverse_of(map.levels[static_cast<size_t>(y) * map.columns + x]);
  };
  EXPECT_NEAR(inverse_at(5, 7), 1 / 3., 0.03);
  EXPECT_NEAR(inverse_at(15, 7), 1 / 1.5, 0.05);
}

TEST_F(ArrayDepthTest, UnchangedImagesKeepTheirDepths) {
  ArrayDepth depth = estimate(walls_.own);
  std::vector<Image> noisy = walls_.images;
  for (Image& image : noisy)
    for (size_t i = 0; i < image.data().size(); i++)
      image.data()[i] = static_cast<uint8_t>(image.data()[i] + static_cast<int>(i * 7919 % 9) - 4);
  const ArrayDepth next = depth.updated(walls_.rig, walls_.own, {}, [&](CameraIndex i) { return noisy[i].view(); });
  EXPECT_TRUE(next.shares_all(depth));
}

TEST_F(ArrayDepthTest, ImagesThatAreKnownAreNotFetched) {
  const ArrayDepth depth = estimate(walls_.own);
  const MatchedImages none = [](CameraIndex camera) -> ImageView {
    ADD_FAILURE() << "camera " << camera;
    return {};
  };
  EXPECT_TRUE(depth.updated(walls_.rig, walls_.own, walls_.own, none).shares_all(depth));
}

// The walls come nearer by a third.
TEST_F(ArrayDepthTest, UpdatesFollowTheScene) {
  const test::ArrayOfWalls later(false, 1.33);
  const MatchedImages images = [&](CameraIndex i) { return later.images[i].view(); };
  ArrayDepth depth = estimate(walls_.own);
  const auto is_near = [&](const FocalMap& map) {
    const size_t middle = static_cast<size_t>(map.rows / 2) * map.columns + map.columns / 4;
    return std::abs(map.inverse_of(map.levels[middle]) - 1.33 / 3) < 0.04;
  };
  EXPECT_FALSE(is_near(depth.surface(view())));
  int updates = 0;
  for (; updates < 8; updates++) {
    ArrayDepth next = depth.updated(later.rig, walls_.own, {}, images);
    const bool is_same = next.shares_all(depth);
    depth = std::move(next);
    if (is_same) break;
  }
  EXPECT_TRUE(is_near(depth.surface(view())));
  EXPECT_LE(updates, 5) << "then the depths rest";
}

TEST_F(ArrayDepthTest, ANewCameraJoins) {
  CameraSet some = walls_.own;
  some.pop_back();
  const ArrayDepth depth = estimate(some).updated(walls_.rig, walls_.own, {}, images_);
  EXPECT_EQ(depth.cameras(), walls_.own);
  EXPECT_GT(share_right(view(), depth.surface(view())), 0.95);
}

TEST_F(ArrayDepthTest, AViewOfNothingIsFar) {
  View away = view();
  away.pose = Pose(away.pose.position, glm::angleAxis(3.0, Vec3(0, 1, 0)));
  const FocalMap map = estimate(walls_.own).surface(away);
  for (const uint8_t level : map.levels) EXPECT_LE(map.inverse_of(level), 0.34);
}

TEST_F(ArrayDepthTest, ALensBeyondItsRaysIsFar) {
  View wide = view();
  wide.lens = Lens(LensModel::kSimpleRadial, {40, 79.5, 59.5, -0.3});  // rays beyond a radius of 1.05 fold back
  const FocalMap map = estimate(walls_.own).surface(wide);
  EXPECT_EQ(map.levels.size(), 40u * 30u);
}

// The pixels beside the edge of the near wall have the depth of their own wall.
TEST_F(ArrayDepthTest, EdgesFollowTheSilhouetteToThePixel) {
  const ArrayDepth depth = estimate(walls_.own);
  View seen = view();
  seen.focus.map = std::make_shared<const FocalMap>(depth.surface(seen));
  const DepthEdges edges = depth.edges(seen);
  const FocalMap& map = *seen.focus.map;
  int right = 0, right_by_nodes = 0, all = 0;
  for (int y = 8; y < seen.height - 8; y++)
    for (int x = 8; x < seen.width - 8; x++) {
      const float* const inverse = edges.depth_at(x, y);
      if (!inverse) continue;
      const double on_near_wall = seen.pose.position.x + 1.5 * seen.lens.unproject({x, y})->x;
      const double expected = on_near_wall > 0 ? 1 / 1.5 : 1 / 3.;
      all++;
      right += std::abs(*inverse / expected - 1) < 0.1;
      right_by_nodes += std::abs(map.inverse_at(x, y) / expected - 1) < 0.1;
    }
  std::printf("%d pixels at edges, %d right, %d by interpolation of nodes\n", all, right, right_by_nodes);
  ASSERT_GT(all, 300);
  EXPECT_GT(right, 0.8 * all);
  EXPECT_GT(right, 1.5 * right_by_nodes);
  EXPECT_EQ(depth.edges(seen, parallel_for_all_processors()).cells, edges.cells);
}

// A camera on the right sees the edge of the near wall where a view from the left sees the far wall.
TEST_F(ArrayDepthTest, FindsOutWhatACameraSees) {
  constexpr CameraIndex kRight = 5;
  const double camera = walls_.rig.cameras[kRight].pose.position.x;
  View seen = walls_.view(60);
  seen.pose.position.x = -camera;
  auto map = std::make_shared<FocalMap>(*seen.focus.map);
  std::vector<double> on_far_wall, on_near_wall;  // x of each node; NaN: on the other wall
  for (size_t i = 0; i < map->levels.size(); i++) {
    const Vec2 pixel = {map->step * (static_cast<double>(i % map->columns)) + 1.5, 1.5};
    const double u = seen.lens.unproject(pixel)->x, near = seen.pose.position.x + 1.5 * u;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    on_near_wall.push_back(near > 0 ? near : nan);
    on_far_wall.push_back(near > 0 ? nan : seen.pose.position.x + 3 * u);
    if (near > 0) map->levels[i] = 170;
  }
  seen.focus.map = map;
  const ArrayDepth depth = estimate(walls_.own);
  const Rect whole{0, 0, seen.width, seen.height};
  const std::optional<VisibilityMask> mask = depth.visibility(seen, kRight, {&whole, 1});
  ASSERT_TRUE(mask);
  ASSERT_EQ(mask->nodes.size(), map->levels.size());
  double hidden = 0, visible = 0;
  int of_hidden = 0, of_visible = 0;
  for (size_t i = 0; i < mask->nodes.size(); i++) {
    if (std::abs(on_far_wall[i]) < 0.5 * camera) {
      hidden += mask->nodes[i];
      of_hidden++;
    } else if (on_far_wall[i] < -2 * camera || on_near_wall[i] > camera) {
      visible += mask->nodes[i];
      of_visible++;
    }
  }
  ASSERT_GT(of_hidden, 20);
  ASSERT_GT(of_visible, 500);
  EXPECT_LT(hidden / of_hidden, 150);
  EXPECT_GT(visible / of_visible, 250);

  const std::optional<VisibilityMask> untested = depth.visibility(seen, kRight, {});
  ASSERT_TRUE(untested);
  EXPECT_EQ(std::ranges::count(untested->nodes, VisibilityMask::kVisible), std::ssize(untested->nodes));
  EXPECT_FALSE(depth.visibility(seen, 99, {&whole, 1})) << "an unknown camera";
  EXPECT_FALSE(depth.visibility(view(), kRight, {&whole, 1})) << "no focal map";
}

}  // namespace
}  // namespace lf
