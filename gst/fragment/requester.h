// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <gst/gst.h>

#include "common/common.h"
#include "common/custom_events.h"
#include "common/gst_pointers.h"
#include "common/gst_wire.h"
#include "node/fair_answers.h"
#include "node/frame_timing.h"
#include "node/node.h"
#include "wire/command_codec.h"

namespace lf {

// A request that is to be answered, and what is known of it when it comes.
struct FragmentJob {
  wire::AnyRequest request;
  GstClockTime pts, duration;
  NearCompositor compositor;
  double work = 0;   // of its answer, see WorkEstimate
  uint64_t due = 0;  // live: when its answer is of no use any more, now_ns(); 0: never
};

// Requests that wait for their answers, of which those that may go together (Node::may_go_together()) are answered at
// once. Thread-safe.
class WaitingJobs {
 public:
  // Pixels of views that are answered at once at most, as all of their answers are held until the last one is made.
  static constexpr size_t kMostPixels = 16'000'000;

  // It waits as long as somebody holds it.
  void add(const std::shared_ptr<FragmentJob>& job);
  // How many nobody holds any more that have not been taken; they are forgotten.
  size_t forget_dropped();
  // Takes a job, and unless it is to go `alone` those that wait and may go with it; nothing if it has been taken.
  std::vector<std::shared_ptr<FragmentJob>> take_with(const std::shared_ptr<FragmentJob>& job, bool alone);

 private:
  std::mutex mutex_;
  std::deque<std::weak_ptr<FragmentJob>> waiting_;
};

// The answers to one requester's live requests, one view beside the other, by a thread of its answer pad.
class LiveAnswers {
 public:
  // `common`: whose are what all views have in common.
  LiveAnswers(ParallelFor parallel, const Node::Requester& common)
      : fair_(std::move(parallel), g_get_num_processors()), views_(common) {}

  // Makes one answer, with what is kept of its view, and pushes it; nothing: there was none to push. Called by the
  // thread of the answer pad.
  using Answer = std::function<std::optional<GstFlowReturn>(Node::Requester&, const ParallelFor&)>;
  // Queues an answer. `work`: the work that is planned for it. *dropped becomes true if an older request of the view is
  // dropped for this one. `of_set`: see FairAnswers. Returns how the latest answer could be pushed.
  GstFlowReturn add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped, size_t of_set);
  // Makes the answer whose turn it is: what the thread of the answer pad does, again and again.
  void work(GstPad* src);

  // Starts the thread of the answer pad.
  void start();
  bool stop(GstPad* src);
  // Waits until all answers to earlier requests have been pushed.
  void drain() { fair_.drain(); }
  void begin_flush() { fair_.clear(); }
  void end_flush();

 private:
  FairAnswers fair_;
  ViewRequesters views_;
  std::atomic<GstFlowReturn> flow_ = GST_FLOW_OK;  // what came of pushing the latest answer
};

// Where the requests of one requester are in time, so that it is seen when they go on elsewhere. The requests'
// streaming thread, but for is_live() and, while that is out, flush() and clear().
class RequestPlace {
 public:
  // A new segment; the requests come in real time or not.
  void begin(bool live) { live_ = live; }
  bool is_live() const { return live_; }
  // A request for this time came in this segment. Whether cameras that are read from files have to follow: after a
  // flush, and where a new segment goes back.
  bool moves(const GstSegment& segment, uint64_t time) {
    const bool back = !gst_segment_is_equal(&segment, &segment_) && time < last_time_;
    const bool moved = std::exchange(flushed_, false) || back;
    gst_segment_copy_into(&segment, &segment_);
    last_time_ = time;
    return moved && !live_;
  }
  void flush() { flushed_ = true; }
  void clear() {
    segment_ = {};
    last_time_ = 0;
    flushed_ = false;
  }

 private:
  std::atomic<bool> live_ = false;
  GstSegment segment_{};
  uint64_t last_time_ = 0;  // time of the latest request
  bool flushed_ = false;    // requests were flushed since the latest one
};

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
