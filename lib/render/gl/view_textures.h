// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// What a card has to know of a view besides images: owners, numbers of faces, and where they are looked up the focal
// map's levels and lines of sight. All calls while the context is current.
class ViewTextures {
 public:
  // Sends and binds what pixels of `rect` need, and then what blocks of two by two of them do.
  void upload(const simd::SumTask& task, const ImageAtlas& atlas, const Rect& rect);
  void upload_blocks(const simd::SumTask& task, const Rect& rect);

  // The depths of what is drawn, see sum_shader.h.
  const Texture& owners() const { return owners_; }
  const Texture& block_owners() const { return block_owners_; }

 private:
  void upload_owners(const simd::SumTask& task, const Rect& rect);
  void upload_block_owners(const Rect& rect);
  void upload_tables(const simd::SumTask& task, const ImageAtlas& atlas);
  void upload_levels(const FocalMap& map);
  void upload_rays(const Rays& rays, const Rect& rect, bool centres);

  Texture owners_, block_owners_, tables_, levels_, rays_, centre_rays_;
  std::vector<uint16_t> owner_memory_, block_memory_;
  std::vector<float> table_memory_, ray_memory_;
  std::vector<uint8_t> level_memory_;
};

}  // namespace lf::gl
