// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "view/view.h"
#include "wire/surface_codec.h"

namespace lf::serve {

// Makes the messages of the data channel "surface". A message contains the surface that a picture shows
// (wire::PictureSurface), so that the page can redraw the picture from a new viewpoint without waiting for the server.
// A stereo pair has a message for each eye.
//
// The messages take at most kShare of the bits of the video, and kMaxBytes / 2 at the start. If there are not enough
// bits while the view moves, the surface gets less exact depths, and then a lower resolution. While the view rests, the
// surface is sent in full resolution, when it has changed and there are enough bits. Not thread-safe.
class SurfaceSender {
 public:
  static constexpr double kShare = 0.07;
  static constexpr size_t kMaxBytes = 8192;    // of a message
  static constexpr size_t kPacketBytes = 100;  // UDP, DTLS and SCTP headers of a message
  using Message = std::vector<uint8_t>;

  // `video_bytes` is the size of the encoded picture. Returns the messages that are sent with this picture, or none.
  std::vector<Message> messages(const GstStructure* picture, uint32_t timestamp, size_t video_bytes);

 private:
  // RTP time until an unchanged surface is sent again, because messages can be lost: 1 s
  static constexpr uint32_t kRepeat = 90000;
  struct Eye {
    double credit = kMaxBytes / 2.0;  // bytes
    size_t coarseness = 0;            // index of the array of that name
    size_t awaited = 0;               // size of a message that waits for enough bits
    std::optional<View> sent;
    uint32_t sent_timestamp = 0;
  };

  static Message message(Eye& eye, int index, View view, uint32_t timestamp);

  std::array<Eye, wire::PictureSurface::kMaxViews> eyes_;
};

}  // namespace lf::serve
