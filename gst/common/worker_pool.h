// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <deque>
#include <functional>
#include <memory>

namespace lf {

// The threads that the lffragments of a process share: as many nodes as there are don't take more processors than
// there are. Thread-safe.
class WorkerPool {
 public:
  // The one that is in use, or a new one: it goes when nobody holds it any more.
  static std::shared_ptr<WorkerPool> shared();

  WorkerPool();
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // A ParallelFor (base/parallel.h) of at most `threads`, of which the calling one is one: it never waits for a
  // thread of the pool to come free, only for those that have taken up some of its tasks.
  void run(unsigned threads, size_t count, const std::function<void(size_t)>& task);

 private:
  class Batch;
  static void help(gpointer self);

  GstTaskPool* pool_;
  std::deque<std::shared_ptr<Batch>> waiting_;  // one for each helper that is to come
  unsigned most_threads_ = 0;                   // what the pool has been set to
};

}  // namespace lf
