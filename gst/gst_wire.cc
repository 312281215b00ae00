// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst_wire.h"

namespace lf {
namespace {

template <class Decode>
auto decode(GstBuffer* buffer, std::string* reason, Decode decode_bytes) -> decltype(decode_bytes({}, reason)) {
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) {
    if (reason) *reason = "the buffer can't be mapped";
    return std::nullopt;
  }
  auto result = decode_bytes(std::span<const uint8_t>(map.data, map.size), reason);
  gst_buffer_unmap(buffer, &map);
  return result;
}

GstBuffer* wrap(std::vector<uint8_t> bytes) {
  auto* owned = new std::vector<uint8_t>(std::move(bytes));
  return gst_buffer_new_wrapped_full(GstMemoryFlags(0), owned->data(), owned->size(), 0, owned->size(), owned,
                                     [](gpointer data) { delete static_cast<std::vector<uint8_t>*>(data); });
}

}  // namespace

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_request);
}
std::optional<wire::Answer> decode_answer_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_answer);
}
std::optional<wire::Answer> decode_answer_buffer_header(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_answer_header);
}
GstBuffer* encode_request_buffer(const ViewRequest& request) { return wrap(wire::encode_request(request)); }
GstBuffer* encode_answer_buffer(const wire::Answer& answer) { return wrap(wire::encode_answer(answer)); }

}  // namespace lf
