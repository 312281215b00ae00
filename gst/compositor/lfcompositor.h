// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include <gst/base/gstaggregator.h>
#include <gst/gst.h>

#include "common/common.h"
#include "common/custom_events.h"
#include "common/gst_pointers.h"
#include "common/gst_wire.h"
#include "common/properties.h"
#include "common/request_guard.h"
#include "composite/answer_watch.h"
#include "composite/assembly.h"
#include "composite/focus_finder.h"
#include "composite/view_weights.h"
#include "compositor/compositor_stats.h"
#include "compositor/node_input.h"
#include "compositor/picture_output.h"
#include "compositor/view_meta.h"
#include "focus/focus_control.h"
#include "node/answer_encoder.h"
#include "quality/camera_monitor.h"

G_BEGIN_DECLS

#define LF_TYPE_COMPOSITOR (lf_compositor_get_type())
G_DECLARE_FINAL_TYPE(LfCompositor, lf_compositor, LF, COMPOSITOR, GstAggregator)

// Property "latency" at first, of GstAggregator: a frame period at 15/s. Only live pipelines wait for it.
#define LF_COMPOSITOR_LATENCY (60 * GST_MSECOND)

// Property "incomplete": LfCompositorIncomplete.
#define LF_TYPE_COMPOSITOR_INCOMPLETE (lf_compositor_incomplete_get_type())
GType lf_compositor_incomplete_get_type(void);

// Property "focus": lf::FocusMode.
#define LF_TYPE_COMPOSITOR_FOCUS (lf_compositor_focus_get_type())
GType lf_compositor_focus_get_type(void);

// Property "show": lf::ShownWeights.
#define LF_TYPE_COMPOSITOR_SHOW (lf_compositor_show_get_type())
GType lf_compositor_show_get_type(void);

// Property "gains": whether cameras match their brightness. A truth value sets it, too.
typedef enum {
  LF_COMPOSITOR_GAINS_OFF = 0,
  LF_COMPOSITOR_GAINS_ON = 1,
  LF_COMPOSITOR_GAINS_AUTO,
} LfCompositorGains;
#define LF_TYPE_COMPOSITOR_GAINS (lf_compositor_gains_get_type())
GType lf_compositor_gains_get_type(void);

GST_ELEMENT_REGISTER_DECLARE(lfcompositor);

G_END_DECLS

namespace lf {

// lfcompositor's properties, but for the limits of its RequestGuard.
struct CompositorSettings {
  guint view_id = 0;
  std::string rig;
  guint background = 0xff000000;  // 0xAARRGGBB
  bool post_messages = false;
  LfCompositorIncomplete incomplete = LF_COMPOSITOR_INCOMPLETE_CONCEAL;
  guint max_missed = 5;  // a sixth of a second at 30 pictures a second
  bool partial = false;
  guint node = 0;
  CodecChoice codec = CodecChoice::kAuto;
  FocusMode focus = FocusMode::kAuto;
  double focus_near = 0, focus_far = 0;  // metres
  guint monitor_interval = 0;
  guint trial_interval = 1;
  LfCompositorGains gains = LF_COMPOSITOR_GAINS_AUTO;
  ShownWeights show = ShownWeights::kNone;

  // What a view is focused on: `auto` is for arrays that are known, and a compositor inside a tree leaves it to the
  // root.
  FocusControl::Settings view_focus() const;
  // What is set and can have no effect beside the other settings, and why, for a person to read; empty if nothing is.
  std::string without_effect() const;

  // Whether cameras match their brightness. `has_colour`: the rig in use says how their colours are to be corrected.
  bool match_gains(bool has_colour) const {
    return gains == LF_COMPOSITOR_GAINS_ON || (gains == LF_COMPOSITOR_GAINS_AUTO && !has_colour);
  }

  static PropertyTable<CompositorSettings>& properties();

 private:
  // False if the near end of the range of depths is not nearer than the far one: then the scene decides on both.
  bool has_focus_range() const { return focus_far == 0 || focus_near < focus_far; }
};

}  // namespace lf

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);

// What the files of lfcompositor share: lfcompositor.cc (properties, pads, events, queries) and composition.cc
// (requests and answers in, pictures out).

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

// lfcompositor.cc
// A copy of the properties, as they are now.
lf::CompositorSettings lf_compositor_settings(LfCompositor* self);
guint lf_compositor_view_id(LfCompositor* self);
bool lf_compositor_is_live(LfCompositor* self);
// The video that is accepted downstream.
lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self);

// composition.cc
GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean timeout);
GstClockTime lf_compositor_next_time(GstAggregator* agg);
// From now on `rig` is in use; null: none.
void lf_compositor_use_rig(LfCompositor* self, std::shared_ptr<const lf::Rig> rig);
void lf_compositor_forget_request(LfCompositor* self);
// Tells upstream which video is accepted downstream. Whether the next requests are for such pictures.
bool lf_compositor_tell_caps(LfCompositor* self);
