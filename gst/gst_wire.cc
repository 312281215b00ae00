// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst_wire.h"

namespace lf {
namespace {

template <class Decode>
auto decode(GstBuffer* buffer, std::string* reason, Decode decode_bytes) -> decltype(decode_bytes({}, reason)) {
  return decode_bytes(MappedBuffer(buffer).bytes(), reason);
}

template <class Bytes>
GstBuffer* wrap(Bytes bytes) {
  auto* owned = new Bytes(std::move(bytes));
  return gst_buffer_new_wrapped_full(GstMemoryFlags(0), owned->data(), owned->size(), 0, owned->size(), owned,
                                     [](gpointer data) { delete static_cast<Bytes*>(data); });
}

}  // namespace

MappedBuffer::MappedBuffer(GstBuffer* buffer) : buffer_(gst_buffer_ref(buffer)) {
  if (!gst_buffer_map(buffer, &map_, GST_MAP_READ)) map_ = {};
}
MappedBuffer::~MappedBuffer() {
  if (map_.memory) gst_buffer_unmap(buffer_, &map_);
  gst_buffer_unref(buffer_);
}

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_request);
}
std::optional<wire::AnswerHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::parse_answer_header);
}
GstBuffer* encode_request_buffer(const ViewRequest& request) { return wrap(wire::encode_request(request)); }
GstBuffer* wrap_bytes(ByteBuffer bytes) { return wrap(std::move(bytes)); }

}  // namespace lf
