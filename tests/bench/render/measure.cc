// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/measure.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <hwy/highway.h>

#include "bench/render/rows.h"
#include "bench/render/scene.h"
#include "composite/accumulator.h"
#include "jpeg/fragment_codec.h"
#include "quality/image_quality.h"
#include "reference/float_renderer.h"
#include "reference/renderer.h"
#include "render/camera_projection.h"
#include "render/ownership.h"
#include "render/simd/placement-inl.h"
#include "render/simd/sum_task.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::bench {

double seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

namespace {

class Runner {
 public:
  Runner(const Scene& scene, const MethodKind& kind)
      : clock_(kind.setting.threads > 1 ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID) {
    for (const View& view : scene.views()) methods_.push_back(kind.make(scene, view));
  }
  // Several renderings per turn, so that the caches left by other methods count only once.
  void take_turn() {
    constexpr int kInARow = 3;
    constexpr double kLong = 0.05;  // seconds: the state of the caches is negligible
    for (int i = 0; i < kInARow; i++) {
      const double start = seconds(clock_);
      for (const auto& method : methods_) method->render();
      const double taken = seconds(clock_) - start;
      best_ = std::min(best_, taken);
      if (taken > kLong) break;
    }
  }
  double best() const { return best_; }
  double bytes_per_view() const {
    double sum = 0;
    for (const auto& method : methods_) sum += static_cast<double>(method->bytes());
    return sum / static_cast<double>(methods_.size());
  }
  Image picture() const { return methods_.front()->picture(); }

 private:
  const clockid_t clock_;
  std::vector<std::unique_ptr<Method>> methods_;
  double best_ = INFINITY;
};

void judge(const Scene& scene, const Image& picture, Row& row) {
  if (scene.options().array.distortion && !row.setting.any_lens) return;
  const FloatStill& exact = scene.exact(picture.family());
  const ExactQuality error = compare(picture, exact);
  row.max_error = error.max_error;
  row.psnr_reference_db = error.psnr_db;
  if (!scene.truth()) return;
  const bool i420 = picture.family() == PixelFamily::kI420;
  const Quality quality = compare(i420 ? to_rgb(picture) : picture, *scene.truth(), exact.coverage());
  row.psnr_truth_db = quality.psnr_db;
  row.ssim_truth = quality.ssim;
}

void compare_with_baselines(std::vector<Row>& rows) {
  for (Row& row : rows) {
    double baseline = INFINITY;
    for (const Row& other : rows)
      if (other.setting.is_baseline && other.setting.quality == row.setting.quality)
        baseline = std::min(baseline, other.ns_per_output_pixel);
    if (std::isfinite(baseline)) row.ratio_to_opencv = baseline / row.ns_per_output_pixel;
  }
}

}  // namespace

std::vector<Row> measure(const Scene& scene, const std::vector<MethodKind>& kinds, const Timing& timing) {
  std::vector<Row> rows;
  std::vector<Runner> runners;
  for (const MethodKind& kind : kinds) {
    runners.emplace_back(scene, kind);
    runners.back().take_turn();
    rows.push_back({kind.setting, scene.options()});
    judge(scene, runners.back().picture(), rows.back());
  }
  const double start = seconds(CLOCK_MONOTONIC);
  for (int turn = 1;
       timing.repeats > 0 ? turn < timing.repeats : turn < 3 || seconds(CLOCK_MONOTONIC) - start < timing.seconds;
       turn++)
    for (Runner& runner : runners) runner.take_turn();
  for (size_t i = 0; i < rows.size(); i++) {
    rows[i].ns_per_output_pixel = 1e9 * runners[i].best() / (rows[i].pixels() * scene.options().views);
    rows[i].bytes_per_view = runners[i].bytes_per_view();
  }
  compare_with_baselines(rows);
  mark_pareto(rows);
  return rows;
}

namespace {

using Size = std::pair<int, int>;

class Plan {
 public:
  explicit Plan(const PlanOptions& options) : options_(options) {
    methods_.qualities = {90};
    methods_.threads = {1};
    if (options.full) {
      methods_.qualities = {50, 60, 70, 80, 85, 90, 95};
      methods_.all = true;
    }
    if (options.full || options.acceptance) methods_.threads = {1, 2};
    if (options.full)
      for (int n = 4; n <= static_cast<int>(std::thread::hardware_concurrency()); n *= 2) methods_.threads.push_back(n);
    if (!options.qualities.empty()) methods_.qualities = options.qualities;
    if (!options.threads.empty()) methods_.threads = options.threads;
    plain_ = methods_;
    plain_.qualities = {methods_.qualities.size() > 1 ? 90 : methods_.qualities.front()};
    plain_.threads = {methods_.threads.front()};
    plain_.all = false;
  }

  std::vector<Configuration> make() {
    const std::vector<int> cameras = options_.cameras.empty() ? std::vector<int>{64} : options_.cameras;
    for (const int n : cameras)
      for (const Size& size : options_.sizes) {
        add(size, n, methods_);
        if (size == errors_at() || options_.acceptance || options_.full)
          add(size, n, on_one_thread(options_.full || size == errors_at() ? methods_ : plain_)).array.distortion =
              false;
        add_errors(size, n);
      }
    const auto also = [&](std::vector<int> counts, const std::vector<Size>& sizes) {
      if (!options_.cameras.empty()) return;
      for (const int n : counts)
        for (const Size& size : sizes) add(size, n, plain_).most_filmed_pixels = kFewPixels;
    };
    if (options_.full) {
      also({4, 16, 256, 1024}, options_.sizes);
      for (const int views : {2, 4, 8}) {
        SceneOptions& scene = add(errors_at(), cameras.front(), plain_);
        scene.views = views;
        scene.most_filmed_pixels = kFewPixels;
      }
    } else if (options_.acceptance) {
      also({16, 256}, options_.sizes);
    }
    return std::move(plan_);
  }

 private:
  // Used if only time matters.
  static constexpr double kFewPixels = 8e6;

  // OpenCV's baseline has no distortion: one size without distortion shows its errors.
  Size errors_at() const { return options_.sizes.size() > 1 ? options_.sizes[1] : options_.sizes[0]; }

  SceneOptions& add(const Size& size, int cameras, const MethodOptions& methods) {
    SceneOptions scene;
    scene.array.cameras = cameras;
    scene.array.width = size.first;
    scene.array.height = size.second;
    plan_.push_back({scene, methods, {options_.repeats, options_.full ? 10.0 : 6.0}});
    return plan_.back().scene;
  }

  // Used if threads do not change the reported figures.
  static MethodOptions on_one_thread(MethodOptions methods) {
    methods.threads.resize(1);
    return methods;
  }

  void add_errors(const Size& size, int cameras) {
    for (const bool distortion : {true, false}) {
      if (!distortion && size != errors_at()) continue;
      SceneOptions& scene = add(size, cameras, on_one_thread(methods_));
      scene.content = "checkerboard";
      scene.array.distortion = distortion;
      plan_.back().timing.repeats = 1;
    }
  }

  const PlanOptions& options_;
  MethodOptions methods_, plain_;
  std::vector<Configuration> plan_;
};

}  // namespace

std::vector<Configuration> make_plan(const PlanOptions& options) { return Plan(options).make(); }

namespace {

// One term of the error budget (docs/reference/error-budget.md): the error of a single step with exact inputs.
struct Spread {
  double max = 0, rms = 0;
};
struct Term {
  std::string name, unit;
  double bound = 0;  // bound of `max`; 0: no stated bound
  Spread (*measure)(const Scene& scene);
};

class Collector {
 public:
  void add(double difference) {
    max_ = std::max(max_, std::abs(difference));
    squares_ += difference * difference;
    count_++;
  }
  Spread spread() const { return {max_, count_ ? std::sqrt(squares_ / static_cast<double>(count_)) : 0}; }

 private:
  double max_ = 0, squares_ = 0;
  size_t count_ = 0;
};

RenderJob job_of(const Scene& scene) { return {scene.rig(), scene.mesh(), scene.views().front(), scene.cameras()}; }

// Camera weights in float, from edge functions in double.
Spread weights(const Scene& scene) {
  const RenderJob job = job_of(scene);
  const FaceIdMap owners(job.runs());
  const reference::Picture exact = reference::render(scene.rig(), scene.mesh(), scene.views().front(), {});
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const Rect rect = job.plan().camera_rect(camera);
    const std::vector<float> own = pixel_weights(job.plan(), owners, camera, rect);
    size_t i = 0;
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++, i++)
        if (own[i] != 0) errors.add(own[i] - exact.weight_of(x, y, camera));
  }
  return errors.spread();
}

// Positions in the camera images, in double.
Spread positions(const Scene& scene) {
  using namespace reference;
  const RenderJob job = job_of(scene);
  const View& view = scene.views().front();
  const ReferenceLens view_lens(view.lens);
  const V3 normal = to_v3(view.focus.plane.normal), eye = to_v3(view.pose.position);
  Collector errors;
  for (const CameraIndex camera : job.cameras()) {
    const Camera& rig_camera = scene.rig().cameras[camera];
    const ReferenceLens lens(rig_camera.lens);
    const CameraProjection projection(job.plan(), camera, rig_camera);
    const Rect rect = job.plan().camera_rect(camera);
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++) {
        Vec2 position;
        if (!projection.project(job.plan().rays().at(x, y), 0, position)) continue;
        const auto ray = view_lens.line_of_sight({static_cast<Real>(x), static_cast<Real>(y)});
        const V3 d = rotate(view.pose.orientation, V3{ray->x, ray->y, 1});
        const V3 point = eye + (-(dot(normal, eye) + view.focus.plane.d) / dot(normal, d)) * d;
        const V3 in_camera =
            rotate(rig_camera.pose.orientation, point - to_v3(rig_camera.pose.position), /*inverse=*/true);
        const auto at = lens.project(in_camera);
        errors.add(static_cast<double>(position.x - at->x));
        errors.add(static_cast<double>(position.y - at->y));
      }
  }
  return errors.spread();
}

// Camera images with chroma at half resolution: to YCbCr 4:2:0 and back.
Spread chroma_subsampling(const Scene& scene) {
  Collector errors;
  for (const CameraIndex camera : {scene.cameras().front(), scene.cameras().back()}) {
    const Image& rgb = scene.source(camera, PixelFamily::kRgb);
    const Image back = to_rgb(to_i420(rgb));
    for (size_t i = 0; i < rgb.data().size(); i++) errors.add(back.data()[i] - rgb.data()[i]);
  }
  return errors.spread();
}

// In processing order.
std::vector<Term> plain_terms() {
  return {{"edge functions: weights in float", "of 1", 1e-6, weights},
          {"coordinates in double", "pixels", 1e-6, positions},
          {"chroma at half resolution", "of 255", 0, chroma_subsampling}};
}

// Errors of the SIMD renderer's steps, using its own code compiled for the baseline instruction set.

// A scene's whole view with its render job.
struct Ready {
  explicit Ready(const Scene& scene, bool seeing = true)
      : scene(scene),
        view(scene.views().front()),
        job(scene.rig(), scene.mesh(), view, scene.cameras()),
        all{0, 0, view.width, view.height} {
    for (const CameraIndex camera : job.cameras()) {
      sources.push_back({camera, &scene.rig().cameras[camera], {}});
      if (seeing) sources.back().image = scene.image(camera, Pixels::kI420);
    }
  }
  const Scene& scene;
  const View& view;
  const RenderJob job;
  const Rect all;
  std::vector<Source> sources;
};

struct Sum {
  Sum(const Ready& ready, std::span<const Source> sources, Coordinates coordinates)
      : samples(packed_size(PixelFamily::kI420, ready.all.width(), ready.all.height())),
        lost(static_cast<size_t>(ready.all.width()) * ready.all.height()) {
    const SumRenderer renderer(ready.job.plan(), ready.job.runs(), sources, PixelFamily::kI420, coordinates);
    const bool any_missing =
        renderer.render_rows(0, ready.all.y1, packed_sums(PixelFamily::kI420, ready.all, samples.data(), lost.data()));
    planes = packed_sums<const int16_t, const uint16_t>(PixelFamily::kI420, ready.all, samples.data(),
                                                        any_missing ? lost.data() : nullptr);
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  ConstSumPlanes planes;
};

// A camera without a picture loses all its weight, which exposes the weight itself.
Spread simd_weights(const Scene& scene) {
  const Ready ready(scene, false);
  const reference::Picture exact = reference::render(scene.rig(), scene.mesh(), ready.view, {});
  Collector errors;
  for (const Source& source : ready.sources) {
    const Sum sum(ready, {&source, 1}, Coordinates::kGrid);
    size_t i = 0;
    for (int y = 0; y < ready.view.height; y++)
      for (int x = 0; x < ready.view.width; x++, i++)
        if (const double weight = exact.weight_of(x, y, source.camera); weight != 0)
          errors.add(sum.lost[i] / double{kMissingOne} - weight);
  }
  return errors.spread();
}

// --- positions -------------------------------------------------------------------------------------------------------

namespace target = simd::HWY_NAMESPACE;

struct Place {
  const simd::Slot& slot;
  const simd::SlotBand& band;
  const Rays& rays;
  int row;    // within the band
  int block;  // index in the band; the left node is entry() + 1
  int entry() const { return row * band.pitch + block; }
  int x() const { return (band.first_block + block) * simd::kBlock; }  // within the view
  std::optional<Vec2> exact(int x) const {
    Vec2 position;
    if (!slot.projection->project_unbounded(rays.at(x, band.y + row), 0, position)) return std::nullopt;
    return position;
  }
};

// Calls visit(place) for all rows of all interpolated blocks.
template <class Visit>
Spread in_blocks(const Scene& scene, bool shuffled_alone, const Visit& visit) {
  const Ready ready(scene);
  const simd::PreparedTask prepared(ready.job.plan(), ready.job.runs(), ready.sources, PixelFamily::kI420,
                                    Coordinates::kGrid);
  Collector errors;
  for (const simd::Slot& slot : prepared.task.slots) {
    simd::SlotBand band;
    for (int y = slot.rect.y0 / simd::kBandRows * simd::kBandRows; y < slot.rect.y1; y += simd::kBandRows) {
      band.y = y;
      band.slot = &slot;
      band.first_block = slot.rect.x0 / simd::kBlock;
      band.blocks = (slot.rect.x1 + simd::kBlock - 1) / simd::kBlock - band.first_block;
      target::place_plane(true, slot, y, band);
      for (int row = std::max(slot.rect.y0 - y, 0); row < std::min(slot.rect.y1 - y, simd::kBandRows); row++)
        for (int block = 0; block < band.blocks; block++) {
          const int method =
              band.interior ? simd::SlotBand::kShuffle : band.method[static_cast<size_t>(row / 2 * band.pitch + block)];
          if (method == simd::SlotBand::kShuffle || (!shuffled_alone && method == simd::SlotBand::kSample))
            visit(Place{slot, band, ready.job.plan().rays(), row, block}, errors);
        }
    }
  }
  return errors.spread();
}

// Positions at the ends of blocks.
Spread projection(const Scene& scene) {
  return in_blocks(scene, false, [](const Place& at, Collector& errors) {
    for (int end = 0; end < 2; end++) {
      const auto exact = at.exact(at.x() + end * simd::kBlock);
      const auto entry = static_cast<size_t>(at.entry() + 1 + end);
      if (!exact) continue;
      errors.add(at.band.luma.node_x[entry] - exact->x);
      errors.add(at.band.luma.node_y[entry] - exact->y);
    }
  });
}

// Bessel interpolation of four values, at `t` from the second to the third.
double interpolated(const double (&v)[4], double t) {
  return v[1] + t * (v[2] - v[1]) + t * (t - 1) / 4 * (v[3] - v[2] - v[1] + v[0]);
}

// Interpolation between exact positions at the ends of blocks.
Spread grid(const Scene& scene) {
  return in_blocks(scene, false, [](const Place& at, Collector& errors) {
    double x[4], y[4];
    for (int k = 0; k < 4; k++) {
      const auto node = at.exact(at.x() + (k - 1) * simd::kBlock);
      if (!node) return;
      x[k] = node->x;
      y[k] = node->y;
    }
    for (int i = 0; i < simd::kBlock; i++)
      if (const auto exact = at.exact(at.x() + i)) {
        const double t = static_cast<double>(i) / simd::kBlock;
        errors.add(interpolated(x, t) - exact->x);
        errors.add(interpolated(y, t) - exact->y);
      }
  });
}

// Positions from sample_windows(), compared with the same interpolation in double.
Spread fixed_point(const Scene& scene) {
  return in_blocks(scene, true, [](const Place& at, Collector& errors) {
    const simd::PlanePositions& luma = at.band.luma;
    const auto entry = static_cast<size_t>(at.entry());
    const simd::WindowPositions& window = luma.window[entry];
    const auto corner = luma.corner[entry], stride = static_cast<int32_t>(at.slot.image.stride[0]);
    double x[4], y[4];
    for (size_t k = 0; k < 4; k++) {
      x[k] = luma.node_x[entry + k];
      y[k] = luma.node_y[entry + k];
    }
    const auto times15 = [](int a, int b) { return (a * b + (1 << 14)) >> 15; };
    for (int i = 0; i < simd::kBlock; i++) {
      const auto whole = [&](int v) { return static_cast<double>(v) / (1 << simd::kPositionBits); };
      const double t = static_cast<double>(i) / simd::kBlock;
      const int bessel15 = static_cast<int16_t>(target::bessel(static_cast<float>(t)) * 32768 - 0.5f);
      const int fx =
          window.x0 + static_cast<int>((uint32_t{window.dx} * (i << 12)) >> 16) + times15(window.sx, bessel15);
      const int fy = window.y0 + times15(window.dy, i << 11) + times15(window.sy, bessel15);
      errors.add(corner % stride + whole(fx) - interpolated(x, t));
      errors.add(corner / stride + whole(fy) - interpolated(y, t));
    }
  });
}

// --- pictures --------------------------------------------------------------------------------------------------------

// The luma of 16-bit sums before rounding.
template <Coordinates kCoordinates>
Spread sums(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, kCoordinates);
  const FloatStill& exact = scene.exact(PixelFamily::kI420);
  Collector errors;
  for (size_t i = 0; i < exact.valid.size(); i++)
    if (exact.valid[i] > kMinCoverage) errors.add(sum.samples[i] / double{1 << kSumFractionBits} - exact.colour[i]);
  return errors.spread();
}

Spread picture(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, Coordinates::kGrid);
  Accumulator accumulator;
  accumulator.reset(PixelFamily::kI420, ready.view.width, ready.view.height);
  accumulator.add_borrowed(sum.planes);
  const Image picture = accumulator.resolve();
  const FloatStill& exact = scene.exact(PixelFamily::kI420);
  Collector errors;
  for (size_t i = 0; i < exact.valid.size(); i++)
    if (exact.valid[i] > kMinCoverage) errors.add(picture.data()[i] - exact.colour[i]);
  return errors.spread();
}

// A node's sum through JPEG and back.
template <int kQuality, int kPlane>
Spread jpeg_of_sum(const Scene& scene) {
  const Ready ready(scene);
  const Sum sum(ready, ready.sources, Coordinates::kGrid);
  const Fragment fragment = rounded_fragment(sum.planes);
  const FragmentPlanes before = planes_of(fragment);
  FragmentPlanes after{.family = before.family, .rect = before.rect};
  ByteBuffer scan;
  jpeg::FragmentEncoder().encode_pixels(before, kQuality, scan);
  jpeg::FragmentDecoder decoder;
  decoder.decode_pixels(scan, kQuality, after);
  const auto value = [](const FragmentPlanes& planes, int x, int y) -> int {
    const uint8_t byte = planes.plane[kPlane][y * planes.stride[kPlane] + x];
    return kPlane == 0 ? byte : static_cast<int8_t>(byte);
  };
  Collector errors;
  for (int y = 0; y < plane_height(before.family, before.rect, kPlane); y++)
    for (int x = 0; x < plane_width(before.family, before.rect, kPlane); x++)
      errors.add(value(after, x, y) - value(before, x, y));
  return errors.spread();
}

std::vector<Term> simd_terms() {
  // Positions within 1/256 pixel between samples of 0 and 255 along both axes, plus the errors of the sums: see
  // error-budget.md.
  return {{"SIMD: weights in 15 bits", "of 1", 2.5 / 32768, simd_weights},
          {"SIMD: coordinates in float", "pixels", 1.0 / 4096, projection},
          {"SIMD: between coordinates 16 pixels apart", "pixels", kGridError, grid},
          {"SIMD: coordinates in 11 bits of fraction", "pixels", 3.0 / 2048, fixed_point},
          {"SIMD: sums in 16 bits, exact coordinates", "of 255", 0.1, sums<Coordinates::kExact>},
          {"SIMD: sums in 16 bits, with all of these", "of 255", 0.75, sums<Coordinates::kGrid>},
          {"SIMD: the same, rounded once", "of 255", 1, picture},
          {"JPEG 50, luma of a node's sum", "of 255", 0, jpeg_of_sum<50, 0>},
          {"JPEG 75, luma of a node's sum", "of 255", 0, jpeg_of_sum<75, 0>},
          {"JPEG 90, luma of a node's sum", "of 255", 0, jpeg_of_sum<90, 0>},
          {"JPEG 95, luma of a node's sum", "of 255", 0, jpeg_of_sum<95, 0>},
          {"JPEG 90, chroma of a node's sum", "of 255", 0, jpeg_of_sum<90, 1>}};
}

}  // namespace

bool print_budget() {
  SceneOptions options;
  const Scene natural(options);
  options.content = "checkerboard";
  const Scene checkerboard(options);
  const std::string situation = label(options);
  std::printf("Each step on its own: %s\n%-44s %-7s | %21s | %21s |\n%-44s %-7s | %10s %10s | %10s %10s | %10s\n",
              situation.substr(situation.find(' ') + 1).c_str(), "", "", "natural", "checkerboard", "term", "unit",
              "max", "rms", "max", "rms", "bound");
  bool all = true;
  std::vector<Term> terms = plain_terms();
  for (Term& term : simd_terms()) terms.push_back(std::move(term));
  for (const Term& term : terms) {
    const Spread a = term.measure(natural), b = term.measure(checkerboard);
    std::printf("%-44s %-7s | %10.2g %10.2g | %10.2g %10.2g | ", term.name.c_str(), term.unit.c_str(), a.max, a.rms,
                b.max, b.rms);
    const bool broken = term.bound > 0 && !(a.max <= term.bound && b.max <= term.bound);
    if (term.bound > 0)
      std::printf("%10.2g%s\n", term.bound, broken ? " BROKEN" : "");
    else
      std::printf("%10s\n", "-");
    all = all && !broken;
  }
  return all;
}

}  // namespace lf::bench
