// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "view/view_request.h"

// Name of the GstCustomMeta that describes the view of a picture. lfcompositor.cc documents the fields.
#define LF_VIEW_META "lightfield-view"

namespace lf {

// Registers the meta, once. Converters and encoders copy this meta.
void register_view_meta();

// What is known of the picture of one view.
struct ViewFacts {
  ViewRequest request;
  std::optional<uint64_t> capture_time;  // nanoseconds
  double coverage = -1;                  // share of the view that cameras can see; negative: not known
  unsigned fragments = 0, missing = 0, damaged = 0;
  CameraSet missing_cameras;               // cameras that gave nothing to the picture
  std::vector<std::string> missing_nodes;  // nodes that had not answered

  // Whether nothing is missing, as counted in `stats` of lfcompositor.
  bool complete() const { return fragments > 0 && missing == 0 && damaged == 0; }
};

// Collects the facts about the views of one picture. Not thread-safe.
class ViewMeta {
 public:
  // Adds a view to the current picture, or begins the next picture.
  void add(ViewFacts facts);
  // Adds the meta to the finished picture. A repeated picture already has a meta and keeps it.
  void attach(GstBuffer* picture);
  void clear() { views_.clear(); }

 private:
  std::vector<ViewFacts> views_;  // in request order: the leading view is first
};

}  // namespace lf
