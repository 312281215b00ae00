// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/context.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl31.h>

#include <exception>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace lf::gl {
namespace {

bool has(const char* list, std::string_view name) {
  std::string_view rest = list ? list : "";
  while (!rest.empty()) {
    const size_t end = std::min(rest.find(' '), rest.size());
    if (rest.substr(0, end) == name) return true;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return false;
}

template <class Function>
Function function(const char* name) {
  return reinterpret_cast<Function>(eglGetProcAddress(name));
}

struct Candidate {
  EGLenum platform;
  void* native;
  std::string name;
  bool software;  // according to EGL; may be wrong
};

std::vector<Candidate> candidates() {
  std::vector<Candidate> hardware, software;
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const auto query = function<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
  const auto query_string = function<PFNEGLQUERYDEVICESTRINGEXTPROC>("eglQueryDeviceStringEXT");
  if (query && query_string && has(extensions, "EGL_EXT_platform_device")) {
    EGLDeviceEXT devices[32];
    EGLint count = 0;
    if (!query(std::size(devices), devices, &count)) count = 0;
    for (EGLint i = 0; i < count; i++) {
      const bool is_software = has(query_string(devices[i], EGL_EXTENSIONS), "EGL_MESA_device_software");
      (is_software ? software : hardware)
          .push_back({EGL_PLATFORM_DEVICE_EXT, devices[i], "device " + std::to_string(i), is_software});
    }
  }
  hardware.insert(hardware.end(), software.begin(), software.end());
  if (has(extensions, "EGL_MESA_platform_surfaceless"))
    hardware.push_back({EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, "without a device", false});
  return hardware;
}

bool is_software_name(std::string_view renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR", "SwiftShader"})
    if (renderer.find(name) != std::string_view::npos) return true;
  return false;
}

}  // namespace

struct Context::Handles {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  ~Handles() {
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    // Displays belong to the process, so eglTerminate() would also affect other users of the same display.
  }

  std::optional<std::string> open(const Candidate& candidate) {
    const auto get_display = function<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
    display = get_display ? get_display(candidate.platform, candidate.native, nullptr) : EGL_NO_DISPLAY;
    if (display == EGL_NO_DISPLAY) return "no display";
    if (!eglInitialize(display, nullptr, nullptr)) return "cannot be initialized";
    const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
    if (!has(extensions, "EGL_KHR_surfaceless_context")) return "needs a window";
    if (!eglBindAPI(EGL_OPENGL_ES_API)) return "no OpenGL ES";
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint configs = 0;
    if (!eglChooseConfig(display, wanted, &config, 1, &configs) || configs == 0) return "no OpenGL ES 3";
    const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 1, EGL_NONE};
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, version);
    if (context == EGL_NO_CONTEXT) return "no OpenGL ES 3.1";
    return {};
  }
};

Context::Context(std::unique_ptr<Handles> handles, External foreign)
    : handles_(std::move(handles)), external_(std::move(foreign)) {}

Context::~Context() = default;

bool Context::look() {
  return run([this] {
    const auto* renderer = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
    device_ = renderer ? renderer : "unknown";
    // The core profile of desktop OpenGL has no combined extension string.
    GLint count = 0;
    glGetIntegerv(GL_NUM_EXTENSIONS, &count);
    for (GLint i = 0; i < count; i++)
      if (const GLubyte* name = glGetStringi(GL_EXTENSIONS, static_cast<GLuint>(i)))
        extensions_.append(reinterpret_cast<const char*>(name)).append(" ");
    software_ = software_ || is_software_name(device_);
    glGetError();  // clears earlier errors of an external context
  });
}

std::unique_ptr<Context> Context::create(Drivers drivers, std::string& why) {
  why.clear();
  const auto reject = [&](const std::string& name, const std::string& reason) {
    why += (why.empty() ? "" : "; ") + name + ": " + reason;
  };
  for (const Candidate& candidate : candidates()) {
    if (candidate.software && drivers == Drivers::kHardware) {
      reject(candidate.name, "computes on the CPU");
      continue;
    }
    auto handles = std::make_unique<Handles>();
    if (const auto reason = handles->open(candidate)) {
      reject(candidate.name, *reason);
      continue;
    }
    std::unique_ptr<Context> context(new Context(std::move(handles), {}));
    context->software_ = candidate.software;
    if (!context->look()) {
      reject(candidate.name, "the context cannot be used without a window");
      continue;
    }
    if (!context->software_ || drivers == Drivers::kAny) return context;
    reject(context->device_, "computes on the CPU");
  }
  if (why.empty()) why = "EGL lists no device";
  return nullptr;
}

std::unique_ptr<Context> Context::create_in(External foreign, Drivers drivers, std::string& why) {
  std::unique_ptr<Context> context(new Context(nullptr, std::move(foreign)));
  const bool is_there = context->look();
  if (is_there && (!context->software_ || drivers == Drivers::kAny)) return context;
  why = is_there ? context->device_ + ": computes on the CPU" : "the context no longer exists";
  return nullptr;
}

bool Context::has_extension(std::string_view name) const { return has(extensions_.c_str(), name); }

void Context::lose() {
  const std::lock_guard lock(mutex_);
  lost_ = true;
}

bool Context::run(const std::function<void()>& job) {
  const std::lock_guard lock(mutex_);
  if (lost_) return false;
  if (handles_) {
    // Mesa's software driver (22.3) crashed when two contexts compiled shaders at once.
    static std::mutex software;
    std::unique_lock alone(software, std::defer_lock);
    if (software_) alone.lock();
    if (!eglMakeCurrent(handles_->display, EGL_NO_SURFACE, EGL_NO_SURFACE, handles_->context)) {
      lost_ = true;
      return false;
    }
    struct Release {
      EGLDisplay display;
      ~Release() { eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }
    } const release{handles_->display};
    job();
    return true;
  }
  std::exception_ptr thrown;
  lost_ = !external_.call([&] {
    try {
      job();
    } catch (...) {
      thrown = std::current_exception();
    }
  });
  if (thrown) std::rethrow_exception(thrown);
  return !lost_;
}

}  // namespace lf::gl
