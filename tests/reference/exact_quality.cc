// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/exact_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "quality/quality.h"

namespace lf {
namespace {

// Which pixels count, and which chroma samples.
std::vector<uint8_t> covered_pixels(const FloatStill& exact) {
  std::vector<uint8_t> covered(exact.valid.size());
  for (size_t i = 0; i < covered.size(); i++) covered[i] = exact.valid[i] > kCovered;
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
