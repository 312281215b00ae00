// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>

#include "common/common.h"
#include "common/gst_wire.h"
#include "common/qos_watch.h"
#include "fragment/live_answers.h"
#include "fragment/pad_pair.h"
#include "fragment/request_place.h"
#include "node/delay_notice.h"
#include "node/node.h"
#include "node/work_estimate.h"

namespace lf {

// Whether answers on a pad stay in this process up to the compositor: asked once, and when downstream has changed.
// Streaming thread, but for note_change().
class CompositorSide {
 public:
  void note_change() { is_new_ = true; }
  bool is_near(GstPad* src) {
    if (is_new_.exchange(false)) {
      near_ = compositor_is_near(src);
      GST_INFO_OBJECT(src, "the compositor is %s", near_ ? "in this process" : "behind a link");
    }
    return near_;
  }

 private:
  std::atomic<bool> is_new_ = true;
  bool near_ = false;
};

// One requester of lffragment. Belongs to both of its pads.
struct Requester {
  // `number`: its own in the element. `parallel`: does the tasks of its live answers.
  Requester(GstPad* request, GstPad* src, uint32_t number, ParallelFor parallel)
      : pads(request, src), number(number), live_answers(std::move(parallel), kept.cancelled) {}
  static Requester& of(GstPad* pad) { return *static_cast<Requester*>(gst_pad_get_element_private(pad)); }

  PadPair pads;
  const uint32_t number;
  RequestPlace place;
  CompositorSide compositor;
  QosWatch qos;           // any thread
  WorkEstimate estimate;  // of its answers
  DelayNotice delay;      // streaming thread
  Node::Requester kept;   // of requests that are not live, and `cancelled` of all
  LiveAnswers live_answers;
  std::shared_ptr<AnswerMemory> memory = std::make_shared<AnswerMemory>();
  bool ended = false;  // has sent EOS; under the object lock of the element
};

}  // namespace lf
