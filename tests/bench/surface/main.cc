// SPDX-License-Identifier: LGPL-2.1-or-later
// bench-surface: the gain of a focal surface, on still arrays with known truth and on the moving built-in scene.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "base/json_value.h"
#include "base/text.h"
#include "bench/chart.h"
#include "bench/surface/cases.h"
#include "bench/surface/measure.h"
#include "bench/surface/report.h"
#include "command_line.h"
#include "image/image.h"
#include "progress.h"

namespace {

using namespace lf::focus;

struct Arguments {
  std::string rig, views, truth, out, json, mode = "surface", resampling = "bilinear";
  int held_out = 4;
  bool automatic = false, acceptance = false;
  AcceptanceOptions accepting;
  double moving = 0, eye_step = 0.3, seconds = 2;
  Faults faults;
  Options options;
};

Case load(const Arguments& a) {
  Case c = a.moving > 0      ? moving_case(a.moving, static_cast<int>(a.moving * a.seconds), a.eye_step)
           : a.rig.empty()   ? scene_case()
           : a.views.empty() ? held_out_case(a.rig, a.held_out)
                             : truth_case(a.rig, a.views, a.truth);
  add_faults(a.faults, c);
  return c;
}

lf::Resampling resampling_of(const std::string& name) {
  const auto at = std::ranges::find(kResamplingNames, name) - std::begin(kResamplingNames);
  return kResamplings[at];
}

bool is_to_be_found(const lf::DepthRange& range) { return range.nearest == 0 || range.farthest == 0; }

std::string metres(double inverse) {
  char text[40];
  std::snprintf(text, sizeof text, inverse > 0 ? "%.4g" : "infinity", 1 / inverse);
  return text;
}

void require_range(const lf::DepthRange& range) {
  if (!(range.nearest > range.farthest))
    throw lf::Error("the nearest distance, " + metres(range.nearest) + ", is not nearer than the farthest, " +
                    metres(range.farthest));
}

Options completed(Options options, const std::optional<Depths>& found) {
  if (!found) return options;
  lf::DepthRange& range = options.range;
  if (range.nearest == 0) range.nearest = found->range.nearest;
  if (range.farthest == 0) range.farthest = found->range.farthest;
  require_range(range);
  if (found->best >= range.farthest && found->best <= range.nearest) options.one_more_plane = 1 / found->best;
  if (options.start == 0) options.start = 1 / std::clamp(found->middle, range.farthest, range.nearest);
  return options;
}

Depths find_depths(const Case& c, const std::vector<size_t>& views) {
  Depths all{.range = {std::numeric_limits<double>::infinity(), 0}};
  for (const size_t view : views) {
    const std::optional<Depths> found = lf::focus::find_depths(c, view);
    if (!found) continue;
    all.range.farthest = std::min(all.range.farthest, found->range.farthest);
    all.range.nearest = std::max(all.range.nearest, found->range.nearest);
    all.middle = found->middle;
    all.best = found->best;
  }
  return all;
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
  std::printf("%s\n", c.name.c_str());
  StillTable table(c, a.options);
  SpeedPlot speed;
  for (size_t view = 0; view < c.views.size(); view++) {
    const std::string& name = c.views[view].name;
    const std::optional<Depths> found = is_to_be_found(a.options.range) ? find_depths(c, view) : std::nullopt;
    if (!found && is_to_be_found(a.options.range)) {
      table.add_unseen(name);
      continue;
    }
    const Options options = completed(a.options, found);
    const StillResult r = measure_still(c, view, options);
    table.add(name, options, r);
    if (!r.gains.empty()) {
      std::printf("gains:");
      for (const auto& [camera, g] : r.gains) std::printf(" %u %.3f", c.rig.cameras[camera].id, std::exp(g.log));
      std::printf("\n");
    }
    if (a.out.empty()) continue;
    save(r, a.out + "/" + name);
    // Repeats the measurement with each other resampling method.
    Options other = options;
    other.planes = 0;
    other.one_more_plane = r.best_distance;
    other.start = r.start;
    for (const lf::Resampling resampling : kResamplings) {
      other.resampling = resampling;
      speed.add(resampling, resampling == options.resampling ? r : measure_still(c, view, other));
    }
  }
  table.finish();
  if (!a.json.empty()) lf::write_text_file(table.json().dump(1) + "\n", a.json);
  if (a.out.empty()) return;
  speed.print();
  try {
    speed.draw(c.name, a.out);
  } catch (const lf::Error& e) {  // pictures and maps are already written
    std::fprintf(stderr, "note: %s: apt-get install gnuplot-nox\n", e.what());
  }
}

void film(const Arguments& a, const Case& c) {
  if (c.views.empty()) throw lf::Error("--moving, --seconds: there is no picture in that time");
  Options options = a.options;
  if (is_to_be_found(options.range))
    options = completed(options, find_depths(c, {0, c.views.size() / 2, c.views.size() - 1}));
  Progress progress("filming", c.views.size());
  const std::vector<Frame> frames = measure_film(c, options, [&] { progress.step(); });
  progress.finish();
  double plane = 0, surface = 0, settled = 0;
  const size_t first = std::min<size_t>(12, frames.size() / 2);
  lf::bench::Series plane_series{"best plane of the film", true, {}}, surface_series{"focal surface", false, {}};
  for (size_t i = 0; i < frames.size(); i++) {
    plane += frames[i].plane_db / static_cast<double>(frames.size());
    surface += frames[i].surface_db / static_cast<double>(frames.size());
    if (i >= first) settled += (frames[i].surface_db - frames[i].plane_db) / static_cast<double>(frames.size() - first);
    plane_series.points.push_back({static_cast<double>(i) / a.moving, frames[i].plane_db, ""});
    surface_series.points.push_back({static_cast<double>(i) / a.moving, frames[i].surface_db, ""});
  }
  std::printf(
      "%zu pictures at %g/s, eye %g pitch a picture: plane %.2f dB, surface %.2f dB, gain %+.2f dB (from picture "
      "%zu on %+.2f)\n",
      frames.size(), a.moving, a.eye_step, plane, surface, surface - plane, first, settled);
  if (a.out.empty()) return;
  lf::bench::Panel panel{.title = "PSNR against truth", .x_label = "seconds", .y_label = "dB", .log_x = false};
  panel.series = {plane_series, surface_series};
  lf::bench::draw({"The built-in scene as it moves", "", {panel}}, a.out,
                  "film-" + std::to_string(static_cast<int>(a.moving)));
}

void run(Arguments a) {
  a.options.resampling = resampling_of(a.resampling);
  a.options.focus.mode = a.mode == "auto" ? lf::FocusMode::kAuto : lf::FocusMode::kSurface;
  const auto inverse = [](double distance) { return distance > 0 ? 1 / distance : 0; };
  a.options.range = {inverse(a.options.focus.far), inverse(a.options.focus.near)};
  if (!is_to_be_found(a.options.range)) require_range(a.options.range);
  if (a.automatic) a.options.focus.near = a.options.focus.far = 0;
  if (!a.out.empty()) std::filesystem::create_directories(a.out);
  if (a.acceptance) {
    a.accepting.folder = a.out;
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
  cli::App app(
      "Measures how much a focal surface improves pictures over the best single plane. Uses the built-in scene without "
      "--rig.",
      "bench-surface");
  app.add_option("--rig", a.rig, "Rig file with still images");
  app.add_option(
         "--views", a.views,
         "Views to render (views.json). Without this option, some cameras are held out and predicted from the others")
      ->needs(app.add_option("--truth", a.truth, "Folder with NAME.png of each view"));
  app.add_option("--held-out", a.held_out, "Number of cameras to hold out")->check(cli::PositiveNumber);
  app.add_option("--near", a.options.focus.near,
                 "Nearest distance, in metres from the array (default: for planes estimated from the ground truth, for "
                 "the surface by its own search)")
      ->check(cli::PositiveNumber);
  app.add_option("--far", a.options.focus.far, "Farthest distance, in metres (default: as for --near)")
      ->check(cli::PositiveNumber);
  app.add_option("--start", a.options.start,
                 "Distance of the viewer's plane, in metres (default: the middle of the scene)")
      ->check(cli::PositiveNumber);
  app.add_flag("--automatic", a.automatic,
               "Use --near and --far for planes only, so that the surface finds its own range");
  app.add_option("--rounds", a.options.rounds, "Number of pictures, starting with the viewer's plane")
      ->check(cli::PositiveNumber);
  app.add_option("--mode", a.mode, "Mode of the depth estimation")->check(cli::IsMember({"surface", "auto"}));
  app.add_option("--resampling", a.resampling, "Resampling of the camera images")
      ->check(cli::IsMember({"bilinear", "sharpened"}));
  app.add_flag("--gains", a.options.gains, "Compensate for cameras with different brightness");
  app.add_option("--noise", a.faults.noise, "Standard deviation of the noise to add, in levels of 255");
  app.add_option("--gain-error", a.faults.gain_error, "Relative error of the brightness of every fourth camera");
  app.add_option("--pointing-error", a.faults.pointing_error, "Pointing error of the camera in the middle, in degrees");
  app.add_option("--moving", a.moving, "Frame rate for the moving built-in scene, per second");
  app.add_option("--eye-step", a.eye_step, "Moving scene: movement of the viewpoint per picture, in pitches");
  app.add_option("--seconds", a.seconds, "Moving scene: duration")->check(cli::PositiveNumber);
  cli::Option* acceptance =
      app.add_flag("--acceptance", a.acceptance,
                   "Measure all difficult scenes: prints a table, writes plots (--out) and JSON (--json)");
  app.add_option("--only", a.accepting.only, "Scenes to measure with --acceptance (default: all)")->needs(acceptance);
  app.add_option("--data", a.accepting.data,
                 "Folder with the scenes toys and chess, which --acceptance then also measures")
      ->needs(acceptance);
  app.add_option("--most-views", a.accepting.views, "Maximum number of views of each scene for --acceptance")
      ->needs(acceptance)
      ->check(cli::PositiveNumber);
  app.add_option("--out", a.out,
                 "Folder for pictures, depth maps and a plot of speed against error (requires gnuplot)");
  app.add_option("--json", a.json, "JSON file that also receives the results");
  return cli::run_tool(app, argc, argv, [&] { run(a); });
}
