// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include <gst/video/video.h>

#include "common/pixel_family.h"
#include "fragment/camera_frames.h"
#include "image/image.h"

namespace lf {

// Turns the frames of one stream into the node's family: nothing to do for RGB in any order and for full-range BT.601
// I420 with centred chroma; NV12 and GRAY8 are laid out as I420, to the bit; everything else (limited range, other
// matrix or siting, the other family) is converted.
class FrameConverter {
 public:
  FrameConverter(const GstVideoInfo& input, PixelFamily family);

  PixelFamily family() const { return family_; }
  // Takes ownership of `buffer`. Null buffer in the result if it can't be mapped. `keep_original`: so that in_family()
  // can go back to it.
  CameraFrame convert(GstBuffer* buffer, bool keep_original = false) const;

 private:
  struct Step {
    GstVideoInfo from, to;
    std::unique_ptr<GstVideoConverter, void (*)(GstVideoConverter*)> converter;  // null: another layout alone
  };
  static CameraFrame run(const Step& step, GstBuffer* buffer);
  void add_step(const GstVideoInfo& from, GstVideoFormat format);
  void add_planar_step(const GstVideoInfo& from);

  GstVideoInfo input_;
  PixelFamily family_;
  std::vector<Step> steps_;  // none: frames are taken as they are
};

// The frame in that family, the same to the bit whether it was converted to the other one before or not: from its
// original where there is one. Not for JPEG.
CameraFrame in_family(const CameraFrame& frame, PixelFamily family);

// A frame mapped for reading as long as this lives.
class MappedFrame {
 public:
  explicit MappedFrame(const CameraFrame& frame);
  ~MappedFrame();
  MappedFrame(const MappedFrame&) = delete;
  MappedFrame& operator=(const MappedFrame&) = delete;
  bool ok() const { return ok_; }
  ImageView view() const;

 private:
  GstVideoFrame frame_;
  bool ok_;
};

}  // namespace lf
