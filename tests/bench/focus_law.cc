// SPDX-License-Identifier: LGPL-2.1-or-later
// Tests random arrays, viewpoints, sizes, scenes and faults. Searches for a case in which the picture with a focal
// surface is worse than with the viewer's plane by more than kLaw. Prints the worst situations, and with --out writes
// their pictures (truth, plane, surface). Exits with 1 if it finds a violation.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "bench/sum_picture.h"
#include "bench/surface/cases.h"
#include "command_line.h"
#include "focus/depth_estimator.h"
#include "focus/exposure_compensation.h"
#include "focus/hypothesis_renderer.h"
#include "focus/warp_depth_map.h"
#include "image/image.h"
#include "image/image_filters.h"
#include "node/request_renderer.h"
#include "quality/image_quality.h"
#include "reference/generators.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "rig/rig.h"
#include "scene/scene.h"
#include "view/view.h"

namespace lf::focus {
namespace {

// A random situation: an array that views a still scene, with random faults that may mislead the search.
struct Situation {
  std::string text;  // one line to print
  Rig rig;
  std::vector<Image> images;              // one per camera
  std::function<View(int picture)> view;  // on the viewer's plane
  std::function<Image(const View&)> truth;
  FocusMode mode = FocusMode::kAuto;
  bool moves = false;  // the viewpoint moves
};

struct Seen {
  int picture = 0;
  double plane_db = 0, surface_db = 0;  // over the pixels that both cover
  double near = 0, far = 0;             // metres
};
struct Watched {
  std::vector<Seen> seen;
  Image truth, plane, surface;  // pictures at the surface's worst result relative to the plane
  int worst = -1;               // index into `seen`; -1: nothing is covered
  double lead() const { return worst < 0 ? 0 : seen[worst].surface_db - seen[worst].plane_db; }
};
Watched watch(const Situation& situation, const std::vector<int>& pictures);

using reference::Random;

double log_uniform(Random& random, double low, double high) {
  return std::exp(random.uniform(std::log(low), std::log(high)));
}

constexpr double kInstant = 0.5;  // seconds

Image film(const std::string& world, const Lens& lens, const Pose& pose, int width, int height) {
  if (world == "built-in") return render_scene({width, height, lens, pose}, kInstant);
  return film_world(world, lens, pose, width, height);
}

struct Draft {
  std::string kind;
  int rows, columns;
  double pitch;
};

Rig draw_rig(Random& random, Draft& draft) {
  constexpr std::array<std::pair<int, int>, 4> kSizes{{{160, 120}, {320, 240}, {240, 240}, {200, 150}}};
  const auto [width, height] = kSizes[random.integer(0, 3)];
  draft.pitch = log_uniform(random, 0.015, 0.15);
  draft.rows = random.one_in(8) ? 1 : random.integer(2, 6);
  draft.columns = random.integer(2, 6);
  const double focal = width / (2 * std::tan(random.uniform(35, 65) * M_PI / 360));
  const int kind = random.integer(0, 3);
  draft.kind = kind == 0 ? "exact grid" : kind < 3 ? "jittered grid" : "scattered";
  const double place = kind == 0 ? 0 : kind == 1 ? 0.02 : kind == 2 ? 0.1 : 0.35;
  const double turn = kind == 0 ? 0 : kind < 3 ? 1 : 4;  // degrees
  Rig rig;
  for (int r = 0; r < draft.rows; r++)
    for (int c = 0; c < draft.columns; c++) {
      const double f = focal * (kind == 0 ? 1 : random.uniform(0.98, 1.02));
      const Vec3 at(c - (draft.columns - 1) / 2., r - (draft.rows - 1) / 2., 0);
      const Vec3 jitter = place * random.point_in_box(1);
      const Lens lens(LensModel::kRadial, {f, (width - 1) / 2.0, (height - 1) / 2.0, kind == 0 ? 0 : -0.1, 0});
      const Quat orientation = kind == 0 ? Quat(1, 0, 0, 0) : random.small_rotation(turn * M_PI / 180);
      rig.cameras.push_back(reference::make_camera(static_cast<uint32_t>(rig.cameras.size()), width, height, lens,
                                                   {draft.pitch * (at + jitter), orientation}));
    }
  if (kind < 3) rig.topology = {Topology::Type::kGrid, draft.rows, draft.columns, {}};
  return rig;
}

Situation random_situation(uint64_t seed) {
  Random random(seed);
  Situation s;
  Draft draft;
  s.rig = draw_rig(random, draft);
  const std::vector<std::string> worlds = world_names();
  const std::string world =
      random.one_in(2) ? "built-in" : worlds[random.integer(0, static_cast<int>(worlds.size()) - 1)];
  const double gain_error = random.one_in(4) ? 0.1 : 0, noise = random.one_in(3) ? random.uniform(1, 6) : 0;
  for (size_t i = 0; i < s.rig.cameras.size(); i++) {
    const Camera& camera = s.rig.cameras[i];
    s.images.push_back(film(world, camera.lens, camera.pose, camera.width, camera.height));
    const double gain = i % 4 == 0 ? 1 + (i % 8 == 0 ? 1 : -1) * gain_error : 1;
    for (uint8_t& v : s.images.back().data()) {
      double spread = 0;  // sum of three uniform numbers: approximately normal
      for (int k = 0; k < 3; k++) spread += random.uniform(-1, 1);
      v = static_cast<uint8_t>(std::lround(std::clamp(gain * v + noise * spread, 0., 255.)));
    }
  }
  constexpr std::array<std::pair<int, int>, 10> kSizes{{{160, 120},
                                                        {320, 240},
                                                        {320, 180},
                                                        {240, 320},
                                                        {400, 240},
                                                        {333, 117},
                                                        {120, 160},
                                                        {480, 270},
                                                        {320, 240},
                                                        {640, 360}}};
  const auto [width, height] = kSizes[random.integer(0, 9)];
  const double fov = random.uniform(20, 50);
  const Camera& some = s.rig.cameras[random.integer(0, static_cast<int>(s.rig.cameras.size()) - 1)];
  const Camera& other = s.rig.cameras[random.integer(0, static_cast<int>(s.rig.cameras.size()) - 1)];
  Vec3 eye = some.pose.position;
  std::string where = "at a camera";
  switch (random.integer(0, 7)) {
    case 0: break;
    case 1: eye += Vec3(0.001, 0, 0), where = "1 mm beside a camera"; break;
    case 2: eye = (some.pose.position + other.pose.position) / 2.0, where = "between two cameras"; break;
    case 3: eye += Vec3(0, 0, random.uniform(-0.6, 0)), where = "behind"; break;
    case 4: eye += Vec3(0, 0, random.uniform(0, 0.4)), where = "before"; break;
    case 5: eye = Vec3(0), where = "in the middle"; break;
    default:
      eye = draft.pitch *
            Vec3(random.uniform(-0.5, 0.5) * (draft.columns - 1), random.uniform(-0.5, 0.5) * (draft.rows - 1), 0);
      where = "somewhere";
  }
  const Quat turned = random.one_in(2) ? Quat(1, 0, 0, 0) : random.small_rotation(0.15);
  const double distance = random.one_in(3) ? random.uniform(1.2, 4.5) : log_uniform(random, 0.1, 20);
  s.mode = random.one_in(2) ? FocusMode::kAuto : FocusMode::kSurface;
  s.moves = random.one_in(4);
  const double step = s.moves ? random.uniform(0.05, 0.5) * draft.pitch : 0;
  s.view = [=, w = width, h = height](int picture) {
    View view;
    view.width = w;
    view.height = h;
    view.lens = Lens::pinhole(h / 2. / std::tan(fov * M_PI / 360), (w - 1) / 2., (h - 1) / 2.);
    view.pose = {eye + Vec3(2 * draft.pitch * std::sin(step / (2 * draft.pitch) * picture), 0, 0), turned};
    view.focus.plane = focal_plane_at(view.pose, distance);
    return view;
  };
  s.truth = [world](const View& v) { return film(world, v.lens, v.pose, v.width, v.height); };
  char text[300];
  std::snprintf(text, sizeof text,
                "%s, %s of %dx%d, pitch %.3f, cameras %dx%d, view %dx%d fov %.0f, eye %s%s, focus %.2f m, %s%s%s",
                world.c_str(), draft.kind.c_str(), draft.rows, draft.columns, draft.pitch, some.width, some.height,
                width, height, fov, where.c_str(), s.moves ? ", moving" : "", distance,
                s.mode == FocusMode::kAuto ? "auto" : "surface", gain_error > 0 ? ", gains 10 %" : "",
                noise > 0 ? ", noise" : "");
  s.text = text;
  return s;
}

struct Picture {
  Image image;
  std::vector<float> coverage;
};

// Everything that a node with all cameras and a compositor do for a view, in one thread.
class Array {
 public:
  explicit Array(const Situation& s) : s_(s), mesh_(build_mesh(s.rig)) {
    own_.resize(s.rig.cameras.size());
    std::iota(own_.begin(), own_.end(), 0);
    sharp_.resize(own_.size());
  }

  // `gains`: null: no exposure gains.
  Picture picture(const View& view, const GainRequest* gains) {
    const RenderJob job(s_.rig, mesh_, view, own_);
    std::vector<Source> sources = sources_of(job.cameras());
    if (gains && gains->use) sources = match(sources, *gains);
    for (size_t i = 0; i < sources.size(); i++)
      if (shows_detail(view, *sources[i].rig_camera))
        sources[i].image = sharpen(sources[i].image, whole(sources[i].camera), sharp_[i]);
    const SumRenderer renderer(job.plan(), job.runs(), sources, PixelFamily::kRgb);
    return {bench::picture_of_sums(renderer, view.width, view.height).image,
            view_coverage(s_.rig, job.plan(), FaceIdMap(job.runs()))};
  }

  std::vector<PhotoConsistency> moments(const ViewRequest& request) {
    if (request.hypotheses.empty() || !request.view.focus.map) return {};
    const FocalMap& map = *request.view.focus.map;
    const std::vector<std::vector<uint8_t>> levels = hypothesis_levels(request.view, request.hypotheses);
    std::vector<PhotoConsistency> sums(levels.size());
    for (PhotoConsistency& sum : sums) sum.reset(map.columns, map.rows);
    const RenderJob job(s_.rig, mesh_, hypothesis_view(request.view), own_);
    const std::vector<Source> sources = sources_of(job.cameras());
    add_consistency(job, request.gains.use ? match(sources, request.gains) : sources, levels, sums);
    return sums;
  }

  // Adds the brightness measurement to the next request.
  void ask_mean(const ViewRequest& request, GainRequest& gains) {
    if (!turns_.next(!request.hypotheses.empty(), true)) return;
    const WideLuma wide(s_.rig, mesh_, mean_view(request.view), own_);
    WideLuma::Seen seen = wide.see(sources_of(wide.cameras()), matcher_.gains_for({}));
    gains.mean = mean_luma(seen.moments, seen.gains);
    gains.mean_of = request.sequence;
    matcher_.keep(request.sequence, std::move(seen.cameras));
  }

 private:
  Rect whole(CameraIndex camera) const { return {0, 0, s_.rig.cameras[camera].width, s_.rig.cameras[camera].height}; }
  std::vector<Source> sources_of(const std::vector<CameraIndex>& cameras) const {
    std::vector<Source> sources;
    for (const CameraIndex i : cameras) sources.push_back({i, &s_.rig.cameras[i], s_.images[i].view()});
    return sources;
  }
  std::vector<Source> match(const std::vector<Source>& sources, const GainRequest& gains) {
    const auto all = [&](CameraIndex camera) { return whole(camera); };
    return GainMatcher::match(sources, matcher_.gains_for(gains), all, divided_);
  }

  const Situation& s_;
  const Mesh mesh_;
  std::vector<CameraIndex> own_;
  std::vector<ByteBuffer> sharp_;
  std::vector<ByteBuffer> divided_;
  GainMatcher matcher_;
  ExposureSchedule turns_;
};

Watched watch(const Situation& s, const std::vector<int>& pictures) {
  Array array(s);
  const FocusArray from(s.rig);
  DepthEstimator control({.mode = s.mode});
  Watched out;
  double worst = std::numeric_limits<double>::infinity();
  DepthEstimator::Plan plan;
  GainRequest gains;
  Picture plane;
  Image truth;
  for (int i = 0; i <= pictures.back(); i++) {
    ViewRequest request;
    request.view = s.view(i);
    request.sequence = static_cast<uint32_t>(i);
    request.gains = gains;
    if (i > 0) {
      if (plan.view.focus.map) request.view.focus.map = warp_depth_map(plan.view, request.view);
      request.hypotheses = plan.hypotheses;
      request.on_plane = plan.on_plane;
      if (plan.plane) request.view.focus.plane = *plan.plane;
    }
    if (std::ranges::binary_search(pictures, i)) {
      if (plane.coverage.empty() || s.moves) {
        truth = s.truth(request.view);
        plane = array.picture(s.view(i), nullptr);
      }
      const Picture surface = array.picture(displayed_view(request), &request.gains);
      std::vector<float> coverage = plane.coverage;
      for (size_t k = 0; k < coverage.size(); k++) coverage[k] = std::min(coverage[k], surface.coverage[k]);
      const Quality of_plane = compare(plane.image, truth, coverage),
                    of_surface = compare(surface.image, truth, coverage);
      constexpr double kSome = 0.05;
      if (of_plane.coverage >= kSome) {
        out.seen.push_back({i, of_plane.psnr_db, of_surface.psnr_db, control.state().near, control.state().far});
        if (of_surface.psnr_db - of_plane.psnr_db < worst) {
          worst = of_surface.psnr_db - of_plane.psnr_db;
          out.worst = static_cast<int>(out.seen.size()) - 1;
          out.truth = truth;
          out.plane = plane.image;
          out.surface = surface.image;
        }
      }
    }
    const std::vector<PhotoConsistency> moments = array.moments(request);
    gains = {.use = control.state().mixed};
    if (gains.use && request.view.focus.map) array.ask_mean(request, gains);
    plan = control.next(request, moments, from);
  }
  return out;
}

constexpr double kLaw = -0.1;  // dB

struct Found {
  uint64_t seed;
  std::string text;
  Watched watched;
};

void print(const Found& f) {
  if (f.watched.worst < 0) return;
  const Seen &at = f.watched.seen[f.watched.worst], &last = f.watched.seen.back();
  std::printf("%6lu: %+6.2f dB (plane %.2f) at picture %d, at last %+.2f (%.2f to %.2f m): %s\n",
              static_cast<unsigned long>(f.seed), f.watched.lead(), at.plane_db, at.picture,
              last.surface_db - last.plane_db, last.near, last.far, f.text.c_str());
  std::fflush(stdout);
}

}  // namespace
}  // namespace lf::focus

int main(int argc, char** argv) {
  using namespace lf::focus;
  cli::App app("Searches for situations in which a focal surface is worse than a plane.", "bench-focus-law");
  uint64_t first = 1, situations = 1000, show = 10;
  int pictures = 60;
  std::string out;
  bool all = false;
  app.add_option("--first", first, "Seed of the first situation")->capture_default_str();
  app.add_option("--situations", situations, "How many")->capture_default_str();
  app.add_option("--pictures", pictures, "Looked at in each")->capture_default_str();
  app.add_option("--show", show, "How many of the worst")->capture_default_str();
  app.add_option("--out", out, "Folder for the pictures of the worst");
  app.add_flag("--all", all, "Prints every picture looked at");
  bool broken = false;
  const int status = cli::run_tool(app, argc, argv, [&] {
    std::vector<int> looked_at{0,  1,  2,  3,  4,   5,   6,   8,   10,  12,  15,   20,   25,  30,
                               40, 50, 60, 80, 100, 150, 200, 300, 400, 600, 1000, 1500, 2000};
    std::erase_if(looked_at, [&](int p) { return p > pictures; });
    std::vector<Found> worst;
    if (!out.empty()) std::filesystem::create_directories(out);  // checked first, because a search is long
    double gain = 0, least = 0;
    size_t measured = 0, below = 0;
    for (uint64_t seed = first; seed < first + situations; seed++) {
      const Situation s = random_situation(seed);
      Found found{seed, s.text, watch(s, looked_at)};
      if (found.watched.worst < 0) continue;
      measured++;
      const Seen& last = found.watched.seen.back();
      gain += last.surface_db - last.plane_db;
      least = std::min(least, found.watched.lead());
      if (found.watched.lead() < kLaw) below++;
      if (all) {
        print(found);
        for (const Seen& at : found.watched.seen) std::printf(" %d:%+.2f", at.picture, at.surface_db - at.plane_db);
        std::printf("\n");
      }
      worst.push_back(std::move(found));
      std::ranges::sort(worst, {}, [](const Found& f) { return f.watched.lead(); });
      if (worst.size() > show) worst.pop_back();
      // A search takes most of an hour: report intermediate results, in case it is interrupted.
      if (measured % 20 == 0)
        std::fprintf(stderr, "seeds %llu to %llu: %zu below the law, the worst by %.2f dB\n",
                     static_cast<unsigned long long>(first), static_cast<unsigned long long>(seed), below, least);
    }
    for (const Found& f : worst) {
      print(f);
      if (out.empty()) continue;
      const std::string stem = out + "/" + std::to_string(f.seed);
      lf::save_image(f.watched.truth, stem + "_truth.png");
      lf::save_image(f.watched.plane, stem + "_plane.png");
      lf::save_image(f.watched.surface, stem + "_surface.png");
    }
    broken = below > 0;
    std::printf(
        "%zu situations measured: %zu below the law of %.1f dB, the worst by %.2f dB; at last %+.2f dB in the mean\n",
        measured, below, kLaw, least, measured > 0 ? gain / static_cast<double>(measured) : 0);
  });
  return status != 0 ? status : broken;
}
