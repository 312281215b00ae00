// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include <gst/base/gstaggregator.h>
#include <gst/gst.h>

#include "common/gst_pointers.h"
#include "composite/camera_health.h"
#include "view/view.h"
#include "wire/answer_codec.h"

namespace lf {

// Stores answers that arrive too early. A compositor makes one picture at a time, but a fast node may already answer
// the next requests. These answers wait here until the compositor has reached their requests, so that they do not block
// the sink pad. A forged answer to a future request cannot block the pad either; it is rejected when its request is
// reached. Not thread-safe.
class EarlyAnswers {
 public:
  // An answer may be for at most this many requests after the current one, which is enough for two sets of views.
  static constexpr int32_t kMaxRequests = 64 + 2 * ViewSetPosition::kMaxViews;
  static constexpr size_t kMaxBytes = size_t{64} << 20;
  static constexpr size_t kMaxUnits = 4096;

  // Returns true if there is room for a buffer of this size. A single buffer always fits.
  bool has_room(size_t bytes) const;
  // Stores an answer to the request `sequence`.
  void keep(uint32_t sequence, BufferPtr buffer);
  // Removes and returns the stored answers to the request `sequence`, in order of arrival. Answers to earlier requests
  // are freed, because nothing can use them any more.
  std::vector<BufferPtr> take(uint32_t sequence);
  void clear();
  size_t size() const { return waiting_.size(); }

 private:
  struct Waiting {
    uint32_t sequence;
    BufferPtr buffer;
  };
  std::deque<Waiting> waiting_;
  size_t bytes_ = 0;
};

// Receives the answers of one camera node, behind one sink pad of an lfcompositor. The class passes each part of the
// answer to the current request on, stores answers to later requests, and decides whether the picture must wait for
// this node. The last part of an answer stays on the pad until the picture is done. GstAggregator calls aggregate()
// when every pad has a buffer, which therefore means that all nodes have answered. Use from the streaming thread,
// except for flushed() and detach().
class NodeInput {
 public:
  // attach() creates the NodeInput of a new pad, which lives as long as the pad. of() returns the NodeInput.
  static void attach(GstAggregatorPad* pad);
  static NodeInput& of(GstAggregatorPad* pad);
  // Stops all access to the pad's buffers. Call from any thread, before releasing the pad. GstAggregator 1.22 would
  // otherwise drop the peeked buffer without the pad's lock, so that the buffer could be returned and freed at the same
  // time.
  void detach();

  enum class UnitResult {
    kDone,
    kLast,   // this part has been processed, and the answer to the current request is complete
    kEarly,  // this part answers a later request
  };
  // Reads the units (parts of answers, one per buffer) that have arrived, and calls `take_unit` for each, until the
  // answer to the request `sequence` is complete. If `live` is true, answers to later requests are stored, so that they
  // do not block the pad; otherwise they stay on the pad.
  void take(uint32_t sequence, bool live, const std::function<UnitResult(GstBuffer*)>& take_unit);
  // For use in `take_unit`. Records a part of the answer. Returns false if the same part has already been received.
  bool add_part(const wire::AnswerPart& part) { return parts_.add(part); }
  // Returns what `take_unit` must return after add_part(): kLast if the node's answer is now complete, otherwise kDone.
  // `last_of_node` is false if the node sends a further answer to the same request.
  UnitResult part_added(bool last_of_node);
  // Call this for an answer that missed its picture although it arrived before the deadline. The node works, so its
  // count of missed pictures restarts at 0, and the next picture waits for the node again.
  void was_in_time() { missed_ = 0; }

  // Returns true if the current picture must wait for this node. Live pipelines do not wait for a node that has missed
  // more than `max_missed` consecutive pictures (0: wait for all nodes).
  bool is_awaited(bool live, unsigned max_missed) const;
  bool has_answered() const { return head_ == HeadState::kDone; }
  bool has_unread() const;
  bool has_ended() const { return gst_aggregator_pad_is_eos(pad_); }

  // Call when the current picture is done. If `counts` is true and the node has not answered, the picture counts as
  // missed by this node.
  void close(bool counts);
  // Drops the incomplete answer, because the current request gets no picture.
  void drop_answer();
  // Forgets what has been read for the current request. The buffer on the pad will be read again.
  void forget();
  void drop_early() { early_.clear(); }
  void drop_all();
  SilenceDetector& silence() { return silence_; }
  std::string name() const;
  // Call when the pad has been flushed. Any thread.
  void flushed() { flushed_ = true; }

 private:
  explicit NodeInput(GstAggregatorPad* pad) : pad_(pad) {}
  BufferPtr peek() const;
  BufferPtr pop();
  bool take_early(uint32_t sequence, const std::function<UnitResult(GstBuffer*)>& take_unit);

  enum class HeadState {
    kUnread,
    kDone,
    kEarly,  // answer to a later request, so the node has skipped the current request
  };
  GstAggregatorPad* const pad_;
  mutable std::mutex queue_mutex_;  // held while accessing the queue of pad_
  bool detached_ = false;
  HeadState head_ = HeadState::kUnread;
  GstBuffer* parsed_buffer_ = nullptr;  // the buffer that head_ describes; not owned
  wire::AnswerParts parts_;
  EarlyAnswers early_;
  SilenceDetector silence_;  // see SilenceDetector for thread safety
  unsigned missed_ = 0;      // consecutive pictures without this node
  std::atomic<bool> flushed_ = false;
};

// A snapshot of an lfcompositor's sink pads for answers, to iterate over their NodeInputs without the object lock.
// Holds references to the pads.
class NodeInputs {
 public:
  explicit NodeInputs(GstPad* request);
  auto begin() const { return nodes_.begin(); }
  auto end() const { return nodes_.end(); }

 private:
  std::vector<PadPtr> pads_;
  std::vector<NodeInput*> nodes_;
};

}  // namespace lf
