// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include <gst/video/video.h>

#include "fragment/raw_picture.h"
#include "image/card_image.h"
#include "node/camera_picture.h"

namespace lf {

// A picture of raw video in textures of GStreamer's (GstGLMemory). It is sampled where it is if it is of one of the
// pixel families as they are, or NV12 of that kind, and what draws shares the textures; whoever else wants it, and of
// other video, has it here, converted as FrameConverter does it.
class CardPicture : public CameraPicture {
 public:
  // Takes ownership of `buffer`, whose memory is such.
  CardPicture(GstBuffer* buffer, const GstVideoInfo& info);
  ~CardPicture() override;

  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  bool takes_work(PixelFamily) const override { return true; }
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;
  const ImageView* view_on_card(PixelFamily family, gl::ShareGroup group) override;

 private:
  class Textures;

  const std::shared_ptr<GstBuffer> buffer_;
  const GstVideoInfo info_;
  std::mutex mutex_;
  std::unique_ptr<Textures> textures_;     // null: it is not sampled there, or has not been yet
  std::shared_ptr<RawPicture> converted_;  // null: nobody has wanted it here yet
};

}  // namespace lf
