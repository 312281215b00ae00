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

// Calls task(0) .. task(count - 1), each once, in any order and from any threads, and returns when all are done. An
// exception of one of them is thrown again in the caller, after the others.
using ParallelFor = std::function<void(size_t count, const std::function<void(size_t)>& task)>;

inline void serial_for(size_t count, const std::function<void(size_t)>& task) {
  for (size_t i = 0; i < count; i++) task(i);
}

// The threads that the nodes of a process share: as many nodes as there are don't take more processors than there are.
// Thread-safe.
class WorkerPool {
 public:
  // The pool of this process, made by the first who asks; it goes when nobody holds it any more.
  static std::shared_ptr<WorkerPool> shared();

  WorkerPool() = default;
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // A ParallelFor of at most `threads`, of which the calling one is one: it never waits for a
  // thread of the pool to come free, only for those that have taken up some of its tasks.
  void run(unsigned threads, size_t count, const std::function<void(size_t)>& task);

 private:
  class Batch;
  void help();

  std::mutex mutex_;
  std::condition_variable come_;                // signalled when a batch waits, or the pool ends
  std::deque<std::shared_ptr<Batch>> waiting_;  // each batch as often as threads are to help with it
  std::vector<std::thread> threads_;
  bool ended_ = false;
};

}  // namespace lf
