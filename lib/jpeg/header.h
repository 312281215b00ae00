// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace lf::jpeg {

// A Huffman table of a DHT segment (T.81 annex B.2.4.2). The first values of symbols[], as many as the sum of counts[],
// are in use; the rest are zero.
struct HuffmanSpec {
  std::array<uint8_t, 16> counts{};  // number of codes of 1 to 16 bits
  std::array<uint8_t, 256> symbols{};
  bool operator==(const HuffmanSpec&) const = default;
};

// Return the tables of T.81 annex K.3 for luma (0) and chroma (1), taken from libjpeg. Frames without DHT segments, as
// in Motion JPEG in AVI, use these tables. Thread-safe.
const HuffmanSpec& standard_dc(int chroma);
const HuffmanSpec& standard_ac(int chroma);

// A colour component of a frame, with the numbers of its quantisation and Huffman tables.
struct Component {
  uint8_t id = 0;
  uint8_t h = 1, v = 1;  // blocks of an MCU along x and y; both 1 if this is the only component
  uint8_t quant = 0, dc = 0, ac = 0;
};

// Maximum pixels of a frame that must be decoded as a whole. libjpeg then keeps all coefficients in memory, whereas
// decoding in regions takes memory only for these regions.
inline constexpr int kMaxWholePixels = 1 << 26;

// Everything before the entropy-coded bytes of a frame with 8 bits per sample: grey, YCbCr, RGB, CMYK or YCCK.
struct Header {
  int width = 0, height = 0;  // pixels, 1..kMaxImageSize
  int components = 0;         // 1 (grey) or 3; of four components only the first three
  Component component[3];
  int h_max = 1, v_max = 1;  // largest h and v, so that an MCU covers 8 h_max x 8 v_max pixels
  uint16_t quant[4][64] = {};
  HuffmanSpec dc[4], ac[4];  // if the file lacks a table, the standard table of T.81 annex K or an empty table
  int restart_interval = 0;  // MCUs between restart markers, or 0
  size_t scan = 0;           // offset of the first scan's entropy-coded bytes
  // True if the frame can be decoded in regions: one baseline scan of all components, grey or YCbCr with chroma at full
  // or half resolution along each axis.
  bool one_baseline_scan = false;

  int blocks_per_mcu() const;
  int mcus_x() const { return (width + 8 * h_max - 1) / (8 * h_max); }
  int mcus_y() const { return (height + 8 * v_max - 1) / (8 * v_max); }
};

// Reads the marker segments up to the first scan. If they are damaged or the kind of JPEG is unsupported, returns
// nothing and sets *reason to a text for users. *unsupported distinguishes the two cases. Allocates memory only for the
// reason.
std::optional<Header> parse_header(std::span<const uint8_t> frame, std::string* reason, bool* unsupported = nullptr);

}  // namespace lf::jpeg
