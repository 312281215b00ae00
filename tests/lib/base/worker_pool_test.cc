// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Also run under ThreadSanitizer (tests/sanitize.sh thread).
#include "base/worker_pool.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(WorkerPool, EveryTaskRunsOnce) {
  WorkerPool pool;
  for (const unsigned threads : {1u, 2u, 5u})
    for (const size_t count : {0u, 1u, 2u, 100u}) {
      std::vector<std::atomic<int>> done(count);
      pool.run(threads, count, [&](size_t i) { done[i]++; });
      for (const std::atomic<int>& n : done) EXPECT_EQ(n, 1);
    }
}

TEST(WorkerPool, UsesSeveralThreads) {
  WorkerPool pool;
  std::mutex mutex;
  std::set<std::thread::id> threads;
  pool.run(3, 30, [&](size_t) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::lock_guard lock(mutex);
    threads.insert(std::this_thread::get_id());
  });
  EXPECT_GE(threads.size(), 2u);
  EXPECT_LE(threads.size(), 3u);
  EXPECT_TRUE(threads.contains(std::this_thread::get_id()));
}

TEST(WorkerPool, IsSharedByManyCallers) {
  const auto pool = WorkerPool::shared();
  EXPECT_EQ(pool, WorkerPool::shared());
  std::atomic<int> done = 0;
  std::vector<std::thread> callers;
  for (int c = 0; c < 4; c++)
    callers.emplace_back([&] {
      for (int round = 0; round < 200; round++) pool->run(2, 8, [&](size_t) { done++; });
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(done, 4 * 200 * 8);
}

TEST(WorkerPool, ExceptionsReachTheCaller) {
  WorkerPool pool;
  std::atomic<int> done = 0;
  EXPECT_THROW(pool.run(2, 10,
                        [&](size_t i) {
                          done++;
                          if (i == 3) throw std::runtime_error("three");
                        }),
               std::runtime_error);
  EXPECT_EQ(done, 10);
}

}  // namespace
}  // namespace lf
