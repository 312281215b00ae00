// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/acceptance.h"

#include <algorithm>
#include <cstdio>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "bench/chart.h"
#include "bench/surface/worlds.h"
#include "scene/scene.h"

namespace lf::focus {
namespace {

struct Trouble {
  const char* name;
  Faults faults;
  bool matched = true;  // gains=on
};
constexpr Trouble kTroubles[] = {{"", {}},
                                 {", noise of 5", {.noise = 5}},
                                 {", gains off by 10 %", {.gain_error = 0.1}},
                                 {", gains off by 10 %, not matched", {.gain_error = 0.1}, false},
                                 {", a camera 0.5 degrees off", {.pointing_error = 0.5}}};

struct Subject {
  std::string name;
  double near, far;  // metres
  std::function<Case()> make;
  double least_gain_db;  // promised
  double least_way;      // of the way to the bound
  bool matched = true;   // cameras match their brightness
};

std::vector<Subject> subjects(const AcceptanceOptions& options) {
  constexpr double kNear = 0.95 * kSceneNear, kFar = 1.1 * kSceneFar, kNothing = -0.5;
  std::vector<Subject> all;
  for (const std::string& world : world_names()) {
    const double far = world == "mirror" ? 7 : kFar;
    all.push_back({world, kNear, far, [world, &options] { return world_case(world, options.views); }, kNothing, 0});
  }
  const auto with_troubles = [&](const std::string& name, double near, double far, const std::function<Case()>& make,
                                 double least_gain_db, double least_way) {
    for (const Trouble& trouble : kTroubles) {
      const bool clean = std::string(trouble.name).empty();
      const auto spoilt = [make, trouble] {
        Case c = make();
        add_faults(trouble.faults, c);
        return c;
      };
      all.push_back({name + trouble.name, near, far, spoilt, clean ? least_gain_db : kNothing, clean ? least_way : 0,
                     trouble.matched});
    }
  };
  const auto some_views = [views = options.views](Case c) {
    c.views.resize(std::min<size_t>(c.views.size(), views));
    return c;
  };
  with_troubles(
      "built-in scene", kNear, kFar, [=] { return some_views(scene_case()); }, 5, 0.75);
  if (!options.data.empty()) {
    const std::string chess = options.data + "/chess", toys = options.data + "/toys/rig.json";
    with_troubles(
        "chess", 45, 200,
        [=] { return some_views(truth_case(chess + "/rig.json", chess + "/views.json", chess + "/truth")); }, 4.2,
        0.75);
    with_troubles(
        "toys", 0.42, 1.2, [=, views = options.views] { return held_out_case(toys, views); }, 4.3, 0);
  }
  if (!options.only.empty())
    std::erase_if(all, [&](const Subject& s) { return std::ranges::find(options.only, s.name) == options.only.end(); });
  if (all.empty()) throw Error("none of the scenes is known");
  return all;
}

void check(const Subject& subject, AcceptanceRow& row) {
  char text[100];
  const auto at_least = [&](double value, double least, const char* what) {
    if (value >= least) return;
    std::snprintf(text, sizeof text, "%s: %.2f, not %.2f", what, value, least);
    row.missed.push_back(text);
  };
  at_least(row.gain_db, subject.least_gain_db, "gain, dB");
  at_least(row.gain_db / row.bound_db, subject.least_way, "way to the bound");
  at_least(row.worst_view_db, subject.least_gain_db > 0 ? -0.1 : -0.5, "worst view, dB");
  at_least(row.worst_on_way_db, -0.3, "worst on the way, dB");
  at_least(-row.still.clear_median, -1, "flicker, of 255");
  if (subject.name == "flat") at_least(-row.rest_percent, -2, "bytes at rest, %");
}

Options options_for(const Subject& subject) {
  Options options;
  options.focus = {.mode = FocusMode::kSurface, .near = subject.near, .far = subject.far};
  options.range = {1 / subject.far, 1 / subject.near};
  options.resampling = Resampling::kSharpened;
  options.gains = subject.matched;
  return options;
}

AcceptanceRow measure(const Subject& subject) {
  AcceptanceRow row;
  row.name = subject.name;
  const Case c = subject.make();
  const Options options = options_for(subject);
  Options automatic = options;
  automatic.focus.mode = FocusMode::kAuto;
  row.worst_view_db = row.worst_on_way_db = 1e9;
  const double part = 1 / static_cast<double>(c.views.size());
  for (const size_t size : {static_cast<size_t>(options.rounds + 1)})
    for (auto* series : {&row.gain_by_round_db, &row.trial_bytes_by_round, &row.trial_ms_by_round})
      series->resize(size);
  for (size_t view = 0; view < c.views.size(); view++) {
    const StillResult r = measure_still(c, view, automatic);
    const Picture& last = r.rounds.back();
    const auto add = [part](Quality& to, const Quality& q) {
      to.psnr_db += part * q.psnr_db;
      to.ssim += part * q.ssim;
    };
    add(row.plane, r.plane.quality);
    add(row.surface, last.quality);
    const double gain = last.quality.psnr_db - r.plane.quality.psnr_db;
    row.gain_db += part * gain;
    row.bound_db += part * (r.bound.quality.psnr_db - r.plane.quality.psnr_db);
    row.worst_view_db = std::min(row.worst_view_db, gain);
    double bytes = 0, ms = 0;
    for (size_t i = 0; i < r.rounds.size(); i++) {
      row.gain_by_round_db[i] += part * (r.rounds[i].quality.psnr_db - r.plane.quality.psnr_db);
      row.trial_bytes_by_round[i] += part * bytes;
      row.trial_ms_by_round[i] += part * ms;
      row.worst_on_way_db =
          std::min(row.worst_on_way_db, r.rounds[i].quality.psnr_db - r.rounds.front().quality.psnr_db);
      bytes += r.rounds[i].trial_bytes;
      ms += r.rounds[i].trial_ms;
    }
    row.plane_bytes += part * r.plane.colour_bytes;
    row.surface_bytes += part * (last.colour_bytes + last.trial_bytes);
    row.plane_ms += part * r.plane.colour_ms;
    row.surface_ms += part * (last.colour_ms + last.trial_ms);
    if (view > 0) continue;
    row.still = measure_rest(c, view, options);
    const RestResult rest = measure_rest(c, view, automatic);
    row.rest_percent = 100 * rest.trial_bytes / rest.colour_bytes;
    row.rest_gain_db = rest.quality.psnr_db - r.plane.quality.psnr_db;
  }
  check(subject, row);
  return row;
}

void print(const AcceptanceRow& r) {
  std::printf(
      "%-40s | %6.2f %6.4f | %6.2f %6.4f %+6.2f %+6.2f %+6.2f %+6.2f | %7.0f %7.0f | %5.2f %5.2f | %5.2f %+6.2f | "
      "%4.2f %5.2f %4.2f %5.2f %3.0f\n",
      r.name.c_str(), r.plane.psnr_db, r.plane.ssim, r.surface.psnr_db, r.surface.ssim, r.gain_db, r.bound_db,
      r.worst_view_db, r.worst_on_way_db, r.plane_bytes, r.surface_bytes, r.plane_ms, r.surface_ms, r.rest_percent,
      r.rest_gain_db, r.still.clear_median, r.still.clear_p99, r.still.unclear_median, r.still.unclear_p99,
      100 * r.still.unclear);
  for (const std::string& missed : r.missed) std::printf("    MISSED %s\n", missed.c_str());
  std::fflush(stdout);
}

void draw_rows(const std::vector<AcceptanceRow>& rows, const std::string& folder) {
  bench::Panel bytes{.title = "against bytes",
                     .x_label = "trials so far, % of a picture's colour",
                     .y_label = "gain, dB",
                     .log_x = false};
  bench::Panel time{.title = "against time", .x_label = "ms of trials so far", .y_label = "", .log_x = false};
  for (const AcceptanceRow& row : rows) {
    if (row.name.find(',') != std::string::npos) continue;  // without troubles
    bench::Series by_bytes{row.name, false, {}}, by_time{row.name, false, {}};
    for (size_t i = 0; i < row.gain_by_round_db.size(); i++) {
      by_bytes.points.push_back({100 * row.trial_bytes_by_round[i] / row.plane_bytes, row.gain_by_round_db[i], ""});
      by_time.points.push_back({row.trial_ms_by_round[i], row.gain_by_round_db[i], ""});
    }
    bytes.series.push_back(by_bytes);
    time.series.push_back(by_time);
  }
  bench::draw({"Gain of a focal surface over the best plane, picture after picture", "", {bytes, time}}, folder,
              "acceptance");
}

}  // namespace

std::vector<AcceptanceRow> measure_acceptance(const AcceptanceOptions& options) {
  std::printf("%-40s | %6s %6s | %6s %6s %6s %6s %6s %6s | %7s %7s | %5s %5s | %5s %6s | %4s %5s %4s %5s %3s\n",
              "scene", "plane", "ssim", "surf.", "ssim", "gain", "bound", "worst", "on way", "plane B", "surf. B", "ms",
              "ms", "rest%", "gain", "flic", "99 %", "uncl", "99 %", "%");
  std::vector<AcceptanceRow> rows;
  for (const Subject& subject : subjects(options)) {
    rows.push_back(measure(subject));
    print(rows.back());
  }
  if (!options.folder.empty()) draw_rows(rows, options.folder);
  return rows;
}

void write_json(const std::vector<AcceptanceRow>& rows, const std::string& path) {
  nlohmann::ordered_json json;
  for (const AcceptanceRow& r : rows)
    json["rows"].push_back({{"name", r.name},
                            {"plane_db", r.plane.psnr_db},
                            {"plane_ssim", r.plane.ssim},
                            {"surface_db", r.surface.psnr_db},
                            {"surface_ssim", r.surface.ssim},
                            {"gain_db", r.gain_db},
                            {"bound_db", r.bound_db},
                            {"worst_view_db", r.worst_view_db},
                            {"worst_on_way_db", r.worst_on_way_db},
                            {"plane_bytes", r.plane_bytes},
                            {"surface_bytes", r.surface_bytes},
                            {"plane_ms", r.plane_ms},
                            {"surface_ms", r.surface_ms},
                            {"rest_percent", r.rest_percent},
                            {"rest_gain_db", r.rest_gain_db},
                            {"flicker_median", r.still.clear_median},
                            {"flicker_p99", r.still.clear_p99},
                            {"unclear_flicker_median", r.still.unclear_median},
                            {"unclear_flicker_p99", r.still.unclear_p99},
                            {"unclear_share", r.still.unclear},
                            {"gain_by_round_db", r.gain_by_round_db},
                            {"trial_bytes_by_round", r.trial_bytes_by_round},
                            {"trial_ms_by_round", r.trial_ms_by_round},
                            {"missed", r.missed}});
  write_text_file(json.dump(1) + "\n", path);
}

}  // namespace lf::focus
