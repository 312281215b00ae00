// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/float_still.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "reference/float_renderer.h"

namespace lf {
namespace {

// Adds `in`, `rect` of a plane `width` samples wide and `channels` deep.
void add(const float* in, const Rect& rect, int channels, int width, double* plane) {
  const int row = rect.width() * channels;
  for (int y = rect.y0; y < rect.y1; y++, in += row) {
    double* const out = plane + (static_cast<size_t>(y) * width + rect.x0) * channels;
    for (int i = 0; i < row; i++) out[i] += in[i];
  }
}

Rect chroma_rect(const Rect& luma) {
  const int x = luma.x0 / 2, y = luma.y0 / 2;
  return {x, y, x + chroma_size(luma.width()), y + chroma_size(luma.height())};
}

void add(const FloatFragment& fragment, FloatStill& still) {
  const Rect& rect = fragment.rect;
  add(fragment.valid.data(), rect, 1, still.width, still.valid.data());
  add(fragment.lost.data(), rect, 1, still.width, still.lost.data());
  if (fragment.family == PixelFamily::kRgb) {
    add(fragment.colour.data(), rect, 3, still.width, still.colour.data());
    return;
  }
  const Rect chroma = chroma_rect(rect);
  const int width = chroma_size(still.width);
  const float* const cb = fragment.colour.data() + fragment.valid.size();
  double* const out = still.colour.data() + still.valid.size();
  add(fragment.colour.data(), rect, 1, still.width, still.colour.data());
  add(cb, chroma, 1, width, out);
  add(cb + static_cast<size_t>(chroma.width()) * chroma.height(), chroma, 1, width,
      out + static_cast<size_t>(width) * chroma_size(still.height));
}

// A chroma sample's lost weight is the mean of its pixels'.
double mean_of_block(const std::vector<double>& values, int width, int height, int cx, int cy) {
  double sum = 0;
  int n = 0;
  for (int y = 2 * cy; y < std::min(2 * cy + 2, height); y++)
    for (int x = 2 * cx; x < std::min(2 * cx + 2, width); x++, n++) sum += values[static_cast<size_t>(y) * width + x];
  return sum / n;
}

void divide(double& value, double lost) {
  if (lost < 1) value /= 1 - lost;
}

void divide_by_what_is_left(FloatStill& still) {
  const size_t pixels = still.valid.size();
  if (still.family == PixelFamily::kRgb) {
    for (size_t i = 0; i < 3 * pixels; i++) divide(still.colour[i], still.lost[i / 3]);
    return;
  }
  for (size_t i = 0; i < pixels; i++) divide(still.colour[i], still.lost[i]);
  const int width = chroma_size(still.width), height = chroma_size(still.height);
  const size_t samples = static_cast<size_t>(width) * height;
  for (size_t i = 0; i < samples; i++) {
    const auto cx = static_cast<int>(i % width), cy = static_cast<int>(i / width);
    const double lost = mean_of_block(still.lost, still.width, still.height, cx, cy);
    for (const size_t c : {pixels + i, pixels + samples + i}) {
      divide(still.colour[c], lost);
      still.colour[c] += 128;
    }
  }
}

}  // namespace

FloatStill render_float_still(const Rig& rig, const ViewPlan& plan, const OwnerMap& owners, PixelFamily family,
                              const CameraImages& images) {
  const View& view = plan.view();
  const size_t pixels = static_cast<size_t>(view.width) * view.height;
  FloatStill still{family, view.width, view.height};
  still.colour.resize(packed_size(family, view.width, view.height));
  still.valid.resize(pixels);
  still.lost.resize(pixels);
  for (const CameraIndex camera : plan.contributors()) {
    const Image& image = images(camera);
    if (image.family() != family)
      throw Error("camera " + std::to_string(rig.cameras[camera].id) +
                  ": its image is not of the pixel family asked for");
    if (const auto fragment = render_float(plan, owners, camera, rig.cameras[camera], image.view()))
      add(*fragment, still);
  }
  divide_by_what_is_left(still);
  return still;
}

}  // namespace lf
