// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/card_picture.h"

#include <array>
#include <atomic>
#include <utility>

#include "common/buffer_ptr.h"
#include "common/gl_share.h"
#include "common/gl_writer.h"

namespace lf {

// The picture in its textures. What is done of it is done once.
class CardPicture::Textures : public CardImage {
 public:
  // Null if they can't be had.
  static std::unique_ptr<Textures> make(CardPicture& picture) {
    std::unique_ptr<Textures> textures(new Textures(picture));
    return textures->find() ? std::move(textures) : nullptr;
  }
  gl::ShareGroup group() const { return group_; }
  const ImageView& image() const { return image_; }

  Texture plane(int index) const override { return planes_[static_cast<size_t>(index)]; }
  void wait() const override {
    gst_gl_sync_meta_wait(gst_buffer_get_gl_sync_meta(written_.get()), gst_gl_context_get_current());
  }
  ImageView fetch() const override {
    const std::lock_guard lock(mutex_);
    is_fetched_ = true;
    if (!here_) here_ = picture_.view(image_.family, {});
    return here_ ? *here_ : ImageView{};
  }
  bool is_fetched() const override { return is_fetched_; }

 private:
  explicit Textures(CardPicture& picture) : picture_(picture), group_(group_of_planes(picture.buffer_.get())) {}

  bool find() {
    const GstVideoInfo& info = picture_.info_;
    GstBuffer* const buffer = picture_.buffer_.get();
    GstGLContext* const context = wait_for_writer(buffer);
    // What was written by the CPU goes to the textures now. They stay, and as they are, as long as the buffer is held.
    GstVideoFrame frame;
    if (!gst_video_frame_map(&frame, const_cast<GstVideoInfo*>(&info), buffer,
                             static_cast<GstMapFlags>(GST_MAP_READ | GST_MAP_GL)))
      return false;
    const bool is_rgb = family_of(info) == PixelFamily::kRgb, is_interleaved = GST_VIDEO_INFO_N_PLANES(&info) == 2;
    const auto name = [&frame](guint plane) { return *static_cast<const guint*>(frame.data[plane]); };
    for (int i = 0; i < (is_rgb ? 1 : 3); i++)
      planes_[static_cast<size_t>(i)] = {name(static_cast<guint>(is_interleaved ? std::min(i, 1) : i)),
                                         is_interleaved && i == 2 ? 1 : 0};
    gst_video_frame_unmap(&frame);
    written_.reset(gst_buffer_new());
    gst_gl_sync_meta_set_sync_point(gst_buffer_add_gl_sync_meta(context, written_.get()), context);
    image_ = {.family = family_of(info), .width = info.width, .height = info.height, .on_card = {this}};
    if (is_rgb) image_.layout = rgb_layout(info);
    return true;
  }

  CardPicture& picture_;
  const gl::ShareGroup group_;
  std::array<Texture, 3> planes_ = {};
  BufferPtr written_;  // has nothing but the sync point behind what was written to the textures
  ImageView image_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const ImageView> here_;
  mutable std::atomic<bool> is_fetched_ = false;
};

CardPicture::CardPicture(GstBuffer* buffer, const GstVideoInfo& info)
    : buffer_(buffer, gst_buffer_unref), info_(info) {}

CardPicture::~CardPicture() = default;

std::shared_ptr<const ImageView> CardPicture::view(PixelFamily family, const Rect& region) {
  const std::lock_guard lock(mutex_);
  if (!converted_) wait_for_writer(buffer_.get());
  if (!converted_ || converted_->takes_work(family))
    converted_ = FrameConverter(info_, family).convert(gst_buffer_ref(buffer_.get()));
  return converted_ ? converted_->view(family, region) : nullptr;
}

const ImageView* CardPicture::view_on_card(PixelFamily family, gl::ShareGroup group) {
  if (!FrameConverter::takes_samples_of(info_, family) || !has_planes_on_card(buffer_.get(), info_)) return nullptr;
  const std::lock_guard lock(mutex_);
  if (!textures_ && group_of_planes(buffer_.get()) == group) textures_ = Textures::make(*this);
  if (!textures_ || textures_->group() != group) return nullptr;
  return &textures_->image();
}

}  // namespace lf
