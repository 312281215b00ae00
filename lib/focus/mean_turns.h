// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf {

// Which requests of a view ask for the mean that cameras compare their brightness with: every kInterval-th that has trials,
// but one at a time, because cameras keep what they saw for the latest one alone, and because what is measured of gains
// that are being corrected would correct them once more. A plain value without locks.
class MeanTurns {
 public:
  static constexpr unsigned kInterval = 3;   // requests with trials from one that asks to the next
  static constexpr unsigned kPatience = 30;  // until what was asked for is thought to be lost

  // Whether the next request asks. `has_trials`: it; `came`: the mean that was asked for is there.
  bool next(bool has_trials, bool came) {
    if (came) awaited_ = 0;
    if (!has_trials) return false;
    if (pause_ > 0) pause_--;
    if (awaited_ > 0) awaited_--;
    if (pause_ > 0 || awaited_ > 0) return false;
    pause_ = kInterval;
    awaited_ = kPatience;
    return true;
  }

 private:
  unsigned pause_ = 0, awaited_ = 0;
};

}  // namespace lf
