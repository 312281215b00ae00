// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace lf::gl {

// An OpenGL ES 3.1 context without a window, on a display of its own: what sums are rendered with on a graphics card.
//
// Displays are looked for among the devices that EGL lists (EGL_EXT_platform_device), then without one
// (EGL_MESA_platform_surfaceless); never on GBM, where NVIDIA's library is known to crash without a render node. A
// driver that is unfit is passed over.
class Context {
 public:
  enum class Drivers { kHardware, kAny };  // kAny: those that compute on the CPU, too, if there is no other

  // Null with the reason in `why`, one clause for each display that was tried, if there is none. Takes tens to hundreds
  // of milliseconds. Any thread.
  static std::unique_ptr<Context> create(Drivers drivers, std::string& why);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // What the driver says that it runs on: "llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& device() const { return device_; }
  // Whether the driver computes on the CPU.
  bool is_software() const { return software_; }

  // Whether the driver has an extension of OpenGL ES.
  bool has_extension(std::string_view name) const;

  // Makes the context that of the calling thread, for as long as this lives; others wait.
  class Current {
   public:
    explicit Current(Context& context);
    ~Current();
    Current(const Current&) = delete;
    Current& operator=(const Current&) = delete;
    // False if the context is lost: nothing can be drawn with it ever again.
    explicit operator bool() const { return good_; }

   private:
    Context& context_;
    std::lock_guard<std::mutex> lock_;
    bool good_;
  };
  // Makes the context as if its driver had lost it, from now on. Any thread.
  void lose();

 private:
  struct Handles;
  explicit Context(std::unique_ptr<Handles> handles);

  std::unique_ptr<Handles> handles_;
  std::mutex mutex_;  // held while the context is current
  bool lost_ = false;
  std::string device_, extensions_;
  bool software_ = false;
};

}  // namespace lf::gl
