// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <GLES3/gl31.h>

#include "base/memory.h"
#include "base/text.h"
#include "render/gl/sum_shader.h"

// Wrappers of the OpenGL objects that GlesRenderer uses. The context must be current for all calls.
namespace lf::gl {

// Thrown if the GPU does not answer, so that it must not be used again.
struct GpuTimeout : Error {
  GpuTimeout() : Error("the GPU does not answer") {}
};

// A texture that is only reallocated if a larger size is needed.
class Texture {
 public:
  Texture() = default;
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (name_) glDeleteTextures(1, &name_);
  }
  // Binds the texture. Its size is at least the given size, and equal to it if `exact`.
  void bind(int unit, GLenum format, int width, int height, bool exact = false) {
    glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    const bool fits = exact ? width == width_ && height == height_ : width <= width_ && height <= height_;
    if (name_ && format == format_ && fits) {
      glBindTexture(GL_TEXTURE_2D, name_);
      return;
    }
    if (name_) glDeleteTextures(1, &name_);
    glGenTextures(1, &name_);
    glBindTexture(GL_TEXTURE_2D, name_);
    glTexStorage2D(GL_TEXTURE_2D, 1, format, width, height);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    format_ = format;
    width_ = width;
    height_ = height;
  }
  GLuint name() const { return name_; }

 private:
  GLenum format_ = 0;
  GLuint name_ = 0;
  int width_ = 0, height_ = 0;
};

// A buffer that is only reallocated if a larger size is needed. Buffers for kUpload and kRead stay mapped, which saves
// copies, if the driver has EXT_buffer_storage or ARB_buffer_storage.
class Buffer {
 public:
  // kTables is for small tables that change now and then, kUpload for texture uploads, kComputed for results of the
  // GPU, and kRead for reading them back.
  enum class Use { kTables, kUpload, kComputed, kRead };
  explicit Buffer(Use use) : use_(use) {}
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer() {
    if (name_) glDeleteBuffers(1, &name_);
  }
  // Makes room for at least `bytes` bytes. The contents are lost if the buffer grows.
  void reserve(size_t bytes);
  // Replaces `bytes` bytes from byte `first` on. Only for kTables.
  void put(size_t first, const void* from, size_t bytes);
  GLuint name() const { return name_; }
  size_t bytes() const { return bytes_; }
  // Returns the mapped memory, or null if the buffer is not mapped and must be accessed with OpenGL calls.
  uint8_t* memory() const { return memory_; }

 private:
  const Use use_;
  GLuint name_ = 0;
  size_t bytes_ = 0;
  uint8_t* memory_ = nullptr;
};

// A texture that gets new pixels in each pass, with one upload. The upload memory is a mapped buffer if the driver
// supports mapped buffers. The result of the previous pass must have been read before new pixels are written.
class UploadTexture {
 public:
  void reserve(size_t bytes);
  // Returns true if the upload memory, room(), has at least this many bytes. has_room() and room() need no context.
  // Write the pixels to room() before send().
  bool has_room(size_t bytes) const { return buffer_.bytes() >= bytes; }
  uint8_t* room() { return buffer_.memory() ? buffer_.memory() : memory_.data(); }
  // Uploads the contents of room() as packed rows, and binds the texture, which may be larger unless `exact`. If `from`
  // is not 0, uploads that buffer instead of room().
  void send(int unit, GLenum internal_format, GLenum format, int width, int height, bool exact, GLuint from = 0);
  // Copies the first bytes of room() to another OpenGL buffer.
  void copy_to(GLuint buffer, size_t bytes);

 private:
  Texture texture_;
  Buffer buffer_{Buffer::Use::kUpload};
  std::vector<uint8_t> memory_;  // upload memory if the driver has no mapped buffers
};

enum Unit { kLevels, kRays, kCentreRays, kImages, kTargets, kGpuImage };

// Measures the GPU time between begin() and end() if the driver supports GL_EXT_disjoint_timer_query.
class GpuTimer {
 public:
  explicit GpuTimer(bool works) : works_(works) { glGenQueries(1, &name_); }
  GpuTimer(const GpuTimer&) = delete;
  GpuTimer& operator=(const GpuTimer&) = delete;
  ~GpuTimer() { glDeleteQueries(1, &name_); }
  void reset() { used_ = false; }
  // Call once after each reset().
  void begin() {
    if (works_) glBeginQuery(kTimeElapsed, name_);
    used_ = works_;
  }
  void end() {
    if (works_) glEndQuery(kTimeElapsed);
  }
  // Waits for the result. Returns 0 if the time was not measured.
  uint64_t nanoseconds() const {
    GLuint ns = 0;
    if (used_) glGetQueryObjectuiv(name_, GL_QUERY_RESULT, &ns);
    return ns;
  }

 private:
  static constexpr GLenum kTimeElapsed = 0x88bf;  // GL_TIME_ELAPSED_EXT
  const bool works_;
  GLuint name_ = 0;
  bool used_ = false;
};

// A compiled shader program, with the locations of its uniforms; -1 if the program does not have the uniform.
struct Program {
  GLuint name = 0;
  GLint origin = -1, size = -1, extent = -1, chroma_places = -1, parts = -1, missing_rows = -1;
  GLint planes = -1, byte_levels = -1, background = -1, channels = -1;
};

// Compiles shader programs on first use, and keeps the compiled programs.
class Programs {
 public:
  Programs() = default;
  Programs(const Programs&) = delete;
  Programs& operator=(const Programs&) = delete;
  ~Programs() {
    for (const auto& [what, program] : programs_) glDeleteProgram(program.name);
  }
  // Activates a program. Its first use compiles it, which takes tens of milliseconds. Throws Error with the driver's
  // log if that fails. The result is valid as long as this object.
  const Program& use(const SumProgram& what);

 private:
  std::map<SumProgram, Program> programs_;
};

// Waits for all GPU commands issued so far. Throws GpuTimeout. The context must be current.
void wait_for_gpu();

// A buffer of 32-bit words that compute shaders write and that can be read back. The context must be current for all
// calls.
class ComputeBuffer {
 public:
  // A readback buffer in exclusive use.
  class Fetched {
   public:
    // Returns all reserved words. Words that were not fetched are undefined.
    uint32_t* words() { return reinterpret_cast<uint32_t*>(buffer_.memory() ? buffer_.memory() : memory_.data()); }

   private:
    friend ComputeBuffer;
    Buffer buffer_{Buffer::Use::kRead};
    UninitializedVector<uint8_t> memory_;  // used if the driver has no mapped buffers
    std::atomic<bool> is_free_ = true;
  };

  // Returns the maximum size of a buffer that shaders can write.
  static size_t most_words();
  // Makes room; the contents are lost if the buffer grows. Throws Error if shaders cannot write so many words.
  void reserve(size_t words);
  GLuint name() const { return result_.name(); }
  // Returns a free readback buffer of the size that was reserved last. This object must outlive the buffer.
  std::shared_ptr<Fetched> start_readback();
  struct Words {
    size_t first = 0, end = 0;
  };
  // Copies the words to the same offsets in `to`, and waits. Throws GpuTimeout.
  void fetch(Fetched& to, std::span<const Words> which);

 private:
  size_t words_ = 0;
  Buffer result_{Buffer::Use::kComputed};
  std::vector<std::unique_ptr<Fetched>> fetched_;  // in use, or free for reuse
};

}  // namespace lf::gl
