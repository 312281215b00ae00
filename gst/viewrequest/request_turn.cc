// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_turn.h"

namespace lf {

void RequestTurn::set_unlocked(bool unlocked) {
  const std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  if (unlocked && clock_id_) gst_clock_id_unschedule(clock_id_);
  released_.notify_all();
}

void RequestTurn::note_change() {
  const std::lock_guard lock(mutex_);
  changed_ = true;
  if (ends_with_change_ && clock_id_) gst_clock_id_unschedule(clock_id_);
}

void RequestTurn::forget_change() {
  const std::lock_guard lock(mutex_);
  changed_ = false;
}

GstFlowReturn RequestTurn::wait_until(GstClock* clock, GstClockTime time, bool or_change) {
  std::unique_lock lock(mutex_);
  if (unlocked_) return GST_FLOW_FLUSHING;
  if (or_change && changed_) return GST_FLOW_OK;
  ends_with_change_ = or_change;
  GstClockID id = clock_id_ = gst_clock_new_single_shot_id(clock, time);
  lock.unlock();
  const GstClockReturn result = gst_clock_id_wait(id, nullptr);
  lock.lock();
  clock_id_ = nullptr;
  const bool ended = result == GST_CLOCK_UNSCHEDULED && !(or_change && changed_ && !unlocked_);
  lock.unlock();
  gst_clock_id_unref(id);
  return ended ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

void RequestTurn::hold(guint32 seqnum, bool held) {
  const std::lock_guard lock(mutex_);
  if (held)
    held_for_ = seqnum;
  else if (held_for_ == seqnum)
    held_for_ = GST_SEQNUM_INVALID;
  released_.notify_all();
}

GstFlowReturn RequestTurn::wait_for_seek() {
  std::unique_lock lock(mutex_);
  released_.wait(lock, [this] { return held_for_ == GST_SEQNUM_INVALID || unlocked_; });
  return unlocked_ ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

}  // namespace lf
