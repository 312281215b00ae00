// SPDX-License-Identifier: LGPL-2.1-or-later
#include "worker_pool.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>

namespace lf {
namespace {

// The tasks of one run(). Helpers may come to it when all is done; they find nothing left then, and `task` is not
// touched any more.
class Batch {
 public:
  Batch(size_t count, const std::function<void(size_t)>& task) : count_(count), task_(task) {}

  void work() {
    for (size_t i; (i = next_.fetch_add(1)) < count_;) {
      try {
        task_(i);
      } catch (...) {
        std::lock_guard lock(mutex_);
        if (!error_) error_ = std::current_exception();
      }
      if (done_.fetch_add(1) + 1 == count_) {
        std::lock_guard lock(mutex_);
        all_done_.notify_all();
      }
    }
  }

  void wait() {
    std::unique_lock lock(mutex_);
    all_done_.wait(lock, [this] { return done_ == count_; });
    if (error_) std::rethrow_exception(error_);
  }

 private:
  const size_t count_;
  const std::function<void(size_t)>& task_;
  std::atomic<size_t> next_ = 0, done_ = 0;
  std::mutex mutex_;
  std::condition_variable all_done_;
  std::exception_ptr error_;
};

void help(gpointer data) {
  auto* batch = static_cast<std::shared_ptr<Batch>*>(data);
  (*batch)->work();
  delete batch;
}

}  // namespace

std::shared_ptr<WorkerPool> WorkerPool::shared() {
  static std::mutex mutex;
  static std::weak_ptr<WorkerPool> current;
  std::lock_guard lock(mutex);
  std::shared_ptr<WorkerPool> pool = current.lock();
  if (!pool) current = pool = std::make_shared<WorkerPool>();
  return pool;
}

WorkerPool::WorkerPool() : pool_(gst_shared_task_pool_new()) { gst_task_pool_prepare(pool_, nullptr); }

// Waits for helpers that have not come to their empty batches yet.
WorkerPool::~WorkerPool() {
  gst_task_pool_cleanup(pool_);
  gst_object_unref(pool_);
}

void WorkerPool::run(unsigned threads, size_t count, const std::function<void(size_t)>& task) {
  const size_t helpers = std::min<size_t>(threads, count) - (count > 0 ? 1 : 0);
  if (helpers == 0) {
    for (size_t i = 0; i < count; i++) task(i);
    return;
  }
  {
    std::lock_guard lock(mutex_);
    if (most_threads_ < threads) {
      most_threads_ = threads;
      gst_shared_task_pool_set_max_threads(GST_SHARED_TASK_POOL(pool_), threads);
    }
  }
  const auto batch = std::make_shared<Batch>(count, task);
  for (size_t i = 0; i < helpers; i++) {
    auto* share = new std::shared_ptr<Batch>(batch);
    GError* error = nullptr;
    const gpointer handle = gst_task_pool_push(pool_, help, share, &error);
    if (handle) gst_task_pool_dispose_handle(pool_, handle);
    if (error) {  // no thread to be had: the caller does it all
      g_error_free(error);
      delete share;
      break;
    }
  }
  batch->work();
  batch->wait();
}

}  // namespace lf
