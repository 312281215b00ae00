// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf {

// How 8 bits hold YCbCr: luma of 0..255 as gain * luma + offset, chroma of -128..127 as 128 + chroma_gain * chroma.
struct Levels {
  float gain = 1, offset = 0, chroma_gain = 1;
  bool operator==(const Levels&) const = default;
};
inline constexpr Levels kFullLevels;
// BT.601 as video has it: luma from 16 to 235, chroma from 16 to 240.
inline constexpr Levels kVideoLevels{219.f / 255, 16, 224.f / 255};

// BT.601, full range: 0..255, and chroma without the 128 offset.
struct YCbCr {
  float y, cb, cr;
};
// `r`, `g`, `b`: 0..255.
inline YCbCr ycbcr_of(float r, float g, float b) {
  return {0.299f * r + 0.587f * g + 0.114f * b, -0.168736f * r - 0.331264f * g + 0.5f * b,
          0.5f * r - 0.418688f * g - 0.081312f * b};
}

}  // namespace lf
