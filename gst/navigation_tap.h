// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
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

  // Calls `navigated` for every upstream event at a source pad of the element `name` in the pipeline of `element`, in
  // the thread that sends it. False if there is no such element, or it has no source pad.
  bool attach(GstElement* element, const std::string& name, std::function<void(GstEvent*)> navigated);
  void detach();

 private:
  std::function<void(GstEvent*)> navigated_;
  std::vector<std::pair<GstPad*, gulong>> probes_;
};

}  // namespace lf
