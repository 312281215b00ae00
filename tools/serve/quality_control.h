// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

namespace lf::serve {

// Follows what the network takes: the bit rate falls at once where packets are lost or queue up, and comes back slowly.
// Where it is too little for every pixel first every other picture is left out, then pictures are of half the size.
// Plain arithmetic without clock or locks; update() once a second.
class QualityControl {
 public:
  static constexpr double kMuchLoss = 0.05, kLittleLoss = 0.02;  // parts of a second's packets that were lost
  static constexpr double kQueueing = 0.1;                       // seconds of round trip beyond the least seen
  static constexpr double kFall = 0.75, kRise = 1.08;
  // Below, H.264 shows blocks where anything moves. To come back takes a little more, or steps would follow steps.
  static constexpr double kLeastBitsPerPixel = 0.05, kBack = 1.25;
  // Browsers take H.264's key frame although the packets before it, which tell the new size, are lost, decode it as of
  // the old size, and notice nothing. So the key frame of a new size is followed by one a second, for this long, where
  // packets are lost.
  static constexpr int kRepeats = 5;

  // `pixels_per_second`: of the video at its best.
  QualityControl(int least, int most, double pixels_per_second)
      : least_(least), most_(most), pixels_(pixels_per_second), now_(most) {
    choose_step();
  }

  int bits_per_second() const { return static_cast<int>(now_); }
  int pictures_left_out() const { return step_ > 0 ? 1 : 0; }  // pictures left out after each that is shown
  int size_divisor() const { return step_ > 1 ? 2 : 1; }
  bool wants_key_frame() const { return wants_key_frame_; }

  // What the receiver reported; `round_trip` in seconds, 0: unknown. Returns whether anything has changed.
  bool update(double loss, double round_trip) {
    if (round_trip > 0) best_ = best_ > 0 ? std::min(best_, round_trip) : round_trip;
    const double before = now_;
    const int size_before = size_divisor();
    const double queueing = round_trip > 0 ? round_trip - best_ : 0;
    if (loss > kMuchLoss || queueing > kQueueing)
      now_ = std::max<double>(least_, now_ * kFall);
    else if (loss < kLittleLoss && queueing < kQueueing / 2)
      now_ = std::min<double>(most_, now_ * kRise);
    choose_step();
    wants_key_frame_ = repeats_ > 0 && loss > 0;
    repeats_ = size_divisor() != size_before ? kRepeats : std::max(repeats_ - 1, 0);
    return now_ != before;
  }

 private:
  static constexpr double kShare[] = {1, 1.0 / 2, 1.0 / 8};  // part of the pixels at each step
  static constexpr int kLastStep = 2;

  double needed(int step) const { return kLeastBitsPerPixel * pixels_ * kShare[step]; }
  void choose_step() {
    while (step_ < kLastStep && now_ < needed(step_)) step_++;
    while (step_ > 0 && (now_ >= most_ || now_ >= kBack * needed(step_ - 1)) && now_ >= needed(step_ - 1)) step_--;
  }

  double least_, most_, pixels_, now_, best_ = 0;
  int step_ = 0;
  int repeats_ = 0;  // repetitions of the key frame still to come
  bool wants_key_frame_ = false;
};

}  // namespace lf::serve
