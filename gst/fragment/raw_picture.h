// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <gst/video/video.h>

#include "common/common.h"
#include "image/image.h"
#include "node/camera_inputs.h"

namespace lf {

// A raw video frame of one camera, in a layout that the renderer can read. Its pixels are usually in the pixel family
// of the node (RGB or YCbCr). A frame that arrived before the node had chosen a family keeps its own family, and view()
// converts the pixels.
class RawPicture : public CameraPicture {
 public:
  // `original` is the frame before its conversion (null: not converted), in case a request needs another family.
  RawPicture(std::shared_ptr<GstBuffer> buffer, const GstVideoInfo& info, std::shared_ptr<RawPicture> original = {})
      : buffer_(std::move(buffer)), info_(info), original_(std::move(original)) {}
  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  bool takes_work(PixelFamily family) const override { return family_of(info_) != family; }
  // Returns the image in this pixel family. If a conversion is necessary, it starts from the original frame, so the
  // result does not depend on earlier conversions.
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;

 private:
  std::shared_ptr<const ImageView> map() const;

  const std::shared_ptr<GstBuffer> buffer_;
  const GstVideoInfo info_;
  const std::shared_ptr<RawPicture> original_;
};

// Converts the frames of one stream to the pixel family of the node. RGB in any order and full-range BT.601 I420 with
// centred chroma need no conversion. NV12 and GRAY8 are rearranged to I420 without loss. All other video (limited
// range, another matrix, siting or family) is converted.
class FrameConverter {
 public:
  FrameConverter(const GstVideoInfo& input, PixelFamily family);

  PixelFamily family() const { return family_; }
  // Returns true if the video needs no arithmetic for this family, but at most another order of its samples.
  static bool takes_samples_of(const GstVideoInfo& video, PixelFamily family);
  // Converts a frame, and takes its reference. Returns null if the buffer cannot be mapped. If `keep_original` is true,
  // the result keeps the buffer, so that it can be converted to another family without a second loss.
  std::shared_ptr<RawPicture> convert(GstBuffer* buffer, bool keep_original = false) const;

 private:
  struct Step {
    GstVideoInfo from, to;
    // The converter of GStreamer or our own converter. If both are unset, the step only rearranges the samples.
    std::unique_ptr<GstVideoConverter, void (*)(GstVideoConverter*)> converter;
    std::optional<YcbcrConversion> ycbcr;
  };
  static std::shared_ptr<GstBuffer> run(const Step& step, GstBuffer* buffer);
  void add_step(const GstVideoInfo& from, GstVideoFormat format);
  void add_planar_step(const GstVideoInfo& from);
  void add_ycbcr_step(const GstVideoInfo& from);

  GstVideoInfo input_;
  PixelFamily family_;
  std::vector<Step> steps_;  // empty: no conversion
};

// A raw video frame in GPU memory (GstGLMemory). The GPU renderer samples the textures directly if its OpenGL context
// shares them, and if the video needs no colour conversion. Otherwise the frame is downloaded and converted, as by
// FrameConverter.
class GpuPicture : public CameraPicture {
 public:
  // Takes the buffer, which must consist of GstGLMemory.
  GpuPicture(GstBuffer* buffer, const GstVideoInfo& info);
  ~GpuPicture() override;

  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  bool takes_work(PixelFamily) const override { return true; }
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;
  const ImageView* view_on_gpu(PixelFamily family, gl::ShareGroup group) override;

 private:
  class Textures;

  const std::shared_ptr<GstBuffer> buffer_;
  const GstVideoInfo info_;
  std::mutex mutex_;
  std::unique_ptr<Textures> textures_;     // null: not sampled on the GPU yet
  std::shared_ptr<RawPicture> converted_;  // null: not downloaded yet
};

}  // namespace lf
