// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/card_textures.h"

#include <GLES3/gl31.h>
#include <gst/gl/gl.h>

#include <algorithm>
#include <utility>

#include "common/gl_share.h"
#include "common/pixel_family.h"

namespace lf {

CardTextures::CardTextures(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group) : group_(group) {
  if (!has_planes_on_card(picture, info) || group_of_planes(picture) != group) return;
  is_mapped_ = gst_video_frame_map(&frame_, &info, picture, static_cast<GstMapFlags>(GST_MAP_READWRITE | GST_MAP_GL));
  if (!is_mapped_) return;
  if (family_of(info) == PixelFamily::kRgb) picture_.layout = rgb_layout(info);
  const guint planes = GST_VIDEO_INFO_N_PLANES(&info);
  picture_.is_interleaved = planes == 2;
  for (guint i = 0; i < planes; i++) picture_.textures[i] = *static_cast<const guint*>(frame_.data[i]);
}

CardTextures::~CardTextures() {
  std::string why;
  finish(why);
  if (is_mapped_) gst_video_frame_unmap(&frame_);
}

// Behind all that the textures' own context has been given to do with them.
void* CardTextures::put_fence() const {
  void* fence = nullptr;
  const auto put = [](GstGLContext*, gpointer to) {
    *static_cast<void**>(to) = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    glFlush();
  };
  auto* const texture = reinterpret_cast<GstGLMemory*>(frame_.map[0].memory);
  gst_gl_context_thread_add(texture->mem.context, put, &fence);
  return fence;
}

bool CardTextures::draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why) {
  gl::CardPicture to = picture_;
  to.x = x;
  to.y = y;
  // Once for each drawer: what that does comes one after the other.
  const auto is_beside = [&sum](const auto& begun) { return begun->is_beside(sum.first_on_card()); };
  if (std::ranges::none_of(begun_, is_beside)) to.fence = put_fence();
  const Levels levels = has_video_levels(frame_.info) ? kVideoLevels : kFullLevels;
  std::shared_ptr<gl::CardSum> next = sum.resolve_on_card(background, levels, to, why);
  if (!next) return false;
  begun_.push_back(std::move(next));
  return true;
}

bool CardTextures::finish(std::string& why) {
  bool is_there = true;
  while (!begun_.empty()) {
    const std::shared_ptr<gl::CardSum> latest = begun_.back();
    is_there = latest->wait(why) && is_there;
    std::erase_if(begun_, [&latest](const auto& begun) { return begun->is_beside(*latest); });
  }
  return is_there;
}

}  // namespace lf
