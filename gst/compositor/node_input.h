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

// Keeps the answers of a live node to later requests until these requests become current. This also prevents a forged
// answer from blocking the answers behind it, because a forged answer is rejected only when its request becomes
// current. Not thread-safe.
class EarlyAnswers {
 public:
  // An answer may be for at most this many requests after the current one, which is enough for two sets of views.
  static constexpr int32_t kMostRequests = 64 + 2 * ViewSetPosition::kMaxViews;
  static constexpr size_t kMostBytes = size_t{64} << 20;
  static constexpr size_t kMostUnits = 4096;

  EarlyAnswers() = default;
  ~EarlyAnswers() { clear(); }
  EarlyAnswers(const EarlyAnswers&) = delete;
  EarlyAnswers& operator=(const EarlyAnswers&) = delete;

  // Returns true if there is room for a buffer of this size. A single buffer always fits.
  bool has_room(size_t bytes) const;
  // Takes the buffer, an answer to request `sequence`.
  void keep(uint32_t sequence, GstBuffer* buffer);
  // Returns the answers to request `sequence` in order of arrival (transfer full). Drops all answers to earlier
  // requests.
  std::vector<GstBuffer*> take(uint32_t sequence);
  void clear();
  size_t size() const { return waiting_.size(); }

 private:
  struct Waiting {
    uint32_t sequence;
    GstBuffer* buffer;
  };
  std::deque<Waiting> waiting_;
  size_t bytes_ = 0;
};

// The input of an lfcompositor from one camera node, behind one sink pad. It collects the node's answer to the current
// request, keeps answers to later requests, and decides whether to wait for the node. The last part of an answer stays
// on the pad until the picture is done, so that GstAggregator finds a buffer on every pad when all nodes have answered.
// Use from the streaming thread, except for flushed().
class NodeInput {
 public:
  // The NodeInput lives as long as the pad.
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
  // Calls `take_unit` for each received unit, up to the last unit of the answer to request `sequence`. If `live`, sets
  // aside answers to later requests, so that they do not block the pad.
  void take(uint32_t sequence, bool live, const std::function<UnitResult(GstBuffer*)>& take_unit);
  // For `take_unit`. Returns false if this part of the answer has already been added.
  bool add_part(const wire::AnswerPart& part) { return parts_.add(part); }
  // The result for `take_unit` after add_part(): kLast if the answer is complete.
  UnitResult part_added(bool last_of_node);
  // Call for a late answer that arrived before the deadline. Resets the count of missed pictures.
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
  // Resets the state; the buffer on the pad will be read again.
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
    kEarly,  // answer to a later request: the node skipped this request
  };
  GstAggregatorPad* const pad_;
  mutable std::mutex queue_mutex_;  // held while accessing the queue of pad_
  bool detached_ = false;
  HeadState head_ = HeadState::kUnread;
  GstBuffer* seen_ = nullptr;  // the buffer that head_ describes; not owned
  wire::AnswerParts parts_;
  EarlyAnswers early_;
  SilenceDetector silence_;  // see SilenceDetector for thread safety
  unsigned missed_ = 0;      // consecutive pictures without this node
  std::atomic<bool> flushed_ = false;
};

// The nodes that an lfcompositor has now. Holds references to the pads.
class NodeInputs {
 public:
  explicit NodeInputs(GstPad* request);
  ~NodeInputs();
  NodeInputs(const NodeInputs&) = delete;
  NodeInputs& operator=(const NodeInputs&) = delete;
  auto begin() const { return nodes_.begin(); }
  auto end() const { return nodes_.end(); }

 private:
  std::vector<GstAggregatorPad*> pads_;
  std::vector<NodeInput*> nodes_;
};

}  // namespace lf
