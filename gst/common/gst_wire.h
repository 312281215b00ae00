// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "base/memory.h"
#include "render/gl/gpu_sum.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"
#include "wire/request_codec.h"
#include "wire/unit.h"

// Converts between GStreamer buffers and units of the wire format. A unit is one request or one part of an answer, and
// a buffer holds exactly one unit.
namespace lf {

// Creates a GstMemory for an answer that the GPU has rendered, so that the pixels can stay on the GPU. The pixels are
// downloaded only if the memory is mapped; a compositor on the same GPU never maps the memory. The mapped bytes are the
// payload of one 16-bit fragment of the whole view. The memory is read-only, and the caller owns the result.
GstMemory* gpu_sum_memory_new(std::shared_ptr<gl::GpuSum> sum);

// Returns the pixels of an answer that are on a GPU. Returns null if the answer is in system memory.
std::shared_ptr<gl::GpuSum> gpu_sum_of(GstBuffer* answer);

// Decode the unit in a buffer. Return nothing if the unit is invalid, and set *reason (may be null) to an explanation.
std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
// Returns the view id in the header of an answer, without decoding the rest. Returns nothing if the buffer is not an
// answer.
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer);
bool is_consistency_buffer(GstBuffer* buffer);
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason = nullptr);

// Maps a buffer for reading during the lifetime of the object. Holds a reference.
class MappedBuffer {
 public:
  // kHead leaves out pixels that are on a GPU, so that nothing is downloaded. kAll maps the whole buffer.
  enum class Part { kAll, kHead };
  explicit MappedBuffer(GstBuffer* buffer, Part part = Part::kAll);
  ~MappedBuffer();
  MappedBuffer(const MappedBuffer&) = delete;
  MappedBuffer& operator=(const MappedBuffer&) = delete;
  // Empty if mapping failed.
  std::span<const uint8_t> bytes() const { return {map_.data, map_.size}; }

 private:
  GstBuffer* buffer_;
  GstMapInfo map_{};
};

// Memory pool for the bytes of answers. Freed buffers return their bytes to the pool, even if the element does not
// exist any more.
using AnswerMemory = MemoryPool<ByteBuffer>;

GstBuffer* encode_request_buffer(const ViewRequest& request);
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes);
GstBuffer* wrap_bytes(ByteBuffer bytes);
// Wraps the bytes of an answer in a new buffer, which the caller owns. When the buffer is freed, its bytes return to
// the pool `memory`. `payload` contains the pixels if they are on a GPU, and otherwise is null.
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory,
                       std::shared_ptr<gl::GpuSum> payload = nullptr);

}  // namespace lf
