// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "image/image.h"
#include "jpeg/jpeg_frame.h"
#include "render/gl/context.h"
#include "rig/rig.h"

namespace lf {

// A camera's picture as its stream gave it, in whatever memory. Thread-safe: views share it.
class CameraPicture {
 public:
  virtual ~CameraPicture() = default;
  virtual int width() const = 0;  // pixels
  virtual int height() const = 0;
  // Whether damage shows only where a view looks.
  virtual bool is_compressed() const { return false; }
  // Whether view() has to decode or to convert.
  virtual bool takes_work(PixelFamily family) const = 0;
  // The picture's pixels in this family, valid as long as the result lives; of a compressed picture those of `region`
  // alone. Null where they can't be had.
  virtual std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) = 0;
  // The same in textures of the contexts of this group, where it is in such, valid as long as the picture lives; null:
  // it is not.
  virtual const ImageView* view_on_card(PixelFamily, gl::ShareGroup) { return nullptr; }
};

// A picture as compressed as it came, decoded where a view looks.
class JpegPicture : public CameraPicture {
 public:
  explicit JpegPicture(std::shared_ptr<JpegFrame> frame) : frame_(std::move(frame)) {}
  int width() const override { return frame_->width(); }
  int height() const override { return frame_->height(); }
  bool is_compressed() const override { return true; }
  bool takes_work(PixelFamily) const override { return true; }
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;

 private:
  const std::shared_ptr<JpegFrame> frame_;
};

// What a camera showed at one time.
struct CameraFrame {
  std::shared_ptr<CameraPicture> picture;  // null: none could be had
  uint64_t behind = 0;                     // how much later it came than frames of this stream can, nanoseconds
  uint64_t time = 0;  // capture time, nanoseconds: clock time of live cameras, running time of others

  // Whether it is a picture of the size that the rig has the camera in.
  bool fits(const Camera& camera) const {
    return picture && picture->width() == camera.width && picture->height() == camera.height;
  }
};

}  // namespace lf
