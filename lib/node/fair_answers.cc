// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/fair_answers.h"

#include <algorithm>
#include <utility>

namespace lf {

// Where it would end before what the running one has had by now.
bool FairAnswers::goes_before(const View& view, uint32_t running) const {
  return !view.waiting.empty() && !view.in_flight && view.end() < views_.at(running).used;
}

bool FairAnswers::add(uint32_t view, uint64_t work, Answer answer, bool* dropped) {
  const std::lock_guard lock(mutex_);
  if (stopped_) return false;
  View& state = views_[view];
  if (state.waiting.empty()) {
    state.since = order_++;
    if (!state.in_flight) state.used = std::max(state.used, virtual_time_ - kClaim);
  }
  state.waiting.push_back({static_cast<double>(work), std::move(answer)});
  const bool too_many = state.waiting.size() > kMostWaiting;
  if (too_many) state.waiting.pop_front();
  if (dropped) *dropped = too_many;
  if (depth_ > 0 && depth_ < kDeepest) {
    charge_running();
    urgent_ = urgent_ || goes_before(state, running_);
  }
  changed_.notify_all();
  return true;
}

FairAnswers::Views::iterator FairAnswers::first_waiting() {
  auto first = views_.end();
  for (auto view = views_.begin(); view != views_.end(); ++view) {
    const View& state = view->second;
    if (state.waiting.empty() || state.in_flight) continue;
    if (first == views_.end() ||
        std::pair(state.end(), state.since) < std::pair(first->second.end(), first->second.since))
      first = view;
  }
  return first;
}

void FairAnswers::charge_running() {
  const uint64_t now = now_();
  views_[running_].used += static_cast<double>(now - since_);
  since_ = now;
}

void FairAnswers::answer_first(std::unique_lock<std::mutex>& lock) {
  const auto first = first_waiting();
  const uint32_t view = first->first;
  View& state = first->second;
  const Answer answer = std::move(state.waiting.front().answer);
  state.waiting.pop_front();
  state.since = order_++;
  state.in_flight = true;
  virtual_time_ = std::max(virtual_time_, state.used);
  running_ = view;
  since_ = now_();
  depth_++;
  urgent_ = false;
  const auto finish = [&] {
    lock.lock();
    charge_running();
    state.in_flight = false;
    depth_--;
    // What is no more than the others have had tells nothing.
    std::erase_if(views_, [this](const auto& entry) {
      return entry.second.waiting.empty() && !entry.second.in_flight && entry.second.used <= virtual_time_ - kClaim;
    });
    changed_.notify_all();
  };
  lock.unlock();
  try {
    answer([this, view](size_t count, const std::function<void(size_t)>& task) { run_tasks(view, count, task); });
  } catch (...) {
    finish();
    throw;
  }
  finish();
}

void FairAnswers::run_tasks(uint32_t view, size_t count, const std::function<void(size_t)>& task) {
  std::atomic<size_t> next = 0;
  while (next < count) {
    if (urgent_) let_others_go_first(view);
    parallel_(std::min(threads_, count - next), [&](size_t) {
      while (!urgent_) {
        const size_t i = next++;
        if (i >= count) return;
        task(i);
      }
    });
  }
}

void FairAnswers::let_others_go_first(uint32_t view) {
  std::unique_lock lock(mutex_);
  charge_running();
  while (!stopped_ && depth_ < kDeepest) {
    const auto first = first_waiting();
    if (first == views_.end() || !goes_before(first->second, view)) break;
    try {
      answer_first(lock);
    } catch (...) {
      running_ = view;
      since_ = now_();
      throw;
    }
    running_ = view;
    since_ = now_();
  }
  urgent_ = false;
}

bool FairAnswers::work() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || first_waiting() != views_.end(); });
  if (stopped_) return false;
  answer_first(lock);
  return true;
}

void FairAnswers::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || (depth_ == 0 && first_waiting() == views_.end()); });
}

void FairAnswers::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  for (auto& [view, state] : views_) state.waiting.clear();
  changed_.notify_all();
}

void FairAnswers::start() {
  const std::lock_guard lock(mutex_);
  stopped_ = false;
}

void FairAnswers::clear() {
  const std::lock_guard lock(mutex_);
  for (auto& [view, state] : views_) state.waiting.clear();
  changed_.notify_all();
}

size_t FairAnswers::waiting() const {
  const std::lock_guard lock(mutex_);
  size_t count = 0;
  for (const auto& [view, state] : views_) count += state.waiting.size();
  return count;
}

}  // namespace lf
