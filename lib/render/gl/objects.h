// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <GLES3/gl31.h>

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
  // Binds the texture, with room for at least width x height texels in `layers` layers (0: one image), or for exactly
  // as many where `exact`.
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

// The units that textures are bound to.
enum Unit { kOwners, kTables, kLevels, kRays, kCentreRays, kImages, kChromaImages, kLumaSeen, kTargets };

class Program {
 public:
  Program() = default;
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program() {
    if (name_) glDeleteProgram(name_);
  }
  // Makes the program current, compiled and linked the first time; false with what the driver says in `why`.
  bool use(SumProgram what, std::string& why) {
    if (!name_ && !make(what, why)) return false;
    glUseProgram(name_);
    return true;
  }
  void set(const char* name, int value) { glUniform1i(at(name), value); }
  void set(const char* name, int x, int y) { glUniform2i(at(name), x, y); }
  void set(const char* name, double x, double y) {
    glUniform2f(at(name), static_cast<float>(x), static_cast<float>(y));
  }

 private:
  GLint at(const char* name) const { return glGetUniformLocation(name_, name); }
  bool make(SumProgram what, std::string& why) {
    const GLuint vertex = compile(GL_VERTEX_SHADER, vertex_shader(), why);
    const GLuint fragment = vertex ? compile(GL_FRAGMENT_SHADER, sum_shader(what), why) : 0;
    if (fragment) {
      name_ = glCreateProgram();
      glAttachShader(name_, vertex);
      glAttachShader(name_, fragment);
      glLinkProgram(name_);
      GLint linked = 0;
      glGetProgramiv(name_, GL_LINK_STATUS, &linked);
      if (!linked) {
        char text[512] = "";
        glGetProgramInfoLog(name_, sizeof text, nullptr, text);
        why = std::string("a shader does not link: ") + text;
        glDeleteProgram(name_);
        name_ = 0;
      }
    }
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    if (!name_) return false;
    glUseProgram(name_);
    for (const auto& [name, unit] :
         {std::pair("owners", kOwners), std::pair("tables", kTables), std::pair("levels", kLevels),
          std::pair("rays", kRays), std::pair("centre_rays", kCentreRays), std::pair("images", kImages),
          std::pair("chroma_images", kChromaImages), std::pair("luma_seen", kLumaSeen)})
      set(name, unit);
    return true;
  }
  static GLuint compile(GLenum kind, const std::string& text, std::string& why) {
    const GLuint shader = glCreateShader(kind);
    const char* source = text.c_str();
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    GLint compiled = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
    if (compiled) return shader;
    char log[512] = "";
    glGetShaderInfoLog(shader, sizeof log, nullptr, log);
    why = std::string("a shader does not compile: ") + log;
    glDeleteShader(shader);
    return 0;
  }
  GLuint name_ = 0;
};

}  // namespace lf::gl
