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
#include "composite/assembly.h"
#include "composite/camera_health.h"
#include "composite/depth_loop.h"
#include "composite/latency_control.h"
#include "composite/view_weights.h"
#include "compositor/compositor_stats.h"
#include "compositor/depth_output.h"
#include "compositor/node_input.h"
#include "compositor/picture_output.h"
#include "compositor/view_meta.h"
#include "focus/depth_estimator.h"
#include "node/answer_encoder.h"
#include "quality/camera_monitor.h"

#define LF_TYPE_COMPOSITOR (lf_compositor_get_type())
G_DECLARE_FINAL_TYPE(LfCompositor, lf_compositor, LF, COMPOSITOR, GstAggregator)

// Default of the property "latency" of GstAggregator, which is the time that a live picture may wait for answers. The
// value is a frame period at 15 frames per second.
#define LF_COMPOSITOR_LATENCY (60 * GST_MSECOND)

// Values of the property "gains" (exposure compensation), which also accepts booleans.
typedef enum {
  LF_COMPOSITOR_GAINS_OFF = 0,
  LF_COMPOSITOR_GAINS_ON = 1,
  LF_COMPOSITOR_GAINS_AUTO,
} LfCompositorGains;

namespace lf {

// The properties of lfcompositor, except for `limits`, which is part of its RequestGuard.
struct CompositorSettings {
  guint view_id = 0;
  std::string rig;
  guint background = 0xff000000;
  bool post_messages = false;
  LfCompositorIncomplete incomplete = LF_COMPOSITOR_INCOMPLETE_CONCEAL;
  guint max_missed = 5;  // a sixth of a second at 30 pictures per second
  bool partial = false;
  guint node = 0;
  CodecChoice codec = CodecChoice::kAuto;
  FocusMode focus = FocusMode::kAuto;
  double focus_near = 0, focus_far = 0;
  guint monitor_interval = 0;
  guint depth_interval = 1;
  LfCompositorGains gains = LF_COMPOSITOR_GAINS_AUTO;
  WeightOverlayMode show = WeightOverlayMode::kNone;

  // Returns the settings for depth estimation. Depths are not estimated if the property `focus` is `auto` and there is
  // no rig. An inner compositor of a tree (partial=true) never estimates depths, because the root of the tree does.
  DepthEstimator::Settings view_depths() const;
  // Returns a warning for the user about settings that have no effect, or "" if all settings have an effect.
  std::string ignored_settings() const;

  // Returns true if exposure compensation is active. `has_colour` means that the rig contains colour corrections, which
  // make exposure compensation unnecessary in the mode `auto`.
  bool match_gains(bool has_colour) const {
    return gains == LF_COMPOSITOR_GAINS_ON || (gains == LF_COMPOSITOR_GAINS_AUTO && !has_colour);
  }

  static PropertyTable<CompositorSettings>& properties();

 private:
  // Returns true if the limits of the focus are valid: the near limit must be nearer than the far limit (0: no limit).
  // Otherwise both limits are ignored.
  bool has_focus_range() const { return focus_far == 0 || focus_near < focus_far; }
};

}  // namespace lf

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);

// The state of an lfcompositor. Two files share it: lfcompositor.cc (properties, pads, events and queries) and
// composition.cc (requests, answers and pictures).

struct _LfCompositor {
  GstAggregator parent;
  GstPad* request;

  // Guarded by the object lock.
  lf::CompositorSettings* settings;
  // New rig of a running element, used from the next request on; null if there is none.
  std::shared_ptr<const lf::Rig>* new_rig;

  lf::RequestGuard* guard;

  struct State {
    explicit State(GstAggregator* self) : output(self), depths(GST_ELEMENT(self)) {}

    lf::CompositorStats stats;
    lf::QosTracker qos;
    lf::SilenceDetector silence;  // see SilenceDetector for thread safety
    // Whether the pipeline is live. This is cached, because GstAggregator would send queries to all pads.
    std::atomic<bool> live = false;
    std::atomic<double> extent = 0;  // width of the array, metres; see array_extent()
    std::atomic<bool> request_flushed = false;
    std::atomic<bool> over = false;
    std::atomic<guint32> seek_seqnum = GST_SEQNUM_INVALID;  // the latest seek

    // Streaming thread.
    lf::CompositorSettings settings;
    std::shared_ptr<const lf::Rig> rig;
    std::optional<lf::ViewRequest> current;  // the request of the picture in progress; its buffer stays on the pad
    lf::Assembly assembly;
    uint64_t bytes = 0;
    int64_t adding = 0;
    lf::RequestHistory past;
    lf::CameraHealth health;
    lf::CameraRanges cameras_without_frame;  // file cameras without a frame in the latest answers
    lf::CameraSet corners;  // hull of the array, see lf::mesh_exclusions()
    lf::DepthLoop focus;
    lf::ProbeScheduler turns;
    lf::ViewCoverage coverage;
    lf::PictureOutput output;
    lf::DepthOutput depths;
    lf::ViewMeta view_meta;
    bool warned_rig = false;
    bool warned_unseen = false;
    std::optional<uint32_t> first_set;  // sequence number of the first request of the first set
    bool warned_unlinked = false;       // already warned since the start or the latest successful push
    int64_t latency_query_time = 0;
    lf::LatencyControl latency;
  } * state;
};

lf::CompositorSettings lf_compositor_settings(LfCompositor* self);
guint lf_compositor_view_id(LfCompositor* self);
bool lf_compositor_is_live(LfCompositor* self);
// Returns the raw video caps that downstream accepts.
lf::SharedCaps lf_compositor_accepted_caps(LfCompositor* self);

GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean timeout);
GstClockTime lf_compositor_next_time(GstAggregator* agg);
void lf_compositor_use_rig(LfCompositor* self, std::shared_ptr<const lf::Rig> rig);
void lf_compositor_forget_request(LfCompositor* self);
// Tells the view's lfviewrequest the accepted caps. Returns true if the next requests will match these caps.
bool lf_compositor_announce_caps(LfCompositor* self);
