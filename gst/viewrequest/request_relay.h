// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>

#include <gst/gst.h>

#include "common/buffer_ptr.h"

namespace lf {

// The sink pad of lfviewrequest, if it has one, and the requests of other viewers on their way from it to the source
// pad's thread. Thread-safe.
class RequestRelay {
 public:
  ~RequestRelay() { gst_clear_caps(&caps_); }

  // The pad, borrowed; null: requests are not relayed but made.
  void set_sink(GstPad* sink);
  bool is_on() const;
  // What the pad's peer says to these: false, too, without a pad. Takes the event.
  bool push_upstream(GstEvent* event);
  bool query_upstream(GstQuery* query);

  // Caps of what comes in, until they are taken: owned by the caller, null if there are no new ones.
  void set_caps(GstCaps* caps);
  GstCaps* take_caps();

  // Takes the buffer. Live, the oldest is dropped where more than kMost wait (false); else push() waits for room.
  // GST_FLOW_FLUSHING while unlocked or flushing, GST_FLOW_EOS after the end.
  GstFlowReturn push(GstBuffer* request, bool live, bool* dropped);
  void end();
  // The next request, owned by the caller; waits for it. GST_FLOW_EOS behind the last.
  GstFlowReturn pop(GstBuffer** request);

  void set_flushing(bool flushing);  // the stream that comes in is flushed: drops what waits
  void set_unlocked(bool unlocked);  // nobody waits
  void clear();

 private:
  static constexpr size_t kMost = 64;
  GstPad* hold_sink() const;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  GstPad* sink_ = nullptr;
  GstCaps* caps_ = nullptr;
  std::deque<BufferPtr> waiting_;
  bool flushing_ = false, unlocked_ = false, ended_ = false;
};

}  // namespace lf
