// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include "render/gl/card_sum.h"

namespace lf {

// The textures that a picture's buffer consists of, mapped to be drawn to as long as this lives.
class CardTextures {
 public:
  // `group`: that they have to be of.
  CardTextures(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  ~CardTextures();
  CardTextures(const CardTextures&) = delete;
  CardTextures& operator=(const CardTextures&) = delete;

  // False if it does not consist of such, or of others than a sum can be drawn to.
  explicit operator bool() const { return is_mapped_; }
  // Where they are, how their bytes are laid out, and what has to be done before; to be drawn to.
  gl::CardPicture picture() const;

 private:
  GstVideoFrame frame_;
  bool is_mapped_ = false;
};

}  // namespace lf
