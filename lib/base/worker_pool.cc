// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/worker_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <system_error>

namespace lf {

// The tasks of one run(). A helper that arrives late finds no task left, and does not access `task`, which may no
// longer exist.
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

void WorkerPool::help() {
  std::unique_lock lock(mutex_);
  while (true) {
    work_available_.wait(lock, [this] { return ended_ || !waiting_.empty(); });
    if (ended_) return;
    const std::shared_ptr<Batch> batch = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    batch->work();
    lock.lock();
  }
}

std::shared_ptr<WorkerPool> WorkerPool::shared() {
  static std::mutex mutex;
  static std::weak_ptr<WorkerPool> current;
  std::lock_guard lock(mutex);
  std::shared_ptr<WorkerPool> pool = current.lock();
  if (!pool) current = pool = std::make_shared<WorkerPool>();
  return pool;
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  work_available_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::run(unsigned threads, size_t count, const std::function<void(size_t)>& task) {
  const size_t helpers = count > 0 ? std::min<size_t>(std::max(threads, 1u), count) - 1 : 0;
  if (helpers == 0) {
    for (size_t i = 0; i < count; i++) task(i);
    return;
  }
  const auto batch = std::make_shared<Batch>(count, task);
  {
    const std::lock_guard lock(mutex_);
    try {
      while (threads_.size() + 1 < threads) threads_.emplace_back([this] { help(); });
    } catch (const std::system_error&) {
      // If no thread can be created, the existing threads and the caller do the work.
    }
    waiting_.insert(waiting_.end(), helpers, batch);
  }
  for (size_t i = 0; i < helpers; i++) work_available_.notify_one();
  batch->work();
  {
    const std::lock_guard lock(mutex_);
    std::erase(waiting_, batch);
  }
  batch->wait();
}

ParallelFor parallel_for_all_processors() {
  return [pool = WorkerPool::shared()](size_t count, const std::function<void(size_t)>& task) {
    pool->run(std::max(std::thread::hardware_concurrency(), 1u), count, task);
  };
}

}  // namespace lf
