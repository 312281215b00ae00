// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lf {

// The median: the upper one of the two in the middle where the number of values is even. `values` must not be empty,
// nor hold NaN.
template <typename T>
T median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Percentiles over the latest samples of a quantity. Not thread-safe.
class Percentiles {
 public:
  Percentiles(size_t window = 1024) : window_(window) {}

  void add(uint64_t value) {
    if (values_.size() < window_)
      values_.push_back(value);
    else
      values_[next_] = value;
    next_ = (next_ + 1) % window_;
  }
  void clear() {
    values_.clear();
    next_ = 0;
  }
  // Nearest-rank percentile, p in (0, 100]; 0 without samples.
  uint64_t at(double p) const {
    if (values_.empty()) return 0;
    std::vector<uint64_t> sorted = values_;
    const size_t n = sorted.size();
    const size_t rank = static_cast<size_t>(p / 100 * static_cast<double>(n) + 0.999999);
    const auto nth = sorted.begin() + static_cast<ptrdiff_t>(std::clamp<size_t>(rank, 1, n) - 1);
    std::nth_element(sorted.begin(), nth, sorted.end());
    return *nth;
  }

 private:
  size_t window_, next_ = 0;
  std::vector<uint64_t> values_;
};

}  // namespace lf
