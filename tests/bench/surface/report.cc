// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <string_view>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "base/maths.h"
#include "base/text.h"
#include "bench/chart.h"
#include "bench/surface/cases.h"
#include "scene/scene.h"

namespace lf::focus {

void SpeedPlot::add(Resampling resampling, const StillResult& result) {
  const auto at = static_cast<size_t>(std::ranges::find(kResamplings, resampling) - std::begin(kResamplings));
  const Picture& plane = result.plane_alike;
  const Picture& surface = result.rounds.back();
  std::vector<double> hypotheses;
  for (const Picture& picture : result.rounds) hypotheses.push_back(picture.depth_ms);
  const double ms[] = {plane.colour_ms, surface.colour_ms, surface.colour_ms + median(hypotheses)};
  const double db[] = {plane.quality.psnr_db, surface.quality.psnr_db, surface.quality.psnr_db};
  for (size_t i = 0; i < std::size(ways_); i++) {
    ways_[i].cost[at].ms.add(ms[i]);
    ways_[i].cost[at].db.add(db[i]);
  }
}

void SpeedPlot::print() const {
  std::printf("\n%-32s", "ms a picture, dB");
  for (const char* name : kResamplingNames) std::printf(" | %14s", name);
  std::printf("\n");
  for (const Way& way : ways_) {
    std::printf("%-32s", way.name);
    for (const Cost& cost : way.cost) std::printf(" | %6.2f, %6.2f", cost.ms.value(), cost.db.value());
    std::printf("\n");
  }
}

void SpeedPlot::draw(const std::string& title, const std::string& folder) const {
  bench::Panel panel{
      .title = "PSNR against truth", .x_label = "ms a picture, one thread", .y_label = "dB", .log_x = false};
  for (const Way& way : ways_) {
    bench::Series series{way.name, way.name == ways_[2].name, {}};
    for (size_t i = 0; i < std::size(way.cost); i++)
      if (std::isfinite(way.cost[i].db.value()))
        series.points.push_back({way.cost[i].ms.value(), way.cost[i].db.value(), kResamplingNames[i]});
    if (!series.points.empty()) panel.series.push_back(series);
  }
  if (!panel.series.empty()) bench::draw({"Speed against error", title, {panel}}, folder, "speed");
}

namespace {

struct Column {
  const char *group, *name;  // group and column heading; a group is named in its first column
  int width, decimals;
  bool sign;
  const char* json;
  const char* meaning;
};
constexpr int kDistance = -1;  // four digits
constexpr Column kColumns[] = {
    {"scene", "near", 6, kDistance, false, "near",
     "nearest distance that planes are picked from, metres from the array"},
    {"", "far", 6, kDistance, false, "far", "farthest"},
    {"", "start", 6, kDistance, false, "start", "where the viewer's plane is, from which the surface begins"},
    {"plane", "dB", 6, 2, false, "plane_db", "PSNR of the best single plane (picked with the truth, bilinear)"},
    {"", "ssim", 6, 4, false, "plane_ssim", "its SSIM: 1 is the truth"},
    {"", "at", 6, kDistance, false, "plane_at", "its distance from the array"},
    {"", "seen", 4, 0, false, "plane_seen_percent",
     "% of the pixels that are seen by the cameras around them: only these count"},
    {"surface", "dB", 6, 2, false, "surface_db", "PSNR of the last picture through the focal surface"},
    {"", "ssim", 6, 4, false, "surface_ssim", "its SSIM"},
    {"", "seen", 4, 0, false, "surface_seen_percent", "% of the pixels, as above"},
    {"", "gain", 6, 2, true, "gain_db", "dB that the surface is better than the plane"},
    {"", "alike", 6, 2, true, "gain_alike_db", "the same, of the pixels that both see"},
    {"", "bound", 6, 2, true, "bound_db",
     "dB that each pixel's best plane (picked with the truth) is better than one for all"},
    {"", "%", 4, 0, false, "gain_percent", "gain, of the bound"},
    {"", "worst", 6, 2, true, "worst_db",
     "dB that the worst picture on the way differs from the first, on the viewer's plane"},
    {"bytes", "colour", 8, 0, false, "colour_bytes", "of a picture: what all cameras together send, as it is"},
    {"", "hypotheses", 7, 0, false, "consistency_bytes",
     "of the hypotheses that come with a picture, deflated; mean of the pictures"},
    {"", "%", 5, 1, false, "consistency_percent", "hypotheses, of colour"},
    {"ms", "plane", 7, 2, false, "plane_ms",
     "to draw a picture through that plane, sampled as the surface is: one thread"},
    {"", "surface", 7, 2, false, "surface_ms", "to draw it through the surface"},
    {"", "hypotheses", 7, 2, false, "depth_ms", "to try depths for it and to choose; median of the pictures"},
};

constexpr size_t place_of(std::string_view json) {
  size_t i = 0;
  while (json != kColumns[i].json) i++;
  return i;
}
constexpr size_t kGain = place_of("gain_db"), kBound = place_of("bound_db"), kPercent = place_of("gain_percent");

std::vector<double> figures_of(const Options& options, const StillResult& r) {
  const Picture& last = r.rounds.back();
  const double plane = r.plane.quality.psnr_db, gain = last.quality.psnr_db - plane,
               bound = r.bound.quality.psnr_db - plane;
  double worst = std::numeric_limits<double>::infinity();
  Mean consistency_bytes;
  std::vector<double> depth_ms;
  for (size_t i = 0; i < r.rounds.size(); i++) {
    worst = std::fmin(worst, r.rounds[i].quality.psnr_db - r.rounds[0].quality.psnr_db);
    depth_ms.push_back(r.rounds[i].depth_ms);
    if (i > 0) consistency_bytes.add(r.rounds[i].consistency_bytes);
  }
  return {1 / options.range.nearest,
          1 / options.range.farthest,
          r.start,
          plane,
          r.plane.quality.ssim,
          r.best_distance,
          100 * r.plane.quality.coverage,
          last.quality.psnr_db,
          last.quality.ssim,
          100 * last.quality.coverage,
          gain,
          r.gain_alike_db,
          bound,
          100 * gain / bound,
          worst,
          last.colour_bytes,
          consistency_bytes.value(),
          100 * consistency_bytes.value() / last.colour_bytes,
          r.plane_alike.colour_ms,
          last.colour_ms,
          median(depth_ms)};
}

bool is_distance(const Column& column) { return column.decimals == kDistance; }

std::string text_of(const Column& column, double figure) {
  char text[40];
  if (!std::isfinite(figure))
    std::snprintf(text, sizeof text, "%*s", column.width, "-");
  else if (is_distance(column))
    std::snprintf(text, sizeof text, "%*.*g", column.width, 4, figure);
  else
    std::snprintf(text, sizeof text, column.sign ? "%+*.*f" : "%*.*f", column.width, column.decimals, figure);
  return text;
}

nlohmann::ordered_json to_json(const std::vector<double>& figures) {
  nlohmann::ordered_json json;
  for (size_t i = 0; i < figures.size(); i++)
    json[kColumns[i].json] = std::isfinite(figures[i]) ? nlohmann::ordered_json(figures[i]) : nullptr;
  return json;
}

}  // namespace

StillTable::StillTable(const Case& c, const Options& options) : name_width_(4), means_(std::size(kColumns)) {
  for (const NamedView& view : c.views) name_width_ = std::max(name_width_, static_cast<int>(view.name.size()));
  std::printf(
      "Each view is drawn through planes, and then, from the viewer's plane on, %d times through a focal surface that "
      "hypotheses improve.\n",
      options.rounds);
  std::string groups(static_cast<size_t>(name_width_), ' '), names = "view";
  names.resize(groups.size(), ' ');
  const char* group = "";
  for (const Column& column : kColumns) {
    if (*column.group) {
      group = column.group;
      groups += " |";
      names += " |";
    }
    std::printf("  %-7s %-7s %s\n", group, column.name, column.meaning);
    char text[40];
    std::snprintf(text, sizeof text, " %*s", column.width, column.name);
    names += text;
    std::snprintf(text, sizeof text, " %-*s", column.width, column.group);
    groups += text;
  }
  std::printf("  -               nothing to measure: no pixel is seen by the cameras around it\n%s\n%s\n",
              groups.c_str(), names.c_str());
  std::fflush(stdout);
}

void StillTable::add(const std::string& view, const Options& options, const StillResult& result) {
  gain_by_round_.resize(result.rounds.size());
  for (size_t i = 0; i < result.rounds.size(); i++)
    gain_by_round_[i].add(result.rounds[i].quality.psnr_db - result.plane.quality.psnr_db);
  add(view, figures_of(options, result));
}

void StillTable::add_unseen(const std::string& view) {
  add(view, std::vector<double>(std::size(kColumns), std::numeric_limits<double>::quiet_NaN()));
}

void StillTable::add(const std::string& view, const std::vector<double>& figures) {
  for (size_t i = 0; i < figures.size(); i++) means_[i].add(figures[i]);
  nlohmann::ordered_json json = {{"name", view}};
  json.update(to_json(figures));
  views_.push_back(json);
  print(view, figures);
}

void StillTable::finish() {
  for (const Mean& mean : means_) mean_figures_.push_back(mean.value());
  mean_figures_[kPercent] = 100 * mean_figures_[kGain] / mean_figures_[kBound];
  print("mean", mean_figures_);
  std::printf("gain by picture:");
  for (const Mean& gain : gain_by_round_)
    std::isfinite(gain.value()) ? std::printf(" %+.2f", gain.value()) : std::printf(" -");
  std::printf("\n");
  std::fflush(stdout);
}

nlohmann::ordered_json StillTable::json() const {
  nlohmann::ordered_json json, by_round = nlohmann::ordered_json::array();
  for (const Mean& gain : gain_by_round_)
    by_round.push_back(std::isfinite(gain.value()) ? nlohmann::ordered_json(gain.value()) : nullptr);
  json["views"] = views_;
  json["mean"] = to_json(mean_figures_);
  json["mean"]["by_round_db"] = by_round;
  return json;
}

void StillTable::print(const std::string& view, const std::vector<double>& figures) const {
  std::string line = view;
  line.resize(std::max(line.size(), static_cast<size_t>(name_width_)), ' ');
  for (size_t i = 0; i < figures.size(); i++) {
    if (*kColumns[i].group) line += " |";
    line += " " + text_of(kColumns[i], figures[i]);
  }
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

namespace {

struct Trouble {
  const char* name;
  Faults faults;
  bool matched = true;  // exposure gains enabled
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
  double least_gain_db;  // goal
  double least_way;      // fraction of the bound's gain
  bool matched = true;   // exposure gains
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
    for (auto* series : {&row.gain_by_round_db, &row.consistency_bytes_by_round, &row.depth_ms_by_round})
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
      row.consistency_bytes_by_round[i] += part * bytes;
      row.depth_ms_by_round[i] += part * ms;
      row.worst_on_way_db =
          std::min(row.worst_on_way_db, r.rounds[i].quality.psnr_db - r.rounds.front().quality.psnr_db);
      bytes += r.rounds[i].consistency_bytes;
      ms += r.rounds[i].depth_ms;
    }
    row.plane_bytes += part * r.plane.colour_bytes;
    row.surface_bytes += part * (last.colour_bytes + last.consistency_bytes);
    row.plane_ms += part * r.plane.colour_ms;
    row.surface_ms += part * (last.colour_ms + last.depth_ms);
    if (view > 0) continue;
    row.still = measure_rest(c, view, options);
    const RestResult rest = measure_rest(c, view, automatic);
    row.rest_percent = 100 * rest.consistency_bytes / rest.colour_bytes;
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
                     .x_label = "hypotheses so far, % of the bytes of a picture",
                     .y_label = "gain, dB",
                     .log_x = false};
  bench::Panel time{.title = "against time", .x_label = "time for depths so far, ms", .y_label = "", .log_x = false};
  for (const AcceptanceRow& row : rows) {
    if (row.name.find(',') != std::string::npos) continue;  // without faults
    bench::Series by_bytes{row.name, false, {}}, by_time{row.name, false, {}};
    for (size_t i = 0; i < row.gain_by_round_db.size(); i++) {
      by_bytes.points.push_back(
          {100 * row.consistency_bytes_by_round[i] / row.plane_bytes, row.gain_by_round_db[i], ""});
      by_time.points.push_back({row.depth_ms_by_round[i], row.gain_by_round_db[i], ""});
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
                            {"consistency_bytes_by_round", r.consistency_bytes_by_round},
                            {"depth_ms_by_round", r.depth_ms_by_round},
                            {"missed", r.missed}});
  write_text_file(json.dump(1) + "\n", path);
}

}  // namespace lf::focus
