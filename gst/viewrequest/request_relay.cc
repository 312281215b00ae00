// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_relay.h"

#include <utility>

namespace lf {

void RequestRelay::set_sink(GstPad* sink) {
  const std::lock_guard lock(mutex_);
  sink_ = sink;
}

bool RequestRelay::is_on() const {
  const std::lock_guard lock(mutex_);
  return sink_ != nullptr;
}

// Owned by the caller: the pad may be released meanwhile.
GstPad* RequestRelay::hold_sink() const {
  const std::lock_guard lock(mutex_);
  return sink_ ? GST_PAD(gst_object_ref(sink_)) : nullptr;
}

bool RequestRelay::push_upstream(GstEvent* event) {
  g_autoptr(GstPad) sink = hold_sink();
  if (sink) return gst_pad_push_event(sink, event);
  gst_event_unref(event);
  return false;
}

bool RequestRelay::query_upstream(GstQuery* query) {
  g_autoptr(GstPad) sink = hold_sink();
  return sink && gst_pad_peer_query(sink, query);
}

void RequestRelay::set_caps(GstCaps* caps) {
  const std::lock_guard lock(mutex_);
  gst_clear_caps(&caps_);
  caps_ = gst_caps_copy(caps);
  gst_caps_set_simple(caps_, "parsed", G_TYPE_BOOLEAN, TRUE, nullptr);
}

GstCaps* RequestRelay::take_caps() {
  const std::lock_guard lock(mutex_);
  return std::exchange(caps_, nullptr);
}

GstFlowReturn RequestRelay::push(GstBuffer* request, bool live, bool* dropped) {
  BufferPtr owned(request);
  std::unique_lock lock(mutex_);
  if (!live) changed_.wait(lock, [this] { return flushing_ || unlocked_ || ended_ || waiting_.size() < kMost; });
  if (flushing_ || unlocked_) return GST_FLOW_FLUSHING;
  if (ended_) return GST_FLOW_EOS;
  *dropped = waiting_.size() >= kMost;
  if (*dropped) waiting_.pop_front();
  waiting_.push_back(std::move(owned));
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
  *request = waiting_.front().release();
  waiting_.pop_front();
  changed_.notify_all();
  return GST_FLOW_OK;
}

void RequestRelay::set_flushing(bool flushing) {
  std::lock_guard lock(mutex_);
  flushing_ = flushing;
  ended_ = false;
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
  waiting_.clear();
  ended_ = false;
}

}  // namespace lf
