// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/sum_drawer.h"

#include <algorithm>
#include <cstddef>

#include "render/gl/face_cover.h"
#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/gl/view_textures.h"

namespace lf::gl {

constexpr GLenum kTimeElapsed = 0x88bf;  // GL_EXT_disjoint_timer_query: GL_TIME_ELAPSED_EXT

struct SumDrawer::Objects {
  Texture pixels, lost, chroma_sums, chroma;
  ViewTextures view;
  ImageAtlas atlas;
  Programs programs;
  GLuint frame = 0, corners = 0;
  GLuint times[2] = {};  // of pixels, of chroma
  bool has_times = false;
  GLint max_size = 0;
  GLenum float_target = GL_RG16F;

  Objects() {
    glGenFramebuffers(1, &frame);
    glGenBuffers(1, &corners);
    glGenQueries(2, times);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &max_size);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
  }
  ~Objects() {
    glDeleteFramebuffers(1, &frame);
    glDeleteBuffers(1, &corners);
    glDeleteQueries(2, times);
  }

  // Of one kind, over what is bound as the frame; false with the reason in `why`.
  bool draw(const SumProgram& what, const std::vector<CoverCorner>& triangles, const simd::SumTask& task,
            const Rect& rect, int width, int height, std::string& why) {
    if (triangles.empty()) return true;
    const Program* program = programs.use(what, why);
    if (!program) return false;
    glUniform2i(program->origin, rect.x0, rect.y0);
    glUniform2i(program->size, rect.width(), rect.height());
    glUniform2f(program->extent, static_cast<float>(width), static_cast<float>(height));
    if (const FocalMap* map = task.plan->view().focus.map.get())
      glUniform4f(program->map_scale, static_cast<float>(map->step), static_cast<float>(map->farthest),
                  static_cast<float>((map->nearest - map->farthest) / FocalMap::kLevels),
                  static_cast<float>(task.plan->eye_distance()));
    glBindBuffer(GL_ARRAY_BUFFER, corners);
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

  template <class Fn>
  bool timed(GLuint query, const Fn& draw) {
    if (has_times) glBeginQuery(kTimeElapsed, query);
    const bool drawn = draw();
    if (has_times) glEndQuery(kTimeElapsed);
    return drawn;
  }
  // Of those that were timed last; what is read back has waited for them.
  uint64_t nanoseconds(bool both) const {
    uint64_t sum = 0;
    for (int i = 0; i < (has_times ? 1 + both : 0); i++) {
      GLuint ns = 0;
      glGetQueryObjectuiv(times[i], GL_QUERY_RESULT, &ns);
      sum += ns;
    }
    return sum;
  }

  // Makes it what is drawn to there.
  void attach(GLenum where, Texture& texture, GLenum format, int width, int height) {
    texture.bind(kTargets, format, width, height);
    glFramebufferTexture2D(GL_FRAMEBUFFER, where, GL_TEXTURE_2D, texture.name(), 0);
  }

  // What is drawn from now on is drawn there, where the owners are its own. False if the driver can't.
  bool begin(Texture& texture, GLenum format, const Texture& depths, int width, int height) {
    attach(GL_COLOR_ATTACHMENT0, texture, format, width, height);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depths.name(), 0);
    constexpr GLenum kOne[] = {GL_COLOR_ATTACHMENT0};
    glDrawBuffers(1, kOne);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) return false;
    glViewport(0, 0, width, height);
    constexpr GLuint kZeros[4] = {};
    constexpr GLfloat kNothing[4] = {};
    if (format == float_target)
      glClearBufferfv(GL_COLOR, 0, kNothing);
    else
      glClearBufferuiv(GL_COLOR, 0, kZeros);
    return true;
  }
};

SumDrawer::SumDrawer(std::unique_ptr<Context> context) : context_(std::move(context)) {}

SumDrawer::~SumDrawer() {
  const Context::Current current(*context_);
  objects_.reset();
}

std::unique_ptr<SumDrawer> SumDrawer::create(Context::Drivers drivers, std::string& why) {
  auto context = Context::create(drivers, why);
  if (!context) return nullptr;
  std::unique_ptr<SumDrawer> drawer(new SumDrawer(std::move(context)));
  const Context::Current current(*drawer->context_);
  if (!current) return nullptr;
  drawer->objects_ = std::make_unique<Objects>();
  // Unfit drivers are told from others before there is anything to draw.
  GLint inputs = 0, outputs = 0;
  glGetIntegerv(GL_MAX_FRAGMENT_INPUT_COMPONENTS, &inputs);
  glGetIntegerv(GL_MAX_VERTEX_OUTPUT_COMPONENTS, &outputs);
  if (std::min(inputs, outputs) < 4 * (face_texels(true) + 1)) {
    why = "too few numbers between shaders";
    return nullptr;
  }
  if (!drawer->context_->has_extension("GL_EXT_color_buffer_float") &&
      !drawer->context_->has_extension("GL_EXT_color_buffer_half_float")) {
    why = "no sums in float";
    return nullptr;
  }
  if (drawer->context_->has_extension("GL_EXT_color_buffer_float") &&
      drawer->context_->has_extension("GL_EXT_float_blend"))
    drawer->objects_->float_target = GL_RG32F;
  drawer->objects_->has_times = drawer->context_->has_extension("GL_EXT_disjoint_timer_query");
  using Output = SumProgram::Output;
  for (const Output output : {Output::kRgb, Output::kChroma})
    if (!drawer->objects_->programs.use({.output = output, .careful = true, .has_map = true}, why)) return nullptr;
  return drawer;
}

static bool refuse(std::string& why, std::string reason) {
  why = std::move(reason);
  return false;
}

bool SumDrawer::draw(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect, DrawnSum& out,
                     std::string& why) {
  {
    const Context::Current current(*context_);
    if (!current) {
      lost_ = true;
      return refuse(why, "the context is lost");
    }
    if (!draw_now(task, sources, rect, out, why)) return false;
  }
  mended_ = mend(task, out);
  return true;
}

bool SumDrawer::draw_now(const simd::SumTask& task, std::span<const Source> sources, const Rect& rect, DrawnSum& out,
                         std::string& why) {
  Objects& o = *objects_;
  const ViewPlan& plan = *task.plan;
  if (plan.faces().size() >= kMixedOwners) return refuse(why, "too many faces");
  if (std::max({rect.width(), rect.height(), static_cast<int>(plan.faces().size())}) > o.max_size)
    return refuse(why, "the view or the array is too large");
  if (!o.atlas.lay_out(task, sources, o.max_size)) return refuse(why, "the cameras' images are too large");

  out.family = task.family;
  out.rect = rect;
  const FaceCover cover = cover_faces(task, rect);
  o.view.upload(task, o.atlas, rect);
  o.atlas.upload();
  glBindFramebuffer(GL_FRAMEBUFFER, o.frame);
  glDepthFunc(GL_EQUAL);
  glDepthMask(GL_FALSE);
  glEnable(GL_DEPTH_TEST);
  if (!o.timed(o.times[0], [&] { return draw_pixels(task, cover, rect, why); })) return false;
  glFlush();  // while the card draws those, the rest goes up
  if (task.family == PixelFamily::kI420) {
    o.view.upload_blocks(task, rect);
    o.atlas.upload_chroma();
    if (!o.timed(o.times[1], [&] { return draw_chroma(task, cover, rect, why); })) return false;
    glFlush();
  }
  read(cover, out);
  drawn_ns_ = o.nanoseconds(task.family == PixelFamily::kI420);
  if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
    lost_ = error == GL_OUT_OF_MEMORY || lost_;
    return refuse(why, "OpenGL error " + std::to_string(error));
  }
  return true;
}

// The program for all of a task's faces.
static SumProgram program_of(const simd::SumTask& task, SumProgram::Output output, bool careful) {
  SumProgram program{.output = output, .careful = careful};
  program.has_map = task.plan->view().focus.map != nullptr;
  program.has_rays = !task.plan->rays().separable();
  for (const simd::Slot& slot : task.slots) {
    program.is_distorted = program.is_distorted || slot.radial || slot.tangential;
    program.is_cubic = program.is_cubic || slot.is_cubic();
  }
  return program;
}

// Pixels, and where they are careful what they have lost.
bool SumDrawer::draw_pixels(const simd::SumTask& task, const FaceCover& cover, const Rect& rect, std::string& why) {
  Objects& o = *objects_;
  const bool rgb = task.family == PixelFamily::kRgb;
  const SumProgram::Output output = rgb ? SumProgram::Output::kRgb : SumProgram::Output::kLuma;
  const int width = rect.width(), height = rect.height();
  if (!o.begin(o.pixels, rgb ? GL_RGBA16UI : GL_R16UI, o.view.owners(), width, height))
    return refuse(why, "16-bit targets can't be drawn to");
  if (!o.draw(program_of(task, output, false), cover.calm.pixels, task, rect, width, height, why)) return false;
  if (cover.careful_rect.empty()) return true;
  o.attach(GL_COLOR_ATTACHMENT1, o.lost, GL_R16UI, width, height);
  constexpr GLenum kBoth[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  glDrawBuffers(2, kBoth);
  constexpr GLuint kZeros[4] = {};
  glClearBufferuiv(GL_COLOR, 1, kZeros);
  const bool drawn = o.draw(program_of(task, output, true), cover.careful.pixels, task, rect, width, height, why);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT1, GL_TEXTURE_2D, 0, 0);
  return drawn;
}

bool SumDrawer::draw_chroma(const simd::SumTask& task, const FaceCover& cover, const Rect& rect, std::string& why) {
  Objects& o = *objects_;
  const int width = chroma_size(rect.width()), height = chroma_size(rect.height());
  bool drawn = true;
  const auto draw = [&](SumProgram::Output output, bool careful, const std::vector<CoverCorner>& triangles) {
    drawn = drawn && o.draw(program_of(task, output, careful), triangles, task, rect, 2 * width, 2 * height, why);
  };
  if (!o.begin(o.chroma_sums, o.float_target, o.view.block_owners(), width, height))
    return refuse(why, "sums in float can't be drawn to");
  glEnable(GL_BLEND);
  glBlendFunc(GL_ONE, GL_ONE);
  draw(SumProgram::Output::kMixedChroma, false, cover.calm.blocks);
  draw(SumProgram::Output::kMixedChroma, true, cover.careful.blocks);
  glDisable(GL_BLEND);
  if (!o.begin(o.chroma, GL_RG16UI, o.view.block_owners(), width, height))
    return refuse(why, "16-bit targets can't be drawn to");
  draw(SumProgram::Output::kChroma, false, cover.calm.pixels);
  draw(SumProgram::Output::kChroma, true, cover.careful.pixels);
  if (!drawn || !o.programs.use({.output = SumProgram::Output::kChromaBits}, why)) return false;
  glActiveTexture(GL_TEXTURE0 + kChromaSums);
  glBindTexture(GL_TEXTURE_2D, o.chroma_sums.name());
  glDisableVertexAttribArray(0);
  glDisableVertexAttribArray(1);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  return true;
}

void SumDrawer::read(const FaceCover& cover, DrawnSum& out) {
  Objects& o = *objects_;
  const bool rgb = out.family == PixelFamily::kRgb;
  const Rect& rect = out.rect;
  const int width = rect.width(), height = rect.height();
  out.pixels.resize(static_cast<size_t>(width) * height * (rgb ? 4 : 1));
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, 0, 0);
  o.attach(GL_COLOR_ATTACHMENT0, o.pixels, rgb ? GL_RGBA16UI : GL_R16UI, width, height);
  glReadPixels(0, 0, width, height, rgb ? GL_RGBA_INTEGER : GL_RED_INTEGER, GL_UNSIGNED_SHORT, out.pixels.data());
  out.lost_rect = cover.careful_rect;
  if (const Rect& lost = out.lost_rect; !lost.empty()) {
    out.lost.resize(static_cast<size_t>(lost.width()) * lost.height());
    o.attach(GL_COLOR_ATTACHMENT0, o.lost, GL_R16UI, width, height);
    glReadPixels(lost.x0 - rect.x0, lost.y0 - rect.y0, lost.width(), lost.height(), GL_RED_INTEGER, GL_UNSIGNED_SHORT,
                 out.lost.data());
  }
  if (rgb) return;
  const int columns = chroma_size(width), rows = chroma_size(height);
  out.chroma.resize(2 * static_cast<size_t>(columns) * rows);
  o.attach(GL_COLOR_ATTACHMENT0, o.chroma, GL_RG16UI, columns, rows);
  glReadPixels(0, 0, columns, rows, GL_RG_INTEGER, GL_UNSIGNED_SHORT, out.chroma.data());
}

}  // namespace lf::gl
