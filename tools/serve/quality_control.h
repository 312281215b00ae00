// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

namespace lf::serve {

// Which bit rate the network takes: it falls at once where packets are lost or queue up, and comes back slowly. Plain
// arithmetic without clock or locks; update() once a second.
class QualityControl {
 public:
  static constexpr double kMuchLoss = 0.05, kLittleLoss = 0.02;  // of the packets of a second
  static constexpr double kQueueing = 0.1;                       // seconds of round trip beyond the least seen
  static constexpr double kFall = 0.75, kRise = 1.08;

  QualityControl(int least, int most) : least_(least), most_(most), now_(most) {}

  int bits_per_second() const { return static_cast<int>(now_); }
  // What the receiver reported; `round_trip` in seconds, 0: unknown. Returns whether the rate has changed.
  bool update(double loss, double round_trip) {
    if (round_trip > 0) best_ = best_ > 0 ? std::min(best_, round_trip) : round_trip;
    const double before = now_;
    const double queueing = round_trip > 0 ? round_trip - best_ : 0;
    if (loss > kMuchLoss || queueing > kQueueing)
      now_ = std::max<double>(least_, now_ * kFall);
    else if (loss < kLittleLoss && queueing < kQueueing / 2)
      now_ = std::min<double>(most_, now_ * kRise);
    return now_ != before;
  }

 private:
  double least_, most_, now_, best_ = 0;
};

}  // namespace lf::serve
