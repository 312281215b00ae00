// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "bench/render/budget.h"

namespace lf::bench {

class Collector {
 public:
  void add(double difference) {
    max_ = std::max(max_, std::abs(difference));
    squares_ += difference * difference;
    count_++;
  }
  Spread spread() const { return {max_, count_ ? std::sqrt(squares_ / static_cast<double>(count_)) : 0}; }

 private:
  double max_ = 0, squares_ = 0;
  size_t count_ = 0;
};

}  // namespace lf::bench
