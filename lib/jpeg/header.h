// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

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

struct Component {
  uint8_t id = 0;
  uint8_t h = 1, v = 1;               // blocks of an MCU along x and y; 1, 1 where the frame has only this component
  uint8_t quant = 0, dc = 0, ac = 0;  // indices of tables
};

// The most pixels of a frame that has to be decoded as a whole: libjpeg keeps the coefficients of all of it in memory,
// whereas regions touch no more memory than they cover.
inline constexpr int kMaxWholePixels = 1 << 26;

// What precedes the entropy-coded bytes of a frame of 8 bits a sample: grey, YCbCr, RGB, CMYK or YCCK.
struct Header {
  int width = 0, height = 0;  // pixels, 1..kMaxImageSize
  int components = 0;         // 1 (grey) or 3; of four components, the first three
  Component component[3];
  int h_max = 1, v_max = 1;    // largest h and v: an MCU covers 8 h_max x 8 v_max pixels
  uint16_t quant[4][64] = {};  // quantisation tables, in zigzag order
  HuffmanSpec dc[4], ac[4];    // what the file does not define is as T.81 annex K has it, or empty
  int restart_interval = 0;    // MCUs between restart markers; 0: none
  size_t scan = 0;             // offset of the first scan's entropy-coded bytes
  // Whether this is one baseline scan of all components of grey or YCbCr with chroma at full or half resolution along
  // each axis, which is what can be decoded in regions. Else a general decoder has to decode the frame as a whole.
  bool one_baseline_scan = false;

  int blocks_per_mcu() const;
  int mcus_x() const { return (width + 8 * h_max - 1) / (8 * h_max); }
  int mcus_y() const { return (height + 8 * v_max - 1) / (8 * v_max); }
};

// Reads the marker segments up to the first scan. Returns nothing, and the cause in *reason (fit to be shown to a
// person), if they are damaged or of an unsupported kind of JPEG; *unsupported tells which. Allocates only for the
// reason.
std::optional<Header> parse_header(std::span<const uint8_t> frame, std::string* reason, bool* unsupported = nullptr);

}  // namespace lf::jpeg
