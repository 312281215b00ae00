// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/moment_sums.h"

#include <algorithm>

#include "render/gl/sum_tables.h"

namespace lf::gl {

// As moment_shader-inl.h has them.
void MomentSums::upload_surfaces(const MomentTask& task, const Rect& rect) {
  const auto width = static_cast<size_t>(rect.width()), pitch = (width + 3) / 4 * 4;
  const auto columns = static_cast<size_t>(task.sums.plan->view().width);
  surface_memory_.assign(pitch * rect.height() * task.surfaces.size(), 0);
  uint8_t* to = surface_memory_.data();
  for (const std::vector<uint8_t>& levels : task.surfaces)
    for (int y = rect.y0; y < rect.y1; y++, to += pitch) std::copy_n(&levels[y * columns + rect.x0], width, to);
  surfaces_.set(surface_memory_.data(), surface_memory_.size());
}

bool MomentSums::begin(const MomentTask& task, const ViewTextures& view, Programs& programs, const Rect& rect,
                       Stopwatch& stopwatch, std::string& why) {
  SumProgram what = program_of(task.sums);
  what.output =
      task.sums.family == PixelFamily::kRgb ? SumProgram::Output::kMomentsRgb : SumProgram::Output::kMomentsI420;
  const Program* program = programs.use(what, why);
  if (!program) return false;
  make_runs(task.sums, rect, run_memory_);
  runs_.set(run_memory_.data(), sizeof(run_memory_[0]) * run_memory_.size());
  make_tables(task.sums, view.atlas(), table_memory_, task.boxes);
  tables_.set(table_memory_.data(), sizeof(table_memory_[0]) * table_memory_.size());
  upload_surfaces(task, rect);
  const auto pairs = static_cast<uint32_t>((rect.width() + 1) / 2), rows = static_cast<uint32_t>(rect.height());
  words_ = size_t{3} * task.surfaces.size() * pairs * rows;
  if (!result_.reserve(words_, why)) return false;
  view.describe(*program, task.sums, rect);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kRunsBinding, runs_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kTablesBinding, tables_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, result_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kSurfacesBinding, surfaces_.name());
  stopwatch.begin();
  glDispatchCompute((pairs + kGroup - 1) / kGroup, (rows + kGroup - 1) / kGroup,
                    static_cast<uint32_t>(task.surfaces.size()));
  stopwatch.end();
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  return true;
}

bool MomentSums::read(DrawnMoments& out) {
  const std::shared_ptr<Computed::Fetched> fetched = result_.begin_to_fetch();
  out.memory = fetched;
  out.pitch = (out.rect.width() + 1) / 2 * 2;
  out.values = reinterpret_cast<const uint16_t*>(fetched->words());
  return result_.fetch(*fetched, 0, words_);
}

}  // namespace lf::gl
