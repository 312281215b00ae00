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

// Conversion between wire units and buffers. A buffer holds exactly one unit.
namespace lf {

// Creates read-only memory for a sum on a GPU: the payload of a fragment of the whole view in 16 bits. The sum is
// downloaded when the memory is mapped. The caller owns the memory.
GstMemory* gpu_sum_memory_new(std::shared_ptr<gl::GpuSum> sum);

// Returns the sum in the second memory of an answer; null if there is none.
std::shared_ptr<gl::GpuSum> gpu_sum_of(GstBuffer* answer);

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason = nullptr);
// Returns the view id of an answer without decoding it. Nothing for other data.
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer);
bool is_consistency_buffer(GstBuffer* buffer);
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason = nullptr);

// Maps a buffer for reading while the object lives. Holds a reference.
class MappedBuffer {
 public:
  // kHead: the bytes before a payload on a GPU, else all bytes.
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

// Pool for answer bytes: the sums of a 1080p view take six megabytes. Buffers may outlive the element that created
// them.
using AnswerMemory = MemoryPool<ByteBuffer>;

// Returns a new buffer that the caller owns.
GstBuffer* encode_request_buffer(const ViewRequest& request);
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes);
GstBuffer* wrap_bytes(ByteBuffer bytes);
// Returns a new buffer that the caller owns. The bytes return to `memory` when it is freed. `payload`: a sum on a GPU
// that follows the bytes; null: none.
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory,
                       std::shared_ptr<gl::GpuSum> payload = nullptr);

}  // namespace lf
