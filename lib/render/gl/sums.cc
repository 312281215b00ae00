// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sums.h"

#include <algorithm>
#include <array>
#include <memory>

#include "render/gl/passes.h"

namespace lf::gl {
namespace {

BlockSum::Parts lay_out(PixelFamily family, const Rect& rect, uint32_t first) {
  // Rows are padded to whole words.
  const auto columns = static_cast<uint32_t>(chroma_size(rect.width())), rows = static_cast<uint32_t>(rect.height()),
             blocks = static_cast<uint32_t>(chroma_size(rect.height()));
  const bool rgb = family == PixelFamily::kRgb;
  BlockSum::Parts parts{.missing_rows = first, .undecided_rows = first + blocks, .pixels = first + 2 * blocks};
  parts.chroma = parts.pixels + columns * rows * (rgb ? 4 : 1);
  parts.lost = parts.chroma + (rgb ? 0 : columns * blocks);
  parts.end = parts.lost + columns * rows;
  return parts;
}

// Visits the word ranges [first, end) of rows [y0, y1) of the view, for each part that the sum has. y0 is even.
template <class Visit>
void visit_rows(const BlockSum& sum, int y0, int y1, const Visit& visit) {
  const bool rgb = sum.family == PixelFamily::kRgb;
  const auto columns = static_cast<uint32_t>(chroma_size(sum.rect.width())),
             first = static_cast<uint32_t>(y0 - sum.rect.y0), end = static_cast<uint32_t>(y1 - sum.rect.y0);
  const auto visit_part = [&](uint32_t part, uint32_t row, uint32_t first_row, uint32_t end_row) {
    visit(part + row * first_row, part + row * end_row);
  };
  visit_part(sum.parts.pixels, columns * (rgb ? 4 : 1), first, end);
  if (!rgb) visit_part(sum.parts.chroma, columns, first / 2, (end + 1) / 2);
  visit_part(sum.parts.lost, columns, first, end);
}

Rect find_rows(const BlockSum& sum, const uint32_t* words, uint32_t first) {
  const Rect& rect = sum.rect;
  const std::span draws(words + first, static_cast<size_t>(chroma_size(rect.height())));
  const auto begin = std::ranges::find(draws, sum.draw);
  if (begin == draws.end()) return {};
  const auto end = std::find(draws.rbegin(), draws.rend(), sum.draw).base();
  return {rect.x0, rect.y0 + 2 * static_cast<int>(begin - draws.begin()), rect.x1,
          std::min(rect.y0 + 2 * static_cast<int>(end - draws.begin()), rect.y1)};
}

// Points `out` at memory with the layout of the GPU's buffer.
void point_to(const BlockSum& sum, uint32_t* memory, ReadbackBuffer& out) {
  const auto samples = [&](uint32_t first) { return reinterpret_cast<uint16_t*>(memory + first); };
  const uint32_t columns = static_cast<uint32_t>(chroma_size(sum.rect.width()));
  out.pitch = out.missing_pitch = static_cast<int>(2 * columns);
  out.pixels = samples(sum.parts.pixels);
  out.chroma = samples(sum.parts.chroma);
  if (!out.missing_rect.empty())
    out.lost = samples(sum.parts.lost + columns * static_cast<uint32_t>(out.missing_rect.y0 - sum.rect.y0));
}

}  // namespace

std::shared_ptr<ComputeBuffer> BlockSums::next() {
  latest_.clear();
  for (const auto& words : words_)
    if (words.use_count() == 1) return words;
  return words_.emplace_back(std::make_shared<ComputeBuffer>());
}

bool BlockSums::fits(std::span<const GlesView> views) const {
  size_t words = 0, of_tables = 0, of_cells = 0;
  for (const GlesView& view : views) {
    const ViewPlan& plan = *view.task->plan;
    words += lay_out(view.task->family, view.rect, 0).end;
    of_tables +=
        size_t{4} * static_cast<size_t>(face_texels(plan.view().focus.map != nullptr)) * table_rows(*view.task);
    of_cells += most_of_cells(*view.task, view.rect);
  }
  return std::max({words, of_tables, 2 * of_cells}) <= most_words_;  // runs are in the same buffer
}

void BlockSums::begin(std::span<const GlesView> views, PassTables& numbers, const ViewTextures& textures,
                      Programs& programs, GpuTimer& stopwatch) {
  const PixelFamily family = views.front().task->family;
  SumProgram what = program_of(*views.front().task);
  what.output = family == PixelFamily::kRgb ? SumProgram::Output::kBlocksRgb : SumProgram::Output::kBlocksI420;
  const Program& program = programs.use(what);
  const std::shared_ptr<ComputeBuffer> words = next();
  draw_++;
  uint32_t end = 0, columns = 0, rows = 0;
  for (size_t i = 0; i < views.size(); i++) {
    const Rect& rect = views[i].rect;
    const BlockSum::Parts parts = lay_out(family, rect, end);
    end = parts.end;
    numbers.set_result(i, {parts.missing_rows, parts.undecided_rows, parts.pixels, parts.chroma, parts.lost, draw_});
    latest_.push_back(std::make_shared<BlockSum>(BlockSum{family, rect, parts, draw_, words}));
    const auto groups = [](int pixels) { return static_cast<uint32_t>((pixels + 2 * kGroup - 1) / (2 * kGroup)); };
    columns = std::max(columns, groups(rect.width()));
    rows = std::max(rows, groups(rect.height()));
  }
  words->reserve(end);
  numbers.send(numbers_);
  textures.describe_images(program);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, words->name());
  stopwatch.begin();
  glDispatchCompute(columns, rows, static_cast<GLuint>(views.size()));
  stopwatch.end();
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
}

std::shared_ptr<BlockSum> BlockSums::add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view,
                                         Programs& programs) {
  const Program& program = programs.use({.output = SumProgram::Output::kAdded});
  const PixelFamily family = sums.front()->family;
  const bool rgb = family == PixelFamily::kRgb;
  const BlockSum::Parts to = lay_out(family, view, 0);
  const auto all = std::make_shared<BlockSum>(BlockSum{family, view, to, ++draw_, next()});
  all->words->reserve(to.end);
  enum Mode : GLuint { kAdd, kAddMissing, kClear };
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, all->words->name());
  // The sum has `columns` x `rows` words. `missing_row` is the index of the missing_rows word for the first row.
  const auto dispatch = [&](Mode mode, uint32_t columns, uint32_t rows, uint32_t from, uint32_t to_first,
                            uint32_t to_row, uint32_t missing_row = 0) {
    glUniform2i(program.size, static_cast<GLint>(columns), static_cast<GLint>(rows));
    glUniform4ui(program.parts, from, columns, to_first, to_row);
    glUniform4ui(program.planes, mode, missing_row, 0, all->draw);
    glDispatchCompute((columns + kGroup - 1) / kGroup, (rows + kGroup - 1) / kGroup, 1);
  };
  constexpr uint32_t kClearRow = 4096;
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kPictureBinding, sums.front()->words->name());
  dispatch(kClear, kClearRow, to.end / kClearRow, 0, 0, kClearRow);
  dispatch(kClear, to.end % kClearRow, 1, 0, to.end / kClearRow * kClearRow, kClearRow);
  const auto words_of = [](const Rect& rect) { return static_cast<uint32_t>(chroma_size(rect.width())); };
  for (const std::shared_ptr<BlockSum>& sum : sums) {
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kPictureBinding, sum->words->name());
    const Rect& rect = sum->rect;
    const uint32_t columns = words_of(rect), row = words_of(view), rows = static_cast<uint32_t>(rect.height()),
                   blocks = static_cast<uint32_t>(chroma_size(rect.height())),
                   x = static_cast<uint32_t>(rect.x0 - view.x0) / 2, y = static_cast<uint32_t>(rect.y0 - view.y0);
    const uint32_t words = rgb ? 4 : 1;
    dispatch(kAdd, words * columns, rows, sum->parts.pixels, to.pixels + words * (y * row + x), words * row);
    if (!rgb) dispatch(kAdd, columns, blocks, sum->parts.chroma, to.chroma + y / 2 * row + x, row);
    dispatch(kAddMissing, columns, rows, sum->parts.lost, to.lost + y * row + x, row, to.missing_rows + y / 2);
  }
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  return all;
}

void read_sums(std::span<SumReadback> sums) {
  ComputeBuffer& words = *sums.front().sum->words;
  const std::shared_ptr<ComputeBuffer::Fetched> fetched = words.start_readback();
  std::vector<ComputeBuffer::Words> which;
  for (const SumReadback& reading : sums) {
    const BlockSum::Parts& parts = reading.sum->parts;
    which.push_back({parts.missing_rows, reading.only_undecided ? parts.pixels : parts.lost});
  }
  words.fetch(*fetched, which);
  which.clear();
  for (SumReadback& reading : sums) {
    const BlockSum& sum = *reading.sum;
    ReadbackBuffer& out = *reading.out;
    out.memory = fetched;
    const Rect lost = find_rows(sum, fetched->words(), sum.parts.missing_rows);
    reading.any_missing = !lost.empty();
    out.missing_rect = reading.only_undecided ? find_rows(sum, fetched->words(), sum.parts.undecided_rows) : lost;
    point_to(sum, fetched->words(), out);
    if (out.missing_rect.empty()) continue;
    visit_rows(sum, out.missing_rect.y0, out.missing_rect.y1, [&](uint32_t first, uint32_t end) {
      if (reading.only_undecided || first >= sum.parts.lost) which.push_back({first, end});
    });
  }
  if (!which.empty()) words.fetch(*fetched, which);
}

void BlockSum::write_back(const ReadbackBuffer& from) {
  const auto* const memory = reinterpret_cast<const uint32_t*>(from.pixels) - parts.pixels;
  glBindBuffer(GL_COPY_WRITE_BUFFER, words->name());
  visit_rows(*this, from.missing_rect.y0, from.missing_rect.y1, [&](uint32_t first, uint32_t end) {
    glBufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(first * sizeof *memory),
                    static_cast<GLsizeiptr>((end - first) * sizeof *memory), memory + first);
  });
}

// The layout is as in kConsistency of sum_shader-inl.h.
void ConsistencySums::upload_surfaces(const ConsistencyTask& task, const Rect& rect) {
  const auto width = static_cast<size_t>(rect.width()), pitch = (width + 3) / 4 * 4;
  const auto columns = static_cast<size_t>(task.sums.plan->view().width);
  surface_memory_.assign(pitch * rect.height() * task.surfaces.size(), 0);
  uint8_t* to = surface_memory_.data();
  for (const std::vector<uint8_t>& levels : task.surfaces)
    for (int y = rect.y0; y < rect.y1; y++, to += pitch) std::copy_n(&levels[y * columns + rect.x0], width, to);
  surfaces_.reserve(surface_memory_.size());
  surfaces_.put(0, surface_memory_.data(), surface_memory_.size());
}

void ConsistencySums::begin(const ConsistencyTask& task, const Rect& rect, const PassTables& numbers,
                            const ViewTextures& textures, Programs& programs, GpuTimer& stopwatch) {
  SumProgram what = program_of(task.sums);
  what.output = task.sums.family == PixelFamily::kRgb ? SumProgram::Output::kConsistencyRgb
                                                      : SumProgram::Output::kConsistencyI420;
  const Program& program = programs.use(what);
  upload_surfaces(task, rect);
  const auto pairs = static_cast<uint32_t>((rect.width() + 1) / 2), rows = static_cast<uint32_t>(rect.height());
  words_ = size_t{3} * task.surfaces.size() * pairs * rows;
  result_.reserve(words_);
  numbers.send(numbers_);
  textures.describe_images(program);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kResultBinding, result_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kSurfacesBinding, surfaces_.name());
  stopwatch.begin();
  glDispatchCompute((pairs + kGroup - 1) / kGroup, (rows + kGroup - 1) / kGroup,
                    static_cast<uint32_t>(task.surfaces.size()));
  stopwatch.end();
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
}

void ConsistencySums::read(ConsistencyReadback& out) {
  const std::shared_ptr<ComputeBuffer::Fetched> fetched = result_.start_readback();
  out.memory = fetched;
  out.pitch = (out.rect.width() + 1) / 2 * 2;
  out.values = reinterpret_cast<const uint16_t*>(fetched->words());
  const ComputeBuffer::Words all{0, words_};
  result_.fetch(*fetched, {&all, 1});
}

}  // namespace lf::gl
