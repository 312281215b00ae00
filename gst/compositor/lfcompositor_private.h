// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <optional>
#include <set>

#include <gst/video/video.h>

#include "common/common.h"
#include "common/gst_wire.h"
#include "common/qos_watch.h"
#include "common/request_guard.h"
#include "composite/assembly.h"
#include "composite/camera_health.h"
#include "compositor/ahead_answers.h"
#include "compositor/compositor_stats.h"
#include "compositor/lfcompositor.h"
#include "compositor/picture_pool.h"
#include "focus/view_focus.h"
#include "node/answer_form.h"
#include "quality/camera_monitor.h"
#include "rig/mesh.h"
#include "wire/answer_parts.h"

// What the files of lfcompositor share: lfcompositor.cc (the element), compositor_properties.cc, compositor_answers.cc
// (requests in, and when they are answered), compositor_take.cc (answers in), compositor_finish.cc (how a request
// ends), compositor_focus.cc (their focal surface), compositor_monitor.cc (how well cameras are predicted),
// compositor_output.cc (pictures or partial answers out) and compositor_pads.cc (events, queries, pads).

// The node behind an answer pad, as the current request shows it. Streaming thread.
struct NodeInput {
  enum class Head {
    kUnseen,  // nothing there, or something that has not been looked at
    kDone,    // the last part of the node's answer: it has been added and stays until the picture is done
    kAhead,   // an answer to a later request: the node skipped this one
  };
  Head head = Head::kUnseen;
  GstBuffer* seen = nullptr;          // the buffer that `head` is about; not owned
  lf::wire::AnswerParts parts;        // that have been added
  lf::AheadAnswers ahead;             // live: of later requests
  unsigned missed = 0;                // pictures in a row that had to do without this node
  std::atomic<bool> flushed = false;  // by its own stream alone: what is on the pad is not what it was
  bool answered() const { return head != Head::kUnseen; }
};

struct _LfCompositor {
  GstAggregator parent;
  GstPad* request;

  // Properties, under the object lock.
  std::shared_ptr<const lf::Rig>* new_rig;  // set while running, from the next request on; null: none
  guint view_id;
  gchar* rig_path;
  guint32 background;
  gboolean post_messages;
  LfCompositorIncomplete incomplete;
  guint max_missed;
  gboolean partial;
  guint node;
  lf::CodecChoice codec;
  lf::FocusControl::Settings focus;
  guint monitor_interval;
  guint trial_interval;
  gboolean gains;

  lf::RequestGuard* guard;

  // Streaming thread, but for stats.
  struct State {
    std::shared_ptr<const lf::Rig> rig;
    std::atomic<bool> live = false;  // as it was last seen to be: to ask takes queries to all pads
    std::atomic<double> extent = 0;  // of its array, see array_extent(); any thread
    lf::Assembly assembly;
    std::optional<lf::ViewRequest> current;     // the request at the head of the request pad
    std::atomic<bool> request_flushed = false;  // that one is gone
    // Whether its view is spoken of at all. The first: thread of the request pad, monotonic time, microseconds.
    struct {
      int64_t others_since = 0;  // requests of other views alone
      bool asked = false;
      std::atomic<bool> answered = false;
      int64_t asked_since = 0;  // live, without an answer; streaming thread
      bool warned = false;
    } talk;
    int64_t latency_asked_at = 0;       // monotonic time, microseconds
    std::atomic<bool> pushing = false;  // a picture: downstream may take its time
    std::atomic<bool> over = false;     // nobody takes pictures any more, or none will be asked for
    GstSegment segment{};               // of the output: that of the requests
    GstVideoInfo info{};                // negotiated
    bool negotiated = false;            // since the start
    // What the next picture is like, no width: not known yet. Whether downstream takes it, as it is now.
    struct {
      lf::PixelFamily family = lf::PixelFamily::kNone;
      int width = 0, height = 0;
    } wanted;
    bool agreed = false;
    bool warned_rig = false;
    uint64_t current_bytes = 0;  // of the answers added
    int64_t adding = 0;          // time spent adding them, microseconds
    lf::PicturePool pool;
    struct {
      lf::MeshCache mesh;
      lf::View view;  // of which it is known
      lf::CameraSet out_of_service;
      double share = -1;
      int64_t known_at = 0;  // monotonic, microseconds
    } coverage;
    GstBuffer* last_picture = nullptr;  // live: what an incomplete picture may be replaced or mended with
    uint64_t last_rig = 0;              // hash of the rig that it was made with, 0: not known

    struct Past {
      uint32_t sequence;
      GstClockTime deadline;  // clock time
    };
    std::deque<Past> past;                  // requests that were composed last
    std::optional<uint32_t> last_sequence;  // of the request before
    lf::QosWatch qos;                       // any thread
    std::deque<uint32_t> skipped;           // requests that were left out last
    lf::CameraHealth health;
    uint64_t health_rig = 0;        // hash of the rig whose cameras they are, 0: not known yet
    lf::CameraRanges seeing_since;  // cameras whose answers were in time, but after their picture

    std::shared_ptr<lf::AnswerMemory> memory = std::make_shared<lf::AnswerMemory>();
    bool root_is_near = false;  // the compositor that partial answers go to is in this process

    lf::ViewFocus::Answers answers;  // to the current request's trials and to its question for the mean brightness
    lf::MeanTurns mean_turns;        // since the gains were switched on

    uint64_t moment_bytes = 0;
    lf::FocusControl::Settings focus_settings;  // of `focus`
    lf::FocusControl focus;
    std::optional<lf::FocusArray> focus_array;  // of `rig`
    guint unheard = 0;  // requests for which no surface is looked for, because nobody took the one found last

    struct {
      std::optional<lf::CameraMonitor> cameras;
      uint64_t rig = 0;    // hash of the rig whose cameras they are
      guint requests = 0;  // since the latest turn
      std::optional<lf::CameraProbe> asked;
      std::optional<lf::CoveredPicture> seen;
    } monitor;

    lf::CompositorStats stats;  // any thread
  } * state;
};

// compositor_properties.cc
void lf_compositor_install_properties(GObjectClass* klass);
// The rig of the property; null without one. Posts an error and returns false if it can't be read.
bool lf_compositor_load_rig(LfCompositor* self, std::shared_ptr<const lf::Rig>* rig);

// compositor_answers.cc
guint lf_compositor_view_id(LfCompositor* self);
GstFlowReturn lf_compositor_aggregate(GstAggregator* agg, gboolean timeout);
GstClockTime lf_compositor_next_time(GstAggregator* agg);
void lf_compositor_forget_request(LfCompositor* self);

// compositor_take.cc
// Adds what has come from a node for the current request, up to its last part.
void lf_compositor_take_answers(LfCompositor* self, GstAggregatorPad* pad);
// The next request has this number: where it is one before the last one's, what waits for later ones is thrown away.
void lf_compositor_note_sequence(LfCompositor* self, uint32_t sequence);

// compositor_finish.cc
inline constexpr size_t kMostPast = 32;  // requests whose late answers are still signs of life
struct AnswerPads;
// Of what came for the current request; known once its picture is made.
bool lf_compositor_is_complete(LfCompositor* self);
// Puts out the picture of the current request as it is now, and makes room for the next.
GstFlowReturn lf_compositor_finish_request(LfCompositor* self, const AnswerPads& pads);
// Whether the current request's picture would come too late, as who shows them says.
std::optional<lf::QosWatch::Late> lf_compositor_is_too_late(LfCompositor* self);
// Leaves the current request out. That says nothing of the nodes: they have left it out, too.
void lf_compositor_skip_request(LfCompositor* self, const lf::QosWatch::Late& late);

// compositor_time.cc
bool lf_compositor_is_live(LfCompositor* self);
// GST_CLOCK_TIME_NONE without a clock.
GstClockTime lf_compositor_clock_time(LfCompositor* self);
GstClockTime lf_compositor_running_time(LfCompositor* self, GstBuffer* request);
// When the picture of the request at the head of its pad has to be out, in clock time.
GstClockTime lf_compositor_deadline(LfCompositor* self);
// The latency is asked for again if the request at the head comes later than it says.
void lf_compositor_refresh_latency(LfCompositor* self);

// compositor_record.cc
void lf_compositor_follow_segment(LfCompositor* self);
void lf_compositor_note_capture_time(GstBuffer* picture, uint64_t captured);
// What is put out for the current request; takes the picture, and is null where nothing is.
GstBuffer* lf_compositor_replace_incomplete(LfCompositor* self, GstBuffer* picture);
// The current request is left out, as its picture would come too late: counts it and says so.
void lf_compositor_record_skipped(LfCompositor* self, const lf::QosWatch::Late& late);
// Counts the picture, and posts its message. `answered`: monotonic time, microseconds.
void lf_compositor_record(LfCompositor* self, int64_t answered, GstClockTime pts);

// compositor_health.cc
// All cameras are thought to be well.
void lf_compositor_reset_health(LfCompositor* self);
// Cameras are known by their index, which in another rig may be another camera's or nobody's: all that was known is
// forgotten if this is the hash of another one than before. 0 changes nothing.
void lf_compositor_use_rig_for_health(LfCompositor* self, uint64_t hash);
// Tells upstream and the application which cameras are out of service.
void lf_compositor_announce_out_of_service(LfCompositor* self);

// compositor_focus.cc
// Whether lf_compositor_find_focus() tells upstream of surfaces.
bool lf_compositor_finds_focus(LfCompositor* self);
// What came of the trials of the request before.
void lf_compositor_forget_moments(LfCompositor* self);
// Adds moments that belong to the current request. Negative: they belong to nothing any more; positive: they are of a
// request so many later.
int32_t lf_compositor_take_moments(LfCompositor* self, GstBuffer* buffer);
// What has come, as the moments of one node: what goes before its answer, nothing if nothing has.
std::vector<GstBuffer*> lf_compositor_make_moments(LfCompositor* self, guint node);
// Tells upstream where the next request is to be focused, from what came of the trials of the current one.
void lf_compositor_find_focus(LfCompositor* self);
// The current request is a probe with trials, and answered: tells upstream where it is in focus.
void lf_compositor_answer_sweep(LfCompositor* self);

// compositor_monitor.cc
void lf_compositor_reset_monitor(LfCompositor* self);
// The current request has been composed: asks for a camera's turn, if it is time.
void lf_compositor_monitor(LfCompositor* self);
// The current request is a probe, and answered.
void lf_compositor_take_probe(LfCompositor* self);

// compositor_output.cc
gboolean lf_compositor_negotiate(GstAggregator* agg);
GstFlowReturn lf_compositor_update_src_caps(GstAggregator* agg, GstCaps* downstream, GstCaps** caps);
gboolean lf_compositor_negotiated_src_caps(GstAggregator* agg, GstCaps* caps);
gboolean lf_compositor_decide_allocation(GstAggregator* agg, GstQuery* query);
// The picture, or partial answer, of the current request as it is now. Null if there is none to put out; *flow then
// says why.
GstBuffer* lf_compositor_make_picture(LfCompositor* self, GstFlowReturn* flow);

// compositor_pads.cc
void lf_compositor_install_pads(LfCompositorClass* klass);
void lf_compositor_add_request_pad(LfCompositor* self);
NodeInput& lf_compositor_node_of(GstAggregatorPad* pad);
