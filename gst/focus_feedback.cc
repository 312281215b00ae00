// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus_feedback.h"

#include <utility>

#include "focus/autofocus.h"
#include "focus/carry_over.h"

namespace lf {

void FocusFeedback::announce(FocalSurfaceNews news) {
  const std::lock_guard lock(mutex_);
  if (search_ && search_->asked == news.sequence)
    see_sweep(news);
  else
    news_ = std::move(news);
  changed_.notify_all();
}

void FocusFeedback::see_sweep(const FocalSurfaceNews& news) {
  const View& view = news.plan.view;
  const std::optional<double> distance =
      view.focus.map ? focus_distance_at(view, search_->pixel) : std::optional<double>();
  if (distance && !search_->found) {
    search_->found = distance;
    search_->asked.reset();
    return;
  }
  if (distance) found_ = distance;
  search_.reset();
}

std::optional<double> FocusFeedback::focus_at(const Vec2& pixel) {
  const std::lock_guard lock(mutex_);
  if (news_ && news_->plan.view.focus.map) return focus_distance_at(news_->plan.view, pixel);
  search_ = Search{pixel, {}, {}};
  return std::nullopt;
}

std::optional<double> FocusFeedback::take_found() {
  const std::lock_guard lock(mutex_);
  return std::exchange(found_, std::nullopt);
}

bool FocusFeedback::wait_for(uint32_t sequence, std::chrono::milliseconds longest) {
  std::unique_lock lock(mutex_);
  // Sequence numbers wrap: the sign of the difference tells the order.
  const auto is_there = [&] { return news_ && static_cast<int32_t>(news_->sequence - sequence) >= 0; };
  changed_.wait_for(lock, longest, [&] { return unlocked_ || is_there(); });
  return !unlocked_ && is_there();
}

void FocusFeedback::apply(ViewRequest& request, const std::function<Plane()>& from) {
  View found_for;
  {
    const std::lock_guard lock(mutex_);
    if (!news_ || !news_->plan.view.focus.map) {
      if (!search_) return;
      // A request, or what came of it, may get lost.
      constexpr uint32_t kPatience = 30;
      if (search_->asked && request.sequence - *search_->asked > kPatience) search_.reset();
      if (!search_ || search_->asked) return;
      search_->asked = request.sequence;
      return add_focus_sweep(request, from(), search_->found);
    }
    search_.reset();
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
  search_.reset();
  found_.reset();
}

}  // namespace lf
