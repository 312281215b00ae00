// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/worker_pool.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>

namespace lf {
namespace {

// Of all pools' lists, and what makes a pool's memory known to its helpers: a lock of our own, because ThreadSanitizer
// does not know GLib's.
std::mutex handover;

}  // namespace

// The tasks of one run(). Helpers may come to it when all is done; they find nothing left then, and `task` is not
// touched any more.
class WorkerPool::Batch {
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

void WorkerPool::help(gpointer data) {
  auto* self = static_cast<WorkerPool*>(data);
  std::shared_ptr<Batch> batch;
  {
    std::lock_guard lock(handover);
    if (self->waiting_.empty()) return;  // all done
    batch = std::move(self->waiting_.front());
    self->waiting_.pop_front();
  }
  batch->work();
}

std::shared_ptr<WorkerPool> WorkerPool::shared() {
  static std::mutex mutex;
  static std::weak_ptr<WorkerPool> current;
  std::lock_guard lock(mutex);
  std::shared_ptr<WorkerPool> pool = current.lock();
  if (!pool) current = pool = std::make_shared<WorkerPool>();
  return pool;
}

WorkerPool::WorkerPool() : pool_(gst_shared_task_pool_new()) {
  std::lock_guard lock(handover);
  gst_task_pool_prepare(pool_, nullptr);
}

WorkerPool::~WorkerPool() {
  gst_task_pool_cleanup(pool_);  // waits for helpers that have not come yet
  gst_object_unref(pool_);
  std::lock_guard lock(handover);  // they are done with this memory
}

void WorkerPool::run(unsigned threads, size_t count, const std::function<void(size_t)>& task) {
  const size_t helpers = std::min<size_t>(threads, count) - (count > 0 ? 1 : 0);
  if (helpers == 0) {
    for (size_t i = 0; i < count; i++) task(i);
    return;
  }
  const auto batch = std::make_shared<Batch>(count, task);
  {
    std::lock_guard lock(handover);
    if (most_threads_ < threads) {
      most_threads_ = threads;
      gst_shared_task_pool_set_max_threads(GST_SHARED_TASK_POOL(pool_), threads);
    }
    waiting_.insert(waiting_.end(), helpers, batch);
  }
  for (size_t i = 0; i < helpers; i++) {
    const gpointer handle = gst_task_pool_push(pool_, help, this, nullptr);
    if (!handle) break;  // no thread to be had: the caller does it all
    gst_task_pool_dispose_handle(pool_, handle);
  }
  batch->work();
  {
    std::lock_guard lock(handover);
    std::erase(waiting_, batch);
  }
  batch->wait();
}

}  // namespace lf
