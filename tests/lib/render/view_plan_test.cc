// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/view_plan.h"
#include "base/text.h"
#include "render/ownership.h"
#include "scene/scene.h"
#include "support/expect_error.h"
#include "support/fragments.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(Rays, PinholeRaysAreComputed) {
  const Lens lens(LensModel::kPinhole, {100, 200, 9.5, 4.5});
  const Rays rays(lens, 20, 10);
  EXPECT_TRUE(rays.separable());
  EXPECT_NEAR(rays.at(0, 0).x, -0.095, 1e-15);
  EXPECT_NEAR(rays.at(0, 0).y, -0.0225, 1e-15);
  EXPECT_NEAR(rays.at_centre_of_four(2, 2).x, (2.5 - 9.5) / 100, 1e-15);
}

TEST(Rays, DistortedRaysProjectBackToTheirPixels) {
  const Lens lens(LensModel::kRadial, {30, 9.5, 7.5, -0.2, 0.04});
  const Rays rays(lens, 20, 16);
  EXPECT_FALSE(rays.separable());
  for (int y = 0; y < 16; y++)
    for (int x = 0; x < 20; x++) {
      const Vec2 ray = rays.at(x, y);
      const auto pixel = lens.project(Vec3(ray, 1)).value();
      EXPECT_NEAR(pixel.x, x, 1e-9);
      EXPECT_NEAR(pixel.y, y, 1e-9);
    }
}

TEST(Rays, PixelsBeyondTheFoldHaveNone) {
  const Lens lens(LensModel::kSimpleRadial, {10, 31.5, 31.5, -0.5});
  const Rays rays(lens, 64, 64);
  EXPECT_TRUE(std::isnan(rays.at(0, 0).x));
  EXPECT_FALSE(std::isnan(rays.at(32, 32).x));
}

// A table for a large view takes seconds, so it is built in parts that other work can interrupt.
TEST(Rays, TablesAreComputedInParallel) {
  const Lens lens(LensModel::kRadial, {300, 99.5, 70.25, -0.21, 0.0417});
  size_t parts = 0;
  const Rays in_parts(lens, 200, 141, [&parts](size_t count, const std::function<void(size_t)>& task) {
    parts += count;
    for (size_t i = count; i-- > 0;) task(i);
  });
  EXPECT_GE(parts, 100u);
  for (int y = 0; y < 141; y++)
    for (int x = 0; x < 200; x++) {
      const Vec2 ray = in_parts.at(x, y), alone = *lens.unproject({x, y});
      ASSERT_EQ(std::memcmp(&ray, &alone, sizeof ray), 0) << x << ", " << y;
    }
}

TEST(Rays, TablesAreCached) {
  const Lens lens(LensModel::kRadial, {301, 99.5, 70.25, -0.21, 0.0417}), other = lens.shifted({1, 0});
  size_t made = 0;
  const ParallelFor counted = [&made](size_t count, const std::function<void(size_t)>& task) {
    made++;
    serial_for(count, task);
  };
  const Rays first(lens, 64, 48, counted);
  const Rays again(lens, 64, 48, counted);
  EXPECT_EQ(made, 1u);
  const Rays larger(lens, 65, 48, counted), beside(other, 64, 48, counted);
  EXPECT_EQ(made, 3u);
  EXPECT_EQ(first.at(20, 30), again.at(20, 30));
  EXPECT_NE(first.at(20, 30), beside.at(20, 30));
}

TEST(Rays, ChromaAtAnOddEdgeUsesTheLastPixel) {
  for (const double k1 : {0.0, -0.1}) {
    const Rays rays(Lens(LensModel::kSimpleRadial, {30, 2, 2, k1}), 5, 5);
    EXPECT_EQ(rays.at_centre_of_four(4, 4), rays.at(4, 4));
  }
}

constexpr int kWidth = 70, kHeight = 50;

Rect brute_force(const Rays& rays, const std::vector<Vec3>& half_planes) {
  Rect rect;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++) {
      const Vec3 d(rays.at(x, y), 1);
      bool inside = !std::isnan(d.x);
      for (const Vec3& h : half_planes) inside = inside && glm::dot(h, d) >= 0;
      if (inside) rect = unite(rect, {x, y, x + 1, y + 1});
    }
  return rect;
}

bool holds(const Rect& outer, const Rect& inner) { return inner.empty() || unite(outer, inner) == outer; }

std::vector<Vec3> random_half_planes(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> normal(-1, 1);
  std::vector<Vec3> half_planes;
  for (int i = 0; i < count; i++) half_planes.emplace_back(normal(random), normal(random), 0.4 * normal(random));
  return half_planes;
}

struct Bounded {
  explicit Bounded(const Lens& lens, int width = kWidth, int height = kHeight)
      : rays(lens, width, height), bounds(rays, lens, width, height) {}
  Rays rays;
  RegionBounds bounds;
};

class RegionBoundsTest : public testing::TestWithParam<double> {};

TEST_P(RegionBoundsTest, ContainsEveryPixelAndIsTight) {
  const Bounded view(Lens(LensModel::kSimpleRadial, {60, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0, GetParam()}));
  std::mt19937 random(5);
  int seen = 0;
  for (int i = 0; i < 3000; i++) {
    const std::vector<Vec3> half_planes = random_half_planes(1 + i % 4, random);
    const Rect exact = brute_force(view.rays, half_planes), bound = view.bounds.bound(half_planes);
    ASSERT_TRUE(holds(bound, exact)) << i;
    if (exact.empty()) continue;
    seen++;
    // Region corners between pixel centres enlarge a pinhole's bound by a few pixels for slivers; a distorted lens's
    // bound grows to whole tiles.
    const bool pinhole = GetParam() == 0;
    EXPECT_LE(bound.width() * bound.height(), pinhole ? exact.width() * exact.height() * 2 + 400 : kWidth * kHeight)
        << i;
  }
  EXPECT_GT(seen, 1000);
}

INSTANTIATE_TEST_SUITE_P(Lenses, RegionBoundsTest, testing::Values(0.0, -0.2, 0.3));

TEST(RegionBounds, GroupsOfTilesChangeNothing) {
  constexpr int kWide = 400, kTall = 300, kTile = 16;
  const Bounded view(Lens(LensModel::kRadial, {150, 180, 140, -0.3, 0.05}), kWide, kTall);
  std::mt19937 random(6);
  int smaller = 0;
  for (int i = 0; i < 1000; i++) {
    const std::vector<Vec3> half_planes = random_half_planes(1 + i % 4, random);
    Rect by_tiles;
    for (int y = 0; y < kTall; y += kTile)
      for (int x = 0; x < kWide; x += kTile) {
        const Rect tile = intersect({x, y, x + kTile, y + kTile}, {0, 0, kWide, kTall});
        Vec2 low(INFINITY), high(-INFINITY);
        for (int py = tile.y0; py < tile.y1; py++)
          for (int px = tile.x0; px < tile.x1; px++)
            if (const Vec2 ray = view.rays.at(px, py); !std::isnan(ray.x)) {
              low = glm::min(low, ray);
              high = glm::max(high, ray);
            }
        const auto may_contain = [&](const Vec3& h) {
          return h.x * (h.x > 0 ? high.x : low.x) + h.y * (h.y > 0 ? high.y : low.y) + h.z >= -1e-12;
        };
        if (low.x <= high.x && std::ranges::all_of(half_planes, may_contain)) by_tiles = unite(by_tiles, tile);
      }
    ASSERT_EQ(view.bounds.bound(half_planes), by_tiles) << i;
    smaller += by_tiles != Rect{0, 0, kWide, kTall};
  }
  EXPECT_GT(smaller, 500);
}

TEST(RegionBounds, NoHalfPlanesIsTheWholeView) {
  EXPECT_EQ(Bounded(Lens::pinhole(60, 34.5, 24.5)).bounds.bound({}), (Rect{0, 0, kWidth, kHeight}));
}

TEST(RegionBounds, EdgesThroughPixelCentresAreInside) {
  const Vec3 half_planes[] = {{1, 0, -10 / 50.0}, {-1, 0, 20 / 50.0}, {0, 1, -5 / 50.0}, {0, -1, 5 / 50.0}};
  EXPECT_EQ(Bounded(Lens::pinhole(50, 0, 0)).bounds.bound(half_planes), (Rect{10, 5, 21, 6}));
}

// Coordinates from a network may be as large as doubles allow.
TEST(RegionBounds, OverflowsBoundNothing) {
  const Bounded view(Lens::pinhole(60, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0));
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const Vec3& h :
       {Vec3(1e308, 1e308, -1e308) * 10.0, Vec3(kInf, 0, -1), Vec3(NAN, 0, 1), Vec3(0, 1e308, 1.7e308)}) {
    const std::vector<Vec3> half_planes{{1, 0, 0.2}, h};
    EXPECT_EQ(view.bounds.bound(half_planes), (Rect{0, 0, kWidth, kHeight}));
  }
}

TEST(RegionBounds, StayInTheViewForAnyPrincipalPoint) {
  for (const double centre : {3e85, -3e85, 3e9, -3e9}) {
    const Bounded view(Lens::pinhole(60, centre, centre));
    const std::vector<Vec3> half_planes{{1, 0.5, 0.2}};
    const Rect bound = view.bounds.bound(half_planes);
    EXPECT_TRUE(holds(bound, brute_force(view.rays, half_planes))) << centre;
    EXPECT_TRUE(bound.empty() || holds({0, 0, kWidth, kHeight}, bound)) << centre;
  }
}

View middle_view(int width = 60, int height = 45) {
  View view = test::view_from({0, 0, -0.3}, width, height, 20, 2.5);
  view.blending.extrapolates = false;
  return view;
}

TEST(ViewPlan, OwnersAndWeightsDoNotDependOnTheRegion) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const ViewPlan plan(rig, build_mesh(rig), middle_view());
  const FaceIdMap whole(plan, {0, 0, 60, 45}), part(plan, {13, 7, 41, 30});
  for (int y = 7; y < 30; y++)
    for (int x = 13; x < 41; x++) ASSERT_EQ(whole.at(x, y), part.at(x, y));
  EXPECT_EQ(FaceIdMap(plan, {-5, -5, 100, 100}).region(), (Rect{0, 0, 60, 45}));
}

TEST(ViewPlan, RectanglesAreUnionsOfFaces) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const ViewPlan plan(rig, build_mesh(rig), middle_view());
  for (CameraIndex camera = 0; camera < 16; camera++) {
    Rect all;
    for (const FacePlan& face : plan.faces())
      if (std::ranges::count(face.camera, camera)) all = unite(all, face.rect);
    EXPECT_TRUE(intersect(all, plan.camera_rect(camera)) == plan.camera_rect(camera)) << camera;
  }
}

TEST(ViewPlan, ViewThatLooksAwayHasNoContributors) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  View view = middle_view();
  view.pose.orientation = Quat(0, 0, 1, 0);
  view.focus.plane = focal_plane_at(view.pose, 2.5);
  EXPECT_TRUE(ViewPlan(rig, build_mesh(rig), view).contributors().empty());
}

TEST(RenderJob, UsesOnlyTheNodesCameras) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const Mesh mesh = build_mesh(rig);
  const View view = middle_view();
  const std::vector<CameraIndex> own = {5, 6, 15};
  const RenderJob job(rig, mesh, view, own);
  for (const CameraIndex camera : job.cameras()) {
    EXPECT_TRUE(std::ranges::count(own, camera));
    EXPECT_EQ(unite(job.runs().region(), job.plan().camera_rect(camera)), job.runs().region());
  }
  EXPECT_EQ(job.cameras().size(), 3u);
  EXPECT_TRUE(RenderJob(rig, mesh, view, {}).cameras().empty());
}

TEST(MeshCache, FollowsTheCamerasOutOfService) {
  const Rig rig = scene_rig(3, 3, 64, 48);
  MeshCache cache;
  EXPECT_EQ(cache.get(rig, {}).faces.size(), 8u);
  EXPECT_EQ(cache.get(rig, {4}).faces.size(), 6u);
  EXPECT_EQ(cache.get(rig, {}).faces.size(), 8u);
  EXPECT_THROW(cache.get(rig, {99}), Error);
}

TEST(SumRenderer, RefusesAnImageOfAnotherSize) {
  const Rig rig = scene_rig(2, 2, 64, 48);
  const RenderJob job(rig, build_mesh(rig), middle_view(), std::vector<CameraIndex>{0});
  const Image wrong(PixelFamily::kRgb, 64, 47);
  EXPECT_THROW(test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], wrong.view()}), Error);
}

TEST(SumRenderer, EveryRgbLayoutGivesTheSamePart) {
  const Rig rig = scene_rig(2, 2, 64, 48);
  const RenderJob job(rig, build_mesh(rig), middle_view(), std::vector<CameraIndex>{0});
  const Image image = render_scene({64, 48, rig.cameras[0].lens, rig.cameras[0].pose}, 0, 1);
  const auto expected = test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], image.view()});
  for (const RgbLayout layout :
       {RgbLayout{4, 0, 1, 2}, RgbLayout{4, 2, 1, 0}, RgbLayout{4, 1, 2, 3}, RgbLayout{3, 2, 1, 0}}) {
    std::vector<uint8_t> bytes(64 * 48 * static_cast<size_t>(layout.pixel_stride));
    for (size_t i = 0; i < 64 * 48; i++) {
      uint8_t* pixel = &bytes[i * static_cast<size_t>(layout.pixel_stride)];
      pixel[layout.r] = image.data()[3 * i];
      pixel[layout.g] = image.data()[3 * i + 1];
      pixel[layout.b] = image.data()[3 * i + 2];
    }
    ImageView view = image.view();
    view.layout = layout;
    view.plane[0] = bytes.data();
    view.stride[0] = 64 * layout.pixel_stride;
    EXPECT_EQ(test::camera_part(job.plan(), job.runs(), {0, &rig.cameras[0], view}), expected);
  }
}

TEST(ViewPlan, ChromaAlignedCoversWholeSamples) {
  EXPECT_EQ(chroma_aligned({3, 5, 8, 9}, middle_view(61, 45)), (Rect{2, 4, 8, 10}));
  EXPECT_EQ(chroma_aligned({59, 43, 61, 45}, middle_view(61, 45)), (Rect{58, 42, 61, 45}));
}

class ViewWarpTest : public testing::Test {
 protected:
  ViewWarpTest() : rig_(scene_rig(3, 3, 64, 48)) {
    view_ = test::view_from({0.01, 0.02, -0.1}, 60, 40, 30, kSceneMiddle);
    view_.blending.extrapolates = false;
  }
  ViewWarp warp() const { return view_warp(rig_, ViewPlan(rig_, build_mesh(rig_), view_)); }

  Rig rig_;
  View view_;
};

TEST_F(ViewWarpTest, RestoresItsPlan) {
  const ViewPlan plan(rig_, build_mesh(rig_), view_), told(warp(), 9);
  Rig places_unknown = rig_;
  for (Camera& camera : places_unknown.cameras) camera.pose = {};
  EXPECT_FALSE(plan.contributors().empty());
  EXPECT_EQ(told.contributors(), plan.contributors());
  EXPECT_EQ(view_warp(places_unknown, told), warp()) << "also without camera positions";
}

TEST_F(ViewWarpTest, IsEmptyIfTheEyeIsInThePlane) {
  view_.focus.plane = focal_plane_at(view_.pose, 0);
  EXPECT_TRUE(warp().faces.empty());
  EXPECT_TRUE(ViewPlan(warp(), 9).contributors().empty());
}

TEST_F(ViewWarpTest, RefusesUnknownCameras) { EXPECT_ERROR(ViewPlan(warp(), 5), "5 of the"); }

TEST_F(ViewWarpTest, CamerasMustMatchTheCorners) {
  EXPECT_NO_THROW(validate(warp()));
  const auto error_with = [&](void (*spoil)(ViewWarp&)) {
    ViewWarp bad = warp();
    spoil(bad);
    return text_of_error([&] { validate(bad); });
  };
  EXPECT_MENTIONS(error_with([](ViewWarp& w) { w.cameras.pop_back(); }), "cameras:", "corners");
  EXPECT_MENTIONS(error_with([](ViewWarp& w) { w.faces[1].camera[2] = w.faces[1].camera[0]; }), "triangles[1].corners",
                  "different cameras");
  EXPECT_MENTIONS(error_with([](ViewWarp& w) { w.faces[0].rect.x1 = 61; }), "triangles[0].rectangle", "inside");
  EXPECT_MENTIONS(error_with([](ViewWarp& w) { w.cameras[2].camera_from_ray[1][1] = NAN; }), "cameras[2].matrix",
                  "finite");
}

}  // namespace
}  // namespace lf
