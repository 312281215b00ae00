// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/block_sums.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "render/gl/sum_tables.h"

namespace lf::gl {

constexpr size_t kWord = sizeof(uint32_t);

// As block_shader-inl.h has them.
void BlockSums::upload_runs(const simd::SumTask& task, const Rect& rect) {
  run_memory_.assign(static_cast<size_t>(rect.height()) + 1, 0);
  const size_t rows = run_memory_.size();
  for (int y = rect.y0; y < rect.y1; y++) {
    for (const OwnerRun& run : task.runs->row(y, rect.x0, rect.x1)) {
      // What is none of ours costs nothing.
      if (!task.face_corners[static_cast<size_t>(run.face)]) continue;
      const int x0 = std::max(run.x0, rect.x0) - rect.x0, x1 = std::min(run.x1, rect.x1) - rect.x0;
      run_memory_.push_back(static_cast<uint32_t>(x0) | static_cast<uint32_t>(x1) << 16);
      run_memory_.push_back(static_cast<uint32_t>(run.face));
    }
    run_memory_[static_cast<size_t>(y - rect.y0) + 1] = static_cast<uint32_t>((run_memory_.size() - rows) / 2);
  }
  runs_.set(run_memory_.data(), kWord * run_memory_.size());
}

bool BlockSums::begin(const simd::SumTask& task, const ViewTextures& view, Programs& programs, const Rect& rect,
                      Stopwatch& stopwatch, std::string& why) {
  const bool rgb = task.family == PixelFamily::kRgb;
  SumProgram what = program_of(task);
  what.output = rgb ? SumProgram::Output::kBlocksRgb : SumProgram::Output::kBlocksI420;
  what.careful = true;
  const Program* program = programs.use(what, why);
  if (!program) return false;
  upload_runs(task, rect);
  make_tables(task, view.atlas(), table_memory_);
  tables_.set(table_memory_.data(), sizeof(float) * table_memory_.size());
  // Whole words in each row.
  const auto columns = static_cast<uint32_t>(chroma_size(rect.width())), rows = static_cast<uint32_t>(rect.height()),
             blocks = static_cast<uint32_t>(chroma_size(rect.height()));
  parts_.pixels = blocks;
  parts_.chroma = parts_.pixels + columns * rows * (rgb ? 4 : 1);
  parts_.lost = parts_.chroma + (rgb ? 0 : columns * blocks);
  parts_.end = parts_.lost + columns * rows;
  result_.reserve(kWord * parts_.end);
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

BlockSums::Answer& BlockSums::free_answer() {
  for (const auto& answer : answers_)
    if (answer->is_free.exchange(false)) return *answer;
  answers_.push_back(std::make_unique<Answer>());
  answers_.back()->is_free = false;
  return *answers_.back();
}

// Words [first, end) of the result, to the same place in the answer's memory. False if the card does not answer.
bool BlockSums::fetch(Answer& answer, uint32_t first, uint32_t end) {
  glBindBuffer(GL_COPY_READ_BUFFER, result_.name());
  glBindBuffer(GL_COPY_WRITE_BUFFER, answer.buffer.name());
  const auto at = static_cast<GLintptr>(kWord * first);
  const auto size = static_cast<GLsizeiptr>(kWord * (end - first));
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, at, at, size);
  if (answer.buffer.memory()) {
    const GLsync done = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    constexpr GLuint64 kLongest = 10'000'000'000;  // ns; a card that takes longer is lost
    const GLenum state = glClientWaitSync(done, GL_SYNC_FLUSH_COMMANDS_BIT, kLongest);
    glDeleteSync(done);
    return state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED;
  }
  answer.memory.resize(kWord * parts_.end);
  const void* mapped = glMapBufferRange(GL_COPY_WRITE_BUFFER, at, size, GL_MAP_READ_BIT);
  if (!mapped) return false;
  std::memcpy(answer.memory.data() + at, mapped, static_cast<size_t>(size));
  glUnmapBuffer(GL_COPY_WRITE_BUFFER);
  return true;
}

bool BlockSums::read(DrawnSum& out) {
  Answer& answer = free_answer();
  out.memory = std::shared_ptr<void>(&answer, [&answer](void*) { answer.is_free = true; });
  answer.buffer.reserve(kWord * parts_.end);
  if (!fetch(answer, 0, parts_.lost)) return false;
  auto* words = reinterpret_cast<uint32_t*>(answer.buffer.memory() ? answer.buffer.memory() : answer.memory.data());
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
  return fetch(answer, row(out.lost_rect.y0), row(out.lost_rect.y1));
}

}  // namespace lf::gl
