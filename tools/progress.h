// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include <unistd.h>

// Shows a progress bar on standard error. If that is not a terminal, prints a line with the remaining time every ten
// seconds instead. Not thread-safe.
class Progress {
 public:
  Progress(std::string what, size_t total) : label_(std::move(what)), total_(total), visible_(isatty(STDERR_FILENO)) {}
  Progress(const Progress&) = delete;
  ~Progress() { finish(); }

  void step() {
    done_++;
    if (total_ > 0) reach(static_cast<double>(done_) / static_cast<double>(total_));
  }
  // Moves the bar to the completed fraction `share` (0 to 1). The bar never moves back. `step_name` names the current
  // step.
  void reach(double share, const std::string& step_name = "") {
    const int percent = std::max(shown_, static_cast<int>(100 * std::clamp(share, 0.0, 1.0)));
    if (!visible_) {
      const auto now = std::chrono::steady_clock::now();
      if (now - last_line_ < std::chrono::seconds(10)) return;
      last_line_ = now;
      const double passed = std::chrono::duration<double>(now - begun_).count();
      std::fprintf(stderr, "%s: %d %%", label_.c_str(), percent);
      if (share > 0) std::fprintf(stderr, ", about %.0f s left", passed * std::max(1 - share, 0.0) / share);
      std::fprintf(stderr, "\n");
      return;
    }
    if (percent == shown_ && step_name == step_) return;
    shown_ = percent;
    step_ = step_name;
    const int filled = percent * kWidth / 100;
    std::fprintf(stderr, "\r%s [%s%s] %3d %%%s%s\033[K", label_.c_str(), std::string(filled, '#').c_str(),
                 std::string(kWidth - filled, '.').c_str(), percent, step_name.empty() ? "" : "  ", step_name.c_str());
    std::fflush(stderr);
  }
  void finish() {
    if (visible_ && shown_ >= 0) std::fprintf(stderr, "\r\033[K");
    shown_ = -1;
  }

 private:
  static constexpr int kWidth = 40;
  std::string label_, step_;
  size_t total_, done_ = 0;
  int shown_ = -1;
  bool visible_;
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point last_line_ = begun_;
};

// Shows a progress bar for a job that reports no progress, but has a known duration. The bar moves with the time until
// the object is destroyed. If standard error is not a terminal, prints a single line.
class TimedProgress {
 public:
  TimedProgress(const std::string& what, double seconds) {
    if (!isatty(STDERR_FILENO)) {
      std::fprintf(stderr, "%s\n", what.c_str());
      return;
    }
    thread_ = std::jthread([what, seconds](const std::stop_token& stop) {
      Progress bar(what, 0);
      const auto begun = std::chrono::steady_clock::now();
      std::mutex mutex;
      std::condition_variable_any stopped;
      std::unique_lock lock(mutex);
      while (!stop.stop_requested()) {
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun;
        bar.reach(passed.count() / seconds);
        stopped.wait_for(lock, stop, std::chrono::milliseconds(100), [] { return false; });
      }
    });
  }

 private:
  std::jthread thread_;
};
