// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>

#include <gst/gst.h>

#include "rig/mesh.h"
#include "viewrequest/focus_feedback.h"

namespace lf {

// Cameras that compositors announced as out of service, view by view, and requests of other viewers that pass through
// lfviewrequest, waiting to leave. Thread-safe.
class OutOfService {
 public:
  // From now on these are the view's, and no others.
  void announce(uint32_t view_id, CameraSet cameras);
  // `cameras` and those announced for this view.
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMostViews = 1024;  // of viewers that come and go; then the lowest id is forgotten
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// Focal surfaces of views whose viewers can't be told of them: requests get them as they pass. Thread-safe.
class RelayedFocus {
 public:
  void announce(uint32_t view_id, FoundFocus focus);
  // Gives the request the surface and the trials of its view, if it has no surface of its own. Whether it did.
  bool apply(ViewRequest& request);
  void clear();

 private:
  static constexpr size_t kMostViews = 64;  // then the lowest id is forgotten
  FocusFeedback& view(uint32_t id);
  std::mutex mutex_;
  std::map<uint32_t, FocusFeedback> views_;
};

// Requests on their way from the sink pad to the source pad's thread.
class RequestRelay {
 public:
  ~RequestRelay() { clear(); }

  // Takes the buffer. Live, the oldest is dropped where more than kMost wait (false); else push() waits for room.
  // GST_FLOW_FLUSHING while unlocked or flushing, GST_FLOW_EOS after the end.
  GstFlowReturn push(GstBuffer* request, bool live, bool* dropped);
  void end();
  // The next request, owned by the caller; waits for it. GST_FLOW_EOS behind the last.
  GstFlowReturn pop(GstBuffer** request);

  void set_flushing(bool flushing);  // of the stream that comes in; drops what waits
  void set_unlocked(bool unlocked);  // nobody waits
  void clear();

 private:
  static constexpr size_t kMost = 64;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<GstBuffer*> waiting_;
  bool flushing_ = false, unlocked_ = false, ended_ = false;
};

}  // namespace lf
