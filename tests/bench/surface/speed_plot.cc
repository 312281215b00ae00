// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/speed_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "base/percentiles.h"
#include "bench/chart.h"

namespace lf::focus {

void SpeedPlot::add(Resampling resampling, const StillResult& result) {
  const auto at = static_cast<size_t>(std::ranges::find(kResamplings, resampling) - std::begin(kResamplings));
  const Picture& plane = result.plane_alike;
  const Picture& surface = result.rounds.back();
  std::vector<double> trials;
  for (const Picture& picture : result.rounds) trials.push_back(picture.trial_ms);
  const double ms[] = {plane.colour_ms, surface.colour_ms, surface.colour_ms + median(trials)};
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

}  // namespace lf::focus
