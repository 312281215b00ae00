// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

namespace lf {

// Whether a camera serves, what became of it, and when to try again. Times are nanoseconds of a clock that never
// jumps. Thread-safe.
class CameraService {
 public:
  // kEnded: its source has an end, and came to it. kLost: it failed.
  enum class State { kStopped, kOpening, kRunning, kEnded, kLost };
  static constexpr uint64_t kShortestWait = 500'000'000, kLongestWait = 10'000'000'000;

  struct Report {
    State state = State::kStopped;
    std::string reason;    // why the camera was lost the latest time; "" if it never was
    uint64_t losses = 0;   // times it was lost
    uint64_t retries = 0;  // times it was opened again
    bool worked = false;   // has given a frame since the start
  };

  void start();  // is being opened, with nothing behind it
  void stop();
  // False if it was lost already, by another reason; the latest one counts.
  bool lose(const std::string& reason, uint64_t now);
  // How long to wait, after a loss or another attempt in vain: a quarter of the time that it has been out, so that a
  // camera comes back at most that much later than it could, within kShortestWait and kLongestWait. One that comes
  // back for no longer than it was waited for has been out all the time.
  uint64_t wait(uint64_t now);
  void retry();  // is being opened again; lost until it gives a frame
  // A first frame. True if the camera was lost.
  bool find(uint64_t now);
  void end();

  State state() const;
  Report report() const;

 private:
  mutable std::mutex mutex_;
  Report report_;
  uint64_t out_since_ = 0, found_ = 0, waited_ = 0;
};

const char* to_string(CameraService::State state);

}  // namespace lf
