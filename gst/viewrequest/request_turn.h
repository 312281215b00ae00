// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <mutex>

#include <gst/gst.h>

namespace lf {

// Waiting for the turn of a request: for a time, for a change of its view, and for the end of a seek. Thread-safe; one
// thread waits, and is told GST_FLOW_FLUSHING while unlocked.
class RequestTurn {
 public:
  void set_unlocked(bool unlocked);
  // The view is another one than it was in the latest request.
  void note_change();
  // The view that comes next is of now.
  void forget_change();
  // GstBaseSrc would wait after create(), with a request that is then a frame old: so the wait is here, before the view
  // is looked at. `or_change`: until the view is changed, if that is before.
  GstFlowReturn wait_until(GstClock* clock, GstClockTime time, bool or_change = false);

  // Holds requests back from the call with `held` to the one without, for the seek of this number: others are still to
  // take part in it (hold_event.h).
  void hold(guint32 seqnum, bool held);
  GstFlowReturn wait_for_seek();
  void forget_seek() { hold(GST_SEQNUM_INVALID, true); }

 private:
  std::mutex mutex_;
  std::condition_variable released_;
  GstClockID clock_id_ = nullptr;  // the clock's entry of the wait under way; null: none
  bool ends_with_change_ = false;  // the wait under way ends when the view is changed
  bool unlocked_ = false, changed_ = false;
  guint32 held_for_ = GST_SEQNUM_INVALID;  // the seek that is not over, during which nothing leaves
};

}  // namespace lf
