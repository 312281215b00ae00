// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>
#include <vector>

#include "rig/camera_ranges.h"
#include "view/view_request.h"

// GstCustomMeta of pictures: which view they show. Its fields are documented in lfcompositor.cc.
#define LF_VIEW_META "lightfield-view"

namespace lf {

// Registers the meta, once. Elements that change pixels copy it.
void register_view_meta();

// What is known of the picture of one view.
struct ViewFacts {
  ViewRequest request;
  std::optional<uint64_t> capture_time;  // nanoseconds
  double coverage = -1;                  // share of the view that cameras can see; negative: not known
  unsigned fragments = 0, missing = 0, damaged = 0;
  CameraSet missing_cameras;               // cameras that gave nothing to the picture
  std::vector<std::string> missing_nodes;  // nodes that had not answered

  // Whether the picture has all that the cameras have to give, as in `stats` of lfcompositor.
  bool complete() const { return fragments > 0 && missing == 0 && damaged == 0; }
};

// Collects the facts about the views of one picture. Not thread-safe.
class ViewMeta {
 public:
  // One more view of the picture, or the first view of the next picture.
  void add(ViewFacts facts);
  // Adds the meta to a picture of the views since the last call, unless it has one: then it is an older picture.
  void attach(GstBuffer* picture);
  void clear() { views_.clear(); }

 private:
  std::vector<ViewFacts> views_;  // in the order of their requests; the one that leads is first
};

}  // namespace lf
