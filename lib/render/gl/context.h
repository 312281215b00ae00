// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace lf::gl {

// Identifies a group of contexts that share textures; 0: none.
using ShareGroup = uint64_t;

// An OpenGL ES 3.1 context for rendering: either without a window on its own display, or an external context.
//
// Looks for a display among EGL's devices (EGL_EXT_platform_device), then without a device
// (EGL_MESA_platform_surfaceless). GBM is never used, because NVIDIA's library crashes on GBM without a render node.
// Unsuitable drivers are skipped.
class Context {
 public:
  enum class Drivers { kHardware, kAny };  // kAny: also accept drivers that compute on the CPU, if there is no other

  // Returns null if no display is suitable, with one clause for each display that was tried in `why`. Takes tens to
  // hundreds of milliseconds. Thread-safe.
  static std::unique_ptr<Context> create(Drivers drivers, std::string& why);
  // An external context of OpenGL ES 3.1, or of an OpenGL version that includes ES 3.1. Only `call` may make the
  // context current.
  struct External {
    // Runs a job with the context current, and returns when the job is done. Returns false, without running the job, if
    // the context no longer exists.
    std::function<bool(const std::function<void()>& job)> call;
    ShareGroup group = 0;
  };
  // Uses an external context. Returns null, with the reason in `why`, if the context is unsuitable.
  static std::unique_ptr<Context> create_in(External foreign, Drivers drivers, std::string& why);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // Name of the device according to its driver: "llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& device() const { return device_; }
  bool is_software() const { return software_; }

  bool has_extension(std::string_view name) const;

  // 0: the context has its own display.
  ShareGroup group() const { return external_.group; }

  // Runs a job with the context current. Jobs are serialized; exceptions propagate. Returns false if the context is
  // lost: it cannot be used any more. Thread-safe.
  bool run(const std::function<void()>& job);
  // Simulates the loss of the context by its driver. Thread-safe.
  void lose();

 private:
  struct Handles;
  Context(std::unique_ptr<Handles> handles, External foreign);
  bool look();

  std::unique_ptr<Handles> handles_;  // null: external_ is used
  External external_;
  std::mutex mutex_;  // held while the context is current
  bool lost_ = false;
  std::string device_, extensions_;
  bool software_ = false;
};

}  // namespace lf::gl
