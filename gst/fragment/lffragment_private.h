// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <vector>

#include "base/worker_pool.h"
#include "common/gl_share.h"
#include "common/request_guard.h"
#include "common/seek_once.h"
#include "fragment/camera_input.h"
#include "fragment/fragment_settings.h"
#include "fragment/lffragment.h"
#include "fragment/requester.h"
#include "node/card.h"

GST_DEBUG_CATEGORY_EXTERN(lf_fragment_debug);
#undef GST_CAT_DEFAULT  // of another file that is compiled in one with this
#define GST_CAT_DEFAULT lf_fragment_debug

// What the files of lffragment share: lffragment.cc (the element), fragment_properties.cc, fragment_camera_pad.cc
// (camera pads), fragment_cameras.cc (all cameras together), fragment_pad_pair.cc (a requester's pads) and
// fragment_requests.cc (requests in, answers out).

// Properties of a camera pad.
struct LfFragmentPadSettings {
  gint camera = -1;  // id in the rig, -1: told by the stream, else the pad's number
  static lf::PropertyTable<LfFragmentPadSettings>& properties();
};

struct _LfFragmentPad {
  GstPad parent;
  LfFragmentPadSettings settings;
  lf::CameraInput* input;
};

struct _LfFragment {
  GstElement parent;
  struct State {
    // Any thread.
    lf::RequestGuard guard;
    lf::Node node;
    lf::Card card;
    std::shared_ptr<lf::WorkerPool> workers = lf::WorkerPool::shared();
    std::mutex seeking;   // held while cameras are sought
    lf::SeekOnce sought;  // the latest seek that the cameras followed

    // Under the object lock.
    lf::FragmentSettings settings;
    std::set<lf::Requester*> requesters;
    lf::CameraFrames::Mode mode = lf::CameraFrames::Mode::kStopped;  // mode of all cameras
    gint64 trimmed_at = 0;                                           // monotonic time, microseconds
    guint next_camera_pad = 0, next_pair = 0;  // numbers of the next camera pad and of the next pair of pads
    uint32_t next_requester = 0;
    lf::WeakGlContext frames_context;  // of the latest frame that may stay on a card
  } * state;
};

// fragment_properties.cc
void lf_fragment_install_properties(GObjectClass* klass);
_LfFragment::State* lf_fragment_state_new();
// A copy of the properties, as they are now.
lf::FragmentSettings lf_fragment_settings(LfFragment* self);

// fragment_cameras.cc The camera pads of the element, each with a reference.
std::vector<lf::PadPtr> lf_fragment_camera_pads(LfFragment* self);
// Stops, starts or finishes all cameras.
void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode);
// The same if their mode is `before`.
void lf_fragment_change_mode(LfFragment* self, lf::CameraFrames::Mode before, lf::CameraFrames::Mode mode);
// Requests go on at another time: seeks the cameras that are not live there, unless another requester has done so for
// the seek with this number. Waits for no frames.
void lf_fragment_seek_cameras(LfFragment* self, uint64_t time, guint32 seqnum);
// A frame is in textures of this context, where it may stay; null: none is.
void lf_fragment_note_context(LfFragment* self, GstGLContext* context);
// How old captures have to be for the live cameras to have them, at clock time `now`; 0: nothing is known of any.
uint64_t lf_fragment_needed_delay(LfFragment* self, uint64_t now);

// fragment_camera_pad.cc
// A new camera pad, not yet added to the element.
GstPad* lf_fragment_camera_pad_new(LfFragment* self, GstPadTemplate* templ, const gchar* name);

// fragment_pad_pair.cc
// The request pad of a new pair, both of whose pads have been added to the element.
GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request, const gchar* request_name, GstPadTemplate* src,
                             const gchar* src_name);
// Takes both pads away; an answer that is being made ends at once.
void lf_fragment_pair_release(LfFragment* self, GstPad* request);
// Frames come where no requests do any more: memory of answers is given back.
void lf_fragment_trim_memory(LfFragment* self);

// fragment_requests.cc
GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer);
// Does tasks in the threads that the properties allow.
lf::ParallelFor lf_fragment_workers(LfFragment* self);
