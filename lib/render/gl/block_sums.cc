// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/block_sums.h"

#include <algorithm>
#include <memory>
#include <span>

#include "render/gl/sum_tables.h"

namespace lf::gl {

bool BlockSums::begin(const simd::SumTask& task, const ViewTextures& view, Programs& programs, const Rect& rect,
                      Stopwatch& stopwatch, std::string& why) {
  const bool rgb = task.family == PixelFamily::kRgb;
  SumProgram what = program_of(task);
  what.output = rgb ? SumProgram::Output::kBlocksRgb : SumProgram::Output::kBlocksI420;
  what.careful = true;
  const Program* program = programs.use(what, why);
  if (!program) return false;
  make_runs(task, rect, run_memory_);
  runs_.set(run_memory_.data(), sizeof(run_memory_[0]) * run_memory_.size());
  make_tables(task, view.atlas(), table_memory_);
  tables_.set(table_memory_.data(), sizeof(table_memory_[0]) * table_memory_.size());
  // Whole words in each row.
  const auto columns = static_cast<uint32_t>(chroma_size(rect.width())), rows = static_cast<uint32_t>(rect.height()),
             blocks = static_cast<uint32_t>(chroma_size(rect.height()));
  parts_.pixels = blocks;
  parts_.chroma = parts_.pixels + columns * rows * (rgb ? 4 : 1);
  parts_.lost = parts_.chroma + (rgb ? 0 : columns * blocks);
  parts_.end = parts_.lost + columns * rows;
  if (!result_.reserve(parts_.end, why)) return false;
  view.describe(*program, task, rect);
  glUniform4ui(program->parts, parts_.pixels, parts_.chroma, parts_.lost, ++draw_);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kRunsBinding, runs_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kTablesBinding, tables_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, result_.name());
  stopwatch.begin();
  glDispatchCompute((columns + kGroup - 1) / kGroup, (blocks + kGroup - 1) / kGroup, 1);
  stopwatch.end();
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  return true;
}

bool BlockSums::read(DrawnSum& out) {
  const std::shared_ptr<Computed::Fetched> fetched = result_.begin_to_fetch();
  out.memory = fetched;
  if (!result_.fetch(*fetched, 0, parts_.lost)) return false;
  uint32_t* const words = fetched->words();
  const auto samples = [&](uint32_t first) { return reinterpret_cast<uint16_t*>(words + first); };
  const Rect& rect = out.rect;
  const uint32_t columns = static_cast<uint32_t>(chroma_size(rect.width()));
  out.pitch = out.lost_pitch = static_cast<int>(2 * columns);
  out.pixels = samples(parts_.pixels);
  out.chroma = samples(parts_.chroma);
  // Of each row of blocks: the draw that has lost something there.
  const std::span<const uint32_t> draws(words, static_cast<size_t>(chroma_size(rect.height())));
  const auto first = std::ranges::find(draws, draw_);
  if (first == draws.end()) return true;
  const auto end = std::find(draws.rbegin(), draws.rend(), draw_).base();
  out.lost_rect = {rect.x0, rect.y0 + 2 * static_cast<int>(first - draws.begin()), rect.x1,
                   std::min(rect.y0 + 2 * static_cast<int>(end - draws.begin()), rect.y1)};
  const auto row = [&](int y) { return parts_.lost + columns * static_cast<uint32_t>(y - rect.y0); };
  out.lost = samples(row(out.lost_rect.y0));
  return result_.fetch(*fetched, row(out.lost_rect.y0), row(out.lost_rect.y1));
}

}  // namespace lf::gl
