// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "bench/surface/mean.h"
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

}  // namespace lf::focus
