// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/byte_buffer.h"
#include "base/parallel.h"
#include "jpeg/fragment_decoder.h"
#include "jpeg/fragment_encoder.h"
#include "render/fragment_planes.h"
#include "render/fragment_set.h"
#include "render/sum_planes.h"
#include "wire/answer.h"

namespace lf::wire {

// Between fragments and payloads. Both keep memory and libjpeg's state from call to call: one for each thread.

// Lost weight divides the picture: it is coded finer than the pixels (at most as coarse as this).
inline constexpr int kLeastLostQuality = 90;

class FragmentEncoder {
 public:
  // A whole answer of 8-bit fragments. `quality` 0: raw; 1 to 100: JPEG, in which small fragments share atlases, so
  // that the order of the table is not that of `fragments`. `memory`: see AnswerWriter. Throws Error as AnswerWriter
  // does, and for planes that do not fill their rectangles.
  ByteBuffer encode(const AnswerHeader& header, std::span<const Fragment> fragments, int quality,
                    ByteBuffer memory = {});
  ByteBuffer encode(const AnswerHeader& header, std::span<const CameraFragment> fragments, int quality,
                    ByteBuffer memory = {});

  // Appends the JPEG payload of one fragment or of the members of an atlas.
  void encode_payload(std::span<const FragmentPlanes> members, int quality, ByteBuffer& out);

 private:
  jpeg::FragmentEncoder jpeg_;
};

// The same answer by several threads, each with an encoder of its own.
ByteBuffer encode_fragments(const AnswerHeader& header, std::span<const CameraFragment> fragments, int quality,
                            ByteBuffer memory, const ParallelFor& parallel);

class FragmentDecoder {
 public:
  // The fragments of one payload (see group_size()), 8 bits a value, in their order: raw ones where they lie, JPEG
  // decoded into memory of this object, valid until the next call. Empty if the JPEG is damaged, or for 16-bit ones.
  std::span<const FragmentPlanes> decode(std::span<const FragmentView> group);

  // A 16-bit fragment: where it lies, or copied into memory of this object (valid until the next call) if it lies at an
  // odd address. `*copied` (may be null) says which.
  ConstSumPlanes sums(const FragmentView& fragment, bool* copied = nullptr);

 private:
  jpeg::FragmentDecoder jpeg_;
  std::vector<FragmentPlanes> planes_, lost_;
  UninitializedVector<uint16_t> aligned_;
};

}  // namespace lf::wire
