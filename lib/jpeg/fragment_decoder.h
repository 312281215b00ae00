// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "render/sum_planes.h"

namespace lf::jpeg {

// The way back from FragmentEncoder. Bytes may be anything: what is not a whole scan of the picture's size is damaged.
// Keeps libjpeg's state, tables and planes from call to call. One for each thread.
class FragmentDecoder {
 public:
  FragmentDecoder();
  ~FragmentDecoder();
  FragmentDecoder(FragmentDecoder&&) noexcept;
  FragmentDecoder& operator=(FragmentDecoder&&) noexcept;

  // Decodes a fragment whose family and rectangle the caller has set, and points its planes (or its lost weight) into
  // memory of this object, valid until the next call of the same function. False, and the fragment as it was, if the
  // scan is damaged or the size, the family or the quality is not what FragmentEncoder makes.
  bool decode_pixels(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);
  bool decode_lost(std::span<const uint8_t> scan, int quality, FragmentPlanes& fragment);

 private:
  class Picture;
  std::unique_ptr<Picture> pixels_, lost_;
};

}  // namespace lf::jpeg
