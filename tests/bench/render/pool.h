// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "base/worker_pool.h"

namespace lf::bench {

// Threads that wait for work, as a live system has them. The caller works too: a pool of one has no threads.
class Pool {
 public:
  explicit Pool(int threads);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  // As in ParallelFor. From one thread at a time.
  void run(size_t count, const std::function<void(size_t)>& task);
  ParallelFor parallel() {
    return [this](size_t count, const std::function<void(size_t)>& task) { run(count, task); };
  }

 private:
  void wait_for_work();
  void work();

  std::mutex mutex_;
  std::condition_variable start_, done_;
  uint64_t round_ = 0;  // of run()
  size_t working_ = 0;
  bool stop_ = false;
  std::exception_ptr error_;
  // Of this round.
  const std::function<void(size_t)>* task_ = nullptr;
  size_t count_ = 0;
  std::atomic<size_t> next_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace lf::bench
