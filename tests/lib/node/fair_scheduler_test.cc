// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/fair_scheduler.h"

#include "base/worker_pool.h"
#include "node/node.h"
#include "support/test.h"

namespace lf {
namespace {

// Simulates a node: time advances with work, and views send requests meanwhile.
class Simulation {
 public:
  static constexpr uint64_t kTile = 1'000'000;  // a task takes a millisecond

  struct Asked {
    uint64_t at;  // in tiles
    size_t tiles;
    uint32_t view;
    bool expected = true;  // the scheduler can predict the cost of the answer
  };
  explicit Simulation(std::vector<Asked> to_come) : to_come_(std::move(to_come)) {
    std::ranges::stable_sort(to_come_, {}, &Asked::at);
  }

  void run(uint64_t end) {
    while (tile() < end) {
      add_due_requests();
      if (answers_.waiting() > 0)
        answers_.work();
      else if (next_ < to_come_.size())
        time_ = std::max(time_, to_come_[next_].at * kTile);
      else
        return;
    }
  }

  uint64_t p95(uint32_t view) const {
    std::vector<uint64_t> delays;
    for (const auto& [of, delay] : delays_)
      if (of == view) delays.push_back(delay);
    std::ranges::sort(delays);
    return delays.empty() ? 0 : delays[(delays.size() * 95 - 1) / 100];
  }
  uint64_t slowest(uint32_t view) const {
    uint64_t most = 0;
    for (const auto& [of, delay] : delays_)
      if (of == view) most = std::max(most, delay);
    return most;
  }
  size_t answered(uint32_t view) const {
    return static_cast<size_t>(std::ranges::count(delays_, view, &std::pair<uint32_t, uint64_t>::first));
  }
  uint64_t tile() const { return time_ / kTile; }
  size_t dropped() const { return dropped_; }
  size_t most_views() const { return most_views_; }  // known at a time

 private:
  void add_due_requests() {
    while (next_ < to_come_.size() && to_come_[next_].at <= tile()) {
      const Asked asked = to_come_[next_++];
      bool dropped = false;
      answers_.add(
          asked.view, asked.expected ? asked.tiles * kTile : 0,
          [this, asked](const ParallelFor& parallel) {
            parallel(asked.tiles, [this](size_t) {
              time_ += kTile;
              add_due_requests();
            });
            delays_.emplace_back(asked.view, tile() - asked.at);
          },
          &dropped);
      dropped_ += dropped;
      most_views_ = std::max(most_views_, answers_.views());
    }
  }

  uint64_t time_ = kTile;
  std::vector<Asked> to_come_;
  size_t next_ = 0;
  std::vector<std::pair<uint32_t, uint64_t>> delays_;
  size_t dropped_ = 0, most_views_ = 0;
  FairScheduler answers_{serial_for, 1, [this] { return time_; }};
};

std::vector<Simulation::Asked> every(uint64_t interval, size_t tiles, uint32_t view, uint64_t until) {
  std::vector<Simulation::Asked> asked;
  for (uint64_t at = 3 + view; at < until; at += interval) asked.push_back({at, tiles, view});
  return asked;
}

void append(std::vector<Simulation::Asked>& to, const std::vector<Simulation::Asked>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

constexpr uint64_t kEnd = 20'000, kNew = 2'100;  // views with a first request before kNew count as new

TEST(FairScheduler, ExpensiveViewDoesNotDelayOthers) {
  for (const size_t own : {10, 30, 60}) {
    Simulation alone(every(200, own, 1, kEnd));
    alone.run(kEnd);
    for (const size_t greedy : {5, 60, 1000}) {
      std::vector<Simulation::Asked> asked = every(200, own, 1, kEnd);
      append(asked, every(greedy / 10 + 1, greedy, 2, kEnd));
      Simulation both(asked);
      both.run(kEnd);
      EXPECT_LE(static_cast<double>(both.p95(1)), 1.3 * static_cast<double>(alone.p95(1)))
          << own << " beside " << greedy;
      EXPECT_GE(both.answered(1) + 1, alone.answered(1));
      EXPECT_GT(both.answered(2), 10u) << "the other view gets the rest";
      EXPECT_GT(both.dropped(), 100u);
    }
  }
}

// Uses as many view ids as RequestLimiter admits, each once, in sequence or all at once; their costs are unknown.
TEST(FairScheduler, NewViewIdsDoNotDelayOthers) {
  for (const size_t own : {10, 30, 60}) {
    Simulation alone(every(200, own, 1, kEnd));
    alone.run(kEnd);
    for (const size_t at_once : {1, 8, 64}) {
      for (const size_t tiles : {5, 250, 1000}) {
        std::vector<Simulation::Asked> asked = every(200, own, 1, kEnd);
        uint32_t made_up = 100;
        for (uint64_t at = kNew; at < kEnd; at += 2000 * at_once / 64)
          for (size_t i = 0; i < at_once; i++) asked.push_back({at, tiles, made_up++, false});
        Simulation both(asked);
        both.run(kEnd);
        EXPECT_LE(static_cast<double>(both.p95(1)), 1.3 * static_cast<double>(alone.p95(1)))
            << own << " beside " << tiles << " of " << at_once << " at once";
        EXPECT_GE(both.answered(1) + 1, alone.answered(1));
        EXPECT_GT(both.answered(100), 0u) << "the tiles get the rest";
      }
    }
  }
}

// The costs of permanent views stay unknown as well.
TEST(FairScheduler, UnknownWorkDoesNotInterrupt) {
  Simulation alone(every(200, 10, 1, kEnd));
  alone.run(kEnd);
  std::vector<Simulation::Asked> asked = every(200, 10, 1, kEnd);
  for (uint32_t view = 2; view < 20; view++)
    for (uint64_t at = kNew + view; at < kEnd; at += 500)
      asked.push_back({at, view % 2 ? size_t{1} : size_t{1000}, view, false});
  Simulation both(asked);
  both.run(kEnd);
  EXPECT_LE(static_cast<double>(both.p95(1)), 1.3 * static_cast<double>(alone.p95(1)));
}

// Each view sends one request at the same time. The long request goes first, because its cost is unknown, and is
// suspended once it has used more time than the short request will.
TEST(FairScheduler, LongAnswerIsInterruptedByAWaitingRequest) {
  constexpr size_t kOwn = 10, kLong = 1000;
  Simulation both({{3, kOwn, 1}, {100, kLong, 2, false}, {100, kOwn, 1}});
  both.run(kEnd);
  EXPECT_EQ(both.answered(1), 2u);
  EXPECT_EQ(both.answered(2), 1u);
  EXPECT_LE(both.slowest(1), 2 * kOwn + 1);
  EXPECT_EQ(both.slowest(2), kLong + kOwn);
}

TEST(FairScheduler, NewViewIdsAreForgotten) {
  std::vector<Simulation::Asked> asked;
  for (uint32_t i = 0; i < 10'000; i++) asked.push_back({10 + 32 * i, 5, i});
  Simulation made_up(asked);
  made_up.run(10'000 * 40);
  EXPECT_EQ(made_up.answered(9'999), 1u);
  EXPECT_LE(made_up.most_views(), 64u + 1);
}

TEST(FairScheduler, ExpensiveViewsShareEqually) {
  std::vector<Simulation::Asked> asked;
  for (const uint32_t view : {1, 2, 3}) append(asked, every(20 * view, 40 * view, view, kEnd));
  Simulation three(asked);
  three.run(kEnd);
  const auto time_of = [&](uint32_t view) { return static_cast<double>(three.answered(view) * 40 * view); };
  for (const uint32_t view : {1, 2, 3}) EXPECT_NEAR(time_of(view) / static_cast<double>(three.tile()), 1. / 3, 0.03);
}

// An idle view does not accumulate a claim to CPU time.
TEST(FairScheduler, IdleTimeIsNotSaved) {
  std::vector<Simulation::Asked> asked = every(10, 40, 1, kEnd);
  for (const Simulation::Asked& late : every(10, 40, 2, kEnd))
    if (late.at > kEnd / 2) asked.push_back(late);
  Simulation both(asked);
  both.run(kEnd);
  EXPECT_NEAR(static_cast<double>(both.answered(1)) * 40, 0.75 * kEnd, 0.03 * kEnd);
}

TEST(FairScheduler, KeepsTheNewestRequestsOfAView) {
  FairScheduler answers;
  std::vector<int> done;
  int dropped = 0;
  for (int i = 0; i < 12; i++) {
    bool one = false;
    EXPECT_TRUE(answers.add(
        1, 0, [&done, i](const ParallelFor&) { done.push_back(i); }, &one));
    dropped += one;
  }
  EXPECT_EQ(dropped, 4);
  EXPECT_EQ(answers.waiting(), FairScheduler::kMaxQueued);
  while (answers.waiting() > 0) answers.work();
  EXPECT_EQ(done, (std::vector<int>{4, 5, 6, 7, 8, 9, 10, 11}));
}

// Answers that take 1.5 times the interval of the requests. The newest request waits less than an interval.
TEST(FairScheduler, OverloadedViewAnswersItsNewestRequest) {
  Simulation overloaded(every(66, 100, 1, kEnd));
  overloaded.run(kEnd);
  EXPECT_LE(overloaded.p95(1), 66u + 100u + 1u);
  EXPECT_GT(overloaded.dropped(), 80u);
  EXPECT_NEAR(static_cast<double>(overloaded.answered(1)) * 100, kEnd, 500);
}

// A stall delays the requests of 200 ms. All of them are answered.
TEST(FairScheduler, ShortDelaysAreNoOverload) {
  std::vector<Simulation::Asked> asked = every(33, 15, 1, kEnd);
  for (Simulation::Asked& one : asked)
    if (one.at % 3'000 < 200) one.at += 200 - one.at % 3'000;
  Simulation stalling(asked);
  stalling.run(kEnd);
  EXPECT_EQ(stalling.dropped(), 0u);
  EXPECT_EQ(stalling.answered(1), asked.size());
}

TEST(FairScheduler, OverloadEnds) {
  std::vector<Simulation::Asked> asked = every(66, 100, 1, kEnd / 2);
  for (uint64_t at = kEnd / 2 + 500; at < kEnd; at += 66) asked.push_back({at, 20, 1});
  Simulation recovering(asked);
  recovering.run(kEnd / 2 + 500);
  const size_t dropped = recovering.dropped();
  EXPECT_GT(dropped, 0u);
  recovering.run(kEnd);
  EXPECT_EQ(recovering.dropped(), dropped);
}

TEST(FairScheduler, SetsHaveRoom) {
  constexpr size_t kViews = 48;
  FairScheduler answers;
  int dropped = 0;
  for (size_t i = 0; i < 3 * kViews; i++) {
    bool one = false;
    EXPECT_TRUE(answers.add(
        1, 0, [](const ParallelFor&) {}, &one, kViews));
    dropped += one;
  }
  EXPECT_GE(answers.waiting(), 2 * kViews);
  EXPECT_EQ(answers.waiting() + static_cast<size_t>(dropped), 3 * kViews);
  EXPECT_GT(dropped, 0) << "number of views is limited";
}

// Common quilt sizes wait completely; a set with maximum map sizes gets no more room than one view.
TEST(FairScheduler, LargeMapsHaveLittleRoom) {
  ViewRequest request;
  request.place = {.columns = 16, .rows = 8};
  EXPECT_EQ(queued_views_of_set(request), 128u);
  const auto with_map = [&](size_t nodes) {
    auto map = std::make_shared<FocalMap>();
    map->levels.resize(nodes);
    request.view.focus.map = map;
    return queued_views_of_set(request);
  };
  EXPECT_EQ(with_map(size_t{256} * 256), 64u);
  EXPECT_EQ(with_map(1024), 128u);
  EXPECT_EQ(with_map(FocalMap::kMaxNodes), 4u);
  request.gains.mean.resize(4 * FocalMap::kMaxNodes);
  EXPECT_EQ(queued_views_of_set(request), 1u);
  request.place = {};
  EXPECT_EQ(with_map(64), 1u);
}

TEST(FairScheduler, StopWakesWaitingThreads) {
  FairScheduler answers;
  std::thread thread([&] {
    while (answers.work()) {
    }
  });
  std::atomic<int> done = 0;
  for (int i = 0; i < 5; i++) answers.add(0, 0, [&](const ParallelFor&) { done++; });
  answers.drain();
  EXPECT_EQ(done, 5);
  answers.stop();
  thread.join();
  EXPECT_FALSE(answers.add(0, 0, [](const ParallelFor&) {}));
  answers.start();
  EXPECT_TRUE(answers.add(0, 0, [](const ParallelFor&) {}));
}

// Runs tasks in several threads, in any interleaving.
TEST(FairScheduler, EachTaskRunsOnce) {
  WorkerPool pool;
  FairScheduler answers([&pool](size_t count, const std::function<void(size_t)>& task) { pool.run(3, count, task); },
                        3);
  std::vector<std::atomic<int>> first(2000), second(2000);
  std::thread thread([&] {
    while (answers.work()) {
    }
  });
  for (int round = 0; round < 20; round++) {
    for (auto* tasks : {&first, &second})
      answers.add(tasks == &first ? 1 : 2, 1,
                  [tasks](const ParallelFor& parallel) { parallel(tasks->size(), [=](size_t i) { (*tasks)[i]++; }); });
    answers.drain();
  }
  answers.stop();
  thread.join();
  for (const auto& tasks : {std::ref(first), std::ref(second)})
    for (const std::atomic<int>& count : tasks.get()) EXPECT_EQ(count, 20);
}

TEST(FairScheduler, ExceptionLosesOneAnswer) {
  FairScheduler answers;
  bool done = false;
  answers.add(1, 0, [](const ParallelFor& parallel) { parallel(3, [](size_t) { throw std::bad_alloc(); }); });
  answers.add(1, 0, [&done](const ParallelFor&) { done = true; });
  EXPECT_THROW(answers.work(), std::bad_alloc);
  EXPECT_TRUE(answers.work());
  EXPECT_TRUE(done);
}

TEST(WorkEstimate, FollowsTheDurationOfAnswers) {
  WorkEstimate estimate;
  EXPECT_EQ(estimate.nanoseconds(1e6), 0u) << "no measurements";
  estimate.done(1000, 5000);
  EXPECT_EQ(estimate.nanoseconds(100), 500u);
  for (int i = 0; i < 100; i++) estimate.done(1000, 20000);
  EXPECT_NEAR(static_cast<double>(estimate.nanoseconds(100)), 2000, 10);
  for (int i = 0; i < 100; i++) estimate.skipped();
  EXPECT_LT(estimate.nanoseconds(100), 10u) << "retried once";
}

// A view that requests one pixel and then an ordinary picture must not get an estimate of seconds.
TEST(WorkEstimate, SmallAnswersSayLittleAboutLargeOnes) {
  WorkEstimate estimate;
  for (int i = 0; i < 20; i++) estimate.done(WorkEstimate::kAnyAnswer + 1, 140'000);
  EXPECT_NEAR(static_cast<double>(estimate.nanoseconds(WorkEstimate::kAnyAnswer + 1)), 140'000, 1000);
  EXPECT_LT(estimate.nanoseconds(WorkEstimate::kAnyAnswer + 320 * 240), 5'000'000u);
}

}  // namespace
}  // namespace lf
