// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace lf {

// Calls task(0) .. task(count - 1) once each, in any order and on any threads, and returns after the last task.
// Rethrows an exception of a task in the caller, after all tasks have run.
using ParallelFor = std::function<void(size_t count, const std::function<void(size_t)>& task)>;

inline void serial_for(size_t count, const std::function<void(size_t)>& task) {
  for (size_t i = 0; i < count; i++) task(i);
}

// Threads shared by all nodes of a process, so that many nodes use no more processors than available. Thread-safe.
class WorkerPool {
 public:
  // Returns the pool of this process. The first call creates the pool, and releasing the last reference destroys the
  // pool.
  static std::shared_ptr<WorkerPool> shared();

  WorkerPool() = default;
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // A ParallelFor with at most `threads` threads, including the calling thread. Does not wait for an idle thread of the
  // pool, only for threads that have already taken some of these tasks.
  void run(unsigned threads, size_t count, const std::function<void(size_t)>& task);

 private:
  class Batch;
  void help();

  std::mutex mutex_;
  std::condition_variable work_available_;      // signalled when a batch waits, or the pool ends
  std::deque<std::shared_ptr<Batch>> waiting_;  // each batch once per missing helper
  std::vector<std::thread> threads_;
  bool ended_ = false;
};

}  // namespace lf
