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
#include "composite/answer_watch.h"
#include "view/view.h"
#include "wire/answer_codec.h"

namespace lf {

// Answers of a node that came before their request's turn, live, so that none of them stands in front of what comes
// behind it: a forged one is found out when its request has its turn, and hinders nothing until then. Not thread-safe.
class AheadAnswers {
 public:
  // By so many requests an answer may be ahead of the one that has its turn; two sets of views are among them.
  static constexpr int32_t kMostRequests = 64 + 2 * PlaceInSet::kMostViews;
  static constexpr size_t kMostBytes = size_t{64} << 20;
  static constexpr size_t kMostUnits = 4096;

  AheadAnswers() = default;
  ~AheadAnswers() { clear(); }
  AheadAnswers(const AheadAnswers&) = delete;
  AheadAnswers& operator=(const AheadAnswers&) = delete;

  // Whether there is room for one more of so many bytes; there always is for a single one.
  bool has_room(size_t bytes) const;
  // Takes over the buffer, an answer to the request of this number.
  void keep(uint32_t sequence, GstBuffer* buffer);
  // The answers to the request of this number in the order in which they came, owned by the caller. Answers to earlier
  // requests are thrown away.
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

// The node behind an answer pad of lfcompositor: how much of its answer to the current request has come, and what came
// of later ones. The last part of an answer stays on its pad until the picture is done, so that GstAggregator finds a
// buffer on every pad when every node has answered. Streaming thread, but for flushed().
class NodeInput {
 public:
  // Makes the NodeInput of an answer pad, which lives as long as the pad.
  static void attach(GstAggregatorPad* pad);
  static NodeInput& of(GstAggregatorPad* pad);
  // Nobody looks at the pad's buffers from here on. Called before the pad is released, as GstAggregator 1.22 then drops
  // the buffer that was peeked last without the pad's lock, so that it may be handed out and freed at once. Any thread.
  void let_go();

  // What a unit was, for whoever it was given to.
  enum class Taken {
    kDone,   // the unit has been dealt with
    kLast,   // the unit has been dealt with, and the node's answer to the current request is whole
    kAhead,  // the unit answers a later request
  };
  // Gives what has come to `take_unit`, unit by unit, up to the last of the answer to the request of this number.
  // `live`: answers to later requests are kept aside, so that they stand in nobody's way.
  void take(uint32_t sequence, bool live, const std::function<Taken(GstBuffer*)>& take_unit);
  // To be called by `take_unit`: false if this part of the node's answer had been there already.
  bool add_part(const wire::AnswerPart& part) { return parts_.add(part); }
  // What `take_unit` is to return once add_part() has taken a part: kLast if the answer is whole now.
  Taken part_added(bool last_of_node);
  // An answer that came late was in time all the same: the node has missed nothing.
  void was_in_time() { missed_ = 0; }

  // Whether the current request's picture waits for this node. `max_missed`: live, not for one that has missed more
  // pictures in a row; 0: for all.
  bool is_awaited(bool live, unsigned max_missed) const;
  // Whether the node's answer to the current request is whole.
  bool has_answered() const { return head_ == Head::kDone; }
  // Whether something is on the pad that has not been looked at.
  bool has_news() const;
  // Whether nothing is on the pad and its stream has ended.
  bool has_ended() const { return gst_aggregator_pad_is_eos(pad_); }

  // The picture of the current request is done. `counts`: a node that is missing from it has missed one more.
  void close(bool counts);
  // The current request gets no picture: what is there of the answer is dropped.
  void drop_answer();
  // The current request is forgotten, and what is on the pad will be looked at again.
  void forget();
  void forget_later() { ahead_.clear(); }
  void drop_all();
  // Whether anything comes from the node at all.
  SilenceWatch& silence() { return silence_; }
  // Where its answers come from: the pad and, as far as that is linked, the element before it.
  std::string name() const;
  // The pad's stream has been flushed: what is on the pad is not what it was. Any thread.
  void flushed() { flushed_ = true; }

 private:
  explicit NodeInput(GstAggregatorPad* pad) : pad_(pad) {}
  BufferPtr peek() const;
  BufferPtr pop();
  bool take_early(uint32_t sequence, const std::function<Taken(GstBuffer*)>& take_unit);

  enum class Head {
    kUnseen,  // nothing is there, or something that has not been looked at
    kDone,    // the last part of the node's answer
    kAhead,   // an answer to a later request: the node skipped this one
  };
  GstAggregatorPad* const pad_;
  mutable std::mutex queue_mutex_;  // held while a buffer is taken from pad_
  bool let_go_ = false;             // under queue_mutex_
  Head head_ = Head::kUnseen;
  GstBuffer* seen_ = nullptr;  // the buffer that head_ is about; not owned
  wire::AnswerParts parts_;    // parts of the current request's answer that have been added
  AheadAnswers ahead_;         // live: answers to later requests
  SilenceWatch silence_;       // says itself which of its functions which thread may call
  unsigned missed_ = 0;        // pictures in a row that had to do without this node
  std::atomic<bool> flushed_ = false;
};

// The nodes of an lfcompositor whose request pad this is, as they are now: kept, while this lives.
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
