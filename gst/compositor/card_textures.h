// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "composite/accumulator.h"
#include "render/gl/card_sum.h"

namespace lf {

// The textures that a picture's buffer consists of, mapped to be drawn to as long as this lives.
class CardTextures {
 public:
  // `group`: that they have to be of.
  CardTextures(GstBuffer* picture, const GstVideoInfo& info, gl::ShareGroup group);
  // Waits for what has been begun.
  ~CardTextures();
  CardTextures(const CardTextures&) = delete;
  CardTextures& operator=(const CardTextures&) = delete;

  // False if it does not consist of such, or of others than a sum can be drawn to.
  explicit operator bool() const { return is_mapped_; }
  gl::ShareGroup group() const { return group_; }
  // Has the card begin with the picture of a sum that is there, from this pixel on. False with the reason in `why`.
  bool draw(const Accumulator& sum, const Background& background, int x, int y, std::string& why);
  // Waits for all that was begun. False if it will never be there, with the reason in `why`.
  bool finish(std::string& why);

 private:
  void* put_fence() const;

  const gl::ShareGroup group_;
  GstVideoFrame frame_;
  bool is_mapped_ = false;
  gl::CardPicture picture_;                          // where they are, and how their bytes are laid out
  std::vector<std::shared_ptr<gl::CardSum>> begun_;  // and not waited for: nothing is drawn over them until then
};

}  // namespace lf
