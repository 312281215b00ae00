// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

namespace lf::focus {

// Of the figures that there are: what could not be measured (NaN) and what has no number (the PSNR of equal pictures)
// does not count. NaN if there are none.
class Mean {
 public:
  void add(double figure) {
    if (!std::isfinite(figure)) return;
    sum_ += figure;
    figures_++;
  }
  double value() const {
    return figures_ > 0 ? sum_ / static_cast<double>(figures_) : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double sum_ = 0;
  size_t figures_ = 0;
};

}  // namespace lf::focus
