// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <gst/gst.h>

namespace lf {

// Listens to what a window says to another branch of the pipeline: pictures that come off a network end at a source
// that knows nothing of views.
class NavigationTap {
 public:
  ~NavigationTap() { detach(); }

  // Calls `navigated` with `element` for every upstream event at a source pad of the element `name` in its pipeline, in
  // the thread that sends it. Such a call may still be under way, or begin, when detach() has returned; the element
  // lives as long. False if there is no such element, or it has no source pad.
  bool attach(GstElement* element, const std::string& name, void (*navigated)(GstElement*, GstEvent*));
  void detach();

 private:
  std::vector<std::pair<GstPad*, gulong>> probes_;
};

}  // namespace lf
