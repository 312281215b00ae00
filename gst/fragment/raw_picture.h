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

// A picture of raw video, in the node's pixel family, or in its own where that was not chosen yet.
class RawPicture : public CameraPicture {
 public:
  // `original`: the picture as it came, if it has been converted and may be wanted in the other family.
  RawPicture(std::shared_ptr<GstBuffer> buffer, const GstVideoInfo& info, std::shared_ptr<RawPicture> original = {})
      : buffer_(std::move(buffer)), info_(info), original_(std::move(original)) {}
  int width() const override { return info_.width; }
  int height() const override { return info_.height; }
  bool takes_work(PixelFamily family) const override { return family_of(info_) != family; }
  // The pixels are the same to the bit whether the picture was converted to the other family before or not.
  std::shared_ptr<const ImageView> view(PixelFamily family, const Rect& region) override;

 private:
  std::shared_ptr<const ImageView> map() const;

  const std::shared_ptr<GstBuffer> buffer_;
  const GstVideoInfo info_;
  const std::shared_ptr<RawPicture> original_;
};

// Turns the frames of one stream into the node's family: nothing to do for RGB in any order and for full-range BT.601
// I420 with centred chroma; NV12 and GRAY8 are laid out as I420, to the bit; everything else (limited range, other
// matrix or siting, the other family) is converted.
class FrameConverter {
 public:
  FrameConverter(const GstVideoInfo& input, PixelFamily family);

  PixelFamily family() const { return family_; }
  // Whether the samples of video are those of the family, in whatever order.
  static bool takes_samples_of(const GstVideoInfo& video, PixelFamily family);
  // Takes ownership of `buffer`. Null if it can't be mapped. `keep_original`: the picture can give the other family as
  // exactly as the buffer could.
  std::shared_ptr<RawPicture> convert(GstBuffer* buffer, bool keep_original = false) const;

 private:
  struct Step {
    GstVideoInfo from, to;
    // By GStreamer, or by ourselves; neither: another layout alone.
    std::unique_ptr<GstVideoConverter, void (*)(GstVideoConverter*)> converter;
    std::optional<YcbcrConversion> ycbcr;
  };
  static std::shared_ptr<GstBuffer> run(const Step& step, GstBuffer* buffer);
  void add_step(const GstVideoInfo& from, GstVideoFormat format);
  void add_planar_step(const GstVideoInfo& from);
  void add_ycbcr_step(const GstVideoInfo& from);

  GstVideoInfo input_;
  PixelFamily family_;
  std::vector<Step> steps_;  // none: frames are taken as they are
};

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
