// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace lf {

// Geometry is in double precision, whereas weights and pixels are floats (see render/).
using Vec2 = glm::dvec2;
using Vec3 = glm::dvec3;
using Mat3 = glm::dmat3;  // column-major: m[column][row]
using Quat = glm::dquat;  // constructor order w, x, y, z

// Maximum deviation of a quaternion's norm from 1, in files and on the wire.
inline constexpr double kUnitTolerance = 1e-6;

inline bool is_finite(double v) { return std::isfinite(v); }
inline bool is_finite(const Vec3& v) { return is_finite(v.x) && is_finite(v.y) && is_finite(v.z); }
inline bool is_finite(const Quat& q) { return is_finite(q.w) && is_finite(q.x) && is_finite(q.y) && is_finite(q.z); }

// The pixels [x0, x1) x [y0, y1) of a view.
struct Rect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool empty() const { return x1 <= x0 || y1 <= y0; }
  bool operator==(const Rect&) const = default;
};

inline Rect intersect(const Rect& a, const Rect& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

inline Rect unite(const Rect& a, const Rect& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

// Returns the median, or the upper middle value if the number of values is even. `values` must not be empty or contain
// NaN.
template <typename T>
T median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Computes percentiles over the latest samples of a quantity. Not thread-safe.
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
  // Returns the nearest-rank percentile for p in (0, 100], or 0 without samples.
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
