// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/pass_numbers.h"

#include <algorithm>
#include <bit>

#include "render/gl/sum_tables.h"

namespace lf::gl {

void PassNumbers::make(std::span<const DrawnView> views, const ImageAtlas& atlas, const ParallelFor& parallel,
                       std::span<const int> boxes) {
  views_.resize(views.size());
  parallel(views.size(), [&](size_t i) {
    make_runs(*views[i].task, views[i].rect, views_[i].runs);
    make_tables(*views[i].task, atlas.offsets(i), views_[i].tables, boxes);
  });
  for (size_t i = 0; i < views.size(); i++) make_cells(*views[i].task, views[i].rect, parallel, views_[i].cells);
  heads_.assign(kViewWords * views.size(), 0);
  size_t runs = heads_.size(), faces = 0;
  int levels = 0;
  for (size_t i = 0; i < views.size(); i++) {
    uint32_t* const head = &heads_[kViewWords * i];
    const auto put = [head](ViewWord word, auto... values) {
      size_t at = word;
      ((head[at++] = static_cast<uint32_t>(values)), ...);
    };
    const ViewPlan& plan = *views[i].task->plan;
    const Rect& rect = views[i].rect;
    put(kViewOrigin, rect.x0, rect.y0);
    put(kViewSize, rect.width(), rect.height());
    put(kViewRuns, runs);
    put(kViewFaces, faces);
    put(kViewLevels, levels);
    if (const FocalMap* map = plan.view().focus.map.get()) {
      put(kViewNodes, map->columns, map->rows);
      levels += map->rows;
    }
    const MapScale scale = scale_of(plan);
    const auto bits = [](float value) { return std::bit_cast<uint32_t>(value); };
    put(kViewScale, bits(scale.step), bits(scale.farthest), bits(scale.of_level), bits(scale.eye_distance));
    runs += views_[i].runs.size();
    put(kViewCells, runs);
    runs += views_[i].cells.size();
    faces += table_rows(*views[i].task);
  }
}

void PassNumbers::set_result(size_t view, const std::array<uint32_t, 6>& words) {
  std::ranges::copy(words, &heads_[kViewWords * view + kViewResult]);
}

void PassNumbers::send(Buffers& to) const {
  size_t runs = heads_.size(), tables = 0;
  for (const View& view : views_) {
    runs += view.runs.size() + view.cells.size();
    tables += view.tables.size();
  }
  to.runs.reserve(sizeof(uint32_t) * runs);
  to.tables.reserve(sizeof(float) * tables);
  to.runs.put(0, heads_.data(), sizeof(uint32_t) * heads_.size());
  runs = heads_.size();
  tables = 0;
  for (const View& view : views_) {
    to.tables.put(sizeof(float) * tables, view.tables.data(), sizeof(float) * view.tables.size());
    for (const std::vector<uint32_t>* const words : {&view.runs, &view.cells}) {
      to.runs.put(sizeof(uint32_t) * runs, words->data(), sizeof(uint32_t) * words->size());
      runs += words->size();
    }
    tables += view.tables.size();
  }
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kRunsBinding, to.runs.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kTablesBinding, to.tables.name());
}

}  // namespace lf::gl
