// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

namespace lf::jpeg {

// A Huffman table as a DHT segment states it (T.81 annex B.2.4.2). symbols[] holds the sum of counts[], zeros after it.
struct HuffmanSpec {
  std::array<uint8_t, 16> counts{};  // codes of 1..16 bits
  std::array<uint8_t, 256> symbols{};
  bool operator==(const HuffmanSpec&) const = default;
};

// The tables of T.81 annex K.3, for luma (0) and chroma (1): what a frame without DHT segments (Motion JPEG in AVI)
// means. Thread-safe; libjpeg's.
const HuffmanSpec& standard_dc(int chroma);
const HuffmanSpec& standard_ac(int chroma);

}  // namespace lf::jpeg
