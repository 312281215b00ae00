// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/float_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/text.h"
#include "quality/image_quality.h"
#include "render/sum_renderer.h"

namespace lf {
namespace {

using plain::Contribution;

bool render_rgb(const Contribution& contribution, const ImageView& image, FloatFragment& fragment) {
  return contribution.for_each(fragment.rect, [&](int x, int y, float own, bool valid, const Vec2& position) {
    const size_t i = plain::rect_offset(fragment.rect, x, y);
    if (!valid) {
      fragment.lost[i] = own;
      return;
    }
    fragment.valid[i] = own;
    float rgb[3];
    plain::sample_rgb(image, position, rgb);
    for (int c = 0; c < 3; c++) fragment.colour[3 * i + c] = own * rgb[c];
  });
}

bool render_i420(const Contribution& contribution, const ImageView& image, FloatFragment& fragment) {
  const Rect& rect = fragment.rect;
  float* const y = fragment.colour.data();
  float* const cb = y + static_cast<size_t>(rect.width()) * rect.height();
  float* const cr = cb + static_cast<size_t>(chroma_size(rect.width())) * chroma_size(rect.height());
  return plain::for_each_i420(
      contribution, image, rect,
      [&](size_t i, float weight, float luma) {
        fragment.valid[i] = weight;
        y[i] = luma;
      },
      [&](size_t i, float weight) { fragment.lost[i] = weight; },
      [&](size_t i, float blue, float red) {
        cb[i] = blue;
        cr[i] = red;
      });
}

}  // namespace

std::optional<FloatFragment> render_float(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera,
                                          const Camera& rig_camera, const ImageView& image) {
  check_image(rig_camera, image);
  if (plan.camera_rect(camera).empty()) return std::nullopt;
  const Contribution contribution(plan, owners, camera, rig_camera);
  FloatFragment fragment;
  fragment.family = image.family;
  fragment.rect = contribution.rect(camera);
  const Rect& rect = fragment.rect;
  if (rect.empty()) return std::nullopt;
  const bool i420 = image.family == PixelFamily::kI420;
  if (i420) fragment.rect = chroma_aligned(fragment.rect, plan.view());
  const size_t pixels = static_cast<size_t>(rect.width()) * rect.height();
  fragment.colour.resize(packed_size(image.family, rect.width(), rect.height()));
  fragment.valid.resize(pixels);
  fragment.lost.resize(pixels);
  if (!(i420 ? render_i420(contribution, image, fragment) : render_rgb(contribution, image, fragment)))
    return std::nullopt;
  return fragment;
}

namespace {

// Adds `in`, the part `rect` of a plane that is `width` samples wide and `channels` deep.
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

// Returns a chroma sample's missing weight: the mean over its pixels.
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

void divide_by_remaining_weight(FloatStill& still) {
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

FloatStill render_float_still(const Rig& rig, const ViewPlan& plan, const FaceIdMap& owners, PixelFamily family,
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
  divide_by_remaining_weight(still);
  return still;
}

namespace {

// Returns the mask of pixels to count, and of chroma samples.
std::vector<uint8_t> covered_pixels(const FloatStill& exact) {
  std::vector<uint8_t> covered(exact.valid.size());
  for (size_t i = 0; i < covered.size(); i++) covered[i] = exact.valid[i] > kMinCoverage;
  return covered;
}
std::vector<uint8_t> covered_chroma(const std::vector<uint8_t>& pixels, int width, int height) {
  const int chroma_width = chroma_size(width);
  std::vector<uint8_t> covered(static_cast<size_t>(chroma_width) * chroma_size(height), 1);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      covered[static_cast<size_t>(y / 2) * chroma_width + x / 2] &= pixels[static_cast<size_t>(y) * width + x];
  return covered;
}

class Errors {
 public:
  void add(uint8_t value, double exact) {
    const double error = std::abs(value - exact);
    max_ = std::max(max_, error);
    squares_ += error * error;
    count_++;
  }
  double max() const { return count_ > 0 ? max_ : std::numeric_limits<double>::quiet_NaN(); }
  double psnr_db() const { return 10 * std::log10(255 * 255 * static_cast<double>(count_) / squares_); }

 private:
  double max_ = 0, squares_ = 0;
  size_t count_ = 0;
};

}  // namespace

ExactQuality compare(const Image& picture, const FloatStill& exact) {
  if (picture.family() != exact.family || picture.width() != exact.width || picture.height() != exact.height)
    throw Error("pictures to compare differ in size or pixel family");
  const std::vector<uint8_t> covered = covered_pixels(exact);
  const size_t pixels = covered.size();
  const uint8_t* const data = picture.data().data();
  Errors errors;
  if (exact.family == PixelFamily::kRgb) {
    for (size_t i = 0; i < 3 * pixels; i++)
      if (covered[i / 3]) errors.add(data[i], exact.colour[i]);
  } else {
    for (size_t i = 0; i < pixels; i++)
      if (covered[i]) errors.add(data[i], exact.colour[i]);
    const std::vector<uint8_t> chroma = covered_chroma(covered, exact.width, exact.height);
    for (size_t i = 0; i < 2 * chroma.size(); i++)
      if (chroma[i % chroma.size()]) errors.add(data[pixels + i], exact.colour[pixels + i]);
  }
  const auto counted = std::count(covered.begin(), covered.end(), uint8_t{1});
  return {errors.max(), errors.psnr_db(), static_cast<double>(counted) / static_cast<double>(pixels)};
}

}  // namespace lf
