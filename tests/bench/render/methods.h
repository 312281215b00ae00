// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bench/render/scene.h"
#include "composite/accumulator.h"
#include "image/image.h"

namespace lf::bench {

struct Setting {
  std::string renderer;
  Pixels pixels = Pixels::kI420;
  std::string codec = "raw";  // codec between renderer and compositor: raw, jpeg
  int quality = 0;            // of a lossy codec
  int threads = 1;
  bool is_default = false;   // the elements' default
  bool is_baseline = false;  // OpenCV: reference of ratios
  bool any_lens = true;      // false: ignores distortion, so that only the time is meaningful
};

class Method {
 public:
  virtual ~Method() = default;
  // The timed part: from camera images in memory to an 8-bit picture. Everything that a live system prepares before a
  // request (rig, mesh, threads) already exists.
  virtual void render() = 0;
  // Result of the last render().
  virtual Image picture() const = 0;
  // Bytes from the cameras' side to the compositor.
  virtual size_t bytes() const = 0;
};

struct MethodKind {
  Setting setting;
  // `scene` and `view` must outlive the method.
  std::function<std::unique_ptr<Method>(const Scene& scene, const View& view)> make;
};

struct MethodOptions {
  std::vector<int> qualities = {90};
  std::vector<int> threads = {1};  // for the multithreaded parts of elements
  bool all = false;                // includes families, formulations and grids that are neither default nor baseline
};
std::vector<MethodKind> methods(const MethodOptions& options);

// Resolves into memory that is reused between views, like the elements and OpenCV: allocating memory costs more than
// filling an old buffer.
inline void resolve_into(const Accumulator& sum, Image& picture) {
  if (picture.family() != sum.family() || picture.width() != sum.width() || picture.height() != sum.height())
    picture = Image(sum.family(), sum.width(), sum.height());
  const ImageView view = picture.view();
  uint8_t* plane[3] = {picture.plane(0), nullptr, nullptr};
  if (sum.family() == PixelFamily::kI420)
    for (int i = 1; i < 3; i++) plane[i] = picture.plane(i);
  sum.resolve({}, RgbLayout{}, plane, view.stride);
}

}  // namespace lf::bench
