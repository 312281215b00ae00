// SPDX-License-Identifier: LGPL-2.1-or-later
// bench-render: speed against error of every rendering method, and of OpenCV.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "base/json_value.h"
#include "base/text.h"
#include "bench/render/measure.h"
#include "bench/render/methods.h"
#include "bench/render/rows.h"
#include "bench/render/scene.h"
#include "command_line.h"
#include "composite/assembly.h"
#include "node/camera_access.h"
#include "node/request_renderer.h"
#include "progress.h"
#include "reference/float_renderer.h"
#include "reference/numerics.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"

// callgrind counts the instructions of this function by name.
extern "C" [[gnu::noinline]] void render_once(lf::bench::Method* method) {
  method->render();
  asm volatile("");  // prevents a tail call, which would leave the function before the work
}

namespace lf::bench {
namespace {

bool print_case(const reference::HardCase& hard, const std::vector<reference::Subject>& subjects) {
  const std::vector<reference::Measured> measured = measure(hard, subjects);
  print_row(hard, measured);
  bool all = true;
  for (size_t i = 0; i < subjects.size(); i++) {
    if (is_within(measured[i], subjects[i])) continue;
    std::printf("  BEYOND the bounds of %s\n", subjects[i].name.c_str());
    all = false;
  }
  return all;
}

// Prints the table of numerically hard cases: errors of every renderer and their bounds. Returns false and marks the
// row if a bound is exceeded.
bool print_numerics() {
  const std::vector<reference::Subject> subjects = reference::subjects();
  const std::vector<reference::HardCase> cases = reference::hard_cases();
  reference::print_heading(subjects);
  bool all = true;
  for (const reference::HardCase& hard : cases) all &= print_case(hard, subjects);
  std::printf("in pictures of %d times as many rows and columns\n", reference::kEnlarged);
  for (const reference::HardCase& hard : cases)
    all &= print_case(reference::enlarged(hard, reference::kEnlarged), subjects);
  return all;
}

struct Kind {
  const char* name;
  Access access;
};
constexpr Kind kKinds[] = {{"self", Access::kSelf}, {"warp", Access::kWarp}, {"pixels", Access::kPixels}};

// Runs one view through one kind of camera access, step by step; each step consumes the output of its predecessor.
class Round {
 public:
  Round(const Scene& scene, const Kind& kind, int quality)
      : scene_(scene), kind_(kind), rig_(std::make_shared<const Rig>(scene.rig())) {
    request_.view = scene.views().front();
    request_.quality = static_cast<uint8_t>(quality);
    request_.rig_hash = rig_->hash();
    options_.codec = quality > 0 ? CodecChoice::kJpeg : CodecChoice::kRaw;
    assembly_.set_rig(rig_);
  }

  void ask() {
    asked_ = wire::encode_request(request_);
    if (const CameraAccess* told = CameraAccess::of(kind_.access))
      command_ = wire::encode_any_request(told->command(*rig_, scene_.mesh(), request_));
  }

  void answer() {
    const auto request = wire::decode_any_request(command_.empty() ? asked_ : command_).value();
    const auto plan = plan_request(*rig_, mesh_, request, scene_.cameras());
    sources_.clear();
    for (const CameraIndex camera : plan->cameras())
      sources_.push_back({camera, &rig_->cameras[camera], scene_.image(camera, Pixels::kI420)});
    wire::AnswerHeader header;
    std::tie(header.view_width, header.view_height) = wire::view_size(request);
    header.family = PixelFamily::kI420;
    header.rig_hash = request_.rig_hash;
    header.cameras = CameraRanges(scene_.cameras());
    answer_ = renderer_.render({plan.get(), std::move(header)}, sources_, options_, scratch_, std::move(answer_)).bytes;
  }

  void compose() {
    assembly_.begin(wire::decode_request(asked_).value());
    assembly_.add(wire::parse_answer(answer_).value());
    assembly_.finish(PixelFamily::kI420, false);
    resolve_into(assembly_.picture(), picture_);
  }

  size_t asked_bytes() const { return asked_.size() + command_.size(); }
  size_t answer_bytes() const { return answer_.size(); }
  const Image& picture() const { return picture_; }

 private:
  const Scene& scene_;
  const Kind kind_;
  const std::shared_ptr<const Rig> rig_;
  ViewRequest request_;
  RenderOptions options_;
  RequestRenderer renderer_;
  ImageMemory scratch_;
  std::vector<uint8_t> asked_, command_;
  std::vector<Source> sources_;
  ByteBuffer answer_;
  MeshCache mesh_;
  Assembly assembly_;
  Image picture_;
};

// Returns the shortest CPU time of this thread over some calls, nanoseconds.
template <typename F>
double shortest(int repeats, F call) {
  const auto now = [] { return 1e9 * seconds(CLOCK_THREAD_CPUTIME_ID); };
  constexpr double kEnough = 2e9 / 3;  // three steps
  double best = INFINITY, all = 0;
  for (int i = 0; repeats > 0 ? i < repeats : i < 3 || all < kEnough; i++) {
    const double begin = now();
    call();
    const double taken = now() - begin;
    best = std::min(best, taken);
    all += taken;
  }
  return best;
}

// Compares the three random access cameras: bytes to and from 64 cameras for each view size, and CPU time at the
// viewer, the cameras and the compositor. The shortest of `repeats` renderings counts; 0: as many as fit into two
// seconds.
void print_access(const std::vector<std::pair<int, int>>& sizes, int cameras, int repeats) {
  std::printf("%-18s %-10s %8s | %10s %10s | %12s | %12s %12s %12s | %6s %7s\n", "cameras", "view", "codec", "to them",
              "from them", "asking, us", "cameras", "compositor", "together", "max", "PSNR");
  std::printf("%-18s %-10s %8s | %10s %10s | %12s | %38s | %6s %7s\n", "", "", "", "bytes", "bytes", "",
              "ns per pixel of the view", "error", "dB");
  for (const auto& [width, height] : sizes) {
    SceneOptions options;
    options.array = {cameras, width, height};
    const Scene scene(options);
    for (const int quality : {0, 90})
      for (const Kind& kind : kKinds) {
        Round round(scene, kind, quality);
        const double ask = shortest(repeats, [&] { round.ask(); });
        const double answer = shortest(repeats, [&] { round.answer(); });
        const double compose = shortest(repeats, [&] { round.compose(); });
        const double pixels = static_cast<double>(width) * height;
        const ExactQuality error = compare(round.picture(), scene.exact(PixelFamily::kI420));
        const std::string size = std::to_string(width) + "x" + std::to_string(height);
        std::printf("%-18s %-10s %8s | %10zu %10zu | %12.1f | %12.2f %12.2f %12.2f | %6.2f %7.1f\n", kind.name,
                    size.c_str(), quality > 0 ? "jpeg 90" : "raw", round.asked_bytes(), round.answer_bytes(), ask / 1e3,
                    answer / pixels, compose / pixels, (answer + compose) / pixels, error.max_error, error.psnr_db);
        std::fflush(stdout);
      }
  }
}

// Renders one view of a fixed scene `times` times with the method of this label, inside the function "render_once", for
// profilers that count instructions. Throws Error if no method has this label; the message lists all labels.
void run_once(const std::string& name, const ArrayOptions& array, int times) {
  SceneOptions options;
  options.array = array;
  options.most_filmed_pixels = 2.0 * options.array.width * options.array.height;  // a simulated processor is slow
  MethodOptions all;
  all.all = true;
  std::string names;
  for (const MethodKind& kind : methods(all)) {
    if (label(kind.setting) != name) {
      names += (names.empty() ? "" : ", ") + label(kind.setting);
      continue;
    }
    const Scene scene(options);
    const auto method = kind.make(scene, scene.views().front());
    method->render();  // the first call also allocates memory and tables
    for (int i = 0; i < times; i++) render_once(method.get());
    return;
  }
  throw Error("no method \"" + name + "\"; there are " + names);
}

struct Options {
  PlanOptions plan;
  std::vector<std::string> sizes;
  std::string json, plots;
  std::string method, size = "320x240";
  int cameras = 16, times = 1;
};

std::pair<int, int> size_of(const std::string& option, const std::string& text) {
  int width, height, end = 0;
  if (std::sscanf(text.c_str(), "%dx%d%n", &width, &height, &end) != 2 || text[end] != 0 || width < 16 || height < 16 ||
      width > kMaxImageSize || height > kMaxImageSize)
    throw Error(option + " " + text + ": must be WIDTHxHEIGHT, 16 to 16384 pixels each");
  return {width, height};
}

std::vector<std::pair<int, int>> sizes_of(const Options& options) {
  std::vector<std::pair<int, int>> sizes;
  for (const std::string& size : options.sizes) sizes.push_back(size_of("--sizes", size));
  return sizes.empty() ? options.plan.sizes : sizes;
}

void run(Options options) {
  options.plan.sizes = sizes_of(options);
  if (!options.plots.empty()) require_gnuplot();
  const std::vector<Configuration> plan = make_plan(options.plan);
  std::vector<Row> rows;
  Progress progress("measuring", plan.size());
  for (const Configuration& configuration : plan) {
    const Scene scene(configuration.scene);
    const std::vector<Row> some = measure(scene, methods(configuration.methods), configuration.timing);
    progress.finish();
    print_table(some);
    rows.insert(rows.end(), some.begin(), some.end());
    progress.step();
  }
  progress.finish();
  print_pareto(rows);
  if (options.plan.full || options.plan.acceptance) print_acceptance(rows);
  if (!options.json.empty()) write_text_file(to_json(rows), options.json);
  if (!options.plots.empty()) write_plots(rows, options.plots);
}

}  // namespace
}  // namespace lf::bench

int main(int argc, char** argv) {
  using namespace lf::bench;
  Options o;
  cli::App app(
      "Measures every way to render views of an array: time, bytes and error, beside OpenCV. Without options: 64 "
      "cameras, one thread, four sizes, within 5 minutes.",
      "bench-render");
  app.add_flag("--full", o.plan.full, "everything: 4 to 1024 cameras, qualities, threads, pixel families, views");
  app.add_flag("--acceptance", o.plan.acceptance, "what is promised, beside the goals");
  app.add_option("--sizes", o.sizes, "of views and cameras: 640x480,1920x1080")->delimiter(',')->type_name("WxH,...");
  app.add_option("--cameras", o.plan.cameras, "64 without this")->delimiter(',')->check(cli::Range(4, 4096));
  app.add_option("--threads", o.plan.threads)->delimiter(',')->check(cli::Range(1, 256));
  app.add_option("--qualities", o.plan.qualities, "of JPEG")->delimiter(',')->check(cli::Range(1, 100));
  app.add_option("--repeats", o.plan.repeats, "runs of each method, instead of a few seconds per situation")
      ->check(cli::Range(1, 1000000));
  app.add_option("--json", o.json, "write the rows to this file")->type_name("FILE");
  app.add_option("--plots", o.plots, "draw them into this folder (needs gnuplot)")->type_name("DIR");
  app.require_subcommand(0, 1);
  const cli::App* numerics =
      app.add_subcommand("numerics", "errors of every renderer in the hard cases, against 80-bit reals");
  const cli::App* budget = app.add_subcommand("budget", "what each step of rendering adds to the error");
  const cli::App* access = app.add_subcommand(
      "access", "bytes and time of each camera access: self, warp and pixels");
  cli::App* once = app.add_subcommand("once", "renders one view once: what tests/bench/instructions.sh counts");
  once->add_option("METHOD", o.method, "as in the table: \"simd i420\"")->required();
  once->add_option("--size", o.size, "of the view")->capture_default_str()->type_name("WxH");
  once->add_option("--cameras", o.cameras)->capture_default_str()->check(cli::Range(4, 4096));
  once->add_option("--times", o.times, "not once: for profilers that take samples")
      ->capture_default_str()
      ->check(cli::Range(1, 1000000));
  return cli::run_tool(app, argc, argv, [&] {
    const auto require = [](bool within) {
      if (!within) throw lf::Error("an error is beyond its bound");
    };
    if (*numerics) {
      require(print_numerics());
    } else if (*budget) {
      require(print_budget());
    } else if (*access) {
      print_access(sizes_of(o), o.plan.cameras.empty() ? 64 : o.plan.cameras.front(), o.plan.repeats);
    } else if (*once) {
      const auto [width, height] = size_of("--size", o.size);
      run_once(o.method, {o.cameras, width, height}, o.times);
    } else {
      run(o);
    }
  });
}
