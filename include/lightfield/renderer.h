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

// What draws: SIMD on the CPU; OpenGL ES 3.1 without a window, where there is a driver for it; or the faster one of
// them, as the first pictures tell, and never a driver that computes on the CPU. All give the same picture to 1 of 255.
enum class RendererChoice : uint8_t { kCpu, kGl, kAuto };

// How a picture is made of a view.
struct RenderOptions {
  Focus focus = Focus::kPlane;
  // With kAuto: where surfaces may be, metres from the array. Where either is 0 the range follows what is found in the
  // scene.
  double nearest = 0, farthest = 0;
  // With kAuto: whether cameras that are brighter or darker than the others are made as bright, by what they see of the
  // surface. Without a value: only where the rig says nothing of its cameras' colours.
  std::optional<bool> match_brightness = {};
  Resampling resampling = Resampling::kSharpened;  // how cameras' images are sampled
  Colour background = {};                          // is shown where no camera sees anything
  RendererChoice renderer = RendererChoice::kCpu;  // what draws
};

// Pictures of one viewer from the images of all cameras, in this process: what Node and Compositor do between them, in
// one call. It keeps memory, and the focal surface that it has found, from call to call: one renderer for each viewer.
//
// Renderers may be moved. One call at a time for each; different ones may be used by different threads, and all of a
// process share their working threads. Rendering depends on neither: the same input gives the same bits.
class Renderer {
 public:
  // `threads`: how many work on a picture at most; 0: as many as there are processors.
  explicit Renderer(Rig rig, unsigned threads = 0);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  const Rig& rig() const;

  // The cameras that make this view, ascending: for pictures of it others need no image. With Focus::kAuto others are
  // looked at, too, where they have one, which is what tells whether a camera is darker than the rest.
  std::vector<uint32_t> cameras(const View& view) const;

  // The view as a picture of the images' format. `images`: one for each camera of the rig, in its order, all of one
  // format and each of its camera's size; they are only read, and only during the call. Where a camera that the view
  // needs has none its neighbours close the gap. With Focus::kAuto every call improves the surface: images of one time
  // together, from call to call those of a scene that moves as films do. Throws Error for a view that is none and for
  // images that do not fit.
  Image render(const View& view, const std::vector<ImageView>& images, const RenderOptions& options = {});
  Image render(const View& view, const std::vector<Image>& images, const RenderOptions& options = {});

  // What draws, and why: "cpu", "gl: NVIDIA ...", "auto: cpu, there is no other: ...". As of the latest picture.
  std::string drawn_by() const;

  // Forgets the focal surface, as when the scene has become another one. Other options of focus forget it, too.
  void reset_focus();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lightfield
