// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/still_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string_view>

#include "base/percentiles.h"

namespace lf::focus {
namespace {

struct Column {
  const char *group, *name;  // of the heading; a group is named by its first column
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
    {"", "trials", 7, 0, false, "trial_bytes",
     "of the trials that come with a picture, deflated; mean of the pictures"},
    {"", "%", 5, 1, false, "trial_percent", "trials, of colour"},
    {"ms", "plane", 7, 2, false, "plane_ms",
     "to draw a picture through that plane, sampled as the surface is: one thread"},
    {"", "surface", 7, 2, false, "surface_ms", "to draw it through the surface"},
    {"", "trials", 7, 2, false, "trial_ms", "to try depths for it and to choose; median of the pictures"},
};

constexpr size_t place_of(std::string_view json) {
  size_t i = 0;
  while (json != kColumns[i].json) i++;
  return i;
}
constexpr size_t kGain = place_of("gain_db"), kBound = place_of("bound_db"), kPercent = place_of("gain_percent");

// In the order of the columns.
std::vector<double> figures_of(const Options& options, const StillResult& r) {
  const Picture& last = r.rounds.back();
  const double plane = r.plane.quality.psnr_db, gain = last.quality.psnr_db - plane,
               bound = r.bound.quality.psnr_db - plane;
  double worst = std::numeric_limits<double>::infinity();
  Mean trial_bytes;
  std::vector<double> trial_ms;
  for (size_t i = 0; i < r.rounds.size(); i++) {
    worst = std::fmin(worst, r.rounds[i].quality.psnr_db - r.rounds[0].quality.psnr_db);
    trial_ms.push_back(r.rounds[i].trial_ms);
    if (i > 0) trial_bytes.add(r.rounds[i].trial_bytes);
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
          trial_bytes.value(),
          100 * trial_bytes.value() / last.colour_bytes,
          r.plane_alike.colour_ms,
          last.colour_ms,
          median(trial_ms)};
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
      "trials improve.\n",
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

}  // namespace lf::focus
