// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <sstream>
#include <string>

namespace lf::serve {

// A Prometheus histogram of durations. Thread-safe.
class Histogram {
 public:
  static constexpr std::array kBounds = {0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0};  // seconds

  void add(double seconds) {
    size_t bucket = 0;
    while (bucket < kBounds.size() && seconds > kBounds[bucket]) bucket++;
    counts_[bucket]++;
    nanoseconds_ += static_cast<uint64_t>(seconds > 0 ? seconds * 1e9 : 0);
  }
  // Returns the lines of the metric `name` for /metrics.
  std::string text(const std::string& name, const std::string& help) const {
    std::ostringstream out;
    out << "# HELP " << name << ' ' << help << "\n# TYPE " << name << " histogram\n";
    uint64_t sum = 0;
    for (size_t i = 0; i < kBounds.size(); i++)
      out << name << "_bucket{le=\"" << kBounds[i] << "\"} " << (sum += counts_[i]) << '\n';
    sum += counts_.back();
    out << name << "_bucket{le=\"+Inf\"} " << sum << '\n'
        << name << "_sum " << static_cast<double>(nanoseconds_) * 1e-9 << '\n'
        << name << "_count " << sum << '\n';
    return out.str();
  }

 private:
  std::array<std::atomic<uint64_t>, kBounds.size() + 1> counts_ = {};
  std::atomic<uint64_t> nanoseconds_ = 0;
};

}  // namespace lf::serve
