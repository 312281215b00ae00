// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/colour_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "image/colour_correction.h"
#include "render/focus_range.h"

namespace lf {

namespace {

// Weighted sums over the pixels of a sample.
struct PixelSums {
  double weights = 0;
  Vec3 sum{0}, squares{0}, clipped{0};

  void add(const uint8_t* rgb, double weight) {
    weights += weight;
    for (int c = 0; c < 3; c++) {
      const int level = rgb[c];
      sum[c] += weight * level;
      squares[c] += weight * level * level;
      if (level <= 2 || level >= 253) clipped[c] += weight;
    }
  }
  // Returns the mean without a sigma. `variance` receives the variance of the noisiest channel.
  ColourSample mean(const Vec2& place, double& variance) const {
    ColourSample sample{.place = place, .level = sum / weights};
    variance = 0;
    for (int c = 0; c < 3; c++) {
      sample.usable[static_cast<size_t>(c)] = clipped[c] <= 0.01 * weights;
      variance = std::max(variance, squares[c] / weights - sample.level[c] * sample.level[c]);
    }
    return sample;
  }
};

}  // namespace

std::optional<ColourSample> sample_quad(const Image& rgb, const std::array<Vec2, 4>& corners) {
  Vec2 low = corners[0], high = corners[0], middle(0);
  for (const Vec2& corner : corners) {
    low = glm::min(low, corner);
    high = glm::max(high, corner);
    middle += corner / 4.0;
  }
  if (!(low.x >= 0 && low.y >= 0 && high.x <= rgb.width() - 1 && high.y <= rgb.height() - 1)) return std::nullopt;
  double turn = 0;
  for (size_t i = 0; i < 4; i++) {
    const Vec2 a = corners[i], b = corners[(i + 1) % 4];
    turn += a.x * b.y - b.x * a.y;
  }
  const auto is_inside = [&](const Vec2& p) {
    for (size_t i = 0; i < 4; i++) {
      const Vec2 a = corners[i], b = corners[(i + 1) % 4];
      if (((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x)) * turn < 0) return false;
    }
    return true;
  };
  PixelSums sums;
  for (int y = static_cast<int>(std::ceil(low.y)); y <= static_cast<int>(high.y); y++)
    for (int x = static_cast<int>(std::ceil(low.x)); x <= static_cast<int>(high.x); x++)
      if (is_inside({x, y})) sums.add(rgb.pixel(x, y), 1);
  if (sums.weights < 9) return std::nullopt;
  double variance;
  ColourSample sample = sums.mean(middle, variance);
  // Errors in addition to noise: rounding of levels, and position errors between cameras.
  sample.sigma = std::sqrt(0.1 + variance / sums.weights + 0.001 * variance);
  return sample;
}

namespace {

// Share of a patch's side that is sampled. Patch borders are blurred, and the position of the chart is inexact.
constexpr double kInner = 0.5;

// Returns the chart's corners in the image, clockwise in reading order from the first patch; empty if not found.
std::vector<cv::Point2f> corners_of(const cv::Mat& bgr) {
  // The detector misses charts in small images, so these are enlarged.
  const double scale = std::max(1.0, 640.0 / std::min(bgr.cols, bgr.rows));
  cv::Mat large = bgr;
  if (scale > 1) cv::resize(bgr, large, {}, scale, scale, cv::INTER_LINEAR);
  const cv::Ptr<cv::mcc::CCheckerDetector> detector = cv::mcc::CCheckerDetector::create();
  if (!detector->process(large, cv::mcc::MCC24, 1)) return {};
  const cv::Ptr<cv::mcc::CChecker> chart = detector->getBestColorChecker();
  if (!chart) return {};
  std::vector<cv::Point2f> box = chart->getBox();
  if (box.size() != 4) return {};
  for (cv::Point2f& corner : box) {
    corner.x = static_cast<float>((corner.x + 0.5) / scale - 0.5);
    corner.y = static_cast<float>((corner.y + 0.5) / scale - 0.5);
  }
  return box;
}

// Returns the correlation of the levels with the chart's nominal colours in the channel with the lowest correlation.
double likeness(std::span<const ColourSample> chart) {
  const auto n = static_cast<double>(chart.size());
  double least = 1;
  for (int c = 0; c < 3; c++) {
    const auto nominal = [&](const ColourSample& sample) {
      return checker::kSrgb[sample.patch % checker::kPatches][c];
    };
    double mean = 0, nominal_mean = 0, products = 0, squares = 0, nominal_squares = 0;
    for (const ColourSample& sample : chart) mean += sample.level[c] / n, nominal_mean += nominal(sample) / n;
    for (const ColourSample& sample : chart) {
      const double a = sample.level[c] - mean, b = nominal(sample) - nominal_mean;
      products += a * b, squares += a * a, nominal_squares += b * b;
    }
    least = std::min(least, squares > 0 ? products / std::sqrt(squares * nominal_squares) : 0);
  }
  return least;
}

// Charts that the image border cuts off are sometimes found rotated by 90 degrees, or displaced by part of a patch.
constexpr double kMinCorrelation = 0.8;

}  // namespace

std::vector<ColourSample> find_colour_checker(const Image& rgb, CameraIndex camera, uint32_t first_patch) {
  const cv::Mat from(rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data()));
  cv::Mat bgr;
  cv::cvtColor(from, bgr, cv::COLOR_RGB2BGR);
  // The detector draws random numbers. Without a seed, the result would depend on previous images.
  cv::setRNGSeed(1);
  std::vector<cv::Point2f> box;
  try {
    box = corners_of(bgr);
  } catch (const cv::Exception&) {
    return {};  // the module rejects some images
  }
  if (box.empty() || cv::norm(box[1] - box[0]) < 60 || cv::contourArea(box) < 60 * 40) return {};
  constexpr auto kWidth = static_cast<float>(checker::kWidth), kHeight = static_cast<float>(checker::kHeight);
  const std::vector<cv::Point2f> corners{{0, 0}, {kWidth, 0}, {kWidth, kHeight}, {0, kHeight}};
  const cv::Mat image_from_chart = cv::getPerspectiveTransform(corners, box);
  std::vector<ColourSample> samples;
  for (int patch = 0; patch < checker::kPatches; patch++) {
    const Vec2 middle = checker::middle(patch);
    std::vector<cv::Point2f> quad;
    for (const Vec2& side : {Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1), Vec2(-1, 1)}) {
      const Vec2 corner = middle + side * (kInner * checker::kSide / 2);
      quad.emplace_back(static_cast<float>(corner.x), static_cast<float>(corner.y));
    }
    cv::perspectiveTransform(quad, quad, image_from_chart);
    std::array<Vec2, 4> at;
    for (size_t i = 0; i < 4; i++) at[i] = {quad[i].x, quad[i].y};
    if (auto sample = sample_quad(rgb, at)) {
      sample->camera = camera;
      sample->patch = first_patch + static_cast<uint32_t>(patch);
      samples.push_back(*sample);
    }
  }
  if (likeness(samples) < kMinCorrelation) samples.clear();
  return samples;
}

void remove_misread_charts(std::vector<ColourSample>& samples) {
  // The correlations of one camera's charts differ by up to 0.01 if the camera has the faults of
  // scene/calibration_targets.h. Misread charts have correlations that are lower by at least 0.03.
  constexpr double kLess = 0.02;
  const auto chart_of = [](const ColourSample& sample) { return sample.patch / checker::kPatches; };
  std::vector<double> all, likenesses;  // per chart; per sample, of its chart
  for (auto begin = samples.begin(), end = begin; begin != samples.end(); begin = end) {
    end = std::find_if(begin, samples.end(), [&](const ColourSample& s) { return chart_of(s) != chart_of(*begin); });
    all.push_back(likeness({begin, end}));
    likenesses.resize(static_cast<size_t>(end - samples.begin()), all.back());
  }
  if (all.size() < 3) return;
  const double usual = median(all);
  size_t i = 0;
  std::erase_if(samples, [&](const ColourSample&) { return likenesses[i++] < usual - kLess; });
}

namespace {

constexpr int kRadius = 4, kPatchPixels = (2 * kRadius + 1) * (2 * kRadius + 1);
constexpr int kViewDepths = 64;
constexpr size_t kSearched = 6;      // neighbours for the depth search
constexpr double kMinTexture = 3;    // standard deviation of a window, levels; above camera noise
constexpr double kAgrees = 0.9;
constexpr double kMaxDeviation = 5;  // levels; RMS difference of matching windows after brightness correction
constexpr size_t kMinViewCameras = 3;
constexpr size_t kReferences = 16;
constexpr int kAcross = 16;

// A window of luma values with zero mean and unit length.
struct Window {
  std::array<float, kPatchPixels> of;
  double texture;  // standard deviation before normalisation, levels
};

class Luma {
 public:
  Luma() = default;
  explicit Luma(const Image& rgb) : width_(rgb.width()), height_(rgb.height()) {
    for (int y = 0; y < height_; y++)
      for (int x = 0; x < width_; x++) {
        const uint8_t* p = rgb.pixel(x, y);
        values_.push_back(0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2]);
      }
  }
  // Returns false if the window leaves the image, or has less texture than `least`.
  bool window(const Vec2& middle, double least, Window& out) const {
    const int x0 = static_cast<int>(std::floor(middle.x)), y0 = static_cast<int>(std::floor(middle.y));
    if (!(middle.x >= kRadius && middle.y >= kRadius) || x0 + kRadius + 1 >= width_ || y0 + kRadius + 1 >= height_)
      return false;
    const auto u = static_cast<float>(middle.x - x0), v = static_cast<float>(middle.y - y0);
    float sum = 0, squares = 0;
    size_t i = 0;
    for (int y = y0 - kRadius; y <= y0 + kRadius; y++)
      for (int x = x0 - kRadius; x <= x0 + kRadius; x++) {
        const float* p = &values_[static_cast<size_t>(y) * width_ + x];
        const float upper = p[0] + u * (p[1] - p[0]), lower = p[width_] + u * (p[width_ + 1] - p[width_]);
        out.of[i] = upper + v * (lower - upper);
        sum += out.of[i];
        squares += out.of[i] * out.of[i];
        i++;
      }
    const float mean = sum / kPatchPixels, variance = squares / kPatchPixels - mean * mean;
    if (!(variance > least * least)) return false;
    out.texture = std::sqrt(variance);
    const float scale = 1 / std::sqrt(variance * kPatchPixels);
    for (float& value : out.of) value = (value - mean) * scale;
    return true;
  }

 private:
  int width_ = 0, height_ = 0;
  std::vector<float> values_;
};

// Samples the image around a position. Weights decrease towards the border of the window, so that a small position
// error changes the colour little.
std::optional<ColourSample> sample_around(const Image& rgb, const Vec2& at) {
  constexpr int kReach = 6;
  const int x0 = static_cast<int>(std::lround(at.x)), y0 = static_cast<int>(std::lround(at.y));
  if (x0 < kReach || y0 < kReach || x0 + kReach >= rgb.width() || y0 + kReach >= rgb.height()) return std::nullopt;
  double square_weights = 0;
  PixelSums sums;
  for (int y = y0 - kReach; y <= y0 + kReach; y++)
    for (int x = x0 - kReach; x <= x0 + kReach; x++) {
      const double r2 = ((x - at.x) * (x - at.x) + (y - at.y) * (y - at.y)) / (kReach * kReach);
      if (r2 >= 1) continue;
      const double weight = (1 - r2) * (1 - r2);
      square_weights += weight * weight;
      sums.add(rgb.pixel(x, y), weight);
    }
  double variance;
  ColourSample sample = sums.mean(at, variance);
  sample.sigma = std::sqrt(0.1 + variance * square_weights / (sums.weights * sums.weights) + 0.003 * variance);
  return sample;
}

double correlation(const Window& a, const Window& b) {
  return std::inner_product(a.of.begin(), a.of.end(), b.of.begin(), 0.f);
}

// True if the windows match. Weak textures must correlate despite noise; for strong edges, the difference must be small
// as well.
bool agree(const Window& a, const Window& b) {
  const double like = correlation(a, b), texture = std::max(a.texture, b.texture);
  return like >= kAgrees && texture * std::sqrt(2 * (1 - std::min(like, 1.0))) <= kMaxDeviation;
}

std::optional<Vec2> seen_at(const Camera& camera, const Vec3& x_world) {
  return camera.lens.project(camera.pose.camera_from_world(x_world));
}

class Sampler {
 public:
  Sampler(const Rig& rig, std::span<const Image> images) : rig_(rig), images_(images) {
    for (size_t i = 0; i < images.size(); i++) {
      const Camera& camera = rig.cameras[i];
      if (images[i].width() > 0 && (images[i].width() != camera.width || images[i].height() != camera.height))
        throw Error("camera " + std::to_string(camera.id) + ": its image has " +
                    size_text(images[i].width(), images[i].height()) + " pixels, the rig says " +
                    size_text(camera.width, camera.height));
      luma_.push_back(images[i].width() > 0 ? Luma(images[i]) : Luma());
    }
    find_range();
  }

  ColourSamples run() {
    ColourSamples samples;
    samples.cameras = rig_.cameras.size();
    const size_t n = rig_.cameras.size(), references = std::min(n, kReferences);
    for (size_t k = 0; k < references; k++) {
      const auto reference = static_cast<CameraIndex>((2 * k + 1) * n / (2 * references));
      if (images_[reference].width() == 0) continue;
      const Camera& camera = rig_.cameras[reference];
      const std::vector<CameraIndex> near = nearest_to(reference);
      const double step = static_cast<double>(camera.width) / kAcross;
      for (double y = step / 2; y < camera.height; y += step)
        for (double x = step / 2; x < camera.width; x += step) add({x, y}, reference, near, samples);
    }
    return samples;
  }

 private:
  void find_range() {
    const auto range = estimate_focus_range(rig_, [this](CameraIndex i) -> const Image& {
      if (images_[i].width() > 0) return images_[i];
      black_ = Image(PixelFamily::kRgb, rig_.cameras[i].width, rig_.cameras[i].height);
      return black_;
    });
    if (!range)
      throw Error("the views overlap too little, or have too little texture, to compare colours; use a colour chart");
    nearest_ = 0.6 * range->near;
    farthest_ = 2 * range->far;
  }
  std::vector<CameraIndex> nearest_to(CameraIndex reference) const {
    std::vector<CameraIndex> near;
    for (CameraIndex i = 0; i < rig_.cameras.size(); i++)
      if (i != reference && images_[i].width() > 0) near.push_back(i);
    const Vec3 from = rig_.cameras[reference].pose.position;
    std::ranges::sort(near, {}, [&](CameraIndex i) { return glm::length(rig_.cameras[i].pose.position - from); });
    if (near.size() > kSearched) near.resize(kSearched);
    return near;
  }
  Vec3 place(CameraIndex reference, const Vec2& ray, double inverse) const {
    return rig_.cameras[reference].pose.world_from_camera(Vec3(ray, 1) / inverse);
  }

  void add(const Vec2& pixel, CameraIndex reference, const std::vector<CameraIndex>& near, ColourSamples& samples) {
    Window window;
    if (!luma_[reference].window(pixel, kMinTexture, window)) return;
    const std::optional<Vec2> ray = rig_.cameras[reference].lens.unproject(pixel);
    if (!ray) return;
    const double first = 1 / farthest_, last = 1 / nearest_;
    std::array<double, kViewDepths> like;
    for (int k = 0; k < kViewDepths; k++) {
      const Vec3 x = place(reference, *ray, first + (last - first) * k / (kViewDepths - 1));
      double sum = 0;
      size_t count = 0;
      for (const CameraIndex other : near) {
        Window there;
        const std::optional<Vec2> at = seen_at(rig_.cameras[other], x);
        if (!at || !luma_[other].window(*at, kMinTexture / 2, there)) continue;
        sum += correlation(window, there);
        count++;
      }
      like[static_cast<size_t>(k)] = count >= 2 ? sum / static_cast<double>(count) : -1;
    }
    const auto best = static_cast<int>(std::ranges::max_element(like) - like.begin());
    if (like[static_cast<size_t>(best)] < kAgrees - 0.1) return;
    double k = best;
    if (best > 0 && best + 1 < kViewDepths) {
      const double a = like[static_cast<size_t>(best - 1)], b = like[static_cast<size_t>(best)],
                   c = like[static_cast<size_t>(best + 1)];
      if (const double bend = a - 2 * b + c; bend < -1e-9) k += std::clamp((a - c) / (2 * bend), -0.5, 0.5);
    }
    add_patch(window, place(reference, *ray, first + (last - first) * k / (kViewDepths - 1)), samples);
  }

  void add_patch(const Window& window, const Vec3& x, ColourSamples& samples) {
    std::vector<ColourSample> seen;
    for (CameraIndex i = 0; i < rig_.cameras.size(); i++) {
      if (images_[i].width() == 0) continue;
      const std::optional<Vec2> at = seen_at(rig_.cameras[i], x);
      Window there;
      if (!at || !luma_[i].window(*at, kMinTexture / 2, there) || !agree(window, there)) continue;
      auto sample = sample_around(images_[i], *at);
      if (!sample) continue;
      sample->camera = i;
      sample->patch = samples.patches;
      seen.push_back(*sample);
    }
    if (seen.size() < kMinViewCameras) return;
    samples.all.insert(samples.all.end(), seen.begin(), seen.end());
    samples.patches++;
  }

  const Rig& rig_;
  const std::span<const Image> images_;
  double nearest_ = 0, farthest_ = 0;  // search range, metres from the cameras
  std::vector<Luma> luma_;
  Image black_;
};

}  // namespace

ColourSamples sample_views(const Rig& rig, std::span<const Image> images) {
  if (images.size() != rig.cameras.size())
    throw Error("an image for each camera of the rig is required; leave the images of missing cameras empty");
  return Sampler(rig, images).run();
}

}  // namespace lf
