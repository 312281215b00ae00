// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/objects.h"

namespace lf::gl {
namespace {

GLuint compile(const std::string& text, std::string& why) {
  const GLuint shader = glCreateShader(GL_COMPUTE_SHADER);
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
  const GLuint shader = compile(compute_shader(what), why);
  if (!shader) return 0;
  const GLuint name = glCreateProgram();
  glAttachShader(name, shader);
  glDeleteShader(shader);  // with the program
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
       {std::pair("levels", kLevels), std::pair("rays", kRays), std::pair("centre_rays", kCentreRays),
        std::pair("images", kImages), std::pair("card_image", kCardImage)})
    glUniform1i(at(sampler), unit);
  return &(programs_[what] = {name, at("origin"), at("size"), at("extent"), at("chroma_places"),
                              at("parts"), at("lost_rows"), at("planes"), at("byte_levels"), at("background"),
                              at("channels")});
}

}  // namespace lf::gl
