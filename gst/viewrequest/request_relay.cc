// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_relay.h"

#include <algorithm>
#include <iterator>

namespace lf {

void OutOfService::announce(uint32_t view_id, CameraSet cameras) {
  std::lock_guard lock(mutex_);
  if (cameras.empty())
    views_.erase(view_id);
  else
    views_[view_id] = std::move(cameras);
  if (views_.size() > kMostViews) views_.erase(views_.begin());
}

CameraSet OutOfService::with_announced(uint32_t view_id, const CameraSet& cameras) const {
  std::lock_guard lock(mutex_);
  const auto view = views_.find(view_id);
  if (view == views_.end()) return cameras;
  CameraSet all;
  std::ranges::set_union(cameras, view->second, std::back_inserter(all));
  return all;
}

void OutOfService::clear() {
  std::lock_guard lock(mutex_);
  views_.clear();
}

FocusFeedback& RelayedFocus::view(uint32_t id) {
  if (!views_.contains(id) && views_.size() >= kMostViews) views_.erase(views_.begin());
  return views_[id];
}

void RelayedFocus::announce(uint32_t view_id, FoundFocus focus) {
  const std::lock_guard lock(mutex_);
  view(view_id).announce(std::move(focus));
}

bool RelayedFocus::apply(ViewRequest& request) {
  const std::lock_guard lock(mutex_);
  if (request.probe) {
    if (!request.trials.empty()) view(request.view_id).sweep_sent(request.sequence);
    return false;
  }
  const auto found = views_.find(request.view_id);
  if (found == views_.end() || request.view.focus.map) return false;
  const Plane asked = request.view.focus.plane;
  found->second.apply(request);
  return request.view.focus.map || request.view.focus.plane != asked;
}

void RelayedFocus::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

GstFlowReturn RequestRelay::push(GstBuffer* request, bool live, bool* dropped) {
  std::unique_lock lock(mutex_);
  if (!live) changed_.wait(lock, [this] { return flushing_ || unlocked_ || ended_ || waiting_.size() < kMost; });
  if (flushing_ || unlocked_ || ended_) {
    gst_buffer_unref(request);
    return ended_ && !flushing_ && !unlocked_ ? GST_FLOW_EOS : GST_FLOW_FLUSHING;
  }
  *dropped = waiting_.size() >= kMost;
  if (*dropped) {
    gst_buffer_unref(waiting_.front());
    waiting_.pop_front();
  }
  waiting_.push_back(request);
  changed_.notify_all();
  return GST_FLOW_OK;
}

void RequestRelay::end() {
  std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

GstFlowReturn RequestRelay::pop(GstBuffer** request) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return unlocked_ || ended_ || !waiting_.empty(); });
  if (unlocked_) return GST_FLOW_FLUSHING;
  if (waiting_.empty()) return GST_FLOW_EOS;
  *request = waiting_.front();
  waiting_.pop_front();
  changed_.notify_all();
  return GST_FLOW_OK;
}

void RequestRelay::set_flushing(bool flushing) {
  std::lock_guard lock(mutex_);
  flushing_ = flushing;
  ended_ = false;
  for (GstBuffer* buffer : waiting_) gst_buffer_unref(buffer);
  waiting_.clear();
  changed_.notify_all();
}

void RequestRelay::set_unlocked(bool unlocked) {
  std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  changed_.notify_all();
}

void RequestRelay::clear() {
  std::lock_guard lock(mutex_);
  for (GstBuffer* buffer : waiting_) gst_buffer_unref(buffer);
  waiting_.clear();
  ended_ = false;
}

}  // namespace lf
