// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "base/worker_pool.h"
#include "common/gst_wire.h"
#include "common/qos_watch.h"
#include "common/request_guard.h"
#include "fragment/camera_image.h"
#include "fragment/fragment_node.h"
#include "fragment/fragment_settings.h"
#include "fragment/lffragment.h"
#include "node/arrival_watch.h"
#include "node/fair_answers.h"
#include "node/work_estimate.h"

// What the files of lffragment share: lffragment.cc (the element), fragment_camera_pad.cc (camera video in),
// fragment_pad_pair.cc (a requester's pads) and fragment_requests.cc (requests in, answers out).

struct _LfFragmentPad {
  GstPad parent;
  gint camera;  // id in the rig, -1: told by the stream, else the pad's number
  struct Input {
    std::shared_ptr<lf::CameraFrames> frames;
    std::optional<GstVideoInfo> new_format;  // from the caps, until the next frame
    bool new_jpeg = false;                   // the caps said so, until the next frame
    std::optional<GstVideoInfo> format;      // of raw frames
    std::unique_ptr<lf::FrameConverter> converter;
    bool jpeg = false;                             // frames are kept as they come
    std::optional<std::pair<int, int>> jpeg_size;  // of these
    bool warned_damaged = false;                   // a person has been told
    std::optional<guint> id;                       // of the camera, once known; set under the element's object lock
    std::optional<guint> from_stream;              // the same as the stream says it
    std::atomic<bool> live = false;                // known from the segment on
    lf::ArrivalWatch arrivals;                     // while live
    GstClockTime latency = 0;                      // the same
  } * input;
};

struct UnrefPad {
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
};
using PadPtr = std::unique_ptr<GstPad, UnrefPad>;

// One pad of a pair for whoever comes through the other one, while both may be released.
class WeakPad {
 public:
  explicit WeakPad(GstPad* pad) { g_weak_ref_init(&ref_, pad); }
  ~WeakPad() { g_weak_ref_clear(&ref_); }
  WeakPad(const WeakPad&) = delete;
  WeakPad& operator=(const WeakPad&) = delete;
  // Null once it is gone.
  PadPtr get() { return PadPtr(static_cast<GstPad*>(g_weak_ref_get(&ref_))); }

 private:
  GWeakRef ref_;
};

// One requester: a request pad and the answer pad it pairs with. Belongs to both of them.
struct PadPair {
  PadPair(LfFragment* element, GstPad* request_pad, GstPad* src_pad);
  WeakPad request, src;
  lf::FragmentNode::Requester requester;
  std::shared_ptr<lf::AnswerMemory> memory = std::make_shared<lf::AnswerMemory>();
  std::atomic<bool> live = false;  // requests come in real time; known from the segment on
  bool ended = false;              // has sent EOS; under the object lock of the element
  // Where its requests are, so that it is seen when they go elsewhere. Streaming thread, but while flushing.
  GstSegment segment{};
  uint64_t last_time = 0;  // asked for
  bool flushed = false;    // since the latest request
  // The capture delay that cameras need, as the requester was told, and when that was and was looked at, clock time.
  uint64_t told_delay = 0, told_at = 0, looked_at = 0;
  lf::QosWatch qos;                            // any thread
  std::atomic<bool> downstream_is_new = true;  // what is known of it is to be asked again
  bool in_process = false;                     // the compositor is; streaming thread
  uint32_t number = 0;                         // its own in the element
  // Live: requests on their way to the answer pad's thread, and what that thread keeps of each view.
  lf::FairAnswers live_answers;
  std::map<uint32_t, std::unique_ptr<lf::FragmentNode::Requester>> view_requesters;
  std::atomic<GstFlowReturn> live_flow = GST_FLOW_OK;  // that the latest answer came to
  lf::WorkEstimate estimate;
};

struct _LfFragment {
  GstElement parent;
  lf::FragmentSettings* settings;  // under the object lock
  lf::Card* card;
  std::shared_ptr<lf::WorkerPool>* workers;
  lf::RequestGuard* guard;
  lf::FragmentNode* node;
  std::set<PadPair*>* pairs;    // under the object lock
  lf::CameraFrames::Mode mode;  // of all cameras; under the object lock
  guint next_camera_pad, next_pair;
  guint32 next_pair_number;
  gint64 trimmed_at;    // monotonic time, microseconds; under the object lock
  GMutex seek_lock;     // held while cameras are sought
  guint32 seek_seqnum;  // of the latest seek of the cameras; under that
};

// A copy of the properties, as they are now.
lf::FragmentSettings lf_fragment_settings(LfFragment* self);

// Whether what comes to this sink pad comes in real time; if so, after which latency at the latest.
bool lf_fragment_upstream_is_live(GstPad* sink, GstClockTime* latency = nullptr);
// Stops, starts or finishes all cameras.
void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode);

// Requests go on at another time: seeks the cameras that are not live there, unless another requester has done so for
// the seek with this number. Waits for no frames.
void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum);

// How old captures have to be for the live cameras to have them, at clock time `now`; 0: nothing is known of any.
uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now);

// A new camera pad, not yet added to the element. `mode`: of the node's other cameras.
GstPad* lf_fragment_camera_pad_new(GstPadTemplate* templ, const gchar* name, lf::CameraFrames::Mode mode);
// Which camera this pad has; posts an error and returns false if there is none such or another pad has it.
bool lf_fragment_assign_camera(LfFragment* self, LfFragmentPad* pad);
// Forgets frames, format and camera.
void lf_fragment_camera_pad_reset(LfFragment* self, LfFragmentPad* pad);

// The request pad of a new pair, both of whose pads have been added to the element.
GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request, const gchar* request_name, GstPadTemplate* src,
                             const gchar* src_name);
PadPair* lf_fragment_pad_pair_of(GstPad* pad);
// The other pad of the same pair; null while both are being released.
PadPtr lf_fragment_other_pad(GstPad* pad);
// fragment_requests.cc
GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer);
// Takes both pads away; an answer that is being made ends at once.
void lf_fragment_pair_release(LfFragment* self, GstPad* request);
