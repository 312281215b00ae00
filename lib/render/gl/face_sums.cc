// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/face_sums.h"

#include <algorithm>
#include <cstddef>

#include "base/byte_buffer.h"
#include "render/gl/sum_tables.h"

namespace lf::gl {

FaceSums::FaceSums(bool has_float_blend) : float_target_(has_float_blend ? GL_RG32F : GL_RG16F) {
  glGenFramebuffers(1, &frame_);
  glGenBuffers(1, &corners_);
}

FaceSums::~FaceSums() {
  glDeleteFramebuffers(1, &frame_);
  glDeleteBuffers(1, &corners_);
}

void FaceSums::upload_owners(const simd::SumTask& task, const Rect& rect) {
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

// Of the owners that were uploaded. Where the view ends in half a block, the block's middle may be outside of the face
// that has its pixels, so that only what is drawn of several owners' faces, a margin around, is sure to reach it.
void FaceSums::upload_block_owners(const Rect& rect) {
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
    const auto of_half = [](uint16_t a, uint16_t b) {
      return a | b ? static_cast<uint16_t>(kMixedOwners) : uint16_t{0};
    };
    if (upper == lower)
      for (int i = 0; i < width / 2; i++) to[i] = of_half(upper[2 * i], upper[2 * i + 1]);
    else
      for (int i = 0; i < width / 2; i++)
        to[i] = common(upper[2 * i], upper[2 * i + 1], lower[2 * i], lower[2 * i + 1]);
    if (width % 2) to[columns - 1] = of_half(upper[width - 1], lower[width - 1]);
  }
  block_owners_.bind(kBlockOwners, GL_DEPTH_COMPONENT16, columns, rows);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, columns, rows, GL_DEPTH_COMPONENT, GL_UNSIGNED_SHORT, block_memory_.data());
}

// Makes it what is drawn to there.
void FaceSums::attach(GLenum where, Texture& texture, GLenum format, int width, int height) {
  texture.bind(kTargets, format, width, height);
  glFramebufferTexture2D(GL_FRAMEBUFFER, where, GL_TEXTURE_2D, texture.name(), 0);
}

// What is drawn from now on is drawn there, where the owners are its own. False if the driver can't.
bool FaceSums::begin(Texture& texture, GLenum format, const Texture& depths, int width, int height) {
  attach(GL_COLOR_ATTACHMENT0, texture, format, width, height);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depths.name(), 0);
  constexpr GLenum kOne[] = {GL_COLOR_ATTACHMENT0};
  glDrawBuffers(1, kOne);
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) return false;
  glViewport(0, 0, width, height);
  constexpr GLuint kZeros[4] = {};
  constexpr GLfloat kNothing[4] = {};
  if (format == float_target_)
    glClearBufferfv(GL_COLOR, 0, kNothing);
  else
    glClearBufferuiv(GL_COLOR, 0, kZeros);
  return true;
}

// Of one kind, over what is bound as the frame, which is `width` x `height` pixels of the view; false with the reason
// in `why`.
bool FaceSums::draw(const SumProgram& what, const std::vector<CoverCorner>& triangles, int width, int height,
                    std::string& why) {
  if (triangles.empty()) return true;
  const Program* program = job_.programs->use(what, why);
  if (!program) return false;
  job_.textures->describe(*program, job_.view);
  glUniform2f(program->extent, static_cast<float>(width), static_cast<float>(height));
  glBindBuffer(GL_ARRAY_BUFFER, corners_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size() * sizeof(CoverCorner)), triangles.data(),
               GL_STREAM_DRAW);
  const auto offset = [](size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, sizeof(CoverCorner), offset(0));
  glVertexAttribIPointer(1, 1, GL_UNSIGNED_INT, sizeof(CoverCorner), offset(offsetof(CoverCorner, face)));
  glEnableVertexAttribArray(0);
  glEnableVertexAttribArray(1);
  glDrawArrays(GL_TRIANGLES, 0, static_cast<GLsizei>(triangles.size()));
  return true;
}

// The program for all of a task's faces.
static SumProgram program_for(const simd::SumTask& task, SumProgram::Output output, bool careful) {
  SumProgram program = program_of(task);
  program.output = output;
  program.careful = careful;
  return program;
}

static bool fail(std::string& why, std::string reason) {
  why = std::move(reason);
  return false;
}

// Pixels, and where they are careful what they have lost.
bool FaceSums::draw_pixels(std::string& why) {
  const simd::SumTask* const task = job_.view.task;
  const Rect& rect = job_.view.rect;
  const FaceCover& cover = job_.cover;
  const bool rgb = task->family == PixelFamily::kRgb;
  const SumProgram::Output output = rgb ? SumProgram::Output::kRgb : SumProgram::Output::kLuma;
  const int width = rect.width(), height = rect.height();
  if (!begin(pixels_, rgb ? GL_RGBA16UI : GL_R16UI, owners_, width, height))
    return fail(why, "16-bit targets can't be drawn to");
  if (!draw(program_for(*task, output, false), cover.calm.pixels, width, height, why)) return false;
  if (cover.careful_rect.empty()) return true;
  attach(GL_COLOR_ATTACHMENT1, lost_, GL_R16UI, width, height);
  constexpr GLenum kBoth[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(2, kBoth);
  constexpr GLuint kZeros[4] = {};
  glClearBufferuiv(GL_COLOR, 1, kZeros);
  const bool drawn = draw(program_for(*task, output, true), cover.careful.pixels, width, height, why);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, 0, 0);
  return drawn;
}

bool FaceSums::draw_chroma(std::string& why) {
  const Rect& rect = job_.view.rect;
  const FaceCover& cover = job_.cover;
  const int width = chroma_size(rect.width()), height = chroma_size(rect.height());
  bool drawn = true;
  const auto add = [&](SumProgram::Output output, bool careful, const std::vector<CoverCorner>& triangles) {
    drawn = drawn && draw(program_for(*job_.view.task, output, careful), triangles, 2 * width, 2 * height, why);
  };
  if (!begin(chroma_sums_, float_target_, block_owners_, width, height))
    return fail(why, "sums in float can't be drawn to");
  glEnable(GL_BLEND);
  glBlendFunc(GL_ONE, GL_ONE);
  add(SumProgram::Output::kMixedChroma, false, cover.calm.blocks);
  add(SumProgram::Output::kMixedChroma, true, cover.careful.blocks);
  glDisable(GL_BLEND);
  if (!begin(chroma_, GL_RG16UI, block_owners_, width, height)) return fail(why, "16-bit targets can't be drawn to");
  add(SumProgram::Output::kChroma, false, cover.calm.pixels);
  add(SumProgram::Output::kChroma, true, cover.careful.pixels);
  if (!drawn || !job_.programs->use({.output = SumProgram::Output::kChromaBits}, why)) return false;
  glActiveTexture(GL_TEXTURE0 + kChromaSums);
  glBindTexture(GL_TEXTURE_2D, chroma_sums_.name());
  glDisableVertexAttribArray(0);
  glDisableVertexAttribArray(1);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  return true;
}

bool FaceSums::begin(const DrawnView& view, const ViewTextures& textures, Programs& programs, Stopwatch& stopwatch,
                     std::string& why) {
  const simd::SumTask& task = *view.task;
  const Rect& rect = view.rect;
  job_ = {view, &textures, &programs, cover_faces(task, rect)};
  upload_owners(task, rect);
  make_tables(task, textures.atlas().offsets(0), table_memory_);
  const int texels = face_texels(task.plan->view().focus.map != nullptr),
            faces = static_cast<int>(task.plan->faces().size());
  tables_.bind(kTables, GL_RGBA32F, kMaxTableTexels, faces);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, texels, faces, GL_RGBA, GL_FLOAT, table_memory_.data());
  glBindFramebuffer(GL_FRAMEBUFFER, frame_);
  glDepthFunc(GL_EQUAL);
  glDepthMask(GL_FALSE);
  glEnable(GL_DEPTH_TEST);
  stopwatch.begin();
  const bool drawn = draw_pixels(why);
  stopwatch.end();
  if (!drawn) return false;
  glFlush();  // while the card draws those, the rest goes up
  if (task.family != PixelFamily::kI420) return true;
  upload_block_owners(rect);
  stopwatch.begin();
  const bool has_chroma = draw_chroma(why);
  stopwatch.end();
  return has_chroma;
}

void FaceSums::read(DrawnSum& out) {
  const bool rgb = out.family == PixelFamily::kRgb;
  const Rect& rect = out.rect;
  const int width = rect.width(), height = rect.height();
  out.pitch = width;
  out.lost_rect = job_.cover.careful_rect;
  const Rect& lost = out.lost_rect;
  out.lost_pitch = lost.width();
  const int columns = chroma_size(width), rows = chroma_size(height);
  const size_t pixels = static_cast<size_t>(width) * height * (rgb ? 4 : 1),
               chroma = rgb ? 0 : 2 * static_cast<size_t>(columns) * rows;
  const auto memory = std::make_shared<UninitializedVector<uint16_t>>();
  memory->resize(pixels + chroma + static_cast<size_t>(lost.width()) * lost.height());
  out.memory = memory;
  out.pixels = memory->data();
  out.chroma = out.pixels + pixels;
  out.lost = out.chroma + chroma;
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, 0, 0);
  attach(GL_COLOR_ATTACHMENT0, pixels_, rgb ? GL_RGBA16UI : GL_R16UI, width, height);
  glReadPixels(0, 0, width, height, rgb ? GL_RGBA_INTEGER : GL_RED_INTEGER, GL_UNSIGNED_SHORT, out.pixels);
  if (!lost.empty()) {
    attach(GL_COLOR_ATTACHMENT0, lost_, GL_R16UI, width, height);
    glReadPixels(lost.x0 - rect.x0, lost.y0 - rect.y0, lost.width(), lost.height(), GL_RED_INTEGER, GL_UNSIGNED_SHORT,
                 out.lost);
  }
  if (rgb) return;
  attach(GL_COLOR_ATTACHMENT0, chroma_, GL_RG16UI, columns, rows);
  glReadPixels(0, 0, columns, rows, GL_RG_INTEGER, GL_UNSIGNED_SHORT, out.chroma);
}

}  // namespace lf::gl
