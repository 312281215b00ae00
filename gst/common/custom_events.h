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
#include "focus/view_focus.h"
#include "rig/mesh.h"
#include "view/view_request.h"

// Custom events and queries by which viewers, nodes and compositors tell each other what is not in the data, and what
// follows from them.
namespace lf {

// Custom upstream event from a compositor's request pad, before and behind a seek that flushes: who makes requests
// waits in between. A funnel passes the seek to one viewer after the other, and each flush drops what is on its way
// from all of them; so none begins again before the last one has flushed. Field "held" (boolean); the sequence number
// is that of the seek.
#define LF_HOLD_EVENT "lightfield-hold"

// A new event, owned by the caller.
GstEvent* hold_event(bool held, guint32 seqnum);
// False if the event is another one.
bool parse_hold(GstEvent* event, bool* held);

// Takes each seek once, though it comes several times: through the compositor's request pad and, by way of the nodes,
// through its answer pads; and from every compositor behind a tee. Thread-safe.
class SeekOnce {
 public:
  // Whether the seek with this number is another one than the latest.
  bool is_new(guint32 seqnum) { return seqnum_.exchange(seqnum) != seqnum; }
  void clear() { seqnum_ = GST_SEQNUM_INVALID; }

 private:
  std::atomic<guint32> seqnum_ = GST_SEQNUM_INVALID;
};

// Custom upstream event from a node's request pad: how old captures have to be for its live cameras to have them. Field
// "delay" (uint64, nanoseconds).
#define LF_CAPTURE_DELAY_EVENT "lightfield-capture-delay"

GstEvent* capture_delay_event(GstClockTime delay);
// False if it is another event.
bool parse_capture_delay(GstEvent* event, GstClockTime* delay);

// The capture delay that lfviewrequest follows: what nodes need. Grows at once, and shrinks when much less has been
// enough for some seconds. Thread-safe.
class AutoCaptureDelay {
 public:
  static constexpr GstClockTime kMost = 2 * GST_SECOND;  // no camera should take longer
  static constexpr GstClockTime kMemory = 10 * GST_SECOND;

  // A node says what it needs. True if the delay is another one from now on. `now`: of any steady clock.
  bool take(GstClockTime needed, GstClockTime now);
  GstClockTime delay() const;
  void clear();

 private:
  struct Report {
    GstClockTime time, needed;
  };
  mutable std::mutex mutex_;
  std::deque<Report> reports_;  // what nodes said within the last kMemory, each larger than all that came after it
  GstClockTime since_ = 0;      // when the first report of all came
  GstClockTime delay_ = 0;
};

// What QoS events say: which requests' pictures would come too late to be shown. Such an event is of one view, which
// lfcompositor writes into it: nodes answer several. Thread-safe.
class QosWatch {
 public:
  // The view that a QoS event names.
  static std::optional<uint32_t> view_of(GstEvent* event);
  // Writes the name of a view into the event, or into a copy where others have the event, too. Takes and gives a
  // reference.
  static GstEvent* name_view(GstEvent* event, uint32_t view_id);

  struct Late {
    GstClockTimeDiff jitter;  // nanoseconds by which pictures are late
    gdouble proportion;       // time that frames take over time there is
  };
  // Takes note of a QoS event that names its view. `live`: it comes no sooner if some are left out.
  void see(GstEvent* event, bool live);
  // Whether what is to be shown at this running time comes too late.
  std::optional<Late> late(uint32_t view_id, GstClockTime running_time) const;
  void clear();

 private:
  struct View {
    GstClockTime earliest;  // running time
    gdouble proportion;
  };
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
};

// Custom query with which a node asks downstream whether the compositor is in its process: lfcompositor answers TRUE.
// Elements that keep buffers as they are (queue, tee, identity, funnel) pass it on; files, sockets and payloaders don't
// know it. "context" (GstGLContext) is in it where the compositor's pictures are in a graphics card's memory: sums that
// the node renders in a context which shares with that one need not leave the card.
#define LF_IN_PROCESS_QUERY "lightfield-in-process"

bool is_in_process_query(GstQuery* query);
// Answers it. `context`: null if pictures are not in a card's memory.
void answer_in_process_query(GstQuery* query, GstGLContext* context);

// The compositor that answers pushed on this pad come to in this process.
struct NearCompositor {
  bool is_there = false;
  // The contexts of its pictures; 0: they are not in a card's memory. One of them, as long as it is there.
  gl::ShareGroup group = 0;
  WeakGlContext context;
};
NearCompositor near_compositor(GstPad* src);

// The video that is accepted behind the compositor of a view: fields LF_VIEW_ID_FIELD (uint) and "caps" (GstCaps).
// lfviewrequest asks for it with a custom query, downstream, before its first request. The compositor tells it with a
// custom event, upstream, when it may have changed. The event is taken if the next requests are for such pictures.
#define LF_PICTURE_CAPS "lightfield-picture-caps"

// The answer of the view's compositor, downstream of this source pad. Null if there is no such compositor.
SharedCaps query_picture_caps(GstPad* src, guint view_id);
// Whether the query is one, and for which view.
bool is_picture_caps_query(GstQuery* query, guint* view_id);
void answer_picture_caps_query(GstQuery* query, GstCaps* caps);

// A new event, owned by the caller.
GstEvent* picture_caps_event(guint view_id, GstCaps* caps);
// Null if the event is another one.
SharedCaps parse_picture_caps(GstEvent* event, guint* view_id);

// What a compositor has learnt of its view goes upstream, from its request pad to whoever makes the view's requests, as
// one custom event. Its only field, "feedback", is a boxed std::shared_ptr<const ViewFeedback>, so copies of the event
// share the feedback.
#define LF_VIEW_FEEDBACK_EVENT "lightfield-feedback"
// The custom query, downstream, asks whether a compositor of the view (field "lightfield-view-id", uint) will send
// surfaces.
#define LF_FOCUS_QUERY "lightfield-finds-focus"

struct ViewFeedback {
  guint view_id = 0;
  // The focal surface of the next request.
  std::optional<FoundFocus> focus;
  // The cameras that are out of service from the next request on, in place of those that an earlier event named.
  std::optional<CameraSet> out_of_service;
  // Requests that are to be made beside the next one, once. Of each only the view, the cameras out of service, the rig
  // and whether it is a probe count.
  std::vector<ViewRequest> extra_requests;
};

// A new event, owned by the caller.
GstEvent* view_feedback_event(ViewFeedback feedback);
// Null if the event is another one.
std::shared_ptr<const ViewFeedback> parse_view_feedback(GstEvent* event);

// A GstValueArray of uint, the indices of the cameras, as the messages of elements have it.
void set_cameras(GstStructure* structure, const char* field, const CameraSet& cameras);

// Whether somebody downstream of this source pad finds the focus of the view. *waits (may be null): whether who does is
// waiting for its own downstream, as in a pipeline that is paused, and can't get on until that lets it.
bool is_focus_found(GstPad* src, guint view_id, bool* waits = nullptr);
// Writes into the query that a compositor finds the view's focus, and whether it waits for its own downstream.
void set_focus_waits(GstQuery* query, bool waits);
// Whether the query asks for who finds a view's focus, and of which view.
bool is_focus_query(GstQuery* query, guint* view_id);

}  // namespace lf
