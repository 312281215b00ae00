// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <GLES3/gl31.h>

#include <map>
#include <string>

#include "render/gl/sum_shader.h"

// What a context of OpenGL ES holds for SumDrawer. All calls while that context is current.
namespace lf::gl {

// A texture that keeps its memory as long as it is large enough.
class Texture {
 public:
  explicit Texture(GLenum target) : target_(target) {}
  Texture(const Texture&) = delete;
  Texture& operator=(const Texture&) = delete;
  ~Texture() {
    if (name_) glDeleteTextures(1, &name_);
  }
  // Binds it, with room for as much; `layers` 0: of one image. Exactly as much where `exact`.
  void bind(int unit, GLenum format, int width, int height, int layers = 0, bool exact = false) {
    glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    const bool fits = exact ? width == width_ && height == height_ : width <= width_ && height <= height_;
    if (name_ && format == format_ && fits && layers <= layers_) {
      glBindTexture(target_, name_);
      return;
    }
    if (name_) glDeleteTextures(1, &name_);
    glGenTextures(1, &name_);
    glBindTexture(target_, name_);
    if (target_ == GL_TEXTURE_2D_ARRAY)
      glTexStorage3D(target_, 1, format, width, height, layers);
    else
      glTexStorage2D(target_, 1, format, width, height);
    glTexParameteri(target_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(target_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(target_, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(target_, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    format_ = format;
    width_ = width;
    height_ = height;
    layers_ = layers;
  }
  GLuint name() const { return name_; }

 private:
  GLenum target_, format_ = 0;
  GLuint name_ = 0;
  int width_ = 0, height_ = 0, layers_ = 0;
};

// Textures' units.
enum Unit {
  kOwners,
  kBlockOwners,
  kTables,
  kLevels,
  kRays,
  kCentreRays,
  kImages,
  kChromaImages,
  kChromaSums,
  kTargets
};

// Where a program's numbers are.
struct Program {
  GLuint name = 0;
  GLint origin = -1, size = -1, extent = -1, map_scale = -1;
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

}  // namespace lf::gl
