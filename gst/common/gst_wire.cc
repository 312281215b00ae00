// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/gst_wire.h"

#include <algorithm>
#include <utility>

#include "wire/moments_codec.h"

namespace lf {
namespace {

template <class Decode>
auto decode(GstBuffer* buffer, std::string* reason, Decode decode_bytes) -> decltype(decode_bytes({}, reason)) {
  return decode_bytes(MappedBuffer(buffer, MappedBuffer::Part::kHead).bytes(), reason);
}

template <class Owner, class Bytes>
GstBuffer* wrap(Owner* owner, Bytes& bytes) {
  return gst_buffer_new_wrapped_full(GstMemoryFlags(0), bytes.data(), bytes.size(), 0, bytes.size(), owner,
                                     [](gpointer data) { delete static_cast<Owner*>(data); });
}

struct OwnedAnswer {
  ByteBuffer bytes;
  std::shared_ptr<AnswerMemory> memory;
  ~OwnedAnswer() { memory->give_back(std::move(bytes)); }
};

}  // namespace

MappedBuffer::MappedBuffer(GstBuffer* buffer, Part part) : buffer_(gst_buffer_ref(buffer)) {
  const gint memories = part == Part::kHead && card_sum_of(buffer) ? 1 : -1;
  if (!gst_buffer_map_range(buffer, 0, memories, &map_, GST_MAP_READ)) map_ = {};
}
MappedBuffer::~MappedBuffer() {
  if (map_.memory) gst_buffer_unmap(buffer_, &map_);
  gst_buffer_unref(buffer_);
}

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_request);
}
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_any_request);
}
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer) {
  return wire::peek_answer_view(MappedBuffer(buffer, MappedBuffer::Part::kHead).bytes());
}
bool is_moments_buffer(GstBuffer* buffer) {
  const MappedBuffer mapped(buffer, MappedBuffer::Part::kHead);
  return wire::is_moments(mapped.bytes());
}
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::parse_answer_header);
}

GstBuffer* encode_request_buffer(const ViewRequest& request) { return wrap_bytes(wire::encode_request(request)); }
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes) {
  auto* owned = new std::vector<uint8_t>(std::move(bytes));
  return wrap(owned, *owned);
}
GstBuffer* wrap_bytes(ByteBuffer bytes) {
  auto* owned = new ByteBuffer(std::move(bytes));
  return wrap(owned, *owned);
}
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory, std::shared_ptr<gl::CardSum> payload) {
  auto* owned = new OwnedAnswer{std::move(bytes), std::move(memory)};
  GstBuffer* answer = wrap(owned, owned->bytes);
  if (payload) gst_buffer_append_memory(answer, card_memory_new(std::move(payload)));
  return answer;
}

}  // namespace lf
