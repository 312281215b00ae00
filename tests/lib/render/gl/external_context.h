// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl31.h>

#include "render/gl/context.h"
#include "render/gl/gles_renderer.h"
#include "support/test.h"

namespace lf::test {

// A surfaceless Mesa context of an application, which owns textures of pictures and camera images.
class ExternalContext {
 public:
  static constexpr gl::ShareGroup kGroup = 5;
  explicit ExternalContext(EGLenum api) {
    display_ = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    if (!eglInitialize(display_, nullptr, nullptr) || !eglBindAPI(api)) throw std::runtime_error("no display");
    const EGLint of_es[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 1, EGL_NONE};
    const EGLint of_gl[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 5, EGL_NONE};
    context_ = eglCreateContext(display_, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, api == EGL_OPENGL_ES_API ? of_es : of_gl);
    api_ = api;
    if (context_ == EGL_NO_CONTEXT) throw std::runtime_error("no context");
  }
  ~ExternalContext() { eglDestroyContext(display_, context_); }
  ExternalContext(const ExternalContext&) = delete;
  ExternalContext& operator=(const ExternalContext&) = delete;

  bool call(const std::function<void()>& job) {
    if (is_gone_) return false;
    eglBindAPI(api_);
    if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_)) return false;
    job();
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglBindAPI(EGL_OPENGL_ES_API);
    return true;
  }
  gl::Context::External foreign() {
    return {[this](const std::function<void()>& job) { return call(job); }, kGroup};
  }
  void leave() { is_gone_ = true; }

  GLuint texture(int width, int height, int bytes) {
    return texture(width, height, bytes, std::vector<uint8_t>(static_cast<size_t>(width) * height * bytes, 77));
  }
  GLuint texture(int width, int height, int bytes, const std::vector<uint8_t>& pixels) {
    GLuint name = 0;
    call([&] {
      constexpr GLenum kSizes[] = {GL_R8, GL_RG8, GL_RGB8, GL_RGBA8};
      glGenTextures(1, &name);
      glBindTexture(GL_TEXTURE_2D, name);
      glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
      glTexImage2D(GL_TEXTURE_2D, 0, static_cast<GLint>(kSizes[bytes - 1]), width, height, 0, kFormats[bytes - 1],
                   GL_UNSIGNED_BYTE, pixels.data());
      glBindTexture(GL_TEXTURE_2D, 0);
    });
    return name;
  }
  std::vector<uint8_t> bytes_of(GLuint texture, int width, int height, int bytes) {
    std::vector<uint8_t> four(static_cast<size_t>(width) * height * 4), out;
    call([&] {
      GLuint frame = 0;
      glGenFramebuffers(1, &frame);
      glBindFramebuffer(GL_FRAMEBUFFER, frame);
      glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture, 0);
      EXPECT_EQ(glCheckFramebufferStatus(GL_FRAMEBUFFER), GLenum{GL_FRAMEBUFFER_COMPLETE});
      glPixelStorei(GL_PACK_ALIGNMENT, 1);
      glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, four.data());
      glBindFramebuffer(GL_FRAMEBUFFER, 0);
      glDeleteFramebuffers(1, &frame);
      glDeleteTextures(1, &texture);
      EXPECT_EQ(glGetError(), GLenum{GL_NO_ERROR});
    });
    for (size_t i = 0; i < four.size(); i += 4) out.insert(out.end(), &four[i], &four[i] + bytes);
    return out;
  }

 private:
  static constexpr GLenum kFormats[] = {GL_RED, GL_RG, GL_RGB, GL_RGBA};
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
  EGLenum api_ = EGL_OPENGL_ES_API;
  bool is_gone_ = false;
};

// Tests with a renderer in an application's context: in OpenGL ES, and in OpenGL, the default of windows.
class InExternalContext : public testing::TestWithParam<EGLenum> {
 public:
  static std::string name_of(const testing::TestParamInfo<EGLenum>& api) {
    return api.param == EGL_OPENGL_ES_API ? "OpenGlEs" : "OpenGl";
  }

 protected:
  std::shared_ptr<gl::GlesRenderer> new_renderer() {
    std::string why;
    std::shared_ptr<gl::GlesRenderer> gpu =
        gl::GlesRenderer::create_in(somebody_.foreign(), gl::Context::Drivers::kAny, why);
    if (!gpu) throw std::runtime_error(why);
    return gpu;
  }
  ExternalContext somebody_{GetParam()};
  std::shared_ptr<gl::GlesRenderer> gpu_ = new_renderer();
};

}  // namespace lf::test
