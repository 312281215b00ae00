// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench/surface/measure.h"

namespace lf::focus {

inline constexpr Resampling kResamplings[] = {Resampling::kBilinear, Resampling::kSharpened};
inline constexpr const char* kResamplingNames[] = {"bilinear", "sharpened"};  // in the order of the enum

// Speed against error: time per picture and error against the truth, for the best plane and the surface, with each
// resampling. Means over the views.
class SpeedPlot {
 public:
  void add(Resampling resampling, const StillResult& result);
  void print() const;
  // Writes speed.png to the folder, with gnuplot.
  void draw(const std::string& title, const std::string& folder) const;

 private:
  struct Cost {
    Mean ms, db;
  };
  struct Way {
    const char* name;
    Cost cost[std::size(kResamplings)];
  };
  Way ways_[3] = {{"best plane", {}}, {"focal surface", {}}, {"focal surface, with its hypotheses", {}}};
};

// Figures of still views: a table on standard output, one row per view as it completes, and JSON. Values that could not
// be measured are "-" in the table, null in JSON, and not part of the means.
class StillTable {
 public:
  // Prints explanations and headings of the columns.
  StillTable(const Case& c, const Options& options);
  // `options`: options of the measurement.
  void add(const std::string& view, const Options& options, const StillResult& result);
  // Adds a view that the cameras do not see.
  void add_unseen(const std::string& view);
  void finish();
  nlohmann::ordered_json json() const;

 private:
  void add(const std::string& view, const std::vector<double>& figures);
  void print(const std::string& view, const std::vector<double>& figures) const;

  int name_width_;
  std::vector<Mean> means_, gain_by_round_;
  std::vector<double> mean_figures_;
  nlohmann::ordered_json views_ = nlohmann::ordered_json::array();
};

// Goals of focal surfaces and results, scene by scene: means over each scene's views.
struct AcceptanceRow {
  std::string name;
  Quality plane, surface;                     // the best plane, and the settled surface
  double gain_db = 0;                         // gain of the surface over that plane
  double bound_db = 0;                        // gain with each pixel's best plane
  double worst_view_db = 0;                   // least gain of a view
  double worst_on_way_db = 0;                 // least gain of all pictures, starting with the viewer's plane
  double plane_bytes = 0, surface_bytes = 0;  // sums of a view; with hypotheses
  double plane_ms = 0, surface_ms = 0;        // one thread; with hypotheses
  double rest_percent = 0;                    // bytes of hypotheses at rest with focus=auto, relative to colour
  double rest_gain_db = 0;                    // over the best plane, at rest
  RestResult still;                           // while hypotheses continue
  std::vector<double> gain_by_round_db, consistency_bytes_by_round,
      depth_ms_by_round;                                                          // bytes and times are cumulative
  std::vector<std::string> missed;                                                // goals not met
};

struct AcceptanceOptions {
  int views = 4;
  std::vector<std::string> only;  // row names to measure; empty: all rows
  std::string data;               // folder with `toys` and `chess`; empty: skips these rows
  std::string folder;             // for plots; empty: no plots
};

// Measures, prints and draws row by row, then lists the goals that were not met.
std::vector<AcceptanceRow> measure_acceptance(const AcceptanceOptions& options);
void write_json(const std::vector<AcceptanceRow>& rows, const std::string& path);

}  // namespace lf::focus
