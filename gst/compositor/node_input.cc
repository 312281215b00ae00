// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/node_input.h"

#include "common/guard.h"
#include "wire/unit.h"

namespace lf {
namespace {

GQuark node_quark() {
  static const GQuark quark = g_quark_from_static_string("lf-compositor-node");
  return quark;
}

// Reads the sequence number, which has the same position in all units of an answer stream.
uint32_t sequence_of(GstBuffer* unit) {
  constexpr gsize kAt = 16;
  guint8 bytes[4] = {};
  gst_buffer_extract(unit, kAt, bytes, sizeof bytes);
  return wire::Reader(bytes).get<uint32_t>();
}

}  // namespace

bool EarlyAnswers::has_room(size_t bytes) const {
  return waiting_.empty() || (waiting_.size() < kMaxUnits && bytes_ + bytes <= kMaxBytes);
}

void EarlyAnswers::keep(uint32_t sequence, BufferPtr buffer) {
  const size_t bytes = gst_buffer_get_size(buffer.get());
  waiting_.push_back({sequence, std::move(buffer)});
  bytes_ += bytes;
}

std::vector<BufferPtr> EarlyAnswers::take(uint32_t sequence) {
  std::vector<BufferPtr> taken;
  std::deque<Waiting> later;
  bytes_ = 0;
  for (Waiting& waiting : waiting_) {
    const auto ahead = static_cast<int32_t>(waiting.sequence - sequence);
    if (ahead == 0) taken.push_back(std::move(waiting.buffer));
    if (ahead <= 0) continue;
    bytes_ += gst_buffer_get_size(waiting.buffer.get());
    later.push_back(std::move(waiting));
  }
  waiting_ = std::move(later);
  return taken;
}

void EarlyAnswers::clear() {
  waiting_.clear();
  bytes_ = 0;
}

void NodeInput::attach(GstAggregatorPad* pad) {
  g_object_set_qdata_full(G_OBJECT(pad), node_quark(), new NodeInput(pad),
                          [](gpointer data) { delete static_cast<NodeInput*>(data); });
}

NodeInput& NodeInput::of(GstAggregatorPad* pad) {
  return *static_cast<NodeInput*>(g_object_get_qdata(G_OBJECT(pad), node_quark()));
}

void NodeInput::detach() {
  std::lock_guard lock(queue_mutex_);
  detached_ = true;
}

BufferPtr NodeInput::peek() const {
  std::lock_guard lock(queue_mutex_);
  return BufferPtr(detached_ ? nullptr : gst_aggregator_pad_peek_buffer(pad_));
}

BufferPtr NodeInput::pop() {
  std::lock_guard lock(queue_mutex_);
  return BufferPtr(detached_ ? nullptr : gst_aggregator_pad_pop_buffer(pad_));
}

bool NodeInput::take_early(uint32_t sequence, const std::function<UnitResult(GstBuffer*)>& take_unit) {
  if (early_.size() == 0) return false;
  bool whole = false;
  for (const BufferPtr& buffer : early_.take(sequence)) whole = whole || take_unit(buffer.get()) == UnitResult::kLast;
  return whole;
}

void NodeInput::take(uint32_t sequence, bool live, const std::function<UnitResult(GstBuffer*)>& take_unit) {
  if (flushed_.exchange(false)) {
    parsed_buffer_ = nullptr;
    early_.clear();
    if (head_ != HeadState::kDone) head_ = HeadState::kUnread;
  }
  if (head_ == HeadState::kDone) return;
  if (take_early(sequence, take_unit)) {
    head_ = HeadState::kDone;
    return;
  }
  // Holds a reference, because the pad may be flushed or released meanwhile.
  while (const BufferPtr head = peek()) {
    GstBuffer* buffer = head.get();
    if (buffer == parsed_buffer_) return;
    const UnitResult taken = take_unit(buffer);
    if (taken == UnitResult::kDone) {
      pop();
      continue;
    }
    head_ = taken == UnitResult::kLast ? HeadState::kDone : HeadState::kEarly;
    const bool aside = taken == UnitResult::kEarly && live && early_.has_room(gst_buffer_get_size(buffer));
    parsed_buffer_ = aside ? nullptr : buffer;
    if (!aside) return;
    if (BufferPtr popped = pop()) {
      const uint32_t of = sequence_of(popped.get());
      early_.keep(of, std::move(popped));
    }
  }
}

NodeInput::UnitResult NodeInput::part_added(bool last_of_node) {
  if (!parts_.complete()) return UnitResult::kDone;
  if (last_of_node) return UnitResult::kLast;
  parts_.clear();  // another answer follows
  return UnitResult::kDone;
}

bool NodeInput::is_awaited(bool live, unsigned max_missed) const {
  if (head_ != HeadState::kUnread || has_ended()) return false;
  return !live || max_missed == 0 || missed_ <= max_missed;
}

bool NodeInput::has_unread() const {
  const BufferPtr head = peek();
  return head && head.get() != parsed_buffer_ && head_ != HeadState::kDone;
}

void NodeInput::close(bool counts) {
  const bool answered = head_ == HeadState::kDone;
  missed_ = answered || has_ended() ? 0 : missed_ + counts;
  if (!answered) return;
  drop_answer();
  head_ = HeadState::kUnread;
}

void NodeInput::drop_answer() {
  if (head_ != HeadState::kDone || !parsed_buffer_ || flushed_) return;
  head_ = HeadState::kUnread;
  parsed_buffer_ = nullptr;
  pop();
}

void NodeInput::forget() {
  head_ = HeadState::kUnread;
  parsed_buffer_ = nullptr;
  parts_.clear();
}

void NodeInput::drop_all() {
  while (pop()) {
  }
}

std::string NodeInput::name() const {
  g_autoptr(GstPad) peer = gst_pad_get_peer(GST_PAD(pad_));
  g_autoptr(GstElement) from = peer ? gst_pad_get_parent_element(peer) : nullptr;
  g_autofree gchar* pad_name = gst_object_get_name(GST_OBJECT(pad_));
  if (!from) return pad_name;
  g_autofree gchar* name = gst_object_get_name(GST_OBJECT(from));
  return std::string(name) + ", pad " + pad_name;
}

NodeInputs::NodeInputs(GstPad* request) {
  GstElement* element = GST_ELEMENT(GST_PAD_PARENT(request));
  lf::ObjectLock lock(element);
  for (GList* item = element->sinkpads; item; item = item->next)
    if (item->data != request) pads_.emplace_back(GST_PAD(gst_object_ref(item->data)));
  lock.unlock();
  for (const PadPtr& pad : pads_) nodes_.push_back(&NodeInput::of(GST_AGGREGATOR_PAD(pad.get())));
}

}  // namespace lf
