// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/objects.h"

#include <cstring>
#include <string_view>

#include <EGL/egl.h>
#include <GLES2/gl2ext.h>
#include <GLES3/gl31.h>

namespace lf::gl {
namespace {

constexpr size_t kWord = sizeof(uint32_t);

// Returns the function of OpenGL ES or OpenGL, or null if the driver has neither.
PFNGLBUFFERSTORAGEEXTPROC buffer_storage() {
  GLint count = 0;
  glGetIntegerv(GL_NUM_EXTENSIONS, &count);
  for (GLint i = 0; i < count; i++) {
    const auto* text = reinterpret_cast<const char*>(glGetStringi(GL_EXTENSIONS, static_cast<GLuint>(i)));
    const std::string_view name = text ? text : "";
    const bool is_es = name == "GL_EXT_buffer_storage";
    if (is_es || name == "GL_ARB_buffer_storage")
      return reinterpret_cast<PFNGLBUFFERSTORAGEEXTPROC>(
          eglGetProcAddress(is_es ? "glBufferStorageEXT" : "glBufferStorage"));
  }
  return nullptr;
}

GLuint compile(const std::string& text) {
  const GLuint shader = glCreateShader(GL_COMPUTE_SHADER);
  const char* source = text.c_str();
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint compiled = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled) return shader;
  char log[512] = "";
  glGetShaderInfoLog(shader, sizeof log, nullptr, log);
  glDeleteShader(shader);
  throw Error(std::string("a shader does not compile: ") + log);
}

GLuint link(const SumProgram& what) {
  const GLuint shader = compile(compute_shader(what));
  const GLuint name = glCreateProgram();
  glAttachShader(name, shader);
  glDeleteShader(shader);  // deleted when the program is
  glLinkProgram(name);
  GLint linked = 0;
  glGetProgramiv(name, GL_LINK_STATUS, &linked);
  if (linked) return name;
  char text[512] = "";
  glGetProgramInfoLog(name, sizeof text, nullptr, text);
  glDeleteProgram(name);
  throw Error(std::string("a shader does not link: ") + text);
}

}  // namespace

void Buffer::reserve(size_t bytes) {
  if (bytes <= bytes_) return;
  if (name_) glDeleteBuffers(1, &name_);
  glGenBuffers(1, &name_);
  // This binding point is not used elsewhere.
  glBindBuffer(GL_COPY_WRITE_BUFFER, name_);
  bytes_ = bytes + bytes / 8;
  memory_ = nullptr;
  const auto size = static_cast<GLsizeiptr>(bytes_);
  const auto storage = use_ == Use::kUpload || use_ == Use::kRead ? buffer_storage() : nullptr;
  if (storage) {
    const GLbitfield access = (use_ == Use::kUpload ? 0 : GL_MAP_READ_BIT) | GL_MAP_WRITE_BIT |
                              GL_MAP_PERSISTENT_BIT_EXT | GL_MAP_COHERENT_BIT_EXT;
    storage(GL_COPY_WRITE_BUFFER, size, nullptr, access | (use_ == Use::kRead ? GL_CLIENT_STORAGE_BIT_EXT : 0));
    memory_ = static_cast<uint8_t*>(glMapBufferRange(GL_COPY_WRITE_BUFFER, 0, size, access));
    return;
  }
  glBufferData(GL_COPY_WRITE_BUFFER, size, nullptr,
               use_ == Use::kComputed ? GL_DYNAMIC_COPY
               : use_ == Use::kRead   ? GL_STREAM_READ
                                      : GL_STREAM_DRAW);
}

void Buffer::put(size_t first, const void* from, size_t bytes) {
  glBindBuffer(GL_COPY_WRITE_BUFFER, name_);
  glBufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(first), static_cast<GLsizeiptr>(bytes), from);
}

void UploadTexture::reserve(size_t bytes) {
  buffer_.reserve(bytes);
  if (!buffer_.memory()) memory_.resize(buffer_.bytes());
}

void UploadTexture::send(int unit, GLenum internal_format, GLenum format, int width, int height, bool exact,
                         GLuint from) {
  texture_.bind(unit, internal_format, width, height, exact);
  if (!from && buffer_.memory()) from = buffer_.name();
  if (from) glBindBuffer(GL_PIXEL_UNPACK_BUFFER, from);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, format, GL_UNSIGNED_BYTE, from ? nullptr : memory_.data());
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
}

void UploadTexture::copy_to(GLuint buffer, size_t bytes) {
  const auto size = static_cast<GLsizeiptr>(bytes);
  glBindBuffer(GL_COPY_WRITE_BUFFER, buffer);
  if (!buffer_.memory()) {
    glBufferSubData(GL_COPY_WRITE_BUFFER, 0, size, memory_.data());
    return;
  }
  glBindBuffer(GL_COPY_READ_BUFFER, buffer_.name());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, size);
}

const Program& Programs::use(const SumProgram& what) {
  if (const auto found = programs_.find(what); found != programs_.end()) {
    glUseProgram(found->second.name);
    return found->second;
  }
  const GLuint name = link(what);
  glUseProgram(name);
  const auto at = [&](const char* uniform) { return glGetUniformLocation(name, uniform); };
  for (const auto& [sampler, unit] :
       {std::pair("levels", kLevels), std::pair("rays", kRays), std::pair("centre_rays", kCentreRays),
        std::pair("images", kImages), std::pair("gpu_image", kGpuImage)})
    glUniform1i(at(sampler), unit);
  return programs_[what] = {name,          at("origin"),       at("size"),   at("extent"),      at("chroma_places"),
                            at("parts"),   at("missing_rows"), at("planes"), at("byte_levels"), at("background"),
                            at("channels")};
}

void wait_for_gpu() {
  const GLsync done = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  constexpr GLuint64 kLongest = 10'000'000'000;  // nanoseconds; a slower GPU counts as lost
  const GLenum state = glClientWaitSync(done, GL_SYNC_FLUSH_COMMANDS_BIT, kLongest);
  glDeleteSync(done);
  if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED) throw GpuTimeout();
}

size_t ComputeBuffer::most_words() {
  GLint64 most = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  return static_cast<size_t>(most) / kWord;
}

void ComputeBuffer::reserve(size_t words) {
  if (words > most_words()) throw Error("the view is too large");
  words_ = words;
  result_.reserve(kWord * words);
}

std::shared_ptr<ComputeBuffer::Fetched> ComputeBuffer::start_readback() {
  Fetched* free = nullptr;
  for (const auto& fetched : fetched_)
    if (!free && fetched->is_free_.exchange(false)) free = fetched.get();
  if (!free) {
    free = fetched_.emplace_back(std::make_unique<Fetched>()).get();
    free->is_free_ = false;
  }
  free->buffer_.reserve(kWord * words_);
  if (!free->buffer_.memory()) free->memory_.resize(kWord * words_);
  return {free, [](Fetched* fetched) { fetched->is_free_ = true; }};
}

void ComputeBuffer::fetch(Fetched& to, std::span<const Words> which) {
  glBindBuffer(GL_COPY_READ_BUFFER, result_.name());
  glBindBuffer(GL_COPY_WRITE_BUFFER, to.buffer_.name());
  const auto at = [](size_t word) { return static_cast<GLintptr>(kWord * word); };
  for (const auto& [first, end] : which)
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, at(first), at(first), at(end - first));
  if (to.buffer_.memory()) return wait_for_gpu();
  for (const auto& [first, end] : which) {
    const void* mapped = glMapBufferRange(GL_COPY_WRITE_BUFFER, at(first), at(end - first), GL_MAP_READ_BIT);
    if (!mapped) throw GpuTimeout();
    std::memcpy(to.memory_.data() + at(first), mapped, kWord * (end - first));
    glUnmapBuffer(GL_COPY_WRITE_BUFFER);
  }
}

}  // namespace lf::gl
