// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/generators.h"
#include "render/ownership.h"
#include "scene/scene.h"

namespace lf {
namespace {

using reference::Random;
using test::jittered_array, test::view_into;

std::vector<Rect> tiles_of(const RenderJob& job, PixelFamily family, size_t spare_pixels) {
  return sum_tiles(job.plan(), job.runs(), job.cameras(), family, spare_pixels);
}

size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

size_t total(const std::vector<Rect>& tiles) {
  size_t sum = 0;
  for (const Rect& tile : tiles) sum += area(tile);
  return sum;
}

// Which pixels one of the cameras has a weight in.
std::vector<bool> weighted(const test::Production& production, const std::vector<CameraIndex>& cameras) {
  const View& view = production.plan.view();
  std::vector<bool> out(static_cast<size_t>(view.width) * view.height);
  for (const auto& own : production.own_weights())
    if (std::ranges::binary_search(cameras, own.camera))
      for (size_t i = 0; i < out.size(); i++)
        if (own.weight[i] != 0) out[i] = true;
  return out;
}

TEST(SumTiles, HoldEveryPixelOnce) {
  for (int trial = 0; trial < 24; trial++) {
    SCOPED_TRACE(trial);
    Random random(trial);
    const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
    View view = view_into(rig, 5, trial % 3 == 1 ? 157 : 160, trial % 3 == 2 ? 119 : 120, random.small_rotation(0.3));
    if (trial % 4 == 2) view.lens = Lens(LensModel::kSimpleRadial, {200, 79.5, 59.5, -0.1});
    if (trial % 4 == 3) view.blending = Blending{Blending::Kind::kAperture, 0.1, 0};
    std::vector<CameraIndex> own;
    for (CameraIndex camera = 0; camera < rig.cameras.size(); camera++)
      if (random.uniform(0, 1) < (trial % 2 ? 0.1 : 0.4)) own.push_back(camera);
    const Mesh mesh = build_mesh(rig);
    const RenderJob job(rig, mesh, view, own);
    const std::vector<bool> wanted = weighted({rig, mesh, view}, own);
    size_t before = SIZE_MAX;
    for (const size_t spare : {size_t{0}, size_t{300}, size_t{5000}}) {
      const std::vector<Rect> tiles = tiles_of(job, PixelFamily::kI420, spare);
      std::vector<int> there(wanted.size());
      for (const Rect& tile : tiles) {
        EXPECT_FALSE(tile.empty());
        EXPECT_EQ(tile, chroma_aligned(tile, view));
        EXPECT_EQ(intersect(tile, job.runs().region()), tile);
        for (int y = tile.y0; y < tile.y1; y++)
          for (int x = tile.x0; x < tile.x1; x++) there[static_cast<size_t>(y) * view.width + x]++;
      }
      for (size_t i = 0; i < wanted.size(); i++) {
        ASSERT_LE(there[i], 1) << i;
        if (wanted[i]) {
          ASSERT_EQ(there[i], 1) << i % view.width << ", " << i / view.width;
        }
      }
      EXPECT_TRUE(std::ranges::is_sorted(tiles, {}, &Rect::y0));
      EXPECT_LE(tiles.size(), before) << "what may be spared makes fewer of them";
      before = tiles.size();
    }
  }
}

TEST(SumTiles, OneCameraSendsLessThanItsBounds) {
  Random random(3);
  const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
  const View view = view_into(rig, 5, 320, 240, random.small_rotation(0));
  const std::vector<CameraIndex> own{12};
  const RenderJob job(rig, build_mesh(rig), view, own);
  const Rect bounds = CameraCorners(job.plan(), 12).owned(job.runs(), job.plan().camera_rect(12));
  const std::vector<Rect> tight = tiles_of(job, PixelFamily::kRgb, 0);
  EXPECT_GT(tight.size(), 3u);
  EXPECT_LT(total(tight), area(bounds) * 9 / 10);
  EXPECT_EQ(tiles_of(job, PixelFamily::kRgb, 1 << 20), std::vector{bounds});
}

TEST(SumTiles, CamerasFarApartHaveTilesOfTheirOwn) {
  Random random(4);
  const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
  const View view = view_into(rig, 5, 320, 240, random.small_rotation(0));
  const RenderJob job(rig, build_mesh(rig), view, std::vector<CameraIndex>{5, 9});  // at both ends of a row
  const std::vector<Rect> apart = tiles_of(job, PixelFamily::kRgb, 1000);
  EXPECT_EQ(apart.size(), 2u);
  EXPECT_EQ(tiles_of(job, PixelFamily::kRgb, 1 << 20).size(), 1u);
}

TEST(SumTiles, AllCamerasAreOneRectangle) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  View view;
  view.width = 96;
  view.height = 64;
  view.lens = Lens(LensModel::kPinhole, {100, 100, 47.5, 31.5});
  view.pose.position = {0, 0, -0.01};
  view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
  std::vector<CameraIndex> all(16);
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(tiles_of({rig, build_mesh(rig), view, all}, PixelFamily::kI420, 0), (std::vector<Rect>{{0, 0, 96, 64}}));
}

TEST(SumTiles, NobodyHasNone) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  View view;
  view.width = 96;
  view.height = 64;
  view.lens = Lens(LensModel::kPinhole, {100, 100, 47.5, 31.5});
  view.pose.position = {5, 0, -0.01};
  view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
  EXPECT_TRUE(tiles_of({rig, build_mesh(rig), view, std::vector<CameraIndex>{0, 1}}, PixelFamily::kRgb, 0).empty());
}

}  // namespace
}  // namespace lf
