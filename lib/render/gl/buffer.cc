// SPDX-License-Identifier: LGPL-2.1-or-later
#include <EGL/egl.h>
#include <GLES3/gl31.h>
#include <GLES2/gl2ext.h>

#include <string_view>

#include "render/gl/objects.h"

namespace lf::gl {

// Null if the driver has none, of OpenGL ES or of OpenGL.
static PFNGLBUFFERSTORAGEEXTPROC buffer_storage() {
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

void Buffer::reserve(size_t bytes) {
  if (bytes <= bytes_) return;
  if (name_) glDeleteBuffers(1, &name_);
  glGenBuffers(1, &name_);
  // A binding that nothing else depends on.
  glBindBuffer(GL_COPY_WRITE_BUFFER, name_);
  bytes_ = bytes + bytes / 8;
  memory_ = nullptr;
  const auto size = static_cast<GLsizeiptr>(bytes_);
  const auto storage = use_ == Use::kSent || use_ == Use::kRead ? buffer_storage() : nullptr;
  if (storage) {
    const GLbitfield access = (use_ == Use::kSent ? 0 : GL_MAP_READ_BIT) | GL_MAP_WRITE_BIT |
                              GL_MAP_PERSISTENT_BIT_EXT | GL_MAP_COHERENT_BIT_EXT;
    storage(GL_COPY_WRITE_BUFFER, size, nullptr, access | (use_ == Use::kRead ? GL_CLIENT_STORAGE_BIT_EXT : 0));
    memory_ = static_cast<uint8_t*>(glMapBufferRange(GL_COPY_WRITE_BUFFER, 0, size, access));
    return;
  }
  glBufferData(GL_COPY_WRITE_BUFFER, size, nullptr,
               use_ == Use::kComputed ? GL_DYNAMIC_COPY : use_ == Use::kRead ? GL_STREAM_READ : GL_STREAM_DRAW);
}

void Buffer::put(size_t first, const void* from, size_t bytes) {
  glBindBuffer(GL_COPY_WRITE_BUFFER, name_);
  glBufferSubData(GL_COPY_WRITE_BUFFER, static_cast<GLintptr>(first), static_cast<GLsizeiptr>(bytes), from);
}

void SentTexture::reserve(size_t bytes) {
  buffer_.reserve(bytes);
  if (!buffer_.memory()) memory_.resize(buffer_.bytes());
}

void SentTexture::send(int unit, GLenum internal_format, GLenum format, int width, int height, bool exact,
                       GLuint from) {
  texture_.bind(unit, internal_format, width, height, exact);
  if (!from && buffer_.memory()) from = buffer_.name();
  if (from) glBindBuffer(GL_PIXEL_UNPACK_BUFFER, from);
  glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, format, GL_UNSIGNED_BYTE,
                  from ? nullptr : memory_.data());
  glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
}

void SentTexture::copy_to(GLuint buffer, size_t bytes) {
  const auto size = static_cast<GLsizeiptr>(bytes);
  glBindBuffer(GL_COPY_WRITE_BUFFER, buffer);
  if (!buffer_.memory()) {
    glBufferSubData(GL_COPY_WRITE_BUFFER, 0, size, memory_.data());
    return;
  }
  glBindBuffer(GL_COPY_READ_BUFFER, buffer_.name());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, size);
}

}  // namespace lf::gl
