// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/fair_scheduler.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "view/view_request.h"

namespace lf {

// Returns how long the running view may continue before the waiting request of `view` must interrupt it, in
// nanoseconds. The result is infinite if the work of the waiting request is unknown, because such a request never
// interrupts another.
double FairScheduler::ahead(const View& view, uint32_t running) const {
  if (!view.waits() || view.waiting.front().work == 0) return std::numeric_limits<double>::infinity();
  const View& other = views_.at(running);
  if (view.is_new && other.is_new) return view.end() - other.used;
  return virtual_usage(view) + view.waiting.front().work - virtual_usage(other);
}

bool FairScheduler::goes_before(const View& view, uint32_t running) const { return ahead(view, running) < 0; }

// Computes when a waiting view must interrupt the running view. Call right after charging the running view. Its usage
// grows with time, so the moment comes even without another request.
void FairScheduler::look_ahead() {
  double least = std::numeric_limits<double>::infinity();
  if (depth_ < kMaxDepth && !stopped_)
    for (const auto& [id, view] : views_) least = std::min(least, ahead(view, running_));
  urgent_at_ = std::isinf(least) ? kNever : least < 0 ? since_ : since_ + static_cast<uint64_t>(least) + 1;
}

void FairScheduler::resume(uint32_t view) {
  running_ = view;
  since_ = now_();
  look_ahead();
}

bool FairScheduler::is_urgent() const {
  const uint64_t at = urgent_at_;
  return at != kNever && now_() >= at;
}

// The view must not have a waiting request yet.
void FairScheduler::enqueue(View& view) {
  view.since = order_++;
  if (view.in_flight) return;
  if (!view.is_new) {
    view.used = std::max(view.used, virtual_time_ - kMaxCredit);
    return;
  }
  const auto is_there = [](const auto& entry) {
    return entry.second.is_new && (entry.second.in_flight || entry.second.waits());
  };
  if (std::ranges::none_of(views_, is_there)) new_views_usage_ = std::max(new_views_usage_, virtual_time_ + kMaxCredit);
}

bool FairScheduler::add(uint32_t view, uint64_t work, Answer answer, bool* dropped, size_t of_set) {
  const std::lock_guard lock(mutex_);
  if (stopped_) return false;
  if (depth_ > 0) charge_running();
  const uint64_t now = now_();
  const auto [at, is_first] = views_.try_emplace(view);
  View& state = at->second;
  if (is_first) {
    state.began = now;
    for (const auto& [id, other] : views_)
      if (other.is_new) state.used = std::max(state.used, other.used);
  }
  state.asked = now;
  if (state.is_new && now > state.began + RequestLimiter::kViewTimeout) {
    state.is_new = false;
    state.used = new_views_usage_;
  }
  if (state.waiting.empty()) enqueue(state);
  state.waiting.push_back({static_cast<double>(work), std::move(answer), now});
  const size_t most = state.overloaded && of_set == 1 ? 1 : kMaxQueued + 2 * (of_set - 1);
  const bool too_many = state.waiting.size() > most;
  if (too_many) state.dropped_at = now;
  if (dropped) *dropped = too_many;
  while (state.waiting.size() > most) state.waiting.pop_front();
  if (depth_ > 0) look_ahead();
  changed_.notify_all();
  return true;
}

template <typename May>
FairScheduler::Views::iterator FairScheduler::first_of(const May& may) {
  Views::iterator first[2] = {views_.end(), views_.end()};  // first new view, first known view
  for (auto view = views_.begin(); view != views_.end(); ++view) {
    const View& state = view->second;
    if (!may(state)) continue;
    Views::iterator& best = first[state.is_new ? 0 : 1];
    if (best == views_.end() || std::pair(state.end(), state.since) < std::pair(best->second.end(), best->second.since))
      best = view;
  }
  const auto [of_new, of_others] = first;
  if (of_new == views_.end() || of_others == views_.end()) return of_new == views_.end() ? of_others : of_new;
  return new_views_usage_ + of_new->second.waiting.front().work < of_others->second.end() ? of_new : of_others;
}

FairScheduler::Views::iterator FairScheduler::first_waiting() {
  return first_of([](const View& view) { return view.waits(); });
}

void FairScheduler::charge_running() {
  const uint64_t now = now_();
  const auto took = static_cast<double>(now - since_);
  View& running = views_.at(running_);
  running.used += took;
  if (running.is_new) new_views_usage_ += took;
  since_ = now;
}

// Finds out whether a view is overloaded, from the wait of its request that is answered now.
void FairScheduler::note_wait(View& view, uint64_t arrived) {
  const uint64_t now = now_();
  if (view.overloaded) {
    view.overloaded = now <= view.dropped_at + kOverload;
    view.long_waits_since = 0;
  } else if (now <= arrived + kLongWait) {
    view.long_waits_since = 0;
  } else if (view.long_waits_since == 0) {
    view.long_waits_since = now;
  } else if (now > view.long_waits_since + kOverload) {
    view.overloaded = true;
    view.dropped_at = now;
  }
}

void FairScheduler::answer(Views::iterator first, std::unique_lock<std::mutex>& lock) {
  const uint32_t view = first->first;
  View& state = first->second;
  note_wait(state, state.waiting.front().arrived);
  const Answer make = std::move(state.waiting.front().answer);
  state.waiting.pop_front();
  state.since = order_++;
  state.in_flight = true;
  virtual_time_ = std::max(virtual_time_, virtual_usage(state));
  depth_++;
  resume(view);
  const auto finish = [&] {
    lock.lock();
    charge_running();
    state.in_flight = false;
    depth_--;
    std::erase_if(views_, [now = since_](const auto& entry) {
      const View& other = entry.second;
      return other.waiting.empty() && !other.in_flight && now > other.asked + RequestLimiter::kViewTimeout;
    });
    changed_.notify_all();
  };
  lock.unlock();
  try {
    make([this, view](size_t count, const std::function<void(size_t)>& task) { run_tasks(view, count, task); });
  } catch (...) {
    finish();
    throw;
  }
  finish();
}

void FairScheduler::run_tasks(uint32_t view, size_t count, const std::function<void(size_t)>& task) {
  std::atomic<size_t> next = 0;
  while (next < count) {
    if (is_urgent()) yield_to_others(view);
    parallel_(std::min(threads_, count - next), [&](size_t) {
      while (!is_urgent()) {
        const size_t i = next++;
        if (i >= count) return;
        task(i);
      }
    });
  }
}

void FairScheduler::yield_to_others(uint32_t view) {
  std::unique_lock lock(mutex_);
  charge_running();
  while (!stopped_ && depth_ < kMaxDepth) {
    const auto first = first_of([&](const View& other) { return goes_before(other, view); });
    if (first == views_.end()) break;
    try {
      answer(first, lock);
    } catch (...) {
      resume(view);
      throw;
    }
    resume(view);
  }
  look_ahead();
}

bool FairScheduler::work() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || first_waiting() != views_.end(); });
  if (stopped_) return false;
  answer(first_waiting(), lock);
  return true;
}

void FairScheduler::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return stopped_ || (depth_ == 0 && first_waiting() == views_.end()); });
}

void FairScheduler::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  for (auto& [view, state] : views_) state.waiting.clear();
  changed_.notify_all();
}

void FairScheduler::start() {
  const std::lock_guard lock(mutex_);
  stopped_ = false;
}

void FairScheduler::clear() {
  const std::lock_guard lock(mutex_);
  for (auto& [view, state] : views_) state.waiting.clear();
  changed_.notify_all();
}

size_t FairScheduler::waiting() const {
  const std::lock_guard lock(mutex_);
  size_t count = 0;
  for (const auto& [view, state] : views_) count += state.waiting.size();
  return count;
}

size_t FairScheduler::views() const {
  const std::lock_guard lock(mutex_);
  return views_.size();
}

size_t queued_views_of_set(const ViewRequest& request) {
  const size_t kept = request.gains.mean.size() + (request.view.focus.map ? request.view.focus.map->levels.size() : 0);
  const size_t most = FairScheduler::kMaxQueued / 2 * FocalMap::kMaxNodes / std::max<size_t>(kept, 1);
  return std::clamp<size_t>(most, 1, static_cast<size_t>(request.place.count()));
}

}  // namespace lf
