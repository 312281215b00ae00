// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include <gst/gst.h>

#include "common/gst_pointers.h"
#include "rig/rig.h"

// Names of the request pads and their templates, see DepthOutput.
#define LF_DEPTH_PAD "depth_src"
#define LF_CONFIDENCE_PAD "confidence_src"

namespace lf {

// The request pads of lfcompositor that deliver the depths of each picture and their confidences. The documentation in
// lfcompositor.cc describes the values. The depths come from the meta "lightfield-view" of the picture, so they always
// have the pose and the time of the picture. The pads have the events of the source pad `src`. add_pad(), remove_pad()
// and, for flushes, forward() are thread-safe. Call the other functions in the streaming thread.
class DepthOutput {
 public:
  explicit DepthOutput(GstElement* element) : element_(element) {}

  // Adds a pad of this template. Returns null if it exists already.
  GstPad* add_pad(GstPadTemplate* templ);
  // Removes a pad. Returns false if the pad is none of these pads.
  bool remove_pad(GstPad* pad);
  // Sets the rig and the limits of the search, which determine the scale of the depths. A limit of 0 is unknown.
  void set_rig(std::shared_ptr<const Rig> rig);
  void set_limits(double near, double far);

  // The pictures of the existing pads for one picture of the view.
  struct Output {
    PadPtr pad;
    BufferPtr buffer;
  };
  std::vector<Output> make(GstBuffer* picture);
  // Pushes the result of make(), after the picture. `src_flow` is the result of pushing the picture. Returns the result
  // for the element: an error of any pad, or OK if any pad is linked.
  GstFlowReturn push(std::vector<Output> outputs, GstPad* src, GstFlowReturn src_flow);
  // Sends an event of the source pad to the existing pads, if it concerns them: the end of the stream, and flushes.
  // Call this from a probe, which does not hold the stream lock for flushes.
  void forward(GstEvent* event, GstPad* src);

 private:
  // A value v stands for the inverse depth offset + v * scale, in 1/m.
  struct Values {
    double scale = 0, offset = 0;
  };
  const Values& values();
  GstCaps* caps_of(GstPad* pad, GstPad* src);
  void push_headers(GstPad* pad, GstPad* src);
  std::vector<PadPtr> pads() const;

  GstElement* const element_;
  std::vector<GstPad*> pads_;  // borrowed; guarded by the object lock
  std::shared_ptr<const Rig> rig_;
  double near_ = 0, far_ = 0;
  Values values_;  // the scale is 0 if they are not computed for the rig and the limits
};

}  // namespace lf
