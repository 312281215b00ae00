// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <gst/gst.h>

#include "common/gl_share.h"
#include "common/gst_pointers.h"
#include "focus/view_depths.h"
#include "rig/mesh.h"
#include "view/view_request.h"

// Custom events and queries between viewers, nodes and compositors, and the classes that track their state.
namespace lf {

// Custom upstream event from a compositor's request pad, before and after a flushing seek. The source of the requests
// pauses in between. A funnel forwards a seek to its viewers one after another, and each flush discards data of all
// viewers. Therefore no viewer may resume before the last flush. Field "held" (boolean); the sequence number is that of
// the seek.
#define LF_HOLD_EVENT "lightfield-hold"

// Returns a new event that the caller owns, like all *_event() functions here.
GstEvent* hold_event(bool held, guint32 seqnum);
bool parse_hold(GstEvent* event, bool* held);

// Detects duplicates of a seek. A seek arrives several times: by the compositor's request pad, by its answer pads
// through the nodes, and from every compositor behind a tee. Thread-safe.
class SeekFilter {
 public:
  bool is_new(guint32 seqnum) { return seqnum_.exchange(seqnum) != seqnum; }
  void clear() { seqnum_ = GST_SEQNUM_INVALID; }

 private:
  std::atomic<guint32> seqnum_ = GST_SEQNUM_INVALID;
};

// Custom upstream event from a node's request pad: minimum age of captures that its live cameras can deliver. Field
// "delay" (uint64, nanoseconds).
#define LF_CAPTURE_DELAY_EVENT "lightfield-capture-delay"

GstEvent* capture_delay_event(GstClockTime delay);
bool parse_capture_delay(GstEvent* event, GstClockTime* delay);

// Capture delay that lfviewrequest derives from the reports of nodes. Increases immediately, and decreases after some
// seconds if a much smaller delay is sufficient. Thread-safe.
class AutoCaptureDelay {
 public:
  static constexpr GstClockTime kMost = 2 * GST_SECOND;  // upper bound for all cameras
  static constexpr GstClockTime kMemory = 10 * GST_SECOND;

  // Registers the needed delay of a node. Returns true if the delay has changed. `now`: any monotonic clock.
  bool take(GstClockTime needed, GstClockTime now);
  GstClockTime delay() const;
  void clear();

 private:
  struct Report {
    GstClockTime time, needed;
  };
  mutable std::mutex mutex_;
  std::deque<Report> reports_;  // reports within the last kMemory, in decreasing order of `needed`
  GstClockTime since_ = 0;
  GstClockTime delay_ = 0;
};

// Tracks QoS events: the earliest running time that can still be shown on time. An event belongs to one view.
// lfcompositor writes the view id into the event, because nodes serve several views. Thread-safe.
class QosTracker {
 public:
  static std::optional<uint32_t> view_of(GstEvent* event);
  // Writes the view id into the event, or into a copy if the event is shared. Takes and returns a reference.
  static GstEvent* set_view_id(GstEvent* event, uint32_t view_id);

  struct Late {
    GstClockTimeDiff jitter;  // lateness of pictures, nanoseconds
    gdouble proportion;       // processing time divided by available time
  };
  // Registers a QoS event with a view id. `live`: dropping frames does not make later frames earlier.
  void see(GstEvent* event, bool live);
  // Returns the lateness if a picture for this running time would be late.
  std::optional<Late> late(uint32_t view_id, GstClockTime running_time) const;
  void clear();

 private:
  struct View {
    GstClockTime earliest;
    gdouble proportion;
  };
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
};

// Custom query of a node, downstream: is the compositor in the same process? lfcompositor returns TRUE. Elements that
// keep buffers unchanged (queue, tee, identity, funnel) forward the query; files, sockets and payloaders do not. If the
// compositor's pictures are in GPU memory, the answer has the field "context" (GstGLContext). A node that renders in a
// context that shares with it can leave sums in GPU memory.
#define LF_IN_PROCESS_QUERY "lightfield-in-process"

bool is_in_process_query(GstQuery* query);
// Answers the query. `context`: null if pictures are not in GPU memory.
void answer_in_process_query(GstQuery* query, GstGLContext* context);

// The compositor in this process that receives the answers of a pad.
struct LocalCompositor {
  bool is_there = false;
  // Share group of the contexts of its pictures; 0: pictures are not in GPU memory.
  gl::ShareGroup group = 0;
  WeakGlContext context;
};
LocalCompositor find_local_compositor(GstPad* src);

// Video caps accepted downstream of the compositor of a view. Fields: LF_VIEW_ID_FIELD (uint), "caps" (GstCaps).
// lfviewrequest sends a custom query downstream before its first request. The compositor sends a custom event upstream
// when the caps may have changed. The event is handled if the next requests fit the caps.
#define LF_PICTURE_CAPS "lightfield-picture-caps"

// Queries the compositor of the view, downstream of this source pad. Returns null if there is none.
SharedCaps query_picture_caps(GstPad* src, guint view_id);
bool is_picture_caps_query(GstQuery* query, guint* view_id);
void answer_picture_caps_query(GstQuery* query, GstCaps* caps);

GstEvent* picture_caps_event(guint view_id, GstCaps* caps);
SharedCaps parse_picture_caps(GstEvent* event, guint* view_id);

// Custom upstream event from a compositor's request pad to the source of the view's requests. Its only field,
// "feedback", is a boxed std::shared_ptr<const ViewFeedback>, so copies of the event share the feedback.
#define LF_VIEW_FEEDBACK_EVENT "lightfield-feedback"
// Custom downstream query: will a compositor of the view (field "lightfield-view-id", uint) send focal surfaces?
#define LF_FOCUS_QUERY "lightfield-finds-focus"

struct ViewFeedback {
  guint view_id = 0;
  std::optional<DepthEstimate> focus;
  // Cameras out of service from the next request on. Replaces the set of earlier events.
  std::optional<CameraSet> out_of_service;
  // Requests to send once, together with the next request. Only view, cameras out of service, rig and probe flag are
  // used.
  std::vector<ViewRequest> extra_requests;
};

GstEvent* view_feedback_event(ViewFeedback feedback);
std::shared_ptr<const ViewFeedback> parse_view_feedback(GstEvent* event);

// Sets a field to the camera indices, as a GstValueArray of uint.
void set_cameras(GstStructure* structure, const char* field, const CameraSet& cameras);

// True if a compositor downstream of this source pad finds the focus of the view. *waits (may be null): true if the
// compositor is blocked by its own downstream, for example in a paused pipeline.
bool finds_focus(GstPad* src, guint view_id, bool* waits = nullptr);
// Answers LF_FOCUS_QUERY. `waits`: the compositor is blocked by its own downstream.
void set_focus_waits(GstQuery* query, bool waits);
bool is_focus_query(GstQuery* query, guint* view_id);

}  // namespace lf
