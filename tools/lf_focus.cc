// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-focus: what a focal surface is worth, on still arrays with known truth and on the built-in scene as it moves.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "bench/chart.h"
#include "focus/acceptance.h"
#include "focus/cases.h"
#include "focus/measure.h"
#include "image/image_io.h"
#include "progress.h"
#include "run_tool.h"
#include "scene/scene.h"

namespace {

using namespace lf::focus;

struct Arguments {
  std::string rig, views, truth, out, json, mode = "surface", resampling = "bilinear";
  int held_out = 4;
  bool automatic = false, acceptance = false, coded_trials = false;
  AcceptanceOptions accepting;
  double moving = 0, eye_step = 0.3, seconds = 2;
  Faults faults;
  Options options;
};

Case load(const Arguments& a) {
  Case c = a.moving > 0         ? moving_case(a.moving, static_cast<int>(a.moving * a.seconds), a.eye_step)
           : a.rig.empty()      ? scene_case()
           : a.views.empty()    ? held_out_case(a.rig, a.held_out)
                                : truth_case(a.rig, a.views, a.truth);
  add_faults(a.faults, c);
  return c;
}

double gain(const StillResult& r, const Picture& picture) { return picture.quality.psnr_db - r.plane.quality.psnr_db; }

void print_heading() {
  std::printf("%-10s | %6s %6s %6s | %6s %6s %5s %5s | %6s %6s | %8s %8s %5s | %6s %6s %6s\n", "view", "plane", "ssim",
              "at m", "gain", "bound", "way", "ssim", "worst", "last", "colour B", "trial B", "%", "plane", "colour",
              "trials");
}

// Figures in the order of the heading; times in ms.
std::vector<double> figures(const StillResult& r) {
  const Picture& last = r.rounds.back();
  double worst = 1e9;  // of all rounds, against the viewer's own plane
  for (const Picture& p : r.rounds)
    worst = std::min(worst, p.quality.psnr_db - r.rounds.front().quality.psnr_db);
  std::vector<double> trial_ms;
  double trial_bytes = 0;
  for (const Picture& p : r.rounds) {
    trial_ms.push_back(p.trial_ms);
    trial_bytes += p.trial_bytes / static_cast<double>(r.rounds.size() - 1);
  }
  std::ranges::nth_element(trial_ms, trial_ms.begin() + static_cast<ptrdiff_t>(trial_ms.size() / 2));
  const double bound = gain(r, r.bound), got = gain(r, last);
  return {r.plane.quality.psnr_db, r.plane.quality.ssim, r.best_distance, got, bound, 100 * got / bound,
          last.quality.ssim, worst, got, last.colour_bytes, trial_bytes, 100 * trial_bytes / last.colour_bytes,
          r.plane.colour_ms, last.colour_ms, trial_ms[trial_ms.size() / 2]};
}

void print_row(const std::string& name, const std::vector<double>& f) {
  std::printf("%-10s | %6.2f %6.4f %6.4g | %+6.2f %+6.2f %5.0f %5.3f | %+6.2f %+6.2f | %8.0f %8.0f %5.1f | %6.2f %6.2f "
              "%6.2f\n",
              name.c_str(), f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11], f[12], f[13],
              f[14]);
  std::fflush(stdout);
}

void save(const StillResult& r, const std::string& stem) {
  lf::save_image(r.plane.image, stem + "_plane.png");
  lf::save_image(r.rounds.back().image, stem + "_surface.png");
  lf::save_image(r.bound.image, stem + "_bound.png");
  lf::Image map(lf::PixelFamily::kRgb, r.map->columns, r.map->rows);
  for (size_t i = 0; i < r.map->levels.size(); i++)
    for (size_t c = 0; c < 3; c++) map.data()[3 * i + c] = r.map->levels[i];
  lf::save_image(map, stem + "_map.png");
}

void still(const Arguments& a, const Case& c) {
  print_heading();
  std::vector<double> mean, by_round(a.options.rounds + 1);
  nlohmann::ordered_json json;
  for (size_t view = 0; view < c.views.size(); view++) {
    const StillResult r = measure_still(c, view, a.options);
    const std::vector<double> f = figures(r);
    mean.resize(f.size());
    for (size_t i = 0; i < f.size(); i++) mean[i] += f[i] / static_cast<double>(c.views.size());
    for (size_t i = 0; i < by_round.size(); i++)
      by_round[i] += gain(r, r.rounds[i]) / static_cast<double>(c.views.size());
    print_row(c.views[view].name, f);
    if (!r.gains.empty()) {
      std::printf("gains:");
      for (const auto& [camera, g] : r.gains) std::printf(" %u %.3f", c.rig.cameras[camera].id, g);
      std::printf("\n");
    }
    json["views"].push_back({{"name", c.views[view].name},
                             {"plane_db", f[0]},
                             {"gain_db", f[3]},
                             {"bound_db", f[4]},
                             {"worst_db", f[7]},
                             {"colour_bytes", f[9]},
                             {"trial_bytes", f[10]},
                             {"plane_ms", f[12]},
                             {"surface_ms", f[13]},
                             {"trial_ms", f[14]}});
    if (!a.out.empty()) save(r, a.out + "/" + c.views[view].name);
  }
  mean[5] = 100 * mean[3] / mean[4];
  print_row("mean", mean);
  std::printf("gain by round:");
  for (const double db : by_round) std::printf(" %+.2f", db);
  std::printf("\n");
  json["mean"] = {{"gain_db", mean[3]}, {"bound_db", mean[4]}, {"by_round_db", by_round}};
  if (!a.json.empty()) lf::write_text_file(json.dump(1) + "\n", a.json);
}

void film(const Arguments& a, const Case& c) {
  Progress progress("filming", c.views.size());
  const std::vector<Frame> frames = measure_film(c, a.options, [&] { progress.step(); });
  progress.finish();
  double plane = 0, surface = 0, settled = 0;
  const size_t first = std::min<size_t>(12, frames.size() / 2);
  lf::bench::Series plane_series{"best plane of the film", true, {}}, surface_series{"focal surface", false, {}};
  for (size_t i = 0; i < frames.size(); i++) {
    plane += frames[i].plane_db / static_cast<double>(frames.size());
    surface += frames[i].surface_db / static_cast<double>(frames.size());
    if (i >= first)
      settled += (frames[i].surface_db - frames[i].plane_db) / static_cast<double>(frames.size() - first);
    plane_series.points.push_back({static_cast<double>(i) / a.moving, frames[i].plane_db, ""});
    surface_series.points.push_back({static_cast<double>(i) / a.moving, frames[i].surface_db, ""});
  }
  std::printf("%zu pictures at %g/s, eye %g pitch a picture: plane %.2f dB, surface %.2f dB, gain %+.2f dB (from picture "
              "%zu on %+.2f)\n",
              frames.size(), a.moving, a.eye_step, plane, surface, surface - plane, first, settled);
  if (a.out.empty()) return;
  lf::bench::Panel panel{.title = "PSNR against truth", .x_label = "seconds", .y_label = "dB", .log_x = false};
  panel.series = {plane_series, surface_series};
  lf::bench::draw({"The built-in scene as it moves", "", {panel}}, a.out,
                  "film-" + std::to_string(static_cast<int>(a.moving)));
}

void run(Arguments a) {
  a.options.resampling = a.resampling == "bilinear"    ? lf::Resampling::kBilinear
                         : a.resampling == "sharpened" ? lf::Resampling::kSharpened
                                                       : lf::Resampling::kCatmullRom;
  a.options.focus.mode = a.mode == "auto" ? lf::FocusMode::kAuto : lf::FocusMode::kSurface;
  a.options.range = {1 / a.options.focus.far, 1 / a.options.focus.near};
  if (a.automatic) a.options.focus.near = a.options.focus.far = 0;
  if (!a.out.empty()) std::filesystem::create_directories(a.out);
  if (a.acceptance) {
    a.accepting.folder = a.out;
    if (a.coded_trials) return measure_coded_trials(a.accepting);
    const std::vector<AcceptanceRow> rows = measure_acceptance(a.accepting);
    if (!a.json.empty()) write_json(rows, a.json);
    return;
  }
  const Case c = load(a);
  if (a.moving > 0)
    film(a, c);
  else
    still(a, c);
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  a.options.focus.near = lf::kSceneNear * 0.95;
  a.options.focus.far = lf::kSceneFar * 1.1;
  CLI::App app("Measures what a focal surface brings over the best single plane. Without --rig on the built-in scene.",
               "lf-focus");
  app.add_option("--rig", a.rig, "Rig file whose cameras name stills");
  app.add_option("--views", a.views, "Views (views.json); without, cameras of odd rows and columns are left out and made")
      ->needs(app.add_option("--truth", a.truth, "Folder with NAME.png of each view"));
  app.add_option("--held-out", a.held_out, "How many cameras to make")->check(CLI::PositiveNumber);
  app.add_option("--near", a.options.focus.near, "Nearest distance, metres from the array")->check(CLI::PositiveNumber);
  app.add_option("--far", a.options.focus.far, "Farthest distance")->check(CLI::PositiveNumber);
  app.add_flag("--automatic", a.automatic, "The surface finds the range of depths; --near and --far are for planes");
  app.add_option("--rounds", a.options.rounds, "Pictures from the viewer's plane on")->check(CLI::PositiveNumber);
  app.add_option("--mode", a.mode, "surface or auto")->check(CLI::IsMember({"surface", "auto"}));
  app.add_option("--resampling", a.resampling, "How images are sampled: bilinear, sharpened or catmull-rom")
      ->check(CLI::IsMember({"bilinear", "sharpened", "catmull-rom"}));
  app.add_flag("--by-camera", a.options.by_camera, "Fragments and trials of each camera, 8 bits, in place of sums");
  app.add_option("--trial-quality", a.options.trial_quality, "Of cameras' trials as JPEG (0: deflated)")
      ->check(CLI::Range(0, 100));
  app.add_flag("--gains", a.options.gains, "Cameras match their brightness to their mean");
  app.add_option("--noise", a.faults.noise, "Standard deviation of noise, of 255");
  app.add_option("--gain-error", a.faults.gain_error, "Relative error of the brightness of every fourth camera");
  app.add_option("--pointing-error", a.faults.pointing_error, "Of the camera in the middle, degrees");
  app.add_option("--moving", a.moving, "Pictures per second of the built-in scene as it moves");
  app.add_option("--eye-step", a.eye_step, "Of a moving scene: how far the eye moves a picture, in pitches");
  app.add_option("--seconds", a.seconds, "Of a moving scene")->check(CLI::PositiveNumber);
  CLI::Option* acceptance = app.add_flag("--acceptance", a.acceptance,
                                         "Scene after scene what surfaces promise: table, plots (--out), JSON");
  app.add_flag("--coded-trials", a.coded_trials,
               "With --acceptance: instead, what coding the trials of single cameras as JPEG loses")
      ->needs(acceptance);
  app.add_option("--only", a.accepting.only, "With --acceptance: these scenes")->needs(acceptance);
  app.add_option("--data", a.accepting.data, "With --acceptance: folder with toys and chess, measured as well")
      ->needs(acceptance);
  app.add_option("--most-views", a.accepting.views, "With --acceptance: of each scene")
      ->needs(acceptance)
      ->check(CLI::PositiveNumber);
  app.add_option("--out", a.out, "Folder for pictures, maps and plots");
  app.add_option("--json", a.json, "Write figures to this file as well");
  return run_tool(app, argc, argv, [&] { run(a); });
}
