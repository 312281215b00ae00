// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "view/view.h"

namespace lf::serve {

// Makes the messages of the data channel "surface". A message contains the surface that a picture shows
// (wire::PictureSurface), so that the page can redraw the picture from a new viewpoint without waiting for the server.
//
// The messages take at most kShare of the bits of the video. If there are not enough bits while the view moves, the
// surface gets a lower resolution. While the view rests, the surface is sent in full resolution, when it has changed
// and there are enough bits. Not thread-safe.
class SurfaceSender {
 public:
  static constexpr double kShare = 0.15;
  static constexpr size_t kMaxBytes = 8192;    // of a message
  static constexpr size_t kPacketBytes = 100;  // UDP, DTLS and SCTP headers of a message

  // `video_bytes` is the size of the encoded picture. Returns the message, or nothing if none is sent with this
  // picture.
  std::vector<uint8_t> message(const GstStructure* picture, uint32_t timestamp, size_t video_bytes);

 private:
  static constexpr int kRepeat = 30;  // pictures until an unchanged surface is sent again, because messages can be lost

  double credit_ = kMaxBytes / 2.0;  // bytes
  int halvings_ = 0;
  size_t awaited_ = 0;  // size of a message that waits for enough bits
  std::optional<View> sent_;
  int unchanged_ = 0;  // pictures since the last message, with the same view
};

}  // namespace lf::serve
