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

// What names a row of the table: which way of rendering, and its settings.
struct Setting {
  std::string renderer;
  Pixels pixels = Pixels::kI420;
  std::string codec = "raw";  // between renderer and compositor: raw, jpeg
  int quality = 0;            // of a lossy codec
  int threads = 1;
  bool is_default = false;   // what the elements do when nobody says otherwise
  bool is_baseline = false;  // OpenCV: what ratios are relative to
  bool any_lens = true;      // else distortion is left away, and only the time is worth something
};

// A view rendered over and over.
class Method {
 public:
  virtual ~Method() = default;
  // From camera images in memory to a picture of 8 bits: what is timed. Whatever a live system knows before a view is
  // asked for (rig, mesh, threads) was made before.
  virtual void render() = 0;
  // Of the last render().
  virtual Image picture() const = 0;
  // What went from the cameras' side to the compositor's.
  virtual size_t bytes() const = 0;
};

struct MethodKind {
  Setting setting;
  // `scene` and `view` outlive the method.
  std::function<std::unique_ptr<Method>(const Scene& scene, const View& view)> make;
};

// Which settings are wanted.
struct MethodOptions {
  std::vector<int> qualities = {90};
  std::vector<int> threads = {1};  // of what elements do by several
  bool all = false;                // families, formulations and grids that are neither default nor baseline, too
};
// Every way there is.
std::vector<MethodKind> methods(const MethodOptions& options);

// The finished picture in memory that is kept from view to view, as elements and OpenCV have it: fresh memory costs
// more than filling it.
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
