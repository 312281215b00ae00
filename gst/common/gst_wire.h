// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "base/memory.h"
#include "render/gl/card_sum.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

// Buffers hold exactly the bytes of one unit of the wire format.
namespace lf {

// Memory of a sum on a graphics card, owned by the caller: the payload of a fragment of the whole view in 16 bits. It
// comes here when it is mapped, which whoever knows nothing of cards does; to be read alone.
GstMemory* card_memory_new(std::shared_ptr<gl::CardSum> sum);

// The sum whose memory follows the first memory of an answer; null if none does.
std::shared_ptr<gl::CardSum> card_sum_of(GstBuffer* answer);

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
// The view that an answer is of, by its first bytes; the rest is not decoded. Nothing for other bytes.
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer);
// Whether the buffer holds a unit of moments.
bool is_moments_buffer(GstBuffer* buffer);
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason = nullptr);

// A buffer's bytes, mapped and held as long as this lives.
class MappedBuffer {
 public:
  // kHead: of an answer whose payload is on a card what comes before that; of all others everything.
  enum class Part { kAll, kHead };
  explicit MappedBuffer(GstBuffer* buffer, Part part = Part::kAll);
  ~MappedBuffer();
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  // Empty if the buffer can't be mapped.
  std::span<const uint8_t> bytes() const { return {map_.data, map_.size}; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
};

// Of answers that have been taken: the sums of a 1080p view have six megabytes. Buffers may outlive whoever made them.
using AnswerMemory = KeptMemory<ByteBuffer>;

// A new buffer with the request's bytes, owned by the caller; so are those of the functions below.
GstBuffer* encode_request_buffer(const ViewRequest& request);
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes);
GstBuffer* wrap_bytes(ByteBuffer bytes);
// A new buffer of these bytes, owned by the caller. When it is freed its memory goes back to `memory`.
// `payload`: what follows them and is still on a card; null: nothing.
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory,
                       std::shared_ptr<gl::CardSum> payload = nullptr);

}  // namespace lf
