// SPDX-License-Identifier: LGPL-2.1-or-later
// Benchmarks the search for a focal surface against rendering through a plane: ns per output pixel = 1e9 /
// items_per_second (for views with 1 or 6 times the cameras' pixels per side). 64 cameras, one thread.
#include <benchmark/benchmark.h>

#include <cmath>
#include <numeric>

#include "bench/sum_picture.h"
#include "focus/depth_selection.h"
#include "focus/focus_array.h"
#include "focus/hypothesis_renderer.h"
#include "focus/hypothesis_samples.h"
#include "focus/warp_depth_map.h"
#include "image/image_filters.h"
#include "lib/render/sum_arrays.h"
#include "render/camera_projection.h"
#include "wire/request_codec.h"

namespace lf {
namespace {

constexpr int kWidth = 320, kHeight = 240, kSide = 8;

struct Scene {
  // `finer`: pixels of the view per camera pixel, along each side.
  explicit Scene(PixelFamily family, int finer = 1) {
    reference::Random random(1);
    const double f = 1.25 * kWidth;
    rig = test::jittered_array(random, kSide, kWidth, kHeight, -0.15, 0.4 / (kSide - 1));
    mesh = build_mesh(rig);
    own.resize(rig.cameras.size());
    std::iota(own.begin(), own.end(), 0);
    const Image rgb = reference::smooth_image(random, kWidth, kHeight);
    image = family == PixelFamily::kI420 ? to_i420(rgb) : rgb;
    view.width = finer * kWidth;
    view.height = finer * kHeight;
    view.lens = Lens::pinhole(finer * f, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    view.pose = {Vec3(0.2, 0.2, -0.9 * 0.2 * f / (kWidth / 2.0)), Quat(1, 0, 0, 0)};
    view.focus.plane = plane_through({0, 0, 2}, {0, 0, -1});
    focused = view;
    FocalMap map = FocalMap::for_view(view.width, view.height);
    map.from = array_plane(rig);
    map.nearest = 1 / 0.8;  // the range of DepthEstimator for this plane
    map.farthest = 1 / 8.;
    for (int j = 0; j < map.rows; j++)
      for (int i = 0; i < map.columns; i++)  // a rising ground with objects
        map.levels.push_back(static_cast<uint8_t>(40 + j / finer + (((i / 13 + j / 11) % 3 == 0) ? 60 : 0)));
    focused.focus.map = std::make_shared<FocalMap>(map);
    for (const DepthHypothesis& hypothesis : hypotheses_of_round(0))
      hypotheses.push_back(hypothesis_levels(focused, hypothesis));
    sums.resize(hypotheses.size());
  }
  std::vector<Source> sources(const std::vector<CameraIndex>& cameras) const {
    std::vector<Source> out;
    for (const CameraIndex i : cameras) out.push_back({i, &rig.cameras[i], image.view()});
    return out;
  }
  GpuStatus add_all(const RenderJob& job, const ParallelFor& parallel = serial_for, gl::GlesRenderer* gpu = nullptr) {
    for (PhotoConsistency& sum : sums) sum.reset(focused.focus.map->columns, focused.focus.map->rows);
    return add_consistency(job, sources(job.cameras()), hypotheses, sums, parallel, gpu);
  }
  Rig rig;
  Mesh mesh;
  std::vector<CameraIndex> own;
  Image image;
  View view, focused;  // on a plane; through a surface
  std::vector<std::vector<uint8_t>> hypotheses;
  std::vector<PhotoConsistency> sums;
};

void count(benchmark::State& state, int finer = 1) {
  state.SetItemsProcessed(state.iterations() * int64_t{finer} * finer * kWidth * kHeight);
}

void Colour(benchmark::State& state, PixelFamily family, bool surface) {
  const Scene scene(family);
  const View& view = surface ? scene.focused : scene.view;
  std::vector<int16_t> samples(size_t{3} * kWidth * kHeight);
  std::vector<uint16_t> lost(size_t{1} * kWidth * kHeight);
  for (auto _ : state) {
    const RenderJob job(scene.rig, scene.mesh, view, scene.own);
    const SumRenderer renderer(job.plan(), job.runs(), scene.sources(job.cameras()), family);
    const Rect rect = renderer.rect();
    benchmark::DoNotOptimize(
        renderer.render_rows(rect.y0, rect.y1, packed_sums(family, rect, samples.data(), lost.data())));
  }
  count(state);
}
BENCHMARK_CAPTURE(Colour, plane_rgb, PixelFamily::kRgb, false);
BENCHMARK_CAPTURE(Colour, surface_rgb, PixelFamily::kRgb, true);
BENCHMARK_CAPTURE(Colour, plane_i420, PixelFamily::kI420, false);
BENCHMARK_CAPTURE(Colour, surface_i420, PixelFamily::kI420, true);

void Sharpen(benchmark::State& state, PixelFamily family) {
  const Scene scene(family);
  const RenderJob job(scene.rig, scene.mesh, scene.focused, scene.own);
  std::vector<ByteBuffer> memory(scene.rig.cameras.size());
  int64_t pixels = 0;
  for (auto _ : state) {
    pixels = 0;
    for (const CameraIndex i : job.cameras()) {
      const Rect rect = needed_pixels(job.plan(), i, scene.rig.cameras[i]);
      pixels += int64_t{rect.width()} * rect.height();
      sharpen(scene.image.view(), rect, memory[i]);
    }
  }
  count(state);
  state.counters["camera_pixels"] = static_cast<double>(pixels);
}
BENCHMARK_CAPTURE(Sharpen, rgb, PixelFamily::kRgb);
BENCHMARK_CAPTURE(Sharpen, i420, PixelFamily::kI420);

void HypothesisPlan(benchmark::State& state) {
  const Scene scene(PixelFamily::kRgb);
  for (auto _ : state) {
    const RenderJob job(scene.rig, scene.mesh, hypothesis_view(scene.focused), scene.own);
    const FaceIdMap owners(job.runs());
    benchmark::DoNotOptimize(&owners);
  }
  count(state);
}
BENCHMARK(HypothesisPlan);

void HypothesisLevels(benchmark::State& state) {
  const Scene scene(PixelFamily::kRgb);
  for (auto _ : state)
    for (const DepthHypothesis& hypothesis : hypotheses_of_round(0))
      benchmark::DoNotOptimize(hypothesis_levels(scene.focused, hypothesis));
  count(state);
}
BENCHMARK(HypothesisLevels);

void Box(benchmark::State& state, PixelFamily family) {
  const Scene scene(family);
  const RenderJob job(scene.rig, scene.mesh, hypothesis_view(scene.focused), scene.own);
  BoxedLuma luma;
  for (auto _ : state)
    for (const CameraIndex i : job.cameras())
      box_luma(scene.image.view(), needed_pixels(job.plan(), i, scene.rig.cameras[i]), luma);
  count(state);
}
BENCHMARK_CAPTURE(Box, rgb, PixelFamily::kRgb);
BENCHMARK_CAPTURE(Box, i420, PixelFamily::kI420);

void Hypotheses(benchmark::State& state, PixelFamily family) {
  Scene scene(family, static_cast<int>(state.range(0)));
  const RenderJob job(scene.rig, scene.mesh, hypothesis_view(scene.focused), scene.own);
  for (auto _ : state) scene.add_all(job);
  count(state, static_cast<int>(state.range(0)));
}
BENCHMARK_CAPTURE(Hypotheses, rgb, PixelFamily::kRgb)->Arg(1)->Arg(6);
BENCHMARK_CAPTURE(Hypotheses, i420, PixelFamily::kI420)->Arg(1)->Arg(6);

// On a GPU or a software renderer, including the upload of luma and the download of the sums.
void DrawnHypotheses(benchmark::State& state, PixelFamily family) {
  static std::string why;
  static const auto gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) return state.SkipWithError(why.c_str());
  Scene scene(family, static_cast<int>(state.range(0)));
  const RenderJob job(scene.rig, scene.mesh, hypothesis_view(scene.focused), scene.own);
  const ParallelFor parallel = bench::copying_for(gpu.get());
  double drawn_ns = 0;
  scene.add_all(job, parallel, gpu.get());  // compiles the programs
  for (auto _ : state) {
    const GpuStatus drawing = scene.add_all(job, parallel, gpu.get());
    if (!drawing.drawn) return state.SkipWithError(drawing.why_not.c_str());
    drawn_ns += static_cast<double>(gpu->drawn_ns());
  }
  state.counters["drawn_ms"] = drawn_ns / 1e6 / static_cast<double>(state.iterations());
  count(state, static_cast<int>(state.range(0)));
}
BENCHMARK_CAPTURE(DrawnHypotheses, i420, PixelFamily::kI420)->Arg(1)->Arg(6)->MeasureProcessCPUTime()->UseRealTime();

void Choice(benchmark::State& state) {
  Scene scene(PixelFamily::kRgb);
  scene.add_all(RenderJob(scene.rig, scene.mesh, hypothesis_view(scene.focused), scene.own));
  const FocalMap& map = *scene.focused.focus.map;
  const FocusArray array(scene.rig);
  const std::vector<float> evidence = array.evidence(scene.focused, {});
  const DepthSelectionParams terms{
      .evidence = evidence,
      .radius = 1,
      .levels_a_pixel = FocalMap::kLevels / (array.disparity() * (map.nearest - map.farthest))};
  for (auto _ : state) benchmark::DoNotOptimize(select_depths(map, scene.hypotheses, scene.sums, terms));
  count(state);
}
BENCHMARK(Choice);

void Evidence(benchmark::State& state) {
  const Scene scene(PixelFamily::kRgb);
  const FocusArray array(scene.rig);
  for (auto _ : state) benchmark::DoNotOptimize(array.evidence(scene.focused, {}));
  count(state);
}
BENCHMARK(Evidence);

void CarryOver(benchmark::State& state) {
  const Scene scene(PixelFamily::kRgb);
  View moved = scene.focused;
  moved.pose.position.x += 0.02;
  for (auto _ : state) benchmark::DoNotOptimize(warp_depth_map(scene.focused, moved));
  count(state);
}
BENCHMARK(CarryOver);

void RequestWire(benchmark::State& state, bool surface) {
  const Scene scene(PixelFamily::kRgb);
  ViewRequest request;
  request.view = surface ? scene.focused : scene.view;
  if (surface) request.hypotheses = hypotheses_of_round(0);
  size_t size = 0;
  for (auto _ : state) {
    const std::vector<uint8_t> bytes = wire::encode_request(request);
    benchmark::DoNotOptimize(wire::decode_request(bytes));
    size = bytes.size();
  }
  count(state);
  state.counters["bytes"] = static_cast<double>(size);
}
BENCHMARK_CAPTURE(RequestWire, plane, false);
BENCHMARK_CAPTURE(RequestWire, surface, true);

}  // namespace
}  // namespace lf

BENCHMARK_MAIN();
