// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lightfield/image.h>
#include <lightfield/rig.h>

namespace lightfield {

// The device that renders pictures:
// - kCpu uses SIMD instructions.
// - kGl uses OpenGL ES 3.1 without a window, if there is a driver.
// - kAuto measures both on the first pictures and keeps the faster one. It never chooses an OpenGL driver that computes
//   on the CPU.
// Pictures of different devices differ by at most 1 of 255.
enum class RendererChoice : uint8_t { kCpu, kGl, kAuto };

struct RenderOptions {
  Focus focus = Focus::kPlane;
  // Range of the surface distances from the array that Focus::kAuto searches, in metres. If either value is 0, the
  // range adapts to the scene.
  double nearest = 0, farthest = 0;
  // True if Focus::kAuto also measures and corrects brightness differences between the cameras. Without a value,
  // brightness is matched if the rig has no colour calibration.
  std::optional<bool> match_brightness = {};
  Resampling resampling = Resampling::kSharpened;
  Colour background = {};  // colour of pixels that no camera sees
  RendererChoice renderer = RendererChoice::kCpu;
  uint64_t reserved[4] = {};  // space for the options of later versions; must be 0
};

// Renders the pictures of one viewer if the images of all cameras are available in this process. (Otherwise use Node
// and Compositor.) A renderer keeps memory and its focal surface (the estimated depth of each pixel) from call to call,
// so use one renderer per viewer.
//
// A renderer may be moved. Call its methods from one thread at a time; different renderers may run in different
// threads, and all share the worker threads of the process. The same input gives bit-identical pictures for any number
// of threads.
class Renderer {
 public:
  // Creates a renderer for the cameras of `rig`. `threads` is the maximum number of threads per picture; 0 means the
  // number of processors.
  explicit Renderer(Rig rig, unsigned threads = 0);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  const Rig& rig() const;

  // Returns the cameras that contribute to this view, in ascending order. Other cameras need no image. However,
  // Focus::kAuto uses such images if available, to compare the brightness of the cameras.
  std::vector<uint32_t> cameras(const View& view) const;

  // Renders the picture of a virtual camera from the images of the array. The result has the format of the images.
  //
  // `images` has one image for each camera of the rig, in the same order. All must have the same format, and each must
  // have the size of its camera. The images are only read during the call. Neighbouring cameras fill in for a camera
  // without an image.
  //
  // If the focus is Focus::kAuto, every call improves the focal surface. The images of one call must therefore show the
  // same moment, and successive calls should show successive frames. Throws Error if the view is invalid or an image
  // does not fit.
  Image render(const View& view, const std::vector<ImageView>& images, const RenderOptions& options = {});
  Image render(const View& view, const std::vector<Image>& images, const RenderOptions& options = {});

  // Renders like render(), but writes the picture to the memory of `out`. `out` must have the size of the view, and the
  // format of the images (any format if no camera has an image). If this function throws, the pixels of `out` are
  // undefined.
  void render_into(const View& view, const std::vector<ImageView>& images, const MutableImageView& out,
                   const RenderOptions& options = {});

  // Returns the device that rendered the latest picture and the reason, for example "cpu", "gl: NVIDIA ..." or "auto:
  // cpu, there is no other: ...".
  std::string drawn_by() const;

  // Discards the focal surface (the estimated depth of each pixel), for example after the scene has changed. Changing
  // the focus options has the same effect.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
