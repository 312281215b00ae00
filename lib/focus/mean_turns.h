// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

namespace lf {

// Which requests of a view ask for the mean that cameras compare their brightness with, of those that have trials: the
// first kFirst of them, so that cameras match before the first surface is found, then fewer and fewer, because whole
// images of a dozen cameras are looked at for it. One asks at a time, because cameras keep what they saw for the latest
// one alone, and because what is measured of gains that are being corrected would correct them once more. A plain value
// without locks.
class MeanTurns {
 public:
  static constexpr unsigned kFirst = 4;      // as many as planes are swept in: see trials_of_round()
  static constexpr unsigned kLongest = 32;   // requests with trials from one that asks to the next
  static constexpr unsigned kPatience = 30;  // until what was asked for is thought to be lost

  // Whether the next request asks. `has_trials`: it; `came`: the mean that was asked for is there.
  bool next(bool has_trials, bool came) {
    if (came) awaited_ = 0;
    if (!has_trials) return false;
    if (pause_ > 0) pause_--;
    if (awaited_ > 0) awaited_--;
    if (pause_ > 0 || awaited_ > 0) return false;
    if (asked_ < kFirst) asked_++;
    interval_ = asked_ < kFirst ? 1 : std::min(2 * interval_, kLongest);
    pause_ = interval_;
    awaited_ = kPatience;
    return true;
  }

 private:
  unsigned asked_ = 0, interval_ = 1, pause_ = 0, awaited_ = 0;
};

}  // namespace lf
