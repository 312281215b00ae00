// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/block_sums.h"

#include <algorithm>
#include <memory>

#include "render/gl/sum_tables.h"

namespace lf::gl {

// One that nobody holds.
BlockSum& BlockSums::next() {
  latest_.reset();
  for (const auto& sum : sums_)
    if (sum.use_count() == 1) latest_ = sum;
  if (!latest_) latest_ = sums_.emplace_back(std::make_shared<BlockSum>());
  return *latest_;
}

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
  BlockSum& sum = next();
  sum.family = task.family;
  sum.rect = rect;
  sum.draw = ++draw_;
  // Whole words in each row.
  const auto columns = static_cast<uint32_t>(chroma_size(rect.width())), rows = static_cast<uint32_t>(rect.height()),
             blocks = static_cast<uint32_t>(chroma_size(rect.height()));
  BlockSum::Parts& parts = sum.parts;
  parts.pixels = 2 * blocks;
  parts.chroma = parts.pixels + columns * rows * (rgb ? 4 : 1);
  parts.lost = parts.chroma + (rgb ? 0 : columns * blocks);
  parts.end = parts.lost + columns * rows;
  if (!sum.words.reserve(parts.end, why)) return false;
  view.describe(*program, task, rect);
  glUniform4ui(program->parts, parts.pixels, parts.chroma, parts.lost, sum.draw);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kRunsBinding, runs_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kTablesBinding, tables_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, sum.words.name());
  stopwatch.begin();
  glDispatchCompute((columns + kGroup - 1) / kGroup, (blocks + kGroup - 1) / kGroup, 1);
  stopwatch.end();
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  return true;
}

// Words [first, end) of each part, of rows [y0, y1) of the view, y0 even. False once `visit` is.
template <class Visit>
bool BlockSum::visit_rows(int y0, int y1, const Visit& visit) const {
  const bool rgb = family == PixelFamily::kRgb;
  const auto columns = static_cast<uint32_t>(chroma_size(rect.width())), first = static_cast<uint32_t>(y0 - rect.y0),
             end = static_cast<uint32_t>(y1 - rect.y0);
  const auto visit_part = [&](uint32_t part, uint32_t row, uint32_t first_row, uint32_t end_row) {
    return visit(part + row * first_row, part + row * end_row);
  };
  return visit_part(parts.pixels, columns * (rgb ? 4 : 1), first, end) &&
         (rgb || visit_part(parts.chroma, columns, first / 2, (end + 1) / 2)) &&
         visit_part(parts.lost, columns, first, end);
}

// The rows of the sum that are between the first and the last row of blocks with this draw.
Rect BlockSum::find_rows(std::span<const uint32_t> draws) const {
  const auto first = std::ranges::find(draws, draw);
  if (first == draws.end()) return {};
  const auto end = std::find(draws.rbegin(), draws.rend(), draw).base();
  return {rect.x0, rect.y0 + 2 * static_cast<int>(first - draws.begin()), rect.x1,
          std::min(rect.y0 + 2 * static_cast<int>(end - draws.begin()), rect.y1)};
}

// Has a sum refer to what lies in memory as on the card.
void BlockSum::point_to(uint32_t* memory, DrawnSum& out) const {
  const auto samples = [&](uint32_t first) { return reinterpret_cast<uint16_t*>(memory + first); };
  const uint32_t columns = static_cast<uint32_t>(chroma_size(rect.width()));
  out.pitch = out.lost_pitch = static_cast<int>(2 * columns);
  out.pixels = samples(parts.pixels);
  out.chroma = samples(parts.chroma);
  if (!out.lost_rect.empty())
    out.lost = samples(parts.lost + columns * static_cast<uint32_t>(out.lost_rect.y0 - rect.y0));
}

bool BlockSum::read(DrawnSum& out) {
  const std::shared_ptr<Computed::Fetched> fetched = words.begin_to_fetch();
  out.memory = fetched;
  if (!words.fetch(*fetched, 0, parts.lost)) return false;
  out.lost_rect = find_rows({fetched->words(), parts.pixels / 2});
  point_to(fetched->words(), out);
  if (out.lost_rect.empty()) return true;
  return visit_rows(out.lost_rect.y0, out.lost_rect.y1, [&](uint32_t first, uint32_t end) {
    return first < parts.lost || words.fetch(*fetched, first, end);
  });
}

bool BlockSum::read_open(DrawnSum& out, bool& any_lost) {
  const std::shared_ptr<Computed::Fetched> fetched = words.begin_to_fetch();
  out.memory = fetched;
  if (!words.fetch(*fetched, 0, parts.pixels)) return false;
  const std::span<const uint32_t> draws(fetched->words(), parts.pixels);
  any_lost = !find_rows(draws.first(draws.size() / 2)).empty();
  out.lost_rect = find_rows(draws.last(draws.size() / 2));
  point_to(fetched->words(), out);
  if (out.lost_rect.empty()) return true;
  return visit_rows(out.lost_rect.y0, out.lost_rect.y1,
                    [&](uint32_t first, uint32_t end) { return words.fetch(*fetched, first, end); });
}

void BlockSum::write_back(const DrawnSum& from) {
  const auto* const memory = reinterpret_cast<const uint32_t*>(from.pixels) - parts.pixels;
  glBindBuffer(GL_COPY_WRITE_BUFFER, words.name());
  visit_rows(from.lost_rect.y0, from.lost_rect.y1, [&](uint32_t first, uint32_t end) {
    glBufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(first * sizeof *memory),
                    static_cast<GLsizeiptr>((end - first) * sizeof *memory), memory + first);
    return true;
  });
}

}  // namespace lf::gl
