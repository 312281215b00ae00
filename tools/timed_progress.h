// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>

#include "progress.h"

// The progress of what takes a time that is known beforehand, about, and tells nothing meanwhile: a bar that moves by
// the clock, for as long as this lives. Where standard error is no terminal, a line that says what is done.
class TimedProgress {
 public:
  TimedProgress(const std::string& what, double seconds) {
    if (!isatty(STDERR_FILENO)) {
      std::fprintf(stderr, "%s\n", what.c_str());
      return;
    }
    thread_ = std::thread([this, what, seconds] {
      Progress bar(what, 0);
      const auto begun = std::chrono::steady_clock::now();
      std::unique_lock lock(mutex_);
      while (!done_) {
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun;
        bar.reach(passed.count() / seconds);
        changed_.wait_for(lock, std::chrono::milliseconds(100));
      }
    });
  }
  ~TimedProgress() {
    if (!thread_.joinable()) return;
    {
      const std::lock_guard lock(mutex_);
      done_ = true;
    }
    changed_.notify_one();
    thread_.join();
  }
  TimedProgress(const TimedProgress&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_ = false;
  std::thread thread_;
};
