// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>

namespace lf::serve {

// Decides which of a viewer's requests are made, and knows which are being answered. Where the machine or the network
// is slower than the frame rate, requests that nobody has time for are not made: pictures come at the rate that there
// is, each whole and of the newest moment, in place of queues that end in gaps. Thread-safe. Times are those of
// requests, nanoseconds, rising.
class Pace {
 public:
  static constexpr uint64_t kPatience = 1000000000;  // nanoseconds until an answer is not waited for any more

  explicit Pace(size_t most) : most_(most) {}

  // Sets how far apart requests are at least, nanoseconds.
  void set_interval(uint64_t interval) {
    const std::lock_guard lock(mutex_);
    interval_ = interval;
  }
  // Whether the request of this time may be made now; if so it counts as made. What is said of the first request of a
  // time holds for those that follow it: they are for the other eye.
  bool begin(uint64_t time) {
    const std::lock_guard lock(mutex_);
    if (time == asked_) return time == latest_;
    asked_ = time;
    while (!under_way_.empty() && time - under_way_.front() > kPatience) under_way_.pop_front();
    if (latest_ && time < *latest_ + interval_) return false;
    wanted_++;
    if (under_way_.size() >= most_) return false;
    made_++;
    latest_ = time;
    under_way_.push_back(time);
    return true;
  }
  // The part that was made of the requests since the last call that were not too soon; 1 where there were none.
  double kept() {
    const std::lock_guard lock(mutex_);
    const double part = wanted_ > 0 ? static_cast<double>(made_) / static_cast<double>(wanted_) : 1;
    wanted_ = made_ = 0;
    return part;
  }
  // The request of this time has become a picture. What was asked for before never will.
  void end(uint64_t time) {
    const std::lock_guard lock(mutex_);
    while (!under_way_.empty() && under_way_.front() <= time) under_way_.pop_front();
  }

 private:
  const size_t most_;
  std::mutex mutex_;
  std::deque<uint64_t> under_way_;
  uint64_t interval_ = 0, wanted_ = 0, made_ = 0;
  std::optional<uint64_t> asked_, latest_;  // times of the latest request, and of the latest that was made
};

}  // namespace lf::serve
