// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace lf::gl {

// A number for contexts that share their textures with each other; 0: none.
using ShareGroup = uint64_t;

// An OpenGL ES 3.1 context that sums are rendered with on a graphics card: without a window, on a display of its own,
// or in somebody else's.
//
// Displays of its own are looked for among the devices that EGL lists (EGL_EXT_platform_device), then without one
// (EGL_MESA_platform_surfaceless); never on GBM, where NVIDIA's library is known to crash without a render node. A
// driver that is unfit is passed over.
class Context {
 public:
  enum class Drivers { kHardware, kAny };  // kAny: those that compute on the CPU, too, if there is no other

  // Null with the reason in `why`, one clause for each display that was tried, if there is none. Takes tens to hundreds
  // of milliseconds. Any thread.
  static std::unique_ptr<Context> create(Drivers drivers, std::string& why);
  // Somebody else's context, of OpenGL ES 3.1 or an OpenGL that has that, which nobody else makes current.
  struct Foreign {
    // Calls a job where the context is current, and returns after it. False, without calling it, if the context is
    // there no more.
    std::function<bool(const std::function<void()>& job)> call;
    ShareGroup group = 0;  // that it belongs to
  };
  // That one; null with the reason in `why` if it is unfit.
  static std::unique_ptr<Context> create_in(Foreign foreign, Drivers drivers, std::string& why);
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  // What the driver says that it runs on: "llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& device() const { return device_; }
  // Whether the driver computes on the CPU.
  bool is_software() const { return software_; }

  // Whether the driver has an extension of OpenGL ES.
  bool has_extension(std::string_view name) const;

  // 0: the context is on a display of its own.
  ShareGroup group() const { return foreign_.group; }

  // Calls the job where the context is current, one at a time; what it throws comes from here. False if the context is
  // lost: nothing can be drawn with it ever again. Any thread.
  bool run(const std::function<void()>& job);
  // Makes the context as if its driver had lost it, from now on. Any thread.
  void lose();

 private:
  struct Handles;
  Context(std::unique_ptr<Handles> handles, Foreign foreign);
  bool look();

  std::unique_ptr<Handles> handles_;  // null: foreign_ is used
  Foreign foreign_;
  std::mutex mutex_;  // held while the context is current
  bool lost_ = false;
  std::string device_, extensions_;
  bool software_ = false;
};

}  // namespace lf::gl
