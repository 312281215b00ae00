// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

namespace lf::serve {

// What is left away when the machine can't make all pictures, the same for all viewers: first trials of the focal
// surface, then every other picture, then pixels. A step is taken where requests are turned away while the processors
// have nothing left, and taken back, after a while, where they would have enough again; a step back that turns out to
// be wrong makes the next one wait twice as long. Plain arithmetic without clock or locks; update() once a second.
class Shedding {
 public:
  static constexpr double kKept = 0.9;      // part of viewers' requests that is made: less is too little
  static constexpr double kBusy = 0.85;     // part of the processors in use: with less something else is slow
  static constexpr double kRelaxed = 0.65;  // part of the processors in use: less leaves enough for a step back
  static constexpr int kPatience = 3;       // seconds that are too slow before a step is taken
  static constexpr int kRest = 10, kLongestRest = 160;  // seconds from a step to taking it back

  // Requests from one with trials to the next.
  unsigned trial_interval() const { return step_ == 0 ? 1 : step_ == 1 ? 3 : 8; }
  int pictures_left_out() const { return step_ > 2 ? 1 : 0; }  // pictures left out after each that is shown
  int size_divisor() const { return step_ > 3 ? 2 : 1; }
  int step() const { return step_; }

  // `busy`: of the processors, 0 to 1; `kept`: of the requests that viewers would make, those that were made. Returns
  // whether anything has changed.
  bool update(double busy, double kept) {
    since_++;
    slow_ = kept < kKept && busy > kBusy ? slow_ + 1 : 0;
    if (slow_ >= kPatience && step_ < kLastStep) {
      if (went_back_ && since_ < rest_) rest_ = std::min(2 * rest_, kLongestRest);
      return go(step_ + 1, false);
    }
    if (slow_ == 0 && kept >= kKept && busy < kRelaxed && step_ > 0 && since_ >= rest_) return go(step_ - 1, true);
    if (step_ == 0 && since_ > kLongestRest) rest_ = kRest;
    return false;
  }

 private:
  static constexpr int kLastStep = 4;

  bool go(int step, bool back) {
    step_ = step;
    went_back_ = back;
    since_ = slow_ = 0;
    return true;
  }

  int step_ = 0, slow_ = 0, since_ = 0, rest_ = kRest;
  bool went_back_ = false;
};

}  // namespace lf::serve
