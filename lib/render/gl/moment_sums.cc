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
  surfaces_.reserve(surface_memory_.size());
  surfaces_.put(0, surface_memory_.data(), surface_memory_.size());
}

bool MomentSums::begin(const MomentTask& task, const Rect& rect, const PassNumbers& numbers,
                       const ViewTextures& textures, Programs& programs, Stopwatch& stopwatch, std::string& why) {
  SumProgram what = program_of(task.sums);
  what.output =
      task.sums.family == PixelFamily::kRgb ? SumProgram::Output::kMomentsRgb : SumProgram::Output::kMomentsI420;
  const Program* program = programs.use(what, why);
  if (!program) return false;
  upload_surfaces(task, rect);
  const auto pairs = static_cast<uint32_t>((rect.width() + 1) / 2), rows = static_cast<uint32_t>(rect.height());
  words_ = size_t{3} * task.surfaces.size() * pairs * rows;
  if (!result_.reserve(words_, why)) return false;
  numbers.send(numbers_);
  textures.describe_images(*program);
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
  const Computed::Words all{0, words_};
  return result_.fetch(*fetched, {&all, 1});
}

}  // namespace lf::gl
