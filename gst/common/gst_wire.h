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

// Creates read-only memory for a rendered answer that is still on a GPU. The contents are the payload of one 16-bit
// fragment of the whole view. They are downloaded only if the memory is mapped, so a compositor on the same GPU never
// needs the download. The caller owns the memory.
GstMemory* gpu_sum_memory_new(std::shared_ptr<gl::GpuSum> sum);

// Returns the GPU data of an answer, which is in the second memory of its buffer. Returns null if the answer has none.
std::shared_ptr<gl::GpuSum> gpu_sum_of(GstBuffer* answer);

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
// Returns the view id of an answer without decoding the answer. Nothing for other data.
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer);
bool is_consistency_buffer(GstBuffer* buffer);
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason = nullptr);

// Maps a buffer for reading during the lifetime of the object. Holds a reference.
class MappedBuffer {
 public:
  // kHead maps only the bytes before a payload on a GPU, so that the sum need not be downloaded. kAll maps everything.
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

// Recycles the memory of answers. Buffers may outlive their element.
using AnswerMemory = MemoryPool<ByteBuffer>;

GstBuffer* encode_request_buffer(const ViewRequest& request);
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes);
GstBuffer* wrap_bytes(ByteBuffer bytes);
// Returns a new buffer that the caller owns. When the buffer is freed, its bytes return to `memory`. `payload` is data
// on a GPU that follows the bytes; null if there is none.
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory,
                       std::shared_ptr<gl::GpuSum> payload = nullptr);

}  // namespace lf
