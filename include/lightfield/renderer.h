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

// Rendering device. kCpu: SIMD. kGl: offscreen OpenGL ES 3.1, if there is a driver. kAuto: the faster of both in the
// first pictures, but never a software OpenGL driver. Pictures of different devices differ by at most 1 of 255.
enum class RendererChoice : uint8_t { kCpu, kGl, kAuto };

struct RenderOptions {
  Focus focus = Focus::kPlane;
  // kAuto: range of surface distances from the array, in metres. If either value is 0, the range follows the scene.
  double nearest = 0, farthest = 0;
  // kAuto: true to correct brightness differences between the cameras, measured on the surface. Without a value: true
  // if the rig has no colour calibration.
  std::optional<bool> match_brightness = {};
  Resampling resampling = Resampling::kSharpened;
  Colour background = {};  // colour of pixels that no camera sees
  RendererChoice renderer = RendererChoice::kCpu;
};

// Renders the pictures of one viewer from images of all cameras in this process, like a Node and a Compositor in one
// call. Keeps memory and the focal surface from call to call: use one renderer per viewer.
//
// Movable. One call at a time for each renderer. Renderers may run in different threads; all renderers of a process
// share worker threads. The same input gives bit-identical pictures, independent of threads.
class Renderer {
 public:
  // `threads`: maximum threads per picture; 0: number of processors.
  explicit Renderer(Rig rig, unsigned threads = 0);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  const Rig& rig() const;

  // Returns the cameras that this view needs, ascending. Other cameras need no image. With Focus::kAuto, images of
  // other cameras are used if available, to compare the brightness of the cameras.
  std::vector<uint32_t> cameras(const View& view) const;

  // Returns the picture in the format of the images.
  //
  // `images`: one for each camera of the rig, in its order, all of the same format and each of its camera's size.
  // Images are only read, and only during the call. Neighbouring cameras fill in for a camera without an image. With
  // Focus::kAuto every call improves the focal surface: the images of one call must show the same moment, and
  // successive calls may show successive frames. Throws Error if the view is invalid or an image does not fit.
  Image render(const View& view, const std::vector<ImageView>& images, const RenderOptions& options = {});
  Image render(const View& view, const std::vector<Image>& images, const RenderOptions& options = {});

  // Returns the device of the latest picture and the reason: "cpu", "gl: NVIDIA ...", "auto: cpu, there is no other:
  // ...".
  std::string drawn_by() const;

  // Discards the focal surface, for example after a scene change. A change of the focus options does the same.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
