// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>

#include "base/maths.h"
#include "base/text.h"

namespace lf {
namespace {

constexpr int kRadius = 5;  // pixels; 11x11 window
constexpr double kSigma = 1.5;
constexpr double kC1 = (0.01 * 255) * (0.01 * 255), kC2 = (0.03 * 255) * (0.03 * 255);

void require_alike(const Image& a, const Image& b, const std::vector<float>& coverage = {}) {
  if (a.family() != PixelFamily::kRgb || b.family() != PixelFamily::kRgb)
    throw Error("pictures to compare must both be RGB; convert them first");
  if (a.width() != b.width() || a.height() != b.height())
    throw Error("pictures to compare differ in size: " + size_text(a.width(), a.height()) + " and " +
                size_text(b.width(), b.height()));
  if (!coverage.empty() && coverage.size() != static_cast<size_t>(a.width()) * a.height())
    throw Error("coverage has " + std::to_string(coverage.size()) + " values for a picture of " +
                size_text(a.width(), a.height()));
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

// Filters a line of `n` values, `step` apart, with the Gaussian window. At the ends, the window is truncated and its
// weights are renormalised. The 2-D window is separable, so there is one pass for each direction.
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
    // In this form equal pictures give exactly 1: both halves of the fraction are the same sum.
    const double var_x = xx[i] - mx[i] * mx[i], var_y = yy[i] - my[i] * my[i], cov = xy[i] - mx[i] * my[i];
    out[i] =
        ((2 * mx[i] * my[i] + kC1) * (2 * cov + kC2)) / ((mx[i] * mx[i] + my[i] * my[i] + kC1) * (var_x + var_y + kC2));
  }
  return out;
}

}  // namespace

Quality compare(const Image& picture, const Image& truth, const std::vector<float>& coverage) {
  require_alike(picture, truth, coverage);
  const size_t pixels = static_cast<size_t>(picture.width()) * picture.height();
  const std::vector<double> ssim = ssim_map(picture, truth);
  Quality q;
  size_t counted = 0;
  double squares = 0, ssim_sum = 0;
  for (size_t i = 0; i < pixels; i++) {
    if (!coverage.empty() && !(coverage[i] > kMinCoverage)) continue;
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

std::vector<float> differences(const Image& picture, const Image& truth, const std::vector<float>& coverage) {
  require_alike(picture, truth, coverage);
  std::vector<float> out(static_cast<size_t>(picture.width()) * picture.height(), NAN);
  for (size_t i = 0; i < out.size(); i++) {
    if (!coverage.empty() && !(coverage[i] > kMinCoverage)) continue;
    int squares = 0;
    for (size_t c = 3 * i; c < 3 * i + 3; c++) {
      const int difference = picture.data()[c] - truth.data()[c];
      squares += difference * difference;
    }
    out[i] = std::sqrt(static_cast<float>(squares) / 3);
  }
  return out;
}

namespace {

constexpr int kMaxRounds = 12;
constexpr double kSettled = 1e-3;       // pixels
constexpr double kUsualError = 20;      // scale of the Cauchy weight, of 255
constexpr double kMinDeterminant = 1e-9;  // relative to the product of the diagonal
constexpr double kFarthest = 10;        // maximum shift, pixels
constexpr double kMinCoverageShare = 0.25;
constexpr int kPartsAcross = 4, kPartsDown = 3;

struct Luma {
  explicit Luma(const Image& rgb) : width(rgb.width()), height(rgb.height()), values(luma(rgb)) {}
  double at(int x, int y) const { return values[static_cast<size_t>(y) * width + x]; }
  double between(double x, double y) const {
    x = std::clamp(x, 0.0, width - 1.0);
    y = std::clamp(y, 0.0, height - 1.0);
    const int x0 = std::min(static_cast<int>(x), width - 2), y0 = std::min(static_cast<int>(y), height - 2);
    const double ax = x - x0, ay = y - y0;
    return (at(x0, y0) * (1 - ax) + at(x0 + 1, y0) * ax) * (1 - ay) +
           (at(x0, y0 + 1) * (1 - ax) + at(x0 + 1, y0 + 1) * ax) * ay;
  }
  int width, height;
  std::vector<double> values;
};

// Returns the pixels of `part` that are covered together with all their neighbours.
std::vector<size_t> inner_pixels(const std::vector<float>& coverage, int width, const Rect& part) {
  std::vector<size_t> inner;
  for (int y = part.y0; y < part.y1; y++)
    for (int x = part.x0; x < part.x1; x++) {
      bool covered = true;
      for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++)
          covered =
              covered && (coverage.empty() || coverage[static_cast<size_t>(y + j) * width + x + i] > kMinCoverage);
      if (covered) inner.push_back(static_cast<size_t>(y) * width + x);
    }
  return inner;
}

struct Fit {
  double gain = 1;
  Vec2 shift{0, 0};
};

// Fits gain and shift over these pixels by Gauss-Newton. Returns nothing if the system is singular or the fit diverges.
std::optional<Fit> fit(const Luma& predicted, const Luma& seen, const std::vector<size_t>& pixels) {
  const auto width = static_cast<size_t>(seen.width);
  Fit fit;
  for (int round = 0; round < kMaxRounds; round++) {
    Mat3 normal(0);
    Vec3 right(0);
    for (const size_t i : pixels) {
      const auto moved = [&](int dx, int dy) {
        return fit.gain * predicted.between(static_cast<double>(i % width) + dx - fit.shift.x,
                                            static_cast<double>(i / width) + dy - fit.shift.y);
      };
      const double value = moved(0, 0), residual = seen.values[i] - value;
      const double weight = 1 / (1 + residual * residual / (kUsualError * kUsualError));
      // Gradients are averaged over both images, because noise in one image would bias the shift towards zero.
      const double across = moved(1, 0) - moved(-1, 0) + seen.values[i + 1] - seen.values[i - 1];
      const double down = moved(0, 1) - moved(0, -1) + seen.values[i + width] - seen.values[i - width];
      const Vec3 row(value / fit.gain, -across / 4, -down / 4);
      normal += weight * glm::outerProduct(row, row);
      right += weight * residual * row;
    }
    const double size = normal[0][0] * normal[1][1] * normal[2][2];
    if (!(std::abs(glm::determinant(normal)) > kMinDeterminant * size)) return std::nullopt;
    const Vec3 change = glm::inverse(normal) * right;
    fit.gain += change.x;
    fit.shift += Vec2(change.y, change.z);
    if (!(fit.gain > 0) || !(glm::length(fit.shift) < kFarthest)) return std::nullopt;
    if (std::hypot(change.y, change.z) < kSettled) break;
  }
  return fit;
}

void add_scatter(const Luma& predicted, const Luma& seen, const std::vector<float>& coverage, PredictionError* error) {
  std::vector<double> gains, shifts;
  for (int j = 0; j < kPartsDown; j++)
    for (int i = 0; i < kPartsAcross; i++) {
      const int w = seen.width - 2, h = seen.height - 2;
      const Rect part{1 + w * i / kPartsAcross, 1 + h * j / kPartsDown, 1 + w * (i + 1) / kPartsAcross,
                      1 + h * (j + 1) / kPartsDown};
      const std::vector<size_t> pixels = inner_pixels(coverage, seen.width, part);
      if (pixels.size() < static_cast<size_t>(part.width()) * part.height() / 2) continue;
      const std::optional<Fit> own = fit(predicted, seen, pixels);
      gains.push_back(own ? std::abs(own->gain - error->gain) : kFarthest);
      shifts.push_back(own ? glm::length(own->shift - error->shift) : kFarthest);
    }
  if (gains.empty()) return;
  error->gain_scatter = median(gains);
  error->shift_scatter = median(shifts);
}

}  // namespace

CoverageImage coverage_image(const Accumulator& sum) {
  const Image picture = sum.resolve();
  return {picture.family() == PixelFamily::kI420 ? to_rgb(picture) : picture, sum.coverage()};
}

PredictionError compare_prediction(const CoverageImage& predicted, const CoverageImage& seen) {
  std::vector<float> both = predicted.coverage;
  for (size_t i = 0; i < both.size(); i++) both[i] = std::min(both[i], seen.coverage[i]);
  return compare_prediction(predicted.rgb, seen.rgb, both);
}

PredictionError compare_prediction(const Image& predicted, const Image& seen, const std::vector<float>& coverage) {
  const Quality quality = compare(predicted, seen, coverage);
  if (quality.coverage < kMinCoverageShare) return kNoPrediction;
  const Luma p(predicted), s(seen);
  const std::optional<Fit> whole = fit(p, s, inner_pixels(coverage, s.width, {1, 1, s.width - 1, s.height - 1}));
  if (!whole) return kNoPrediction;
  PredictionError error{quality.psnr_db, whole->gain, whole->shift, 0, 0};
  add_scatter(p, s, coverage, &error);
  return error;
}

}  // namespace lf
