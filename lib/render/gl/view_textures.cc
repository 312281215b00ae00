// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/view_textures.h"

#include <algorithm>

#include "render/gl/sum_tables.h"

namespace lf::gl {

static const FocalMap* map_of(const DrawnView& view) { return view.task->plan->view().focus.map.get(); }

void ViewTextures::upload_rays(const Rays& view_rays, const Rect& rect, bool centres) {
  const int step = centres ? 2 : 1, width = centres ? chroma_size(rect.width()) : rect.width(),
            height = centres ? chroma_size(rect.height()) : rect.height();
  ray_memory_.clear();
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const int i = rect.x0 + step * x, j = rect.y0 + step * y;
      const Vec2 ray = centres ? view_rays.at_centre_of_four(i, j) : view_rays.at(i, j);
      ray_memory_.push_back(static_cast<float>(ray.x));
      ray_memory_.push_back(static_cast<float>(ray.y));
    }
  (centres ? centre_rays_ : rays_).bind(centres ? kCentreRays : kRays, GL_RG32F, width, height);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RG, GL_FLOAT, ray_memory_.data());
}

// Of several maps one below the other.
void ViewTextures::upload_levels(std::span<const DrawnView> views) {
  int columns = 0, rows = 0;
  for (const DrawnView& view : views)
    if (const FocalMap* map = map_of(view)) {
      columns = std::max(columns, map->columns);
      rows += map->rows;
    }
  if (rows == 0) return;
  levels_.reserve(static_cast<size_t>(columns) * rows);
  uint8_t* to = levels_.room();
  for (const DrawnView& view : views)
    if (const FocalMap* map = map_of(view))
      for (int y = 0; y < map->rows; y++, to += columns)
        std::copy_n(&map->levels[static_cast<size_t>(y) * map->columns], map->columns, to);
  levels_.send(kLevels, GL_R8UI, GL_RED_INTEGER, columns, rows, true);
}

bool ViewTextures::upload(std::span<const DrawnView> views, ImageAtlas& atlas, Programs& programs, std::string& why) {
  const DrawnView& first = views.front();
  if (const Rays& rays = first.task->plan->rays(); !rays.separable()) {
    upload_rays(rays, first.rect, false);
    if (first.task->family == PixelFamily::kI420) upload_rays(rays, first.rect, true);
  }
  upload_levels(views);
  atlas_ = &atlas;
  return atlas.send(pieces_, programs, why);
}

void ViewTextures::describe_images(const Program& program) const {
  const ImageAtlas::Offset cb = atlas_->chroma_offset(1), cr = atlas_->chroma_offset(2);
  glUniform4i(program.chroma_places, cb.x, cb.y, cr.x, cr.y);
}

}  // namespace lf::gl
