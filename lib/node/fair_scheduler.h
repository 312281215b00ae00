// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>

#include "base/schedule.h"
#include "base/worker_pool.h"
#include "view/view_request.h"

namespace lf {

// Chooses the order of the requests that a node's rendering thread answers, so that one expensive view does not delay
// all views. The algorithm is fair queueing, as in network routers.
//
// The scheduler counts the rendering time that each view has used. The next view is the view that will have used the
// least time after its next answer. A view with less usage may even interrupt the answer of another view, between two
// parallel tasks of this answer. Each view has at most one request in progress. A view that has been idle does not
// collect an unlimited advantage, but at most kMaxCredit.
//
// A client must not get more time by inventing new view ids. Therefore all views that are younger than
// RequestLimiter::kViewTimeout (2 s) count as one view together, which starts as if it had used kMaxCredit more time
// than other views. A view is forgotten after the same time without requests.
//
// Call work() from the rendering thread. add() may be called from any thread.
class FairScheduler {
 public:
  // Maximum number of waiting requests of a view; the newest are kept. In a set of views, each further view of the set
  // adds room for two more.
  static constexpr size_t kMaxQueued = 8;
  // A view is overloaded if each of its requests has waited longer than kLongWait, for the time kOverload. Only its
  // newest request is then kept, because answers to older requests would all be too late (compare CoDel, RFC 8289). The
  // overload ends after the same time without a dropped request.
  static constexpr uint64_t kLongWait = 50'000'000, kOverload = 250'000'000;  // nanoseconds
  static constexpr int kMaxDepth = 8;           // nested interruptions
  static constexpr double kMaxCredit = 0.25e9;  // largest usage deficit of a view, nanoseconds of work

  // Creates a scheduler without requests. `parallel` runs the tasks of an answer in `threads` threads. `now` returns
  // nanoseconds of a monotonic clock.
  explicit FairScheduler(ParallelFor parallel = serial_for, size_t threads = 1, std::function<uint64_t()> now = now_ns)
      : parallel_(std::move(parallel)), threads_(threads), now_(std::move(now)) {}

  using Answer = std::function<void(const ParallelFor&)>;
  // Adds a request. `work` is the estimated duration of the answer in nanoseconds, or 0 if unknown; the request then
  // never interrupts another. `of_set` is the number of views in the request's set. If too many requests of the view
  // are waiting, or the view is overloaded, old requests are dropped and *dropped (may be null) becomes true. Returns
  // false while stopped.
  bool add(uint32_t view, uint64_t work, Answer answer, bool* dropped = nullptr, size_t of_set = 1);
  // Waits for a request and answers this request. Requests of other views may interrupt the answer; they are answered
  // first. Returns false once the scheduler is stopped. Exceptions of an answer propagate and do not affect later
  // requests.
  bool work();
  // Waits until no request is waiting or in progress. Also returns after stop().
  void drain();
  // Wakes all waiting threads and drops all waiting requests.
  void stop();
  void start();
  void clear();
  size_t waiting() const;
  size_t views() const;

 private:
  struct Waiting {
    double work;
    Answer answer;
    uint64_t arrived;  // now_()
  };
  struct View {
    std::deque<Waiting> waiting;
    bool in_flight = false;
    bool is_new = true;
    // The rendering time that the view has used, in nanoseconds (its virtual time). For a new view, the time since its
    // first request.
    double used = 0;
    uint64_t began = 0, asked = 0;  // times of the first and the latest request, now_()
    uint64_t since = 0;
    uint64_t long_waits_since = 0;  // now_(); 0: the latest answer did not wait long
    uint64_t dropped_at = 0;        // time of the latest dropped request, now_()
    bool overloaded = false;
    bool waits() const { return !waiting.empty() && !in_flight; }
    double end() const { return used + waiting.front().work; }  // usage after the next answer
  };
  using Views = std::map<uint32_t, View>;
  // The caller must hold mutex_, unless noted otherwise.
  double virtual_usage(const View& view) const { return view.is_new ? new_views_usage_ : view.used; }
  double ahead(const View& view, uint32_t running) const;
  bool goes_before(const View& view, uint32_t running) const;
  void look_ahead();
  void resume(uint32_t view);
  template <typename May>
  Views::iterator first_of(const May& may);  // best waiting view with may(view)
  Views::iterator first_waiting();
  void charge_running();
  void enqueue(View& view);
  void note_wait(View& view, uint64_t arrived);
  void answer(Views::iterator first, std::unique_lock<std::mutex>& lock);
  bool is_urgent() const;                                                                // takes no lock
  void run_tasks(uint32_t view, size_t count, const std::function<void(size_t)>& task);  // caller does not hold mutex_
  void yield_to_others(uint32_t view);                                                   // caller does not hold mutex_

  const ParallelFor parallel_;
  const size_t threads_;
  const std::function<uint64_t()> now_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Views views_;
  double virtual_time_ = 0;     // usage of the most recently chosen view
  double new_views_usage_ = 0;  // usage of the group of new views
  uint64_t order_ = 0;
  bool stopped_ = false;
  static constexpr uint64_t kNever = UINT64_MAX;
  int depth_ = 0;
  std::atomic<uint64_t> urgent_at_ = kNever;  // time when a waiting view must interrupt, now_()
  uint32_t running_ = 0;                      // valid while depth_ > 0
  uint64_t since_ = 0;                        // time of the latest charge, now_()
};

// Returns the `of_set` argument of add() for a request.
size_t queued_views_of_set(const ViewRequest& request);

}  // namespace lf
