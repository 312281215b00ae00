// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/contribution_map.h"
#include "rig/rig.h"
#include "view/view_request.h"

// Name of the GstCustomMeta on each picture. It describes the view that the picture shows, for applications that need
// the pose or the capture time. The documentation in lfcompositor.cc lists its fields.
#define LF_VIEW_META "lightfield-view"

namespace lf {

// Registers the meta, so that converters and encoders copy it to their output.
void register_view_meta();

// The facts about one view of a picture that the meta reports: the request, and how complete its answers were.
struct ViewMetaEntry {
  ViewRequest request;
  std::optional<uint64_t> capture_time;
  std::optional<MeanCoverage> coverage;  // nothing: unknown
  unsigned fragments = 0, missing = 0, damaged = 0;
  CameraSet missing_cameras;
  std::vector<std::string> missing_nodes;
  std::shared_ptr<const FocalMap> confidence;  // of the surface, see DepthConfidence::map(); null: unknown

  // True if nothing is missing, as counted in `stats` of lfcompositor.
  bool complete() const { return fragments > 0 && missing == 0 && damaged == 0; }
};

// Collects the entries of all views of a set, and attaches them to the finished picture as one LF_VIEW_META. Not
// thread-safe.
class ViewMeta {
 public:
  void add(ViewMetaEntry facts);
  // Adds the meta to the finished picture. A repeated picture keeps the meta that it has.
  void attach(GstBuffer* picture);
  void clear() { views_.clear(); }

 private:
  std::vector<ViewMetaEntry> views_;  // in the order of the requests
};

// Copies the meta of a picture to another buffer that shows the same view.
void copy_view_meta(GstBuffer* from, GstBuffer* to);

// One view of a picture, and its position in a set of views.
struct PictureView {
  View view;
  std::shared_ptr<const FocalMap> confidence;  // see ViewMetaEntry
  int column = 0, row = 0;
};
// Returns the views of a picture from its LF_VIEW_META: one view, or all views of a set. Returns no views if the meta
// is incomplete.
std::vector<PictureView> views_of_picture(const GstStructure* picture);

}  // namespace lf
