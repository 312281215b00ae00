// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"
#include "render/sum_planes.h"
#include "wire/answer.h"

namespace lf::wire {

// FragmentEncoder makes payloads of fragments, FragmentDecoder fragments of payloads. Both keep memory and libjpeg's
// state from call to call: one object for each thread.

// Lost weight divides the picture: it is coded finer than the pixels (at most as coarse as this).
inline constexpr int kLeastLostQuality = 90;

// A fragment that an answer is to have, 8 bits a value.
struct AnswerFragment {
  std::optional<CameraIndex> camera;  // see FragmentHeader
  FragmentPlanes planes;
};

class FragmentEncoder {
 public:
  // A whole answer of 8-bit fragments. `quality` 0: raw; 1 to 100: JPEG. `memory`: see AnswerWriter. Throws Error as
  // AnswerWriter does, and for planes that do not fill their rectangles.
  ByteBuffer encode(const AnswerHeader& header, std::span<const Fragment> fragments, int quality,
                    ByteBuffer memory = {});
  ByteBuffer encode(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                    ByteBuffer memory = {});

  // Appends the JPEG payload of one fragment.
  void encode_payload(const FragmentPlanes& fragment, int quality, ByteBuffer& out);

 private:
  jpeg::FragmentEncoder jpeg_;
};

// The bytes that FragmentEncoder::encode() gives, by several threads, each with an encoder of its own.
ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const AnswerFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel);

class FragmentDecoder {
 public:
  // The planes of a fragment of 8 bits a value: raw ones where they lie, JPEG decoded into memory of this object, valid
  // until the next call. Nothing if the JPEG is damaged, or for a fragment of 16 bits.
  std::optional<FragmentPlanes> decode(const FragmentView& fragment);

  // The planes of a 16-bit fragment: where they lie, or copied into memory of this object (valid until the next call)
  // if it lies at an odd address. `*copied` (may be null) says which.
  ConstSumPlanes sums(const FragmentView& fragment, bool* copied = nullptr);

 private:
  jpeg::FragmentDecoder jpeg_;
  UninitializedVector<uint16_t> aligned_;
};

}  // namespace lf::wire
