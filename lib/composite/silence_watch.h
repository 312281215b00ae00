// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>

namespace lf {

// Notices that a view's compositor will never have anything to show: that nobody asks for the view, or that no node
// answers. Each is said once. Times are of any one clock, microseconds, and not 0. Who sees requests come and who makes
// pictures may be two threads; answered() is for any thread.
class SilenceWatch {
 public:
  static constexpr int64_t kPatience = 5'000'000;

  // Before the others run.
  void clear() {
    others_since_ = asked_since_ = 0;
    asked_ = answered_ = told_ = false;
  }
  // A request of the view has come.
  void asked() { asked_ = true; }
  // One of another view has. True where for so long now there have been no others: most often a wrong view id.
  bool others_asked(int64_t now) {
    if (others_since_ == 0) others_since_ = now;
    if (asked_ || now < others_since_ + kPatience) return false;
    asked_ = true;
    return true;
  }
  void answered() { answered_ = true; }
  // A request of the view has been composed in real time. True where for so long now no answer has come to any.
  bool composed(int64_t now) {
    if (answered_ || told_) return false;
    if (asked_since_ == 0) asked_since_ = now;
    return told_ = now >= asked_since_ + kPatience;
  }

 private:
  int64_t others_since_ = 0;
  bool asked_ = false;
  std::atomic<bool> answered_ = false;
  int64_t asked_since_ = 0;
  bool told_ = false;
};

}  // namespace lf
