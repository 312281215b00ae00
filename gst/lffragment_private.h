// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <set>

#include "camera_image.h"
#include "fragment_node.h"
#include "lffragment.h"
#include "wire/fragment_codec.h"

// What the files of lffragment share: lffragment.cc (the element), fragment_camera_pad.cc (camera video in) and
// fragment_lane.cc (requests in, answers out).

struct _LfFragmentPad {
  GstPad parent;
  gint camera;  // id in the rig, -1: told by the stream, else the pad's number
  struct Input {
    std::shared_ptr<lf::CameraFrames> frames;
    std::optional<GstVideoInfo> new_format;  // from the caps, until the next frame
    std::unique_ptr<lf::FrameConverter> converter;
    lf::CameraIndex index = lf::MeshFace::kNone;  // once known
    lf::CameraIndex from_stream = lf::MeshFace::kNone;
    bool live = false;  // known from the segment on
  } * input;
};

// One requester: a request pad and the answer pad it pairs with.
struct Lane {
  GstPad* request = nullptr;
  GstPad* src = nullptr;
  lf::FragmentNode::Requester requester;
  lf::wire::FragmentEncoder encoder;  // streaming thread
  bool live = false;                  // requests come in real time; known from the segment on
  bool ended = false;                 // has sent EOS; under the object lock of the element
};

struct _LfFragment {
  GstElement parent;
  gchar* rig_path;
  guint node_id;
  lf::FragmentNode* node;
  std::set<Lane*>* lanes;       // under the object lock
  lf::CameraFrames::Mode mode;  // of all cameras; under the object lock
  guint next_camera_pad, next_lane;
};

// Whether what comes to this sink pad comes in real time.
bool lf_fragment_upstream_is_live(GstPad* sink);
// Stops, starts or finishes all cameras.
void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode);

// A new camera pad, not yet added to the element. `mode`: of the node's other cameras.
GstPad* lf_fragment_camera_pad_new(GstPadTemplate* templ, const gchar* name, lf::CameraFrames::Mode mode);
// Forgets frames, format and camera.
void lf_fragment_camera_pad_reset(LfFragment* self, LfFragmentPad* pad);

// A new lane with both its pads added to the element.
Lane* lf_fragment_lane_new(LfFragment* self, GstPadTemplate* request, const gchar* request_name, GstPadTemplate* src,
                           const gchar* src_name);
Lane* lf_fragment_lane_of(GstPad* pad);
