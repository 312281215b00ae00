// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-bench: measures rendering speed, bytes, error and image quality of an array on this machine.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "base/schedule.h"
#include "base/text.h"
#include "command_line.h"
#include "composite/assembly.h"
#include "composite/still.h"
#include "focus/still_focus.h"
#include "image/image.h"
#include "node/renderer_selector.h"
#include "node/request_renderer.h"
#include "progress.h"
#include "quality/image_quality.h"
#include "render/focus_range.h"
#include "rig/rig_json.h"
#include "rig/still_image_cache.h"
#include "scene/scene.h"
#include "terminal.h"
#include "view/navigator.h"
#include "wire/answer_codec.h"

namespace {

struct Options {
  std::string rig, size, renderer = "cpu";
  double distance = 0;  // distance of the focal plane, metres
  int held_out = 4, quality = 90;
  double seconds = 1;
};

constexpr lf::DepthEstimator::Settings kSurface{.mode = lf::FocusMode::kSurface};

struct Array {
  std::shared_ptr<const lf::Rig> rig;
  lf::Mesh mesh;
  std::vector<lf::CameraIndex> cameras;
  std::vector<lf::Image> rgb, i420;
  double distance = 1;

  const lf::CameraImages images = [this](lf::CameraIndex camera) -> const lf::Image& { return rgb[camera]; };
};

std::unique_ptr<Array> load(const Options& options) {
  auto array = std::make_unique<Array>();
  array->rig = std::make_shared<const lf::Rig>(options.rig.empty() ? lf::scene_rig() : lf::load_rig(options.rig));
  const lf::Rig& rig = *array->rig;
  array->mesh = lf::build_mesh(rig);
  array->cameras.resize(rig.cameras.size());
  std::iota(array->cameras.begin(), array->cameras.end(), 0);
  lf::StillImageCache stills(rig);
  Progress progress(options.rig.empty() ? "filming the built-in scene" : "reading images", rig.cameras.size());
  for (lf::CameraIndex i = 0; i < rig.cameras.size(); i++, progress.step()) {
    const lf::Camera& camera = rig.cameras[i];
    array->rgb.push_back(options.rig.empty()
                             ? lf::render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0)
                             : stills.get(i));
    array->i420.push_back(lf::to_i420(array->rgb.back()));
  }
  const std::optional<lf::FocusRange> range = lf::estimate_focus_range(rig, array->images);
  array->distance = options.distance > 0 ? options.distance : range ? std::sqrt(range->near * range->far) : 1;
  return array;
}

lf::View view_of(const Array& array, const Options& options) {
  const lf::Camera& camera = array.rig->cameras[array.rig->cameras.size() / 2];
  int width = camera.width, height = camera.height, end = 0;
  if (!options.size.empty() &&
      (std::sscanf(options.size.c_str(), "%dx%d%n", &width, &height, &end) != 2 || options.size[end] != 0))
    throw lf::Error("--size " + options.size + ": must be WIDTHxHEIGHT, such as 640x480");
  lf::View view = lf::make_view(lf::default_viewpoint(*array.rig, array.distance), width, height);
  lf::validate(view);
  return view;
}

// Measures the rendering speed: renders one view repeatedly, from camera images in memory to the final picture. A node
// with all cameras and a compositor run in one thread.
class Link {
 public:
  // If `jpeg` is true, answers are encoded with this quality, as on a network link. Otherwise they are 16-bit sums
  // (weighted totals of the cameras' pixels), as within a process.
  Link(const Array& array, const lf::View& view, bool jpeg, int quality, lf::RendererChoice choice)
      : array_(array), choice_(choice) {
    options_.in_process = !jpeg;
    request_.view = view;
    request_.rig_hash = array.rig->hash();
    request_.quality = quality;
    assembly_.set_rig(array.rig);
  }

  void render() {
    const lf::RequestPlan plan(*array_.rig, array_.mesh, request_, array_.cameras);
    std::vector<lf::Source> sources;
    for (const lf::CameraIndex i : plan.cameras())
      sources.push_back({i, &array_.rig->cameras[i], array_.i420[i].view()});
    const lf::View& view = request_.view;
    lf::wire::AnswerHeader header = lf::wire::answer_to(request_, {view.width, view.height}, request_.rig_hash);
    header.family = lf::PixelFamily::kI420;
    header.cameras = lf::CameraRanges(array_.cameras);
    std::string warning;
    options_.gpu = gpu_.open(choice_, warning);
    if (!warning.empty())
      throw lf::Error("the GPU renderer cannot be measured, because it is not available: " + warning);
    lf::RenderedAnswer rendered =
        renderer_.render({&plan, std::move(header)}, sources, options_, scratch_, std::move(bytes_));
    gpu_.rendered(choice_, rendered);
    bytes_ = std::move(rendered.bytes);
    const auto answer = lf::wire::parse_answer(bytes_);
    assembly_.begin(request_);
    if (!answer || assembly_.add(*answer) != lf::Assembly::Verdict::kAdded)
      throw lf::Error("the renderer returned an invalid answer, which is an error of this program");
    assembly_.finish(lf::PixelFamily::kI420, false);
    picture_ = assembly_.picture().resolve();
  }
  // Returns the minimum time of many renderings in milliseconds. The first rendering does not count, because a GPU
  // compiles its shaders then.
  double time(double seconds) {
    render();
    double least = std::numeric_limits<double>::infinity();
    for (const uint64_t begun = lf::now_ns(); static_cast<double>(lf::now_ns() - begun) < 1e9 * seconds;) {
      const uint64_t start = lf::now_ns();
      render();
      least = std::min(least, static_cast<double>(lf::now_ns() - start) / 1e6);
    }
    return least;
  }
  size_t bytes() const { return bytes_.size(); }
  const lf::Image& picture() const { return picture_; }
  std::string drawn_by() const { return gpu_.explain(choice_); }

 private:
  const Array& array_;
  const lf::RendererChoice choice_;
  lf::RendererSelector gpu_;
  lf::RenderOptions options_;
  lf::RequestRenderer renderer_;
  lf::ImageMemory scratch_;
  lf::ViewRequest request_;
  lf::ByteBuffer bytes_;
  lf::Assembly assembly_;
  lf::Image picture_;
};

// Renders the luma of a view as a reference, with 16-bit sums (7 fraction bits) and exact projections. The error is at
// most 0.1 of 255 (docs/reference/error-budget.md). Pixels with missing weight are NaN.
std::vector<double> exact_luma(const Array& array, const lf::View& view) {
  const lf::RenderJob job(*array.rig, array.mesh, view, array.cameras);
  std::vector<lf::Source> sources;
  for (const lf::CameraIndex i : job.cameras()) sources.push_back({i, &array.rig->cameras[i], array.i420[i].view()});
  const lf::SumRenderer renderer(job.plan(), job.runs(), sources, lf::PixelFamily::kI420, lf::Coordinates::kExact);
  const lf::Rect rect = renderer.rect();
  const size_t area = static_cast<size_t>(rect.width()) * rect.height();
  std::vector<int16_t> samples(3 * area);
  std::vector<uint16_t> lost(area);
  const bool any_missing = renderer.render_rows(
      rect.y0, rect.y1, lf::packed_sums(lf::PixelFamily::kI420, rect, samples.data(), lost.data()));
  std::vector<double> luma(static_cast<size_t>(view.width) * view.height, NAN);
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      const size_t i = static_cast<size_t>(y - rect.y0) * rect.width() + x - rect.x0;
      if (!any_missing || lost[i] == 0)
        luma[static_cast<size_t>(y) * view.width + x] = samples[i] / static_cast<double>(1 << lf::kSumFractionBits);
    }
  return luma;
}

struct Error {
  double max = 0, psnr_db = 0;
};
Error error_of(const lf::Image& picture, const std::vector<double>& exact) {
  double max = 0, squares = 0;
  size_t counted = 0;
  for (size_t i = 0; i < exact.size(); i++) {
    if (std::isnan(exact[i])) continue;
    const double error = std::abs(picture.data()[i] - exact[i]);
    max = std::max(max, error);
    squares += error * error;
    counted++;
  }
  return {max, 10 * std::log10(255 * 255 * static_cast<double>(counted) / squares)};
}

void print_speed(const Array& array, const Options& options) {
  const lf::View plane = view_of(array, options);
  const lf::View surface = lf::focus_still(*array.rig, array.mesh, plane, array.images, kSurface);
  const lf::RendererChoice renderer = *lf::renderer_choice(options.renderer);
  const std::string by =
      renderer == lf::RendererChoice::kCpu ? std::string("one thread (") + lf::simd_target_name() + ")" : "one thread";
  terminal::print("%zu cameras, views of %dx%d, %s, from camera images in memory to the picture\n\n",
                  array.cameras.size(), plane.width, plane.height, by.c_str());
  terminal::print("%-34s %8s %8s %10s %10s %9s\n", "", "ms", "views/s", "bytes", "max error", "PSNR, dB");
  std::string drawn_by;
  for (const bool jpeg : {false, true})
    for (const bool through_surface : {false, true}) {
      const lf::View& view = through_surface ? surface : plane;
      Link link(array, view, jpeg, options.quality, renderer);
      const double ms = link.time(options.seconds);
      const Error error = error_of(link.picture(), exact_luma(array, view));
      const std::string name = (jpeg ? "JPEG " + std::to_string(options.quality) : "16-bit sums") +
                               (through_surface ? ", focal surface" : ", one focal plane");
      terminal::print("%-34s %8.2f %8.0f %10zu %10.2f %9.2f\n", name.c_str(), ms, 1000 / ms, link.bytes(), error.max,
                      error.psnr_db);
      drawn_by = link.drawn_by();
    }
  if (renderer != lf::RendererChoice::kCpu) terminal::print("drawn by %s\n", drawn_by.c_str());
  terminal::print("error: luma, of 255, against unrounded sums at exact positions\n");
}

// Selects the cameras to hold out, evenly from the inner half of the array, where each camera has neighbours on all
// sides.
std::vector<lf::CameraIndex> held_out(const lf::Rig& rig, int count) {
  const lf::Vec3 middle = lf::default_viewpoint(rig).pose.position;
  std::vector<lf::CameraIndex> cameras(rig.cameras.size());
  std::iota(cameras.begin(), cameras.end(), 0);
  std::ranges::stable_sort(cameras, {},
                           [&](lf::CameraIndex i) { return glm::distance(rig.cameras[i].pose.position, middle); });
  cameras.resize((cameras.size() + 1) / 2);
  std::vector<lf::CameraIndex> some;
  const size_t n = std::min(cameras.size(), static_cast<size_t>(count));
  for (size_t k = 0; k < n; k++) some.push_back(cameras[k * cameras.size() / n]);
  return some;
}

void print_quality(const Array& array, const Options& options) {
  const lf::Rig& rig = *array.rig;
  terminal::print(
      "\nheld-out cameras, rendered from the other cameras: PSNR in dB, SSIM; plane at %.3g m, focal surface\n\n"
      "%-18s %15s %17s %9s\n",
      array.distance, "", "plane", "surface", "covered");
  lf::Quality mean[2];
  int judged = 0;
  const std::vector<lf::CameraIndex> tested = held_out(rig, options.held_out);
  lf::CameraSet others;  // no held-out camera may contribute to the depths
  std::ranges::copy_if(array.cameras, std::back_inserter(others),
                       [&](lf::CameraIndex i) { return std::ranges::find(tested, i) == tested.end(); });
  std::vector<lf::View> views;
  for (const lf::CameraIndex camera : tested) {
    const lf::Camera& at = rig.cameras[camera];
    views.push_back({.width = at.width, .height = at.height, .lens = at.lens, .pose = at.pose, .focus = {}});
    views.back().focus.plane = lf::focal_plane_at(at.pose, array.distance);
  }
  const std::optional<lf::ArrayDepth> depths =
      lf::estimate_depths(rig, others, views, array.images, kSurface, lf::parallel_for_all_processors());
  for (size_t i = 0; i < tested.size(); i++) {
    const lf::CameraIndex camera = tested[i];
    const lf::Camera& at = rig.cameras[camera];
    const lf::Mesh mesh = lf::build_mesh(rig, {camera});
    const lf::View& view = views[i];
    const lf::View surface = lf::focus_still(rig, mesh, view, array.images, kSurface, lf::kSettledRounds, nullptr,
                                             depths ? &*depths : nullptr);
    lf::Quality quality[2];
    for (const bool through_surface : {false, true}) {
      const lf::Still still = lf::render_still(rig, mesh, through_surface ? surface : view, array.images,
                                               lf::Resampling::kSharpened, {}, nullptr, depths ? &*depths : nullptr);
      quality[through_surface] = lf::compare(still.picture, array.rgb[camera], still.coverage);
    }
    const std::string name = at.name.empty() ? "camera " + std::to_string(at.id) : at.name;
    if (std::isnan(quality[0].psnr_db) || std::isnan(quality[1].psnr_db)) {
      terminal::print("%-18s sees nothing that other cameras see\n", name.c_str());
      continue;
    }
    terminal::print("%-18s %8.2f %6.4f %10.2f %6.4f %9.2f\n", name.c_str(), quality[0].psnr_db, quality[0].ssim,
                    quality[1].psnr_db, quality[1].ssim, quality[1].coverage);
    for (int k = 0; k < 2; k++) {
      mean[k].psnr_db += quality[k].psnr_db;
      mean[k].ssim += quality[k].ssim;
    }
    judged++;
  }
  if (judged > 0)
    terminal::print("%-18s %8.2f %6.4f %10.2f %6.4f\n", "mean", mean[0].psnr_db / judged, mean[0].ssim / judged,
                    mean[1].psnr_db / judged, mean[1].ssim / judged);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Measures how well this machine renders an array: the speed, size and rounding error of its views. Also measures "
      "the picture quality by rendering held-out cameras from the remaining cameras. Without --rig, the array is 64 "
      "cameras in the built-in scene.",
      "lf-bench");
  app.add_option(
      "--rig", o.rig,
      "Rig file with one still image per camera, all taken at the same time, for example from lf-rig snapshot");
  app.add_option("--size", o.size,
                 "Size of the rendered views in pixels, for example 1280x720 (default: the size of a "
                 "camera image)")
      ->type_name("WxH");
  app.add_option("--focus-distance", o.distance,
                 "Distance of the focal plane, in metres. Pictures rendered with a plane are sharp only at this "
                 "distance (default: estimated from the images)")
      ->check(cli::PositiveNumber);
  app.add_option("--held-out", o.held_out,
                 "Number of cameras to hold out. Each of them is rendered from the remaining cameras and compared with "
                 "its own image (0: skip this measurement)")
      ->check(cli::NonNegativeNumber);
  app.add_option("--quality", o.quality,
                 "JPEG quality of the answers, which are the compressed parts of a view that a camera host sends over "
                 "the network. A lower quality gives smaller answers and more compression artefacts")
      ->check(cli::Range(1, 100));
  app.add_option("--renderer", o.renderer,
                 "Processor that renders the views. cpu: the CPU, with vector instructions. gl: a GPU, through OpenGL "
                 "ES. auto: the faster of the two on this machine")
      ->check(cli::IsMember({"cpu", "gl", "auto"}));
  app.add_option("--seconds", o.seconds, "Duration of each measurement, in seconds. Longer measurements vary less")
      ->check(cli::PositiveNumber);
  return cli::run_tool(app, argc, argv, [&] {
    const std::unique_ptr<Array> array = load(o);
    print_speed(*array, o);
    if (o.held_out > 0) print_quality(*array, o);
  });
}
