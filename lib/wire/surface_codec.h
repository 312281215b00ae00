// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "view/view.h"

namespace lf::wire {

// The surface that a picture shows, with the pose and the lens of the picture: everything that a client needs to redraw
// the picture from another viewpoint. docs/reference/web-interface.md describes the message.
struct PictureSurface {
  static constexpr uint8_t kVersion = 2;
  static constexpr size_t kHeaderBytes = 77;
  static constexpr size_t kMaxNodes = 8192;
  static constexpr int kMaxTolerance = 8;
  static constexpr int kMinNodes = 8;  // per side; halve() stops there

  static constexpr int kMaxViews = 2;  // a stereo pair

  int view = 0;               // index in the picture, from left to right
  uint32_t timestamp = 0;     // RTP timestamp of the picture
  int width = 0, height = 0;  // pixels
  Pose pose;
  float fx = 1, fy = 1, cx = 0, cy = 0;  // pinhole, pixels
  // The grid of nodes, as in FocalMap. Levels are inverse depths along the optical axis: level 0 is `farthest`, and
  // level 255 is `nearest`, both in 1/m and at least 0.
  int step = 1, columns = 0, rows = 0;
  int tolerance = 0;  // levels; encode_surface() may change each level by this much
  float farthest = 0, nearest = 0;
  std::vector<uint8_t> levels;  // row by row

  bool operator==(const PictureSurface&) const = default;
};

// Returns the surface of a view, with an orientation in single precision, and with at most PictureSurface::kMaxNodes
// nodes. A plane perpendicular to the optical axis has a single node. Parts of the surface behind the view are
// infinitely far away. Returns nullopt if the lens has distortion.
std::optional<PictureSurface> picture_surface(const View& view, uint32_t timestamp);

// Doubles the step. Each new node takes one of the four depths that it replaces, not their mean, so that edges stay
// sharp. Returns false if a side has fewer than 2 PictureSurface::kMinNodes nodes.
bool halve(PictureSurface& surface);

// Removes outliers: each level becomes the median of its neighbourhood of 3 x 3 nodes.
void smooth(PictureSurface& surface);

std::vector<uint8_t> encode_surface(const PictureSurface& surface);
// Returns nullopt, and sets *reason unless null, if the bytes are not a valid message.
std::optional<PictureSurface> decode_surface(std::span<const uint8_t> bytes, std::string* reason = nullptr);

}  // namespace lf::wire
