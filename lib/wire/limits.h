// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "rig/rig.h"

// The limits of the wire format, in one place. A unit beyond them is not decoded; see spec.md.
namespace lf::wire {

inline constexpr uint8_t kVersion = 1;
inline constexpr size_t kMaxRequestBytes = size_t{1} << 20;  // 1 MiB: warp commands for 3500 cameras in one view
inline constexpr size_t kMaxAnswerBytes = size_t{1} << 30;   // 1 GiB: 8192 x 8192 RGB fragments of a whole array
// What elements that keep answers until they are whole take by default: a sum of 4096 x 2304 pixels in 16 bits with its
// lost weight, and its table.
inline constexpr size_t kUsualAnswerBytes = size_t{80} << 20;
inline constexpr size_t kMaxInflation = 1032;  // bytes that a byte of deflated ones can come to
inline constexpr size_t kMaxSources = 4096;    // sets of cameras that the answers to one request speak for
inline constexpr size_t kMaxTriangleRows = size_t{1} << 21;  // rows of all rectangles in a warp command together
inline constexpr uint32_t kMaxFragments = kMaxCameras + 1;
inline constexpr int kMaxViewSize = kMaxImageSize;  // pixels a side

}  // namespace lf::wire
