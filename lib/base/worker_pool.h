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

// Calls task(0) to task(count - 1) once each, usually in parallel, in any order and on any threads. Returns when all
// tasks have finished. If a task throws, the exception is rethrown in the caller after all tasks have run.
using ParallelFor = std::function<void(size_t count, const std::function<void(size_t)>& task)>;

inline void serial_for(size_t count, const std::function<void(size_t)>& task) {
  for (size_t i = 0; i < count; i++) task(i);
}

// A pool of threads that all nodes of a process share. Thread-safe.
class WorkerPool {
 public:
  // Returns the pool of this process. The first call creates the pool, and releasing the last reference destroys the
  // pool.
  static std::shared_ptr<WorkerPool> shared();

  WorkerPool() = default;
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Works like a ParallelFor with at most `threads` threads, including the calling thread. Waits only for threads that
  // have already taken some of these tasks, and never for an idle thread of the pool.
  void run(unsigned threads, size_t count, const std::function<void(size_t)>& task);

 private:
  class Batch;
  void help();

  std::mutex mutex_;
  std::condition_variable work_available_;      // signalled when a batch waits, or when the pool ends
  std::deque<std::shared_ptr<Batch>> waiting_;  // each batch occurs once per missing helper
  std::vector<std::thread> threads_;
  bool ended_ = false;
};

// Returns a ParallelFor that runs tasks on all processors, in the shared pool.
ParallelFor parallel_for_all_processors();

}  // namespace lf
