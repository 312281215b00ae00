// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <unistd.h>

#include <cstdio>
#include <string>

// A progress bar on standard error, drawn only where somebody is there to see it.
class Progress {
 public:
  Progress(std::string what, size_t total) : what_(std::move(what)), total_(total), visible_(isatty(STDERR_FILENO)) {}
  Progress(const Progress&) = delete;
  ~Progress() { finish(); }

  void step() {
    done_++;
    if (!visible_ || total_ == 0) return;
    const int percent = static_cast<int>(100 * done_ / total_);
    if (percent == shown_) return;
    shown_ = percent;
    const int filled = percent * kWidth / 100;
    std::fprintf(stderr, "\r%s [%s%s] %3d %%", what_.c_str(), std::string(filled, '#').c_str(),
                 std::string(kWidth - filled, '.').c_str(), percent);
    std::fflush(stderr);
  }
  // Clears the line.
  void finish() {
    if (visible_ && shown_ >= 0) std::fprintf(stderr, "\r\033[K");
    shown_ = -1;
  }

 private:
  static constexpr int kWidth = 40;
  std::string what_;
  size_t total_, done_ = 0;
  int shown_ = -1;
  bool visible_;
};
