// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "common/common.h"
#include "common/gst_wire.h"
#include "common/in_process.h"
#include "common/qos_watch.h"
#include "fragment/fragment_job.h"
#include "fragment/live_answers.h"
#include "fragment/request_place.h"
#include "node/arrival_watch.h"
#include "node/node.h"

namespace lf {

struct UnrefPad {
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
};
using PadPtr = std::unique_ptr<GstPad, UnrefPad>;

// A request pad and the answer pad that it pairs with, for whoever comes through one of them, while both may be
// released.
class PadPair {
 public:
  PadPair(GstPad* request, GstPad* src) {
    g_weak_ref_init(&request_, request);
    g_weak_ref_init(&src_, src);
  }
  ~PadPair() {
    g_weak_ref_clear(&request_);
    g_weak_ref_clear(&src_);
  }
  PadPair(const PadPair&) = delete;
  PadPair& operator=(const PadPair&) = delete;
  // Null once it is gone.
  PadPtr request() { return PadPtr(static_cast<GstPad*>(g_weak_ref_get(&request_))); }
  PadPtr src() { return PadPtr(static_cast<GstPad*>(g_weak_ref_get(&src_))); }
  PadPtr other(GstPad* pad) { return GST_PAD_IS_SRC(pad) ? request() : src(); }

 private:
  GWeakRef request_, src_;
};

// Whether answers on a pad stay in this process up to the compositor: asked once, and when downstream has changed.
// Streaming thread, but for note_change().
class CompositorSide {
 public:
  void note_change() { is_new_ = true; }
  // While no streaming thread is there. Returns what was known.
  NearCompositor forget() {
    is_new_ = true;
    return std::exchange(near_, {});
  }
  const NearCompositor& look(GstPad* src) {
    if (is_new_.exchange(false)) {
      near_ = near_compositor(src);
      GST_INFO_OBJECT(src, "the compositor is %s",
                      near_.group != 0 ? "in this process, and its pictures on a card"
                      : near_.is_there ? "in this process"
                                       : "behind a link");
    }
    return near_;
  }

 private:
  std::atomic<bool> is_new_ = true;
  NearCompositor near_;
};

// One requester of lffragment, which belongs to its request pad and its answer pad.
struct Requester {
  // `number`: tells the requesters of an element apart. `parallel`: does the tasks of this requester's live answers.
  Requester(GstPad* request, GstPad* src, uint32_t number, ParallelFor parallel)
      : pads(request, src), number(number), live_answers(std::move(parallel), kept) {}
  static Requester& of(GstPad* pad) { return *static_cast<Requester*>(gst_pad_get_element_private(pad)); }

  PadPair pads;
  const uint32_t number;
  RequestPlace place;
  CompositorSide compositor;
  QosWatch qos;        // any thread
  unsigned unfit = 0;  // requests for cameras of another kind (access), until the first that fits; streaming thread
  bool any_fits = false;
  DelayNotice delay;     // streaming thread
  Node::Requester kept;  // what is kept for requests that are not live, and what all requests have in common
  WaitingJobs waiting;   // of live_answers
  LiveAnswers live_answers;
  std::shared_ptr<AnswerMemory> memory = std::make_shared<AnswerMemory>();
  bool ended = false;  // the requester has sent EOS; under the object lock of the element
};

}  // namespace lf
