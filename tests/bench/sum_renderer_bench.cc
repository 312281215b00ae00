// SPDX-License-Identifier: LGPL-2.1-or-later
// Benchmarks planning and rendering one view from a square array of cameras: ns per output pixel = 1e9 /
// items_per_second.
#include <GLES3/gl31.h>
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "base/schedule.h"
#include "bench/sum_picture.h"
#include "lib/render/sum_arrays.h"
#include "render/gl/gpu_sum.h"
#include "wire/fragment_codec.h"

namespace lf {
namespace {

constexpr int kSizes[][2] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}, {3840, 2160}};

// kWide and kWideFisheye: fields of 103 and 143 degrees along a row, and a view of 103 degrees.
enum class Lenses { kPinhole, kRadial, kFisheye, kWide, kWideFisheye };

struct Scene {
  Scene(int side, int width, int height, Lenses lenses, PixelFamily family) {
    reference::Random random(1);
    const double f = (lenses < Lenses::kWide ? 1.25 : 0.4) * width;
    rig = test::jittered_array(random, side, width, height, lenses == Lenses::kRadial ? -0.15 : 0, 0.4 / (side - 1));
    for (Camera& camera : rig.cameras) {
      const std::array<double, Lens::kMaxParams> params = {f, f, camera.lens.cx(), camera.lens.cy(), -0.02, 0.002};
      if (lenses == Lenses::kFisheye || lenses == Lenses::kWideFisheye)
        camera.lens = Lens(LensModel::kOpenCvFisheye, params);
      else if (lenses == Lenses::kWide)
        camera.lens = Lens(LensModel::kOpenCv, params);
    }
    mesh = build_mesh(rig);
    const Image rgb = reference::smooth_image(random, width, height);
    images.assign(rig.cameras.size(), family == PixelFamily::kI420 ? to_i420(rgb) : rgb);
    view.width = width;
    view.height = height;
    view.lens = Lens::pinhole(f, (width - 1) / 2.0, (height - 1) / 2.0);
    view.pose = {Vec3(0.2, 0.2, -0.9 * 0.2 * f / (width / 2.0)), Quat(1, 0, 0, 0)};  // the array fills the view
    view.focus.plane = plane_through({0, 0, 2}, {0, 0, -1});
    for (int c = 0; c < 3; c++) sum[c].resize(static_cast<size_t>(width) * height);
    lost.resize(sum[0].size());
  }
  std::vector<Source> sources(const ViewPlan& plan) const { return test::sources_of(rig, plan, images); }
  Rig rig;
  Mesh mesh;
  std::vector<Image> images;
  View view;
  std::vector<int16_t> sum[3];
  std::vector<uint16_t> lost;
};

// Depths of a typical room: a rising floor, and objects in front of a wall.
std::shared_ptr<const FocalMap> room_depths(const View& view) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.from = plane_through({0, 0, 0}, {0, 0, 1});
  map.farthest = 1 / 5.0;
  map.nearest = 1 / 1.2;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const double x = (i + 0.5) / map.columns, y = (j + 0.5) / map.rows;
      double level = std::max(20 + 10 * x, 300 * (y - 0.6));
      for (const auto& [cx, cy, r, near] :
           {std::array{0.2, 0.4, 0.12, 130.0}, {0.6, 0.5, 0.2, 90.0}, {0.8, 0.7, 0.1, 220.0}})
        if (std::hypot(x - cx, (y - cy) * view.height / view.width) < r) level = near + 20 * (x - cx);
      map.levels.push_back(static_cast<uint8_t>(std::clamp(level, 0.0, FocalMap::kLevels)));
    }
  return std::make_shared<FocalMap>(std::move(map));
}

// Renders a whole sum in the bands of encode_sum().
void render_all(const SumRenderer& renderer, const SumPlanes& out, const ParallelFor& parallel) {
  const std::vector<Rect> bands = wire::cut_rows(out.rect, 32);
  parallel(bands.size(),
           [&](size_t i) { benchmark::DoNotOptimize(renderer.render_rows(bands[i].y0, bands[i].y1, out)); });
}

void time_sum(benchmark::State& state, Scene& scene, PixelFamily family, Coordinates coordinates, bool surface,
              gl::GlesRenderer* gpu) {
  if (surface) scene.view.focus.map = room_depths(scene.view);
  const ViewPlan plan(scene.rig, scene.mesh, scene.view);
  const FaceRuns runs(plan, {0, 0, scene.view.width, scene.view.height});
  auto sources = scene.sources(plan);
  SumPlanes out{.family = family};
  const ParallelFor parallel = bench::copying_for(gpu);
  if (gpu) const SumRenderer compiled(plan, runs, sources, family, coordinates, gpu);  // compiles the GPU's programs
  double drawn_ns = 0;
  uint64_t least = UINT64_MAX;
  for (auto _ : state) {
    const uint64_t begin = now_ns();
    const SumRenderer renderer(plan, runs, sources, family, coordinates, gpu, parallel);
    if (gpu) drawn_ns += static_cast<double>(gpu->drawn_ns());
    if (gpu && !renderer.drawing().drawn) return state.SkipWithError(renderer.drawing().why_not.c_str());
    out.rect = renderer.rect();
    for (int c = 0; c < 3; c++) {
      out.plane[c] = scene.sum[c].data();
      out.stride[c] = family == PixelFamily::kI420 && c > 0 ? chroma_size(out.rect.width()) : out.rect.width();
    }
    render_all(renderer, out, parallel);
    least = std::min(least, now_ns() - begin);
  }
  state.SetLabel(gpu ? gpu->device() : simd_target_name());
  const int64_t pixels = state.iterations() * int64_t{out.rect.width()} * out.rect.height();
  state.SetItemsProcessed(pixels);
  // Best case on a machine with other load.
  state.counters["least_ns_per_pixel"] =
      static_cast<double>(least) / (static_cast<double>(out.rect.width()) * out.rect.height());
  if (gpu) state.counters["drawn_ns_per_pixel"] = drawn_ns / static_cast<double>(pixels);
}

void Sum(benchmark::State& state, PixelFamily family, Lenses lenses, Coordinates coordinates, bool surface = false,
         gl::GlesRenderer* gpu = nullptr) {
  const auto& size = kSizes[state.range(0)];
  Scene scene(static_cast<int>(state.range(1)), size[0], size[1], lenses, family);
  time_sum(state, scene, family, coordinates, surface, gpu);
}
BENCHMARK_CAPTURE(Sum, i420_grid, PixelFamily::kI420, Lenses::kRadial, Coordinates::kGrid)
    ->ArgsProduct({{0, 1, 2, 3}, {4, 8, 16}});
BENCHMARK_CAPTURE(Sum, i420_undistorted, PixelFamily::kI420, Lenses::kPinhole, Coordinates::kGrid)
    ->ArgsProduct({{0, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_exact, PixelFamily::kI420, Lenses::kRadial, Coordinates::kExact)
    ->ArgsProduct({{0, 3}, {8}});
BENCHMARK_CAPTURE(Sum, rgb_grid, PixelFamily::kRgb, Lenses::kRadial, Coordinates::kGrid)->ArgsProduct({{0, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_surface, PixelFamily::kI420, Lenses::kRadial, Coordinates::kGrid, true)
    ->ArgsProduct({{0, 1, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_surface_fisheye, PixelFamily::kI420, Lenses::kFisheye, Coordinates::kGrid, true)
    ->ArgsProduct({{1}, {8}});
BENCHMARK_CAPTURE(Sum, i420_surface_wide, PixelFamily::kI420, Lenses::kWide, Coordinates::kGrid, true)
    ->ArgsProduct({{1, 2, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_surface_wide_fisheye, PixelFamily::kI420, Lenses::kWideFisheye, Coordinates::kGrid, true)
    ->ArgsProduct({{1, 2, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_plane_fisheye, PixelFamily::kI420, Lenses::kFisheye, Coordinates::kGrid)
    ->ArgsProduct({{1}, {8}});
BENCHMARK_CAPTURE(Sum, i420_plane_wide, PixelFamily::kI420, Lenses::kWide, Coordinates::kGrid)
    ->ArgsProduct({{1, 2, 3}, {8}});
BENCHMARK_CAPTURE(Sum, i420_plane_wide_fisheye, PixelFamily::kI420, Lenses::kWideFisheye, Coordinates::kGrid)
    ->ArgsProduct({{1, 2, 3}, {8}});
BENCHMARK_CAPTURE(Sum, rgb_surface, PixelFamily::kRgb, Lenses::kRadial, Coordinates::kGrid, true)
    ->ArgsProduct({{0, 1, 3}, {8}});

// On a GPU or a software renderer, including the upload of images and the download of sums.
void UploadedSum(benchmark::State& state, PixelFamily family, bool surface) {
  static std::string why;
  static const auto gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) return state.SkipWithError(why.c_str());
  Sum(state, family, Lenses::kRadial, Coordinates::kGrid, surface, gpu.get());
}
BENCHMARK_CAPTURE(UploadedSum, i420_plane, PixelFamily::kI420, false)
    ->ArgsProduct({{0, 1, 2, 3, 4}, {8}})
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(UploadedSum, i420_surface, PixelFamily::kI420, true)
    ->ArgsProduct({{0, 1, 2, 3, 4}, {8}})
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(UploadedSum, rgb_plane, PixelFamily::kRgb, false)
    ->ArgsProduct({{0, 3}, {8}})
    ->MeasureProcessCPUTime()
    ->UseRealTime();
// An I420 picture in GPU memory, the target for sums that stay on the GPU.
class PictureOnGpu {
 public:
  PictureOnGpu(gl::GlesRenderer& gpu, int width, int height) : gpu_(gpu) {
    gpu_.work([&](gl::Programs&, gl::Buffer&) {
      glGenTextures(3, planes_.textures);
      for (int c = 0; c < 3; c++) {
        glBindTexture(GL_TEXTURE_2D, planes_.textures[c]);
        glTexStorage2D(GL_TEXTURE_2D, 1, GL_R8, c > 0 ? chroma_size(width) : width,
                       c > 0 ? chroma_size(height) : height);
      }
    });
  }
  ~PictureOnGpu() {
    gpu_.work([&](gl::Programs&, gl::Buffer&) { glDeleteTextures(3, planes_.textures); });
  }
  // Returns false if the sum has not stayed on the GPU. `waits`: until this and all earlier work is complete.
  bool draw(const SumRenderer& renderer, int x, int y, bool waits) const {
    const auto sum = renderer.gpu_sum();
    gl::GpuPicture at = planes_;
    at.x = x;
    at.y = y;
    std::string why;
    return sum && sum->draw(at, why) && (!waits || sum->wait(why));
  }

 private:
  gl::GlesRenderer& gpu_;
  gl::GpuPicture planes_;
};

// Including the upload of images; the picture stays on the GPU.
void StayedSum(benchmark::State& state) {
  static std::string why;
  static const std::shared_ptr<gl::GlesRenderer> gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) return state.SkipWithError(why.c_str());
  const auto& size = kSizes[state.range(0)];
  Scene scene(8, size[0], size[1], Lenses::kRadial, PixelFamily::kI420);
  scene.view.focus.map = room_depths(scene.view);
  const ViewPlan plan(scene.rig, scene.mesh, scene.view);
  const FaceRuns runs(plan, {0, 0, scene.view.width, scene.view.height});
  const auto sources = scene.sources(plan);
  const ParallelFor parallel = bench::copying_for(gpu.get());
  const PictureOnGpu picture(*gpu, scene.view.width, scene.view.height);
  for (auto _ : state) {
    const SumRenderer renderer(plan, runs, sources, PixelFamily::kI420, Coordinates::kGrid, gpu.get(), parallel, true);
    if (!picture.draw(renderer, 0, 0, true)) return state.SkipWithError("it does not stay");
  }
  state.SetLabel(gpu->device());
  state.SetItemsProcessed(state.iterations() * int64_t{scene.view.width} * scene.view.height);
}
BENCHMARK(StayedSum)->ArgsProduct({{0, 1, 2, 3, 4}})->MeasureProcessCPUTime()->UseRealTime();

// A display's 45 views of 512x512 through a surface at one instant, several per pass; `stays`: as one picture on the
// GPU.
void time_set(benchmark::State& state, bool stays) {
  static std::string why;
  static const std::shared_ptr<gl::GlesRenderer> gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) return state.SkipWithError(why.c_str());
  constexpr int kColumns = 9, kRows = 5, kViews = kColumns * kRows, kSide = 512;
  Scene scene(8, kSide, kSide, Lenses::kRadial, PixelFamily::kI420);
  struct Eye {
    Eye(const Scene& scene, const View& view)
        : plan(scene.rig, scene.mesh, view), runs(plan, {0, 0, kSide, kSide}), sources(scene.sources(plan)) {}
    ViewPlan plan;
    FaceRuns runs;
    std::vector<Source> sources;
  };
  std::vector<std::unique_ptr<Eye>> eyes;
  for (int i = 0; i < kViews; i++) {
    View view = scene.view;
    view.pose.position.x += 0.1 * (i / (kViews - 1.0) - 0.5);
    view.focus.map = room_depths(view);
    eyes.push_back(std::make_unique<Eye>(scene, view));
  }
  const ParallelFor parallel = bench::copying_for(gpu.get());
  const PictureOnGpu picture(*gpu, kColumns * kSide, kRows * kSide);
  const int at_once = static_cast<int>(state.range(0));
  double drawn_ns = 0;
  size_t passes = 0;
  std::vector<std::unique_ptr<SumRenderer>> renderers(kViews);
  std::vector<SumRenderer*> drawn;
  for (auto _ : state)
    for (int i = 0; i < kViews; i++) {
      const Eye* const eye = eyes[i].get();
      renderers[i] = std::make_unique<SumRenderer>(eye->plan, eye->runs, eye->sources, PixelFamily::kI420,
                                                   Coordinates::kGrid, nullptr, serial_for, stays);
      drawn.push_back(renderers[i].get());
      if ((i + 1) % at_once != 0 && i + 1 < kViews) continue;
      SumRenderer::draw(drawn, *gpu, parallel);
      drawn_ns += static_cast<double>(gpu->drawn_ns());
      passes += gpu->passes();
      for (size_t k = 0; k < drawn.size(); k++) {
        const SumRenderer& renderer = *drawn[k];
        const int place = i + 1 - static_cast<int>(drawn.size() - k);
        if (!renderer.drawing().drawn) return state.SkipWithError(renderer.drawing().why_not.c_str());
        if (stays && !picture.draw(renderer, place % kColumns * kSide, place / kColumns * kSide, place + 1 == kViews))
          return state.SkipWithError("it does not stay");
        if (stays) continue;
        SumPlanes out{.family = PixelFamily::kI420, .rect = renderer.rect()};
        for (int c = 0; c < 3; c++) {
          out.plane[c] = scene.sum[c].data();
          out.stride[c] = c > 0 ? chroma_size(out.rect.width()) : out.rect.width();
        }
        render_all(renderer, out, parallel);
      }
      drawn.clear();
    }
  state.SetLabel(gpu->device());
  state.SetItemsProcessed(state.iterations());
  state.counters["drawn_ms_per_set"] = drawn_ns / 1e6 / static_cast<double>(state.iterations());
  state.counters["passes_per_set"] = static_cast<double>(passes) / static_cast<double>(state.iterations());
}
void UploadedSet(benchmark::State& state) { time_set(state, false); }
void StayedSet(benchmark::State& state) { time_set(state, true); }
BENCHMARK(UploadedSet)->Arg(1)->Arg(45)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(StayedSet)->Arg(1)->Arg(45)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
}  // namespace lf

BENCHMARK_MAIN();
