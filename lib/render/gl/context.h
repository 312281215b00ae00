// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace lf::gl {

// Identifies a group of contexts that share textures; 0 means none.
using ShareGroup = uint64_t;

// An OpenGL ES 3.1 context for rendering. It is either on a separate display without a window, or an external context,
// for example of the application.
//
// For its own display, the class tries EGL's devices (EGL_EXT_platform_device) and then a display without a device
// (EGL_MESA_platform_surfaceless). Unsuitable drivers are skipped. GBM is never used, because NVIDIA's library crashes
// on GBM without a render node.
class Context {
 public:
  enum class Drivers { kHardware, kAny };  // kAny also accepts drivers that compute on the CPU, if there is no other

  // Returns null if no display is suitable. `why` then contains one clause for each display that was tried. Takes tens
  // to hundreds of milliseconds. Thread-safe.
  static std::unique_ptr<Context> create(Drivers drivers, std::string& why);
  // An external context of OpenGL ES 3.1, or of a version of OpenGL that includes ES 3.1. Only `call` may make the
  // context current.
  struct External {
    // Runs a job while the context is current, and returns when the job is done. Returns false without running the job
    // if the context no longer exists.
    std::function<bool(const std::function<void()>& job)> call;
    ShareGroup group = 0;
  };
  // Uses an external context. If the context is unsuitable, returns null and sets `why` to the reason.
  static std::unique_ptr<Context> create_in(External foreign, Drivers drivers, std::string& why);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // Returns the name of the device according to its driver, for example "llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& device() const { return device_; }
  bool is_software() const { return software_; }

  // Returns true if the driver supports the extension, for example "GL_EXT_disjoint_timer_query".
  bool has_extension(std::string_view name) const;

  // Returns the group of contexts that share textures with this context, or 0 if the context has its own display.
  ShareGroup group() const { return external_.group; }

  // Runs a job while the context is current. Jobs run one at a time, and their exceptions propagate. Returns false if
  // the context is lost, which is permanent. Thread-safe.
  bool run(const std::function<void()>& job);
  // Simulates that the driver loses the context, for tests. Thread-safe.
  void lose();

 private:
  struct Handles;
  Context(std::unique_ptr<Handles> handles, External foreign);
  bool look();

  std::unique_ptr<Handles> handles_;  // null if external_ is used
  External external_;
  std::mutex mutex_;  // held while the context is current
  bool lost_ = false;
  std::string device_, extensions_;
  bool software_ = false;
};

}  // namespace lf::gl
