// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/view_textures.h"

#include <algorithm>

#include "render/gl/sum_tables.h"

namespace lf::gl {

void ViewTextures::upload_owners(const simd::SumTask& task, const Rect& rect) {
  const int width = rect.width(), height = rect.height();
  owner_memory_.resize(static_cast<size_t>(width) * height);
  for (int y = rect.y0; y < rect.y1; y++) {
    uint16_t* row = &owner_memory_[static_cast<size_t>(y - rect.y0) * width];
    int done = 0;
    for (const OwnerRun& run : task.runs->row(y, rect.x0, rect.x1)) {
      const int x0 = std::max(run.x0, rect.x0) - rect.x0, x1 = std::min(run.x1, rect.x1) - rect.x0;
      std::fill(row + done, row + x0, uint16_t{0});
      std::fill(row + x0, row + x1, static_cast<uint16_t>(run.face + 1));
      done = x1;
    }
    std::fill(row + done, row + width, uint16_t{0});
  }
  owners_.bind(kOwners, GL_DEPTH_COMPONENT16, width, height);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_DEPTH_COMPONENT, GL_UNSIGNED_SHORT, owner_memory_.data());
}

// Of the owners that were uploaded.
void ViewTextures::upload_block_owners(const Rect& rect) {
  const int width = rect.width(), height = rect.height(), columns = chroma_size(width), rows = chroma_size(height);
  block_memory_.resize(static_cast<size_t>(columns) * rows);
  for (int j = 0; j < rows; j++) {
    const uint16_t* const upper = &owner_memory_[static_cast<size_t>(2 * j) * width];
    const uint16_t* const lower = 2 * j + 1 < height ? upper + width : upper;
    uint16_t* __restrict const to = &block_memory_[static_cast<size_t>(j) * columns];
    const auto common = [](uint16_t a, uint16_t b, uint16_t c, uint16_t d) {
      const bool same = ((a ^ b) | (a ^ c) | (a ^ d)) == 0;
      return same ? a : static_cast<uint16_t>(kMixedOwners);
    };
    for (int i = 0; i < width / 2; i++) to[i] = common(upper[2 * i], upper[2 * i + 1], lower[2 * i], lower[2 * i + 1]);
    if (width % 2) to[columns - 1] = common(upper[width - 1], upper[width - 1], lower[width - 1], lower[width - 1]);
  }
  block_owners_.bind(kBlockOwners, GL_DEPTH_COMPONENT16, columns, rows);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, columns, rows, GL_DEPTH_COMPONENT, GL_UNSIGNED_SHORT, block_memory_.data());
}

void ViewTextures::upload_tables(const simd::SumTask& task, const ImageAtlas& atlas) {
  make_tables(task, atlas, table_memory_);
  const int texels = face_texels(task.plan->view().focus.map != nullptr),
            faces = static_cast<int>(task.plan->faces().size());
  tables_.bind(kTables, GL_RGBA32F, kMaxTableTexels, faces);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, texels, faces, GL_RGBA, GL_FLOAT, table_memory_.data());
}

// The four nodes around each cell of the map.
void ViewTextures::upload_levels(const FocalMap& map) {
  const int width = std::max(map.columns - 1, 1), height = std::max(map.rows - 1, 1);
  level_memory_.resize(4 * static_cast<size_t>(width) * height);
  uint8_t* to = level_memory_.data();
  for (int j = 0; j < height; j++) {
    const uint8_t* upper = &map.levels[static_cast<size_t>(j) * map.columns];
    const uint8_t* lower = j + 1 < map.rows ? upper + map.columns : upper;
    for (int i = 0; i < width; i++) {
      const int next = std::min(i + 1, map.columns - 1);
      for (const uint8_t level : {upper[i], upper[next], lower[i], lower[next]}) *to++ = level;
    }
  }
  levels_.bind(kLevels, GL_RGBA8UI, width, height, true);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA_INTEGER, GL_UNSIGNED_BYTE, level_memory_.data());
}

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

void ViewTextures::upload(const simd::SumTask& task, const ImageAtlas& atlas, const Rect& rect) {
  const ViewPlan& plan = *task.plan;
  glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
  upload_owners(task, rect);
  upload_tables(task, atlas);
  if (!plan.rays().separable()) upload_rays(plan.rays(), rect, false);
  if (const FocalMap* map = plan.view().focus.map.get()) upload_levels(*map);
}

void ViewTextures::upload_blocks(const simd::SumTask& task, const Rect& rect) {
  upload_block_owners(rect);
  if (!task.plan->rays().separable()) upload_rays(task.plan->rays(), rect, true);
}

}  // namespace lf::gl
