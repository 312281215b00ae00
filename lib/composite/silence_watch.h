// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace lf {

// Notices that a view's compositor has nothing to show: that nobody asks for the view, or that no node answers. Each is
// said once, and once more where nodes that had answered fall silent again. Times are of any one clock, microseconds,
// and not 0. Who sees requests come and who makes pictures may be two threads; answered() is for any thread.
class SilenceWatch {
 public:
  static constexpr int64_t kPatience = 5'000'000;

  // Forgets everything. Call before any of the other functions runs.
  void clear() {
    others_since_ = silent_since_ = composed_at_ = 0;
    asked_ = answered_ = told_ = ever_answered_ = false;
  }
  // A request of the view has come.
  void asked() { asked_ = true; }
  // A request of another view has come. True where for kPatience there have been none of this one: most often a wrong
  // view id.
  bool others_asked(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (asked_ || now < others_since_ + kPatience) return false;
    asked_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // A request of the view has been composed in real time. True where for so long now no answer has come to any of
  // those that followed each other.
  bool composed(int64_t now) {
    // Views followed each other without a pause.
    const bool goes_on = now < std::exchange(composed_at_, now) + kPatience;
    if (answered_.exchange(false)) {
      ever_answered_ = true;
      told_ = false;
      silent_since_ = now;
    }
    if (told_) return false;
    if (!goes_on || silent_since_ == 0) silent_since_ = now;
    return told_ = now >= silent_since_ + kPatience;
  }
  // Whether composed() has said so since the last answer.
  bool is_silent() const { return told_; }
  // Whether an answer had ever come by then.
  bool ever_answered() const { return ever_answered_; }

 private:
  int64_t others_since_ = 0;
  bool asked_ = false;
  std::atomic<bool> answered_ = false;
  int64_t silent_since_ = 0, composed_at_ = 0;
  bool told_ = false, ever_answered_ = false;
};

}  // namespace lf
