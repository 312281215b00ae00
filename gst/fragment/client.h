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
#include "node/fair_scheduler.h"
#include "node/frame_timing.h"
#include "node/node.h"
#include "wire/command_codec.h"

namespace lf {

// A view request that waits for its answer, with everything that is needed to answer later, in another thread.
struct AnswerJob {
  wire::AnyRequest request;
  GstClockTime pts, duration;
  LocalCompositor compositor;
  double work = 0;
  uint64_t due = 0;  // latest useful time of a live answer, as now_ns(); 0: none
};

// The waiting requests of one client (a viewer or compositor). The queue finds requests that one GPU pass can answer
// together, such as all views of a 3D display. Separate passes would leave most of the GPU idle. See
// Node::can_batch_requests(). Thread-safe.
class AnswerJobQueue {
 public:
  // Maximum number of pixels in a batch, because all answers stay in memory until the batch is done.
  static constexpr size_t kMaxPixels = 16'000'000;

  // Adds a job. The queue holds only a weak reference, because FairScheduler owns the job and may drop old jobs.
  void add(const std::shared_ptr<AnswerJob>& job);
  // Removes the jobs that FairScheduler has dropped. Returns the number of these jobs.
  size_t forget_dropped();
  // Removes a job and all waiting jobs that can be answered together with this job, and returns these jobs. If `alone`
  // is true, only takes the job itself. Returns an empty list if the job has already been taken.
  std::vector<std::shared_ptr<AnswerJob>> take_with(const std::shared_ptr<AnswerJob>& job, bool alone);

 private:
  std::mutex mutex_;
  std::deque<std::weak_ptr<AnswerJob>> waiting_;
};

// Answers the live requests of one client, in the thread of its answer pad. The views of the client take turns, so that
// a slow view does not delay other views for long.
class LiveAnswerQueue {
 public:
  // `common` owns the state that all views share.
  LiveAnswerQueue(ParallelFor parallel, const Node::ClientState& common)
      : fair_(std::move(parallel), g_get_num_processors()), views_(common) {}

  // A function that makes and pushes one answer, with the state of its view. It is called in the thread of the answer
  // pad. It returns nothing if no answer was pushed, for example because the answer would be too late.
  using Answer = std::function<std::optional<GstFlowReturn>(Node::ClientState&, const ParallelFor&)>;
  // Queues an answer. `work` is its estimated work (AnswerJob::work), and `of_set` is the number of views in the
  // request's set. If too many requests of the view are waiting, the oldest is dropped and *dropped becomes true.
  // Returns the flow result of the latest push, so that the sender of the requests notices a stopped pipeline.
  GstFlowReturn add(GstPad* src, uint32_t view_id, double work, Answer answer, bool* dropped, size_t of_set);
  // Makes the next answer. The answer pad's thread calls this in a loop.
  void work(GstPad* src);

  void start();
  bool stop(GstPad* src);
  void drain() { fair_.drain(); }
  void begin_flush() { fair_.clear(); }
  void end_flush();

 private:
  FairScheduler fair_;
  ClientStates views_;
  std::atomic<GstFlowReturn> flow_ = GST_FLOW_OK;
};

// Detects when a client requests another part of a film, so that file cameras must seek. Use from the streaming thread
// of the requests, except for is_live(). flush() and clear() may be called while that thread is stopped.
class RequestPosition {
 public:
  // Starts a new segment. `live` means that requests arrive in real time.
  void begin(bool live) { live_ = live; }
  bool is_live() const { return live_; }
  // Call for each request. Returns true if file cameras must seek, which is after a flush, or if a new segment goes
  // back in time.
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
  uint64_t last_time_ = 0;
  bool flushed_ = false;
};

// Caches whether the answers of a pad reach a compositor in this process, because these answers need no compression.
// The query is sent again only after note_change(), which must be called when downstream may have changed. Use from the
// streaming thread, except for note_change().
class CompositorLookup {
 public:
  void note_change() { is_new_ = true; }
  LocalCompositor forget() {
    is_new_ = true;
    return std::exchange(local_, {});
  }
  const LocalCompositor& look(GstPad* src) {
    if (is_new_.exchange(false)) {
      local_ = find_local_compositor(src);
      GST_INFO_OBJECT(src, "the compositor is %s",
                      local_.group != 0 ? "in this process, and its pictures on a GPU"
                      : local_.is_there ? "in this process"
                                        : "behind a link");
    }
    return local_;
  }

 private:
  std::atomic<bool> is_new_ = true;
  LocalCompositor local_;
};

// The state of one client of lffragment. A client is a viewer or compositor with its own pair of a request pad and an
// answer pad, and the two pads share this object.
struct Client {
  // `number` is unique within the element. `parallel` runs the tasks of live answers.
  Client(GstPad* request, GstPad* src, uint32_t number, ParallelFor parallel)
      : request(request), src(src), number(number), live_queue(std::move(parallel), kept) {}
  static Client& of(GstPad* pad) { return *static_cast<Client*>(gst_pad_get_element_private(pad)); }

  const WeakRef<GstPad> request, src;  // either pad may be released at any time
  const uint32_t number;
  RequestPosition place;
  CompositorLookup compositor;
  QosTracker qos;  // any thread
  // Number of requests for another kind of camera (property `access`) before the first suitable request. Streaming
  // thread.
  unsigned wrong_access = 0;
  bool any_fits = false;
  DelayReporter delay;     // streaming thread
  Node::ClientState kept;  // state of non-live requests, and state shared by all requests
  AnswerJobQueue waiting;
  LiveAnswerQueue live_queue;
  std::shared_ptr<AnswerMemory> memory = std::make_shared<AnswerMemory>();
  bool ended = false;  // true after EOS of the client; guarded by the element's object lock
};

}  // namespace lf
