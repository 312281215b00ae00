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

// The requests of several views that one thread answers, so that none of them has to wait for what another asks for:
// each view has one request in flight, and the view goes first that will have had the least of the thread with its next
// answer, even in the middle of another's, which is left between two of its parallel tasks for one that will still have
// had less by its end, and taken up again then. A view that has asked for little keeps a claim to a quarter of a
// second, and to no more.
// Views that are new, of the latest two seconds (RequestGate::kViewQuiet), are together as one view among the others,
// which begins as much behind them, and share its part in the same way: whoever makes up numbers gets no more of the
// thread by it than with one. After as long a silence a view is forgotten.
// add() from any thread, work() from the one that answers.
class FairAnswers {
 public:
  // Requests of a view that wait at most: two turns of lfviewrequest with what goes along; of a set twice as many more
  // as it has other views. Then the newest ones stay.
  static constexpr size_t kMostWaiting = 8;
  static constexpr int kDeepest = 8;        // answers that are left for others at once
  static constexpr double kClaim = 0.25e9;  // nanoseconds of work that a view may have had less than others

  // `parallel`: does the tasks of an answer in `threads` threads. `now`: what work is measured by, nanoseconds.
  explicit FairAnswers(ParallelFor parallel = serial_for, size_t threads = 1, std::function<uint64_t()> now = now_ns)
      : parallel_(std::move(parallel)), threads_(threads), now_(std::move(now)) {}

  // A function that answers one request, with its parallel tasks done by the ParallelFor given.
  using Answer = std::function<void(const ParallelFor&)>;
  // `work`: nanoseconds that it will take, as far as anybody knows; 0: nobody does, and it is not begun in the middle
  // of another. False while stopped. The oldest of the view is dropped where too many wait: true in *dropped (may be
  // null). `of_set`: views of the set that the request is one of.
  bool add(uint32_t view, uint64_t work, Answer answer, bool* dropped = nullptr, size_t of_set = 1);
  // Answers the next request, and those that go before it meanwhile; waits for one. False once stopped. What an answer
  // throws comes out; the others are as before.
  bool work();
  // Returns when nothing waits and nothing is in flight, or it is stopped.
  void drain();
  // Nobody waits any more, and what waited is dropped.
  void stop();
  void start();
  void clear();  // drops what waits
  size_t waiting() const;
  size_t views() const;  // that are not forgotten

 private:
  struct Waiting {
    double work;
    Answer answer;
  };
  struct View {
    std::deque<Waiting> waiting;
    bool in_flight = false;
    bool is_new = true;
    double used = 0;                // of the thread, as a virtual time, while it is new since it began: nanoseconds
    uint64_t began = 0, asked = 0;  // when it asked first and last, now_()
    uint64_t since = 0;             // order in which views came to wait
    bool waits() const { return !waiting.empty() && !in_flight; }
    double end() const { return used + waiting.front().work; }  // used with the next answer
  };
  using Views = std::map<uint32_t, View>;
  // All these with the lock held.
  double used_among_all(const View& view) const { return view.is_new ? used_by_new_ : view.used; }
  double ahead(const View& view, uint32_t running) const;
  bool goes_before(const View& view, uint32_t running) const;
  void look_ahead();
  void go_on_with(uint32_t view);
  template <typename May>
  Views::iterator first_of(const May& may);  // of those that wait, if they may
  Views::iterator first_waiting();
  void charge_running();
  void begin_to_wait(View& view);
  void answer(Views::iterator first, std::unique_lock<std::mutex>& lock);
  bool is_urgent() const;                                                                // without the lock
  void run_tasks(uint32_t view, size_t count, const std::function<void(size_t)>& task);  // without the lock
  void let_others_go_first(uint32_t view);                                               // without the lock

  const ParallelFor parallel_;
  const size_t threads_;
  const std::function<uint64_t()> now_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  Views views_;
  double virtual_time_ = 0;  // what the view that was chosen last had used
  double used_by_new_ = 0;   // by all views that are new, as one of them
  uint64_t order_ = 0;
  bool stopped_ = false;
  static constexpr uint64_t kNever = UINT64_MAX;
  int depth_ = 0;                             // answers in flight
  std::atomic<uint64_t> urgent_at_ = kNever;  // by now_(), when another view is to go before the one that runs
  uint32_t running_ = 0;                      // while depth_ > 0
  uint64_t since_ = 0;                        // when the running view was last charged, by now_()
};

// As many views of the set that the request is one of as may wait together, for add(): what they keep is then no more
// than what the largest requests of a view that is alone do.
size_t views_that_wait_together(const ViewRequest& request);

}  // namespace lf
