// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include <gst/gst.h>

#include "focus/focus_feedback.h"

namespace lf {

// Files in, files out: where somebody downstream finds the focus of a view, each request has what came of the one
// before. Streaming thread.
class FocusWait {
 public:
  // `src`: which the requests leave by.
  FocusWait(FocusFeedback& feedback, GstPad* src) : feedback_(feedback), src_(src) {}

  // Waits for what comes of the request that was sent last. GST_FLOW_FLUSHING while the feedback is unlocked.
  GstFlowReturn wait(guint view_id);
  // Whether the next request is a rehearsal, so that the stream's first picture is in focus already. After wait().
  bool rehearses();
  bool is_rehearsing() const { return rehearses_; }
  void sent(uint32_t sequence) { last_ = sequence; }
  // What is on its way is flushed: nothing comes of it, and what comes next is a first picture.
  void flush() { last_.reset(), rehearsals_ = 0, rehearses_ = false; }
  void clear() { flush(), awaits_.reset(); }

 private:
  FocusFeedback& feedback_;
  GstPad* const src_;
  std::optional<bool> awaits_;    // whether somebody finds the focus, once it has been asked
  std::optional<uint32_t> last_;  // number of the latest request
  unsigned rehearsals_ = 0;       // rehearsals made before the first picture
  bool rehearses_ = false;        // the latest request
};

}  // namespace lf
