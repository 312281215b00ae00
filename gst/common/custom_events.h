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

// Custom events and queries between the three kinds of elements, and the classes that use these events.
namespace lf {

// Custom upstream event that stops all requests during a flushing seek. It is needed if several lfviewrequest elements
// share one stream of requests through a funnel. The funnel forwards a seek to these elements one after another, and
// each seek flushes the shared stream, so a request that is sent before the last flush would be lost. Therefore a
// compositor sends this event from its request pad before the seek (field "held" true) and after the seek ("held"
// false). The event has the sequence number of the seek.
#define LF_HOLD_EVENT "lightfield-hold"

// All *_event() functions here return a new event that the caller owns.
GstEvent* hold_event(bool held, guint32 seqnum);
bool parse_hold(GstEvent* event, bool* held);

// Recognises copies of a seek that has already been handled. An application's seek reaches lfviewrequest several times:
// from the request pad of the compositor, through each node, and from every compositor behind a tee. All copies have
// the same sequence number. Thread-safe.
class SeekFilter {
 public:
  // Returns true for the first event of a seek, and false for its copies.
  bool is_new(guint32 seqnum) { return seqnum_.exchange(seqnum) != seqnum; }
  void clear() { seqnum_ = GST_SEQNUM_INVALID; }

 private:
  std::atomic<guint32> seqnum_ = GST_SEQNUM_INVALID;
};

// Custom upstream event that reports the capture delay of a node: the time from the capture of a frame until this frame
// has arrived at the node. Requests must ask for captures of at least this age. The node sends the event from its
// request pads. Field "delay" (uint64, nanoseconds).
#define LF_CAPTURE_DELAY_EVENT "lightfield-capture-delay"

GstEvent* capture_delay_event(GstClockTime delay);
bool parse_capture_delay(GstEvent* event, GstClockTime* delay);

// Chooses the age of the frames that a live lfviewrequest requests, from the capture delays that the nodes report. The
// age increases immediately, so that requests do not miss frames. It decreases only after some seconds, and only if a
// much smaller age is sufficient, because each change of the latency disturbs the playback. Thread-safe.
class AutoCaptureDelay {
 public:
  // The largest delay, and how long a report is used.
  static constexpr GstClockTime kMost = 2 * GST_SECOND;
  static constexpr GstClockTime kMemory = 10 * GST_SECOND;

  // Takes the report of a node. Returns true if the delay has changed. `now` is the time of any monotonic clock.
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

// Predicts from QoS events whether a picture would arrive too late at the sink, so that the element can skip the
// request and save the work. A node serves several views, and only some sinks may be slow. Therefore lfcompositor
// writes the view id into each QoS event, and this class predicts each view separately. Thread-safe.
class QosTracker {
 public:
  static std::optional<uint32_t> view_of(GstEvent* event);
  // Writes the view id into the event, or into a copy of a shared event. Takes and returns a reference.
  static GstEvent* set_view_id(GstEvent* event, uint32_t view_id);

  struct Late {
    GstClockTimeDiff jitter;
    gdouble proportion;  // processing time divided by available time
  };
  // Evaluates a QoS event with a view id. `live` means that frames come from live sources: later frames then do not
  // arrive earlier if frames are dropped.
  void see(GstEvent* event, bool live);
  // Returns the expected lateness of a picture for this running time, or nothing if it will be on time.
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

// Custom downstream query of a node that finds out whether its compositor is in the same process. Answers then need no
// compression, because they are passed in memory. lfcompositor answers the query with TRUE. Elements that pass buffers
// unchanged (queue, tee, identity, funnel) forward the query, but files, sockets and payloaders do not, so the query
// then fails.
//
// If the compositor makes its pictures in GPU memory, the answer has the field "context" (GstGLContext). A node that
// renders in a context of the same share group can then leave its answer (the weighted sum of its cameras) in GPU
// memory.
#define LF_IN_PROCESS_QUERY "lightfield-in-process"

bool is_in_process_query(GstQuery* query);
// `context` is null if pictures are not in GPU memory.
void answer_in_process_query(GstQuery* query, GstGLContext* context);

// Information about the compositor in this process that receives the answers of a pad.
struct LocalCompositor {
  bool is_there = false;
  // Share group of the OpenGL contexts of the compositor's pictures; 0 if pictures are not in GPU memory.
  gl::ShareGroup group = 0;
  WeakGlContext context;
};
LocalCompositor find_local_compositor(GstPad* src);

// Name of a query and an event about the video caps that are accepted downstream of the compositor of a view. Knowing
// these caps, lfviewrequest requests pictures of the size and frame rate that the sink needs. It sends the query
// downstream before its first request. The compositor sends the event upstream when the caps may have changed.
// lfviewrequest returns TRUE for the event if its next requests will fit the caps. Fields: LF_VIEW_ID_FIELD (uint),
// "caps" (GstCaps).
#define LF_PICTURE_CAPS "lightfield-picture-caps"

// Asks the compositor of the view for the accepted video caps. Returns null if there is no compositor downstream of
// this source pad.
SharedCaps query_picture_caps(GstPad* src, guint view_id);
void answer_picture_caps_query(GstQuery* query, GstCaps* caps);

GstEvent* picture_caps_event(guint view_id, GstCaps* caps);
SharedCaps parse_picture_caps(GstEvent* event, guint* view_id);

// Custom upstream event with the results of a picture (see ViewFeedback), from a compositor to the lfviewrequest of its
// view. Its only field, "feedback", is a boxed std::shared_ptr<const ViewFeedback>, so copies of the event share one
// object.
#define LF_VIEW_FEEDBACK_EVENT "lightfield-feedback"
// Custom downstream query of lfviewrequest that finds out whether a compositor estimates depths for its view. The field
// "lightfield-view-id" (uint) is the view. If the compositor returns TRUE, it will send ViewFeedback with the depths.
#define LF_FOCUS_QUERY "lightfield-finds-focus"

// Results that a compositor returns after a picture, for the next requests of the view: estimated depths, failed
// cameras, and extra requests.
struct ViewFeedback {
  guint view_id = 0;
  std::optional<DepthEstimate> focus;
  // Cameras that requests must leave out, beginning with the next request. The list replaces the list of earlier
  // events.
  std::optional<CameraSet> out_of_service;
  // Requests to send once, together with the next request. The receiver uses only their view, cameras out of service,
  // rig and probe flag.
  std::vector<ViewRequest> extra_requests;
};

GstEvent* view_feedback_event(ViewFeedback feedback);
std::shared_ptr<const ViewFeedback> parse_view_feedback(GstEvent* event);

// Returns true if a compositor downstream of this source pad estimates depths for the view. *waits (may be null)
// becomes true if that compositor is blocked by its own downstream, for example in a paused pipeline.
bool finds_focus(GstPad* src, guint view_id, bool* waits = nullptr);
// Answers LF_FOCUS_QUERY. `waits` means that the compositor is blocked by its own downstream.
void set_focus_waits(GstQuery* query, bool waits);

// Returns the view of a query with this name (LF_FOCUS_QUERY or LF_PICTURE_CAPS). Returns nothing for other queries.
std::optional<guint> view_of_query(GstQuery* query, const char* name);

}  // namespace lf
