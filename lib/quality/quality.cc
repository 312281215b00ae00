// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include "base/error.h"
#include "base/number_text.h"

namespace lf {
namespace {

constexpr int kRadius = 5;  // of the 11x11 window
constexpr double kSigma = 1.5;
constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);

void require_alike(const Image& a, const Image& b) {
  if (a.family() != PixelFamily::kRgb || b.family() != PixelFamily::kRgb)
    throw Error("pictures to compare must both be RGB");
  if (a.width() != b.width() || a.height() != b.height())
    throw Error("pictures to compare differ in size: " + size_text(a.width(), a.height()) + " and " +
                size_text(b.width(), b.height()));
}

std::vector<double> luma(const Image& rgb) {
  std::vector<double> out(static_cast<size_t>(rgb.width()) * rgb.height());
  const uint8_t* p = rgb.data().data();
  for (double& y : out) {
    y = 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
    p += 3;
  }
  return out;
}

// One pass of the window along a line of `n` values `step` apart; what lies outside the line is left out and the
// remaining weights are scaled back to a sum of 1. Two passes make the 2-D window, whose weights are a product.
void blur_line(const double* in, double* out, int n, size_t step) {
  static const std::array<double, kRadius + 1> kWeight = [] {
    std::array<double, kRadius + 1> w{};
    for (int i = 0; i <= kRadius; i++) w[i] = std::exp(-i * i / (2 * kSigma * kSigma));
    return w;
  }();
  for (int i = 0; i < n; i++) {
    double sum = 0, weights = 0;
    for (int j = std::max(0, i - kRadius); j <= std::min(n - 1, i + kRadius); j++) {
      sum += kWeight[std::abs(i - j)] * in[j * step];
      weights += kWeight[std::abs(i - j)];
    }
    out[i * step] = sum / weights;
  }
}

std::vector<double> blur(const std::vector<double>& in, int width, int height) {
  std::vector<double> rows(in.size()), out(in.size());
  for (int y = 0; y < height; y++)
    blur_line(&in[static_cast<size_t>(y) * width], &rows[static_cast<size_t>(y) * width], width, 1);
  for (int x = 0; x < width; x++) blur_line(&rows[x], &out[x], height, width);
  return out;
}

std::vector<double> product(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size());
  for (size_t i = 0; i < a.size(); i++) out[i] = a[i] * b[i];
  return out;
}

std::vector<double> ssim_map(const Image& picture, const Image& truth) {
  const int w = picture.width(), h = picture.height();
  const std::vector<double> x = luma(picture), y = luma(truth);
  const std::vector<double> mx = blur(x, w, h), my = blur(y, w, h);
  const std::vector<double> xx = blur(product(x, x), w, h), yy = blur(product(y, y), w, h);
  const std::vector<double> xy = blur(product(x, y), w, h);
  std::vector<double> out(x.size());
  for (size_t i = 0; i < out.size(); i++) {
    // Written so that equal pictures give exactly 1: both halves of the fraction are then the same sum.
    const double var_x = xx[i] - mx[i] * mx[i], var_y = yy[i] - my[i] * my[i], cov = xy[i] - mx[i] * my[i];
    out[i] =
        ((2 * mx[i] * my[i] + kC1) * (2 * cov + kC2)) / ((mx[i] * mx[i] + my[i] * my[i] + kC1) * (var_x + var_y + kC2));
  }
  return out;
}

}  // namespace

Quality compare(const Image& picture, const Image& truth, const std::vector<float>& coverage) {
  require_alike(picture, truth);
  const size_t pixels = static_cast<size_t>(picture.width()) * picture.height();
  if (!coverage.empty() && coverage.size() != pixels)
    throw Error("coverage has " + std::to_string(coverage.size()) + " values for a picture of " +
                size_text(picture.width(), picture.height()));
  const std::vector<double> ssim = ssim_map(picture, truth);
  Quality q;
  size_t counted = 0;
  double squares = 0, ssim_sum = 0;
  for (size_t i = 0; i < pixels; i++) {
    if (!coverage.empty() && !(coverage[i] > kCovered)) continue;
    counted++;
    ssim_sum += ssim[i];
    for (size_t c = 3 * i; c < 3 * i + 3; c++) {
      const int difference = std::abs(picture.data()[c] - truth.data()[c]);
      squares += difference * difference;
      q.max_error = std::max(q.max_error, difference);
    }
  }
  if (counted == 0) {
    q.psnr_db = q.ssim = std::numeric_limits<double>::quiet_NaN();
    return q;
  }
  const double mse = squares / (3.0 * static_cast<double>(counted));
  q.psnr_db = mse > 0 ? 10 * std::log10(255 * 255 / mse) : std::numeric_limits<double>::infinity();
  q.ssim = ssim_sum / static_cast<double>(counted);
  q.coverage = static_cast<double>(counted) / static_cast<double>(pixels);
  return q;
}

Image error_map(const Image& picture, const Image& truth, double gain) {
  require_alike(picture, truth);
  Image out(PixelFamily::kRgb, picture.width(), picture.height());
  for (size_t i = 0; i < out.data().size(); i += 3) {
    int difference = 0;
    for (size_t c = i; c < i + 3; c++) difference = std::max(difference, std::abs(picture.data()[c] - truth.data()[c]));
    const auto grey = static_cast<uint8_t>(std::clamp(std::lround(difference * gain), 0L, 255L));
    std::fill_n(out.data().begin() + static_cast<ptrdiff_t>(i), 3, grey);
  }
  return out;
}

}  // namespace lf
