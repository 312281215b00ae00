// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench/surface/measure.h"

namespace lf::focus {

inline constexpr Resampling kResamplings[] = {Resampling::kBilinear, Resampling::kSharpened};
inline constexpr const char* kResamplingNames[] = {"bilinear", "sharpened"};  // in that order

// Speed against error: how long a picture takes, and how near the truth it comes, through the best plane and through
// the surface, sampled in each way. Means over the views.
class SpeedPlot {
 public:
  void add(Resampling resampling, const StillResult& result);
  void print() const;
  // speed.png in the folder, by gnuplot.
  void draw(const std::string& title, const std::string& folder) const;

 private:
  struct Cost {
    Mean ms, db;
  };
  struct Way {
    const char* name;
    Cost cost[std::size(kResamplings)];
  };
  Way ways_[3] = {{"best plane", {}}, {"focal surface", {}}, {"focal surface, with its trials", {}}};
};

// The figures of still views: a table on standard output, a row a view as it comes, and as JSON. What could not be
// measured is "-" there, null here, and not in the means.
class StillTable {
 public:
  // Prints what the columns mean, and their headings.
  StillTable(const Case& c, const Options& options);
  // `options`: with which it was measured.
  void add(const std::string& view, const Options& options, const StillResult& result);
  // A view of which the cameras see nothing.
  void add_unseen(const std::string& view);
  // Prints the means.
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

// What focal surfaces promise, scene by scene: means over the views of each.
struct AcceptanceRow {
  std::string name;
  Quality plane, surface;                     // the best plane, and the settled surface
  double gain_db = 0;                         // of the surface over that plane
  double bound_db = 0;                        // of each pixel's best plane
  double worst_view_db = 0;                   // least gain of a view
  double worst_on_way_db = 0;                 // of all pictures from the viewer's plane on, against that
  double plane_bytes = 0, surface_bytes = 0;  // sums of a view; with trials
  double plane_ms = 0, surface_ms = 0;        // one thread; with trials
  double rest_percent = 0;                    // bytes of trials at rest with focus=auto, of colour
  double rest_gain_db = 0;                    // over the best plane, then
  RestResult still;                           // with trials going on
  std::vector<double> gain_by_round_db, trial_bytes_by_round, trial_ms_by_round;  // the latter two in total so far
  std::vector<std::string> missed;                                                // promises
};

struct AcceptanceOptions {
  int views = 4;
  std::vector<std::string> only;  // rows, by name; empty: all
  std::string data;               // folder with `toys` and `chess`; empty: without
  std::string folder;             // for plots, if any
};

// Measures, prints a row at a time, draws, and says which promises were not kept.
std::vector<AcceptanceRow> measure_acceptance(const AcceptanceOptions& options);
void write_json(const std::vector<AcceptanceRow>& rows, const std::string& path);

}  // namespace lf::focus
