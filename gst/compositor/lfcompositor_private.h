// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "common/buffer_ptr.h"
#include "common/common.h"
#include "common/gst_wire.h"
#include "common/qos_watch.h"
#include "common/request_guard.h"
#include "composite/assembly.h"
#include "composite/camera_health.h"
#include "composite/focus_finder.h"
#include "composite/past_requests.h"
#include "composite/silence_watch.h"
#include "composite/view_coverage.h"
#include "compositor/compositor_settings.h"
#include "compositor/compositor_stats.h"
#include "compositor/lfcompositor.h"
#include "compositor/node_input.h"
#include "compositor/picture_output.h"
#include "compositor/view_meta.h"
#include "quality/camera_turns.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_compositor_debug

// What the files of lfcompositor share: lfcompositor.cc (the element), compositor_properties.cc, compositor_answers.cc
// (requests in, and when they are answered), compositor_take.cc (answers in), compositor_finish.cc (how a request
// ends), compositor_feedback.cc (what its viewer is told), compositor_record.cc (what is said of a picture),
// compositor_time.cc and compositor_pads.cc (events, queries, pads).

struct _LfCompositor {
  GstAggregator parent;
  GstPad* request;

  // Under the object lock.
  lf::CompositorSettings* settings;
  // A rig set while running, which counts from the next request on; null: none.
  std::shared_ptr<const lf::Rig>* new_rig;

  lf::RequestGuard* guard;  // thread-safe

  struct State {
    explicit State(GstAggregator* self) : output(self) {}

    // Any thread.
    lf::CompositorStats stats;
    lf::QosWatch qos;
    lf::SilenceWatch silence;  // says itself which of its functions which thread may call
    // Whether the stream is live, as it was last seen to be: asking takes queries to all pads.
    std::atomic<bool> live = false;
    std::atomic<double> extent = 0;             // metres that the array is wide, see array_extent()
    std::atomic<bool> request_flushed = false;  // the current request is gone
    std::atomic<bool> over = false;             // nobody takes pictures any more, or none will be asked for

    // Streaming thread.
    lf::CompositorSettings settings;  // copied when aggregate() is called
    std::shared_ptr<const lf::Rig> rig;
    std::optional<lf::ViewRequest> current;  // the request at the head of the request pad
    lf::Assembly assembly;                   // what the answers to the current request have come to
    uint64_t bytes = 0;                      // bytes of the current request's answers
    int64_t adding = 0;                      // microseconds spent adding the current request's answers
    lf::PastRequests past;
    lf::CameraHealth health;
    lf::CameraRanges gone;  // not live: cameras that had no picture in the latest answers, which nodes leave out
    lf::CameraSet corners;  // the array's corners, see lf::out_of_mesh()
    lf::FocusFinder focus;
    lf::CameraTurns turns;
    lf::ViewCoverage coverage;
    lf::PictureOutput output;
    lf::ViewMeta view_meta;
    bool warned_rig = false;
    bool warned_unseen = false;         // since the start
    std::optional<uint32_t> first_set;  // number of the request that the first set began with
    bool warned_unlinked = false;       // since the start, or since a picture was taken
    int64_t latency_asked_at = 0;       // monotonic time, microseconds
  } * state;
};

// compositor_properties.cc
void lf_compositor_install_properties(GObjectClass* klass);
lf::RequestGuard* lf_compositor_guard_new();
// A copy of the properties, as they are now.
lf::CompositorSettings lf_compositor_settings(LfCompositor* self);
// Posts a warning of what is set without effect, but where it is the same as `before`.
void lf_compositor_warn_without_effect(LfCompositor* self, const std::string& before = "");
guint lf_compositor_view_id(LfCompositor* self);

// compositor_answers.cc
GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean timeout);
GstClockTime lf_compositor_next_time(GstAggregator* agg);
// From now on `rig` is in use; null: none.
void lf_compositor_use_rig(LfCompositor* self, std::shared_ptr<const lf::Rig> rig);
void lf_compositor_forget_request(LfCompositor* self);
// The current request gets no picture, and there is room for the next.
void lf_compositor_drop_request(LfCompositor* self);

// compositor_take.cc
// Adds what has come from a node for the current request, up to its last part.
void lf_compositor_take_answers(LfCompositor* self, lf::NodeInput& node);

// compositor_finish.cc
// Puts out the picture of the current request as it is now, and makes room for the next.
GstFlowReturn lf_compositor_finish_request(LfCompositor* self, const lf::NodeInputs& nodes);
// Whether the current request's picture would come too late, as who shows them says.
std::optional<lf::QosWatch::Late> lf_compositor_is_too_late(LfCompositor* self);
// Leaves the current request out. That says nothing of the nodes: they have left it out, too.
void lf_compositor_skip_request(LfCompositor* self, const lf::QosWatch::Late& late);

// compositor_time.cc
bool lf_compositor_is_live(LfCompositor* self);
// The clock's time now; GST_CLOCK_TIME_NONE without a clock.
GstClockTime lf_compositor_clock_time(LfCompositor* self);
GstClockTime lf_compositor_running_time(LfCompositor* self, GstBuffer* request);
// When the picture of the request at the head of its pad has to be out, in clock time.
GstClockTime lf_compositor_deadline(LfCompositor* self);
// Asks for the latency again if the request at the head of the pad has come later than the latency allows.
void lf_compositor_refresh_latency(LfCompositor* self);

// compositor_record.cc
// The capture time of the current request's picture, or kNoTime.
uint64_t lf_compositor_capture_time(LfCompositor* self);
void lf_compositor_note_capture_time(GstBuffer* picture, uint64_t captured);
// The current request is left out, as its picture would come too late: counts it and says so.
void lf_compositor_record_skipped(LfCompositor* self, const lf::QosWatch::Late& late);
// Counts the picture, posts its message, and notes what its meta will say. `answered`: monotonic time, microseconds.
void lf_compositor_record(LfCompositor* self, const lf::NodeInputs& nodes, int64_t answered, GstClockTime pts);

// compositor_feedback.cc
// Tells upstream which video is accepted downstream. Whether the next requests are for such pictures.
bool lf_compositor_tell_caps(LfCompositor* self);
// Tells upstream and the application which cameras are out of service.
void lf_compositor_announce_out_of_service(LfCompositor* self);
// Tells upstream where the next request is to be focused, from what came of the trials of the current one.
void lf_compositor_find_focus(LfCompositor* self);
// The current request has been composed: asks for a camera's turn, if it is time.
void lf_compositor_monitor(LfCompositor* self);
// The current request is a probe, and answered: it was a camera's turn, or a sweep of depths.
void lf_compositor_take_probe(LfCompositor* self);

// compositor_pads.cc
// The video that is accepted downstream.
lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self);
void lf_compositor_install_pads(LfCompositorClass* klass);
void lf_compositor_add_request_pad(LfCompositor* self);
