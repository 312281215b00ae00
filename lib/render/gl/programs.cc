// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/objects.h"

namespace lf::gl {
namespace {

GLuint compile(GLenum kind, const std::string& text, std::string& why) {
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

// 0 with the reason in `why` if that can't be done.
GLuint link(const SumProgram& what, std::string& why) {
  GLuint shaders[2] = {};
  if (is_computed(what)) {
    shaders[0] = compile(GL_COMPUTE_SHADER, compute_shader(what), why);
    if (!shaders[0]) return 0;
  } else {
    shaders[0] = compile(GL_VERTEX_SHADER, vertex_shader(what), why);
    shaders[1] = shaders[0] ? compile(GL_FRAGMENT_SHADER, fragment_shader(what), why) : 0;
    if (!shaders[1]) {
      glDeleteShader(shaders[0]);
      return 0;
    }
  }
  GLuint name = glCreateProgram();
  for (const GLuint shader : shaders) {
    if (!shader) continue;
    glAttachShader(name, shader);
    glDeleteShader(shader);  // with the program
  }
  glLinkProgram(name);
  GLint linked = 0;
  glGetProgramiv(name, GL_LINK_STATUS, &linked);
  if (linked) return name;
  char text[512] = "";
  glGetProgramInfoLog(name, sizeof text, nullptr, text);
  why = std::string("a shader does not link: ") + text;
  glDeleteProgram(name);
  return 0;
}

}  // namespace

const Program* Programs::use(const SumProgram& what, std::string& why) {
  if (const auto found = programs_.find(what); found != programs_.end()) {
    glUseProgram(found->second.name);
    return &found->second;
  }
  const GLuint name = link(what, why);
  if (!name) return nullptr;
  glUseProgram(name);
  const auto at = [&](const char* uniform) { return glGetUniformLocation(name, uniform); };
  for (const auto& [sampler, unit] :
       {std::pair("owners", kOwners), std::pair("tables", kTables), std::pair("levels", kLevels),
        std::pair("rays", kRays), std::pair("centre_rays", kCentreRays), std::pair("images", kImages),
        std::pair("chroma_sums", kChromaSums), std::pair("card_image", kCardImage)})
    glUniform1i(at(sampler), unit);
  return &(programs_[what] = {name, at("origin"), at("size"), at("extent"), at("map_scale"), at("chroma_places"),
                              at("parts"), at("lost_rows"), at("planes"), at("byte_levels"), at("background"),
                              at("channels")});
}

}  // namespace lf::gl
