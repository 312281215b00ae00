// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus_feedback.h"

#include <utility>

#include "focus/carry_over.h"

namespace lf {

void FocusFeedback::announce(FocalSurfaceNews news) {
  const std::lock_guard lock(mutex_);
  news_ = std::move(news);
  changed_.notify_all();
}

bool FocusFeedback::wait_for(uint32_t sequence, std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  // Sequence numbers wrap: the sign of the difference tells the order.
  const auto is_there = [&] { return news_ && static_cast<int32_t>(news_->sequence - sequence) >= 0; };
  changed_.wait_for(lock, longest, [&] { return unlocked_ || is_there(); });
  return !unlocked_ && is_there();
}

void FocusFeedback::apply(ViewRequest& request) {
  View found_for;
  {
    const std::lock_guard lock(mutex_);
    if (!news_ || !news_->plan.view.focus.map) return;
    found_for = news_->plan.view;
    request.trials = std::exchange(news_->plan.trials, {});
  }
  request.view.focus.map = carry_over(found_for, request.view);
}

void FocusFeedback::set_unlocked(bool unlocked) {
  const std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  changed_.notify_all();
}

void FocusFeedback::clear() {
  const std::lock_guard lock(mutex_);
  news_.reset();
}

}  // namespace lf
