// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/view_textures.h"

#include <algorithm>

namespace lf::gl {

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

void ViewTextures::upload(const simd::SumTask& task, const Rect& rect, ImageAtlas& atlas) {
  const ViewPlan& plan = *task.plan;
  if (!plan.rays().separable()) {
    upload_rays(plan.rays(), rect, false);
    if (task.family == PixelFamily::kI420) upload_rays(plan.rays(), rect, true);
  }
  if (const FocalMap* map = plan.view().focus.map.get()) {
    levels_.reserve(map->levels.size());
    std::ranges::copy(map->levels, levels_.room());
    levels_.send(kLevels, GL_R8UI, GL_RED_INTEGER, map->columns, map->rows, true);
  }
  atlas.send();
  atlas_ = &atlas;
}

void ViewTextures::describe(const Program& program, const simd::SumTask& task, const Rect& rect) const {
  glUniform2i(program.origin, rect.x0, rect.y0);
  glUniform2i(program.size, rect.width(), rect.height());
  const ImageAtlas::Offset cb = atlas_->chroma_offset(1), cr = atlas_->chroma_offset(2);
  glUniform4i(program.chroma_places, cb.x, cb.y, cr.x, cr.y);
  if (const FocalMap* map = task.plan->view().focus.map.get())
    glUniform4f(program.map_scale, static_cast<float>(map->step), static_cast<float>(map->farthest),
                static_cast<float>((map->nearest - map->farthest) / FocalMap::kLevels),
                static_cast<float>(task.plan->eye_distance()));
}

}  // namespace lf::gl
