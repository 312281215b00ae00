// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// The textures of a pass: levels of focal maps, lines of sight of distorted views, and the cameras' images. All calls
// while the context is current.
class ViewTextures {
 public:
  // Sends and binds what the views of a pass need: one view, or several whose lines of sight are not looked up.
  // `atlas` is filled with their images, and stays until what is drawn has been read. False with the reason in `why` if
  // images that are on the card can't be had there.
  bool upload(std::span<const DrawnView> views, ImageAtlas& atlas, Programs& programs, std::string& why);
  // Sets the uniforms with the places of the images, for the program in use.
  void describe_images(const Program& program) const;

 private:
  void upload_levels(std::span<const DrawnView> views);
  void upload_rays(const Rays& rays, const Rect& rect, bool centres);

  const ImageAtlas* atlas_ = nullptr;
  CardPieces pieces_;
  SentTexture levels_;
  Texture rays_, centre_rays_;
  std::vector<float> ray_memory_;
};

}  // namespace lf::gl
