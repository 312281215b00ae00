// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_detector.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "calibration/light_moments.h"

namespace lf {
namespace {

using Eigen::Matrix2d, Eigen::Vector2d;

constexpr double kLeastNoise = 0.4;        // of 255: samples are whole numbers
constexpr float kAbove = 5;                // sigmas over the background where an image begins
constexpr float kLeastAbove = 4;           // of 255
constexpr double kClear = 10;              // sigmas of its brightness that a light has at least
constexpr int kLeastPixels = 2;            // of an image over the threshold; a single one is a hot pixel
constexpr double kBusy = 0.05;             // share of a picture that no light fills
constexpr int kMostBlobs = 300;            // of a picture that is not busy
constexpr int kSaturated = 250;            // of 255: video's white is not always its largest value
constexpr double kSmallest = 0.6;          // pixels: sigma of the narrowest weight
constexpr int kImageRounds = 25;                // the sizes of large images, whose edges are steep, settle slowly
constexpr double kImageSettled = 2e-3;          // pixels
constexpr double kWholeImage = 2.2;             // sigmas of an image that are in the picture on all sides
constexpr double kLean = 0.5, kLeans = 4;  // of the third moment, that the centre is off by; sigmas that are no chance
constexpr double kWander = 3;              // sigmas that the middle may move from where it was first
// Pixels that images are off by which are not what they are taken for: any image, and one that is clipped all over.
// Those that are clipped in part are off by less, as a power of that part that simulated lights show.
constexpr double kSystematic = 0.0015, kClipped = 0.0185, kClippedPower = 1.5;
constexpr double kParting = 0.5, kParted = 0.02;  // of what parting moved a light by, and pixels at least
constexpr double kSkirts = 5;                     // sigmas of an image that are not background
constexpr int kProbes = 3;                        // places without light, for each light, that the noise is watched at
constexpr double kTrust = 40;                     // probes that white noise counts as
constexpr float kUp = 0.02f, kFirst = 0.7f, kLast = 0.05f;  // of the background's steps: lit, and over sigma

// Eigenvalues no smaller than the narrowest weight, nor so large that the picture's noise would take over.
Matrix2d bounded(const Matrix2d& shape) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> axes((shape + shape.transpose()) / 2);
  const Vector2d values = axes.eigenvalues()
                              .cwiseMax(kSmallest * kSmallest)
                              .cwiseMin(kMomentsLargest * kMomentsLargest / (kMomentsReach * kMomentsReach));
  return axes.eigenvectors() * values.asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

struct LightDetector::Blob {
  Vector2d centre, first;
  Matrix2d shape;      // covariance of the weight
  double flux = 0;     // of the image
  double sigma = 0;    // of the centre if the noise were white
  double clipped = 0;  // share of the weighted image that is clipped
  int label = 0;

  // Of the centre, whatever the noise.
  double systematic() const { return std::hypot(kSystematic, kClipped * std::pow(clipped, kClippedPower)); }
  // The image of its own flux and shape.
  double light(int x, int y) const {
    const Vector2d from(x - centre.x(), y - centre.y());
    return flux / (2 * std::numbers::pi * std::sqrt(shape.determinant())) *
           std::exp(-from.dot(shape.inverse() * from) / 2);
  }
};

LightDetector::LightDetector(int width, int height) : width_(width), height_(height) {
  if (width < 16 || height < 16 || width > 16384 || height > 16384)
    throw Error("pictures of " + std::to_string(width) + "x" + std::to_string(height) + " pixels can't be searched");
}

std::vector<Sight> LightDetector::look(const uint8_t* grey, ptrdiff_t stride) {
  const size_t pixels = static_cast<size_t>(width_) * height_;
  if (record_.frames++ == 0) {
    background_.resize(pixels), difference_.resize(pixels), lit_.assign(pixels, 0);
    for (int y = 0; y < height_; y++)
      std::copy_n(grey + y * stride, width_, &background_[static_cast<size_t>(y) * width_]);
  }
  double sum = 0;
  std::vector<float> sizes;
  constexpr size_t kSpacing = 11;
  sizes.reserve(pixels / kSpacing + 1);
  for (int y = 0; y < height_; y++)
    for (int x = 0; x < width_; x++) {
      const size_t i = static_cast<size_t>(y) * width_ + x;
      const uint8_t value = grey[y * stride + x];
      difference_[i] = static_cast<float>(value) - background_[i];
      sum += background_[i];
      record_.brightest = std::max(record_.brightest, static_cast<double>(value));
      if (i % kSpacing == 0 && !lit_[i]) sizes.push_back(difference_[i]);
    }
  record_.background += (sum / static_cast<double>(pixels) - record_.background) / static_cast<double>(record_.frames);
  if (record_.frames == 1 || sizes.empty()) return {};
  const auto quantile = [&](double share) {
    const auto nth = sizes.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(sizes.size()));
    std::nth_element(sizes.begin(), nth, sizes.end());
    return static_cast<double>(*nth);
  };
  // Above the background, since much of what is below is clipped at black. Compression leaves few large ones.
  // Nor is noise what a large bright thing adds to them.
  const double small = quantile(0.6915);
  const double noise =
      std::max(kLeastNoise, std::min(std::max(quantile(0.8413), quantile(0.9772) / 2), 4 * small + 1.5));
  record_.noise += (noise - record_.noise) / static_cast<double>(std::min<size_t>(record_.frames - 1, 30));

  std::vector<Blob> blobs = find_blobs(std::max(kLeastAbove, kAbove * static_cast<float>(record_.noise)));
  std::vector<Sight> sights;
  std::erase_if(blobs, [&](Blob& blob) { return !refine(blob, {}, grey, stride); });
  std::sort(blobs.begin(), blobs.end(), [](const Blob& a, const Blob& b) { return a.flux > b.flux; });
  // Two beginnings that led to one light, and fragments of a large one.
  for (size_t i = 0; i < blobs.size(); i++)
    std::erase_if(blobs, [&](const Blob& b) {
      if (&b <= &blobs[i]) return false;
      const Vector2d apart = b.centre - blobs[i].centre;
      return apart.dot(blobs[i].shape.inverse() * apart) < 6;
    });
  part_neighbours(blobs, grey, stride);
  mark_lit(blobs);
  watch_noise(blobs);
  const double excess = std::sqrt(std::max(1.0, (correlated_ + kTrust) / (white_ + kTrust)));
  for (const Blob& blob : blobs) {
    if (sights.size() == kMostSights) break;
    sights.push_back(
        {{blob.centre.x(), blob.centre.y()}, std::hypot(blob.sigma * excess, blob.systematic()), blob.flux});
  }
  record_.lit += !sights.empty();
  learn(grey, stride);
  return sights;
}

std::vector<LightDetector::Blob> LightDetector::find_blobs(float threshold) {
  const cv::Mat difference(height_, width_, CV_32F, difference_.data());
  cv::Mat mask, labels, boxes, middles;
  mask = difference > threshold;
  std::vector<Blob> blobs;
  // Those that belong to an image are not the background's, nor are those next to them.
  cv::Mat around(height_, width_, CV_8U, lit_.data());
  cv::dilate(mask, around, cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  const int lit = cv::countNonZero(mask);
  if (lit == 0) return blobs;
  const int count = cv::connectedComponentsWithStats(mask, labels, boxes, middles, 8, CV_32S);
  if (lit > kBusy * width_ * height_) {
    record_.busy++;
    return blobs;
  }
  for (int i = 1; i < count; i++) {
    if (boxes.at<int>(i, cv::CC_STAT_AREA) < kLeastPixels) continue;
    Blob& blob = blobs.emplace_back();
    blob.label = i;
    const int left = boxes.at<int>(i, cv::CC_STAT_LEFT), top = boxes.at<int>(i, cv::CC_STAT_TOP);
    Vector2d mean = Vector2d::Zero();
    Matrix2d square = Matrix2d::Zero();
    for (int y = top; y < top + boxes.at<int>(i, cv::CC_STAT_HEIGHT); y++)
      for (int x = left; x < left + boxes.at<int>(i, cv::CC_STAT_WIDTH); x++) {
        if (labels.at<int>(y, x) != i) continue;
        const double d = at(x, y);
        blob.flux += d;
        mean += d * Vector2d(x, y);
        square += d * Vector2d(x, y) * Vector2d(x, y).transpose();
      }
    blob.centre = blob.first = mean / blob.flux;
    blob.shape =
        square / blob.flux - blob.centre * blob.centre.transpose() + kSmallest * kSmallest * Matrix2d::Identity();
  }
  if (blobs.size() > kMostBlobs) {
    record_.busy++;
    blobs.clear();
  }
  return blobs;
}

// To where the image equals its weight; false where there is no such place near, or the light is too faint.
bool LightDetector::refine(Blob& blob, const std::vector<Blob>& others, const uint8_t* grey, ptrdiff_t stride) {
  const double faint = std::pow(kAbove * record_.noise, 2);
  const auto sample = [&](int x, int y) -> LightSample {
    // What a light has left, since it is in the background yet, must not push its neighbours away.
    double d = std::max(static_cast<double>(at(x, y)), -4 * record_.noise);
    for (const Blob& other : others) d -= other.light(x, y);
    // Cameras encode about the square root of light: on top of a bright light the background is next to nothing. What
    // that makes of a pixel's value it makes of its noise, too.
    const double b = background_[static_cast<size_t>(y) * width_ + x], over = std::max(0.0, d);
    const double dark = b * b + faint, all = over * over + dark;
    const bool clipped = grey[y * stride + x] >= kSaturated;
    return {d + b * over * over / all, clipped ? 0 : 1 + 2 * b * over * dark / (all * all)};
  };
  LightMoments m;
  Matrix2d step = Matrix2d::Identity();
  bool settled = false;
  for (int round = 0; round < kImageRounds && !settled; round++) {
    m = light_moments(blob.centre, blob.shape, width_, height_, sample);
    if (!(m.weight > 0)) return false;
    m.mean /= m.weight, m.spread /= m.weight;
    // How the mean answers to a shift of the weight.
    const Matrix2d slope = Matrix2d::Identity() - m.spread * blob.shape.inverse();
    if (!(slope.determinant() > 0.02)) return false;
    step = slope.inverse();
    const Vector2d move = step * m.mean;
    blob.centre += move;
    const Vector2d wander = blob.centre - blob.first;
    if (!(wander.dot(blob.shape.inverse() * wander) < kWander * kWander)) return false;
    // A normal distribution under a weight of its own size has half its covariance.
    const Matrix2d shape = bounded(2 * (m.spread - m.mean * m.mean.transpose()));
    settled = move.norm() < kImageSettled && (shape - blob.shape).norm() < 0.02 * shape.norm();
    if (!settled) blob.shape = shape;
  }
  // What the picture's border cuts off would pull the rest inwards.
  const double rx = kWholeImage * std::sqrt(blob.shape(0, 0)), ry = kWholeImage * std::sqrt(blob.shape(1, 1));
  if (blob.centre.x() < rx - 0.5 || blob.centre.y() < ry - 0.5 || blob.centre.x() > width_ - 0.5 - rx ||
      blob.centre.y() > height_ - 0.5 - ry)
    return false;
  const double variance = record_.noise * record_.noise;
  if (m.weight < kClear * std::sqrt(variance * std::max(m.squares, 1.0))) return false;
  const Matrix2d of_centre = step * (variance * m.by_noise / (m.weight * m.weight)) * step.transpose();
  blob.sigma = std::sqrt(of_centre.trace() / 2);
  blob.clipped = m.clipped / m.weight;
  // An image that leans to one side is that of two lights, or of one and its reflection.
  const double lean = kLean * (m.skew / m.weight).norm();
  if (lean > kLeans * std::hypot(blob.sigma, blob.systematic())) blob.sigma = std::hypot(blob.sigma, lean);
  // The weight halves the sum of a normal distribution of its own size.
  blob.flux = 2 * m.weight;
  return true;
}

// Lights whose images run into each other, each again without what the others leave where it is. What that moved it by
// is not known well.
void LightDetector::part_neighbours(std::vector<Blob>& blobs, const uint8_t* grey, ptrdiff_t stride) {
  const std::vector<Blob> before = blobs;
  for (size_t i = 0; i < blobs.size(); i++) {
    std::vector<Blob> near;
    for (size_t j = 0; j < before.size(); j++) {
      const Vector2d apart = before[j].centre - before[i].centre;
      const Matrix2d both = kMomentsReach * kMomentsReach * (before[i].shape + before[j].shape);
      if (j != i && apart.dot(both.inverse() * apart) < 1) near.push_back(before[j]);
    }
    if (near.empty()) continue;
    if (!refine(blobs[i], near, grey, stride)) blobs[i] = before[i];
    blobs[i].sigma = std::hypot(blobs[i].sigma, kParting * (blobs[i].centre - before[i].centre).norm() + kParted);
  }
}

// The skirts of a light's image are not the background's to learn.
void LightDetector::mark_lit(const std::vector<Blob>& blobs) {
  for (const Blob& blob : blobs) {
    const Matrix2d inverse = blob.shape.inverse();
    const double rx = kSkirts * std::sqrt(blob.shape(0, 0)), ry = kSkirts * std::sqrt(blob.shape(1, 1));
    for (int y = std::max(0, static_cast<int>(blob.centre.y() - ry)); y < height_ && y <= blob.centre.y() + ry; y++)
      for (int x = std::max(0, static_cast<int>(blob.centre.x() - rx)); x < width_ && x <= blob.centre.x() + rx; x++) {
        const Vector2d from(x - blob.centre.x(), y - blob.centre.y());
        if (from.dot(inverse * from) < kSkirts * kSkirts) lit_[static_cast<size_t>(y) * width_ + x] = 255;
      }
  }
}

// What compression, or a camera's own filters, leave of the noise is not white. The first moments that place a light
// are taken where there is none, too: how large they are there, over what white noise would do.
void LightDetector::watch_noise(const std::vector<Blob>& blobs) {
  const auto sample = [&](int x, int y) { return LightSample{at(x, y), 1}; };
  for (const Blob& blob : blobs)
    for (int i = 0; i < kProbes; i++) {
      const auto draw = [&](int range) {
        random_ = random_ * 1664525 + 1013904223;
        return static_cast<int>((random_ >> 8) % static_cast<uint32_t>(range));
      };
      // Amid the pixels as the light is: some compressions know where their blocks begin.
      const Vector2d shift(8 * draw(width_ / 8), 8 * draw(height_ / 8));
      Vector2d at = blob.centre + shift;
      at = {std::fmod(at.x(), width_), std::fmod(at.y(), height_)};
      const double reach = kMomentsReach * std::sqrt(std::max(blob.shape(0, 0), blob.shape(1, 1)));
      const int x0 = static_cast<int>(at.x() - reach), x1 = static_cast<int>(at.x() + reach) + 1;
      const int y0 = static_cast<int>(at.y() - reach), y1 = static_cast<int>(at.y() + reach) + 1;
      if (x0 < 0 || y0 < 0 || x1 >= width_ || y1 >= height_) continue;
      bool dark = true;
      for (int y = y0; y <= y1 && dark; y++)
        dark = std::none_of(&lit_[static_cast<size_t>(y) * width_ + x0], &lit_[static_cast<size_t>(y) * width_ + x1],
                            [](uint8_t l) { return l != 0; });
      if (!dark) continue;
      const LightMoments m = light_moments(at, blob.shape, width_, height_, sample);
      const double expected = record_.noise * record_.noise * m.by_noise.trace();
      if (!(expected > 0)) continue;
      white_ += 1;
      correlated_ += std::min(6.0, m.mean.squaredNorm() / expected);
    }
}

void LightDetector::learn(const uint8_t* grey, ptrdiff_t stride) {
  const auto noise = static_cast<float>(record_.noise);
  const float step = noise * std::max(kLast, kFirst / static_cast<float>(record_.frames)),
              gone = std::max(2 * kLeastAbove, 6 * noise);
  for (int y = 0; y < height_; y++)
    for (int x = 0; x < width_; x++) {
      const size_t i = static_cast<size_t>(y) * width_ + x;
      const float d = difference_[i];
      // A light that stood still from the beginning has gone.
      if (d < -gone)
        background_[i] = grey[y * stride + x];
      else if (lit_[i])
        background_[i] += kUp * (d > 0);
      else
        background_[i] += d > 0 ? step : d < 0 ? -step : 0;
    }
}

}  // namespace lf
