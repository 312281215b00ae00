// SPDX-License-Identifier: LGPL-2.1-or-later
#include "api/api_fixture.h"

#include <cmath>
#include <cstdlib>
#include <numeric>
#include <thread>

#include "composite/accumulator.h"
#include "reference/renderer.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"

namespace lightfield {
namespace {

using test::Array;

constexpr RenderOptions kBilinear{.resampling = Resampling::kBilinear};

lf::Image production(const Array& array, const lf::View& view) {
  const lf::Mesh mesh = lf::build_mesh(array.inside);
  std::vector<lf::CameraIndex> all(array.inside.cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const lf::RenderJob job(array.inside, mesh, view, all);
  std::vector<lf::Source> sources;
  for (const lf::CameraIndex camera : job.cameras())
    sources.push_back({camera, &array.inside.cameras[camera], array.originals[camera].view()});
  const lf::PixelFamily family = array.originals[0].family();
  const lf::SumRenderer renderer(job.plan(), job.runs(), sources, family);
  const lf::Rect rect = renderer.rect();
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  renderer.render_rows(rect.y0, rect.y1, lf::packed_sums(family, rect, samples.data(), lost.data()));
  lf::Accumulator sum;
  sum.reset(family, view.width, view.height);
  sum.add(lf::packed_sums<const int16_t, const uint16_t>(family, rect, samples.data(), lost.data()));
  return sum.resolve();
}

TEST(ApiRenderer, PicturesAreTheProductionRenderers) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420})
    for (const double aperture : {0.0, 0.15}) {
      Array array(format);
      array.view.aperture = aperture;
      Renderer renderer(array.rig);
      const Image picture = renderer.render(array.view, array.images, kBilinear);
      EXPECT_EQ(picture.format, format);
      EXPECT_EQ(picture.pixels, production(array, test::private_view(array.view)).data()) << aperture;
    }
}

TEST(ApiRenderer, WhoeverDrawsThePictureIsTheSameToOneLevel) {
  for (const PixelFormat format : {PixelFormat::kRgb, PixelFormat::kI420}) {
    Array array(format);
    Renderer renderer(array.rig);
    EXPECT_EQ(renderer.drawn_by(), "cpu");
    const Image expected = renderer.render(array.view, array.images, kBilinear);
    RenderOptions options = kBilinear;
    for (const auto& [drawn_by, says] : {std::pair(DrawnBy::kGl, "gl: "), std::pair(DrawnBy::kAuto, "auto: ")}) {
      options.drawn_by = drawn_by;
      const Image picture = renderer.render(array.view, array.images, options);
      EXPECT_EQ(renderer.drawn_by().rfind(says, 0), 0u) << renderer.drawn_by();
      ASSERT_EQ(picture.pixels.size(), expected.pixels.size());
      for (size_t i = 0; i < picture.pixels.size(); i++)
        ASSERT_LE(std::abs(picture.pixels[i] - expected.pixels[i]), 1) << i;
    }
    options.drawn_by = static_cast<DrawnBy>(3);
    EXPECT_THROW(renderer.render(array.view, array.images, options), Error);
  }
}

TEST(ApiRenderer, PicturesAreWithinOneLevelOfTheReference) {
  lf::reference::Random random(7);
  size_t compared = 0;
  for (int i = 0; i < 20; i++) {
    Array array(PixelFormat::kRgb, 100 + i);
    Pose& pose = array.view.world_from_view;
    pose.position = {random.uniform(-0.15, 0.15), random.uniform(-0.1, 0.1), random.uniform(-0.3, 0.1)};
    array.view.focus_distance = random.uniform(0.8, 4);
    Renderer renderer(array.rig, 1 + i % 3);
    const Image picture = renderer.render(array.view, array.images, kBilinear);
    const lf::reference::Picture truth = lf::reference::render(array.inside, lf::build_mesh(array.inside),
                                                               test::private_view(array.view), array.originals);
    const lf::Image rounded = truth.image();
    const std::vector<float> coverage = truth.coverage();
    for (size_t p = 0; p < coverage.size(); p++) {
      if (coverage[p] < 0.999) continue;
      for (int c = 0; c < 3; c++)
        ASSERT_LE(std::abs(picture.pixels[3 * p + c] - rounded.data()[3 * p + c]), 1) << "situation " << i;
      compared++;
    }
  }
  EXPECT_GT(compared, 20u * 96 * 72 / 4);
}

TEST(ApiRenderer, ACameraWithoutAnImageIsMadeUpForByItsNeighbours) {
  Array array;
  Renderer renderer(array.rig);
  const std::vector<uint32_t> looked_at = renderer.cameras(array.view);
  ASSERT_GE(looked_at.size(), 3u);
  std::vector<ImageView> images(array.images.begin(), array.images.end());
  images[looked_at[0]] = {};
  const Image picture = renderer.render(array.view, images, {.background = {255, 0, 255}});
  // Neither black nor the background: in the middle of the array nothing is missing.
  const size_t middle = 3 * (static_cast<size_t>(36) * 96 + 48);
  const Image whole = renderer.render(array.view, array.images);
  for (size_t c = 0; c < 3; c++) EXPECT_NEAR(picture.pixels[middle + c], whole.pixels[middle + c], 80);
  EXPECT_NE(picture.pixels, whole.pixels);

  const std::vector<ImageView> none(array.images.size());
  const Image empty = renderer.render(array.view, none, {.background = {255, 0, 254}});
  EXPECT_EQ(empty.format, PixelFormat::kRgb);
  EXPECT_EQ(empty.pixels[0], 255);
  EXPECT_EQ(empty.pixels[2], 254);
}

TEST(ApiRenderer, NeedsNoOtherCameras) {
  Array array;
  Renderer renderer(array.rig);
  array.view.fov_y = 20;
  const Image whole = renderer.render(array.view, array.images);
  const std::vector<uint32_t> looked_at = renderer.cameras(array.view);
  ASSERT_LT(looked_at.size(), array.images.size());
  for (uint32_t i = 0; i < array.images.size(); i++)
    if (std::find(looked_at.begin(), looked_at.end(), i) == looked_at.end()) array.images[i] = {};
  EXPECT_EQ(renderer.render(array.view, array.images).pixels, whole.pixels);
}

TEST(ApiRenderer, FindsTheFocalSurface) {
  const test::Walls walls;
  Renderer renderer(walls.rig);
  const double on_plane = walls.mean_error(renderer.render(walls.view, walls.images));
  double on_surface = 0;
  for (int i = 0; i < 16; i++)
    on_surface = walls.mean_error(renderer.render(walls.view, walls.images, {.focus = Focus::kAuto}));
  EXPECT_GT(on_plane, 3) << "all of the picture is out of focus";
  EXPECT_LT(on_surface, on_plane / 3);
  renderer.reset_focus();
  EXPECT_NEAR(walls.mean_error(renderer.render(walls.view, walls.images, {.focus = Focus::kAuto})), on_plane, 1e-9);
}

TEST(ApiRenderer, MatchesBrightness) {
  const test::Walls walls(0.8);
  double error[2];
  for (const bool match : {false, true}) {
    Renderer renderer(walls.rig);
    for (int i = 0; i < 40; i++)
      error[match] = walls.mean_error(
          renderer.render(walls.view, walls.images, {.focus = Focus::kAuto, .match_brightness = match}));
  }
  EXPECT_GT(error[false], 3) << "a camera is darker than the others";
  EXPECT_LT(error[true], error[false] / 2);
}

TEST(ApiRenderer, SaysWhatDoesNotFit) {
  Array array;
  Renderer renderer(array.rig);
  std::vector<Image> images = array.images;
  images.pop_back();
  EXPECT_API_ERROR(renderer.render(array.view, images), "images: must be one for each of 12 cameras, are 11");
  images = array.images;
  images[3] = make_image(PixelFormat::kRgb, 64, 47);
  EXPECT_API_ERROR(renderer.render(array.view, images),
                   "image of camera 3 (id 3) has 64x47 pixels, the rig says 64x48");
  images[3] = make_image(PixelFormat::kI420, 64, 48);
  EXPECT_API_ERROR(renderer.render(array.view, images), "some are RGB and some are I420");
  images[3] = array.images[3];
  images[3].pixels.pop_back();
  EXPECT_API_ERROR(renderer.render(array.view, images), "9215 bytes are not those of an image of 64x48 pixels");
  std::vector<ImageView> views(array.images.begin(), array.images.end());
  views[2].stride[0] = 10;
  EXPECT_API_ERROR(renderer.render(array.view, views), "camera 2 (id 2) has a stride of 10 bytes: its rows have 192");
  views[2].plane[0] = nullptr;
  EXPECT_API_ERROR(renderer.render(array.view, views), "camera 2 (id 2) has no plane 0");

  const auto with = [&](auto change) {
    View view = array.view;
    change(view);
    return test::error_of([&] { renderer.render(view, array.images); });
  };
  EXPECT_EQ(with([](View& v) { v.width = 0; }), "width: must be 1 to 16384 pixels, is 0");
  EXPECT_EQ(with([](View& v) { v.fov_y = 180; }), "fov_y: must be above 0 and below 180 degrees");
  EXPECT_EQ(with([](View& v) { v.focus_distance = -1; }), "focus_distance: must be above 0 metres");
  EXPECT_EQ(with([](View& v) { v.aperture = NAN; }), "aperture: must not be below 0 metres");
  EXPECT_EQ(with([](View& v) { v.world_from_view.position.y = INFINITY; }), "position: must be finite numbers");
  EXPECT_EQ(with([](View& v) { v.world_from_view.orientation.w = 2; }),
            "orientation: must be a quaternion of unit norm");
  EXPECT_EQ(with([](View& v) { v.lens = Lens{.fx = 0, .fy = 1}; }), "params[0]: the focal length must be positive");
  EXPECT_API_ERROR(renderer.render(array.view, array.images, {.nearest = 3, .farthest = 2}), "nearest, farthest");
  EXPECT_API_ERROR(renderer.render(array.view, array.images, {.resampling = static_cast<Resampling>(9)}), "resampling");
  // As it was.
  EXPECT_EQ(renderer.render(array.view, array.images).pixels,
            Renderer(array.rig).render(array.view, array.images).pixels);
}

TEST(ApiRenderer, SeveralAtOnceMakeTheSamePictures) {
  const Array array;
  std::vector<Image> alone;
  Renderer first(array.rig, 1);
  for (int i = 0; i < 12; i++) alone.push_back(first.render(array.view, array.images, {.focus = Focus::kAuto}));
  std::vector<std::thread> threads;
  std::vector<int> different(4);
  for (size_t t = 0; t < different.size(); t++)
    threads.emplace_back([&, t] {
      Renderer renderer(array.rig, static_cast<unsigned>(t));
      for (const Image& expected : alone)
        different[t] += renderer.render(array.view, array.images, {.focus = Focus::kAuto}).pixels != expected.pixels;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(different, std::vector<int>(different.size()));
}

}  // namespace
}  // namespace lightfield
