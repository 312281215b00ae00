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
#include "render/gl/sum_shader.h"

// What a context holds for SumDrawer. All calls while that context is current.
namespace lf::gl {

// A texture that keeps its memory as long as it is large enough.
class Texture {
 public:
  Texture() = default;
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (name_) glDeleteTextures(1, &name_);
  }
  // Binds it, with room for as much. Exactly as much where `exact`.
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

// A buffer that keeps its memory as long as it is large enough. Where the driver can (EXT_ or ARB_buffer_storage) a
// buffer of kSent or kRead lies in this process's memory, too, as long as it is there.
class Buffer {
 public:
  // What it is for: numbers that are replaced now and then, bytes that textures are made from, what the card computes,
  // and what of it is read.
  enum class Use { kNumbers, kSent, kComputed, kRead };
  explicit Buffer(Use use) : use_(use) {}
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer() {
    if (name_) glDeleteBuffers(1, &name_);
  }
  // Room for as much; what was in it is lost if there was less.
  void reserve(size_t bytes);
  // kNumbers: replaces bytes of it, from byte `first` on.
  void put(size_t first, const void* from, size_t bytes);
  GLuint name() const { return name_; }
  size_t bytes() const { return bytes_; }
  // Null: reach it by OpenGL's functions.
  uint8_t* memory() const { return memory_; }

 private:
  const Use use_;
  GLuint name_ = 0;
  size_t bytes_ = 0;
  uint8_t* memory_ = nullptr;
};

// A texture whose pixels this process makes anew for each sum: all of them are sent at once, from memory that the
// driver need not copy where it has such. What was drawn from it before has been read by then.
class SentTexture {
 public:
  // Room for so many bytes.
  void reserve(size_t bytes);
  // Without any context: whether there is as much room, and where it begins, to be filled before send().
  bool has_room(size_t bytes) const { return buffer_.bytes() >= bytes; }
  uint8_t* room() { return buffer_.memory() ? buffer_.memory() : memory_.data(); }
  // Sends what is in the room now, rows of bytes in that format without gaps, and binds the texture, which may be
  // larger but where `exact`. `from`: a buffer that has them, in place of the room.
  void send(int unit, GLenum internal_format, GLenum format, int width, int height, bool exact, GLuint from = 0);
  // Copies so many bytes of the room to a buffer.
  void copy_to(GLuint buffer, size_t bytes);

 private:
  Texture texture_;
  Buffer buffer_{Buffer::Use::kSent};
  std::vector<uint8_t> memory_;  // in its place, where the driver has none that is in both
};

// Textures' units.
enum Unit { kLevels, kRays, kCentreRays, kImages, kTargets, kCardImage };

// What the card takes for what it is given between begin() and end(), if its driver tells
// (GL_EXT_disjoint_timer_query).
class Stopwatch {
 public:
  explicit Stopwatch(bool works) : works_(works) { glGenQueries(1, &name_); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() { glDeleteQueries(1, &name_); }
  void reset() { used_ = false; }
  // Call once after each reset().
  void begin() {
    if (works_) glBeginQuery(kTimeElapsed, name_);
    used_ = works_;
  }
  void end() {
    if (works_) glEndQuery(kTimeElapsed);
  }
  // Waits for it. 0: the driver does not tell.
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

// Where a program's numbers are.
struct Program {
  GLuint name = 0;
  GLint origin = -1, size = -1, extent = -1, chroma_places = -1, parts = -1, lost_rows = -1;
  GLint planes = -1, byte_levels = -1, background = -1, channels = -1;
};

// All programs that have been asked for.
class Programs {
 public:
  Programs() = default;
  Programs(const Programs&) = delete;
  Programs& operator=(const Programs&) = delete;
  ~Programs() {
    for (const auto& [what, program] : programs_) glDeleteProgram(program.name);
  }
  // In use from now on; compiled the first time, which takes tens of milliseconds. Null with what the driver says in
  // `why`.
  const Program* use(const SumProgram& what, std::string& why);

 private:
  std::map<SumProgram, Program> programs_;
};

// Waits for all that the card was given. False if it does not answer. While the context is current.
bool wait_for_card();

// What a compute shader has computed, in 32-bit words, and the way back of it. All calls while the context is current.
class Computed {
 public:
  // What was fetched, which nobody else has.
  class Fetched {
   public:
    // As many words as were reserved; those that were not fetched mean nothing.
    uint32_t* words() { return reinterpret_cast<uint32_t*>(buffer_.memory() ? buffer_.memory() : memory_.data()); }

   private:
    friend Computed;
    Buffer buffer_{Buffer::Use::kRead};
    UninitializedVector<uint8_t> memory_;  // in its place, where the driver has none that is in both
    std::atomic<bool> is_free_ = true;
  };

  // As many as shaders can write.
  static size_t most_words();
  // Room for so many words; what was in it is lost if there was less. False with the reason in `why` if shaders can't
  // write as many.
  bool reserve(size_t words, std::string& why);
  GLuint name() const { return result_.name(); }
  // What may be fetched into from now on, as large as what was reserved last. This outlives it.
  std::shared_ptr<Fetched> begin_to_fetch();
  struct Words {
    size_t first = 0, end = 0;
  };
  // All these words, to the same place there. False if the card does not answer.
  bool fetch(Fetched& to, std::span<const Words> which);

 private:
  size_t words_ = 0;
  Buffer result_{Buffer::Use::kComputed};
  std::vector<std::unique_ptr<Fetched>> fetched_;  // that somebody has or had
};

}  // namespace lf::gl
