// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_detector.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "base/maths.h"
#include "base/text.h"

namespace lf {
namespace {

using Eigen::Matrix2d, Eigen::Vector2d;

constexpr double kMinNoise = 0.4;  // grey levels; samples are integers
constexpr float kAbove = 5;        // detection threshold, sigmas over the background
constexpr float kMinAbove = 4;     // grey levels
constexpr double kClear = 10;      // minimum signal-to-noise ratio of a light
constexpr int kMinPixels = 2;      // above the threshold; single pixels are hot pixels
constexpr double kBusy = 0.05;     // share of bright pixels that no light reaches
constexpr int kMaxBlobs = 300;
constexpr int kSaturated = 250;            // grey levels; white in video is not always the maximum
constexpr double kSmallest = 0.6;          // sigma of the narrowest weight, pixels
constexpr int kImageRounds = 25;           // large images with steep edges converge slowly
constexpr double kImageSettled = 2e-3;     // pixels
constexpr double kWholeImage = 2.2;        // sigmas that must be inside the image on all sides
constexpr double kLean = 0.5, kLeans = 4;  // centre error per third moment; significance in sigmas
constexpr double kWander = 3;              // largest shift from the initial centre, sigmas
// Systematic position errors in pixels: of any image, and of a fully clipped image.
constexpr double kSystematic = 0.0015, kClipped = 0.0185, kClippedPower = 1.5;
// Position error of lights that were separated: share of the shift, and minimum in pixels.
constexpr double kParting = 0.5, kParted = 0.02;
constexpr double kSkirts = 5;  // sigmas of an image that are excluded from the background
constexpr int kProbes = 3;     // noise measurements per light, at dark positions
constexpr double kTrust = 40;  // weight of the white-noise prior, in probes
// How much the background changes per frame: at lights (grey levels), at first, and finally (in sigmas).
constexpr float kUp = 0.02f, kFirst = 0.7f, kLast = 0.05f;

constexpr double kMomentReach = 3.5;  // sigmas of the weight
constexpr int kMaxMomentRadius = 80;  // pixels from the centre

struct LightMoments {
  double weight = 0;
  double clipped = 0;  // share of `weight` from clipped pixels
  double squares = 0;  // variance of `weight` for noise of variance 1
  Vector2d mean = Vector2d::Zero();
  Matrix2d spread = Matrix2d::Zero();
  Vector2d skew = Vector2d::Zero();      // third moment, in sigmas of the weight
  Matrix2d by_noise = Matrix2d::Zero();  // covariance of `mean` for noise of variance 1
};

struct LightSample {
  double value = 0;
  double gain = 1;  // derivative of the value by image noise; 0: clipped
};

// Returns the sums within reach of a weight's centre. `sample(x, y)` returns a LightSample.
template <class Sample>
LightMoments light_moments(const Vector2d& centre, const Matrix2d& shape, int width, int height, Sample&& sample) {
  LightMoments m;
  const Matrix2d inverse = shape.inverse();
  const int rx = std::min(kMaxMomentRadius, static_cast<int>(std::ceil(kMomentReach * std::sqrt(shape(0, 0)))));
  const int ry = std::min(kMaxMomentRadius, static_cast<int>(std::ceil(kMomentReach * std::sqrt(shape(1, 1)))));
  const int x0 = std::max(0, static_cast<int>(centre.x()) - rx),
            x1 = std::min(width - 1, static_cast<int>(centre.x()) + rx + 1);
  const int y0 = std::max(0, static_cast<int>(centre.y()) - ry),
            y1 = std::min(height - 1, static_cast<int>(centre.y()) + ry + 1);
  for (int y = y0; y <= y1; y++)
    for (int x = x0; x <= x1; x++) {
      const Vector2d from(x - centre.x(), y - centre.y());
      const double distance = from.dot(inverse * from);
      if (distance > kMomentReach * kMomentReach) continue;
      const auto [d, gain] = sample(x, y);
      const double w = std::exp(-distance / 2), noise = w * w * gain * gain;
      m.weight += w * d;
      m.mean += w * d * from;
      m.spread += w * d * from * from.transpose();
      m.skew += w * d * distance * from;
      m.squares += noise;
      m.by_noise += noise * from * from.transpose();
      if (gain == 0) m.clipped += w * d;
    }
  return m;
}

// Limits the eigenvalues: the narrowest weight, and a size beyond which noise dominates.
Matrix2d bounded(const Matrix2d& shape) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> axes((shape + shape.transpose()) / 2);
  const Vector2d values = axes.eigenvalues()
                              .cwiseMax(kSmallest * kSmallest)
                              .cwiseMin(kMaxMomentRadius * kMaxMomentRadius / (kMomentReach * kMomentReach));
  return axes.eigenvectors() * values.asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

struct LightDetector::Blob {
  Vector2d centre, first;
  Matrix2d shape;
  double flux = 0;
  double sigma = 0;    // standard deviation of the centre for white noise, pixels
  double clipped = 0;  // clipped share of the weighted image
  int label = 0;

  double systematic() const { return std::hypot(kSystematic, kClipped * std::pow(clipped, kClippedPower)); }
  double light(int x, int y) const {
    const Vector2d from(x - centre.x(), y - centre.y());
    return flux / (2 * std::numbers::pi * std::sqrt(shape.determinant())) *
           std::exp(-from.dot(shape.inverse() * from) / 2);
  }
};

LightDetector::LightDetector(int width, int height) : width_(width), height_(height) {
  if (width < 16 || height < 16 || width > 16384 || height > 16384)
    throw Error("images of " + std::to_string(width) + "x" + std::to_string(height) +
                " pixels can't be searched: width and height must be 16 to 16384");
}

std::vector<LightDetection> LightDetector::detect(const uint8_t* grey, ptrdiff_t stride) {
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
  // Uses only positive differences from the background, because negative differences are often clipped at black.
  const double small = quantile(0.6915);
  const double noise = std::max(kMinNoise, std::min(std::max(quantile(0.8413), quantile(0.9772) / 2), 4 * small + 1.5));
  record_.noise += (noise - record_.noise) / static_cast<double>(std::min<size_t>(record_.frames - 1, 30));

  std::vector<Blob> blobs = find_blobs(std::max(kMinAbove, kAbove * static_cast<float>(record_.noise)));
  std::vector<LightDetection> sights;
  std::erase_if(blobs, [&](Blob& blob) { return !refine(blob, {}, grey, stride); });
  std::sort(blobs.begin(), blobs.end(), [](const Blob& a, const Blob& b) { return a.flux > b.flux; });
  for (size_t i = 0; i < blobs.size(); i++)
    std::erase_if(blobs, [&](const Blob& b) {
      if (&b <= &blobs[i]) return false;
      const Vector2d apart = b.centre - blobs[i].centre;
      return apart.dot(blobs[i].shape.inverse() * apart) < 6;
    });
  split_neighbours(blobs, grey, stride);
  mark_lit(blobs);
  update_noise(blobs);
  const double excess = std::sqrt(std::max(1.0, (correlated_ + kTrust) / (white_ + kTrust)));
  for (const Blob& blob : blobs) {
    if (sights.size() == kMaxDetections) break;
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
  // Pixels of a light and their neighbours are excluded from the background.
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
    if (boxes.at<int>(i, cv::CC_STAT_AREA) < kMinPixels) continue;
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
  if (blobs.size() > kMaxBlobs) {
    record_.busy++;
    blobs.clear();
  }
  return blobs;
}

// Moves the weight until it matches the image of the light. Returns false if it does not converge nearby, or if the
// light is too faint.
bool LightDetector::refine(Blob& blob, const std::vector<Blob>& others, const uint8_t* grey, ptrdiff_t stride) {
  const double faint = std::pow(kAbove * record_.noise, 2);
  const auto sample = [&](int x, int y) -> LightSample {
    // Limits negative values, because traces of a light that is still in the background must not displace its
    // neighbours.
    double d = std::max(static_cast<double>(at(x, y)), -4 * record_.noise);
    for (const Blob& other : others) d -= other.light(x, y);
    // Pixel values are about the square root of light, so the background contributes almost nothing under a bright
    // light. The derivative scales the noise accordingly.
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
    const Matrix2d slope = Matrix2d::Identity() - m.spread * blob.shape.inverse();
    if (!(slope.determinant() > 0.02)) return false;
    step = slope.inverse();
    const Vector2d move = step * m.mean;
    blob.centre += move;
    const Vector2d wander = blob.centre - blob.first;
    if (!(wander.dot(blob.shape.inverse() * wander) < kWander * kWander)) return false;
    // Under a weight of equal size, a normal distribution has half its covariance.
    const Matrix2d shape = bounded(2 * (m.spread - m.mean * m.mean.transpose()));
    settled = move.norm() < kImageSettled && (shape - blob.shape).norm() < 0.02 * shape.norm();
    if (!settled) blob.shape = shape;
  }
  // Clipping at the image border would bias the centre inwards.
  const double rx = kWholeImage * std::sqrt(blob.shape(0, 0)), ry = kWholeImage * std::sqrt(blob.shape(1, 1));
  if (blob.centre.x() < rx - 0.5 || blob.centre.y() < ry - 0.5 || blob.centre.x() > width_ - 0.5 - rx ||
      blob.centre.y() > height_ - 0.5 - ry)
    return false;
  const double variance = record_.noise * record_.noise;
  if (m.weight < kClear * std::sqrt(variance * std::max(m.squares, 1.0))) return false;
  const Matrix2d of_centre = step * (variance * m.by_noise / (m.weight * m.weight)) * step.transpose();
  blob.sigma = std::sqrt(of_centre.trace() / 2);
  blob.clipped = m.clipped / m.weight;
  // A skewed image shows two lights, or a light and its reflection.
  const double lean = kLean * (m.skew / m.weight).norm();
  if (lean > kLeans * std::hypot(blob.sigma, blob.systematic())) blob.sigma = std::hypot(blob.sigma, lean);
  // A weight of equal size halves the sum of a normal distribution.
  blob.flux = 2 * m.weight;
  return true;
}

// Refines lights with overlapping images after subtracting their neighbours.
void LightDetector::split_neighbours(std::vector<Blob>& blobs, const uint8_t* grey, ptrdiff_t stride) {
  const std::vector<Blob> before = blobs;
  for (size_t i = 0; i < blobs.size(); i++) {
    std::vector<Blob> near;
    for (size_t j = 0; j < before.size(); j++) {
      const Vector2d apart = before[j].centre - before[i].centre;
      const Matrix2d both = kMomentReach * kMomentReach * (before[i].shape + before[j].shape);
      if (j != i && apart.dot(both.inverse() * apart) < 1) near.push_back(before[j]);
    }
    if (near.empty()) continue;
    if (!refine(blobs[i], near, grey, stride)) blobs[i] = before[i];
    blobs[i].sigma = std::hypot(blobs[i].sigma, kParting * (blobs[i].centre - before[i].centre).norm() + kParted);
  }
}

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

// Compression and camera filters make noise correlated. This measures the first moment at dark positions, relative to
// the moment of white noise.
void LightDetector::update_noise(const std::vector<Blob>& blobs) {
  const auto sample = [&](int x, int y) { return LightSample{at(x, y), 1}; };
  for (const Blob& blob : blobs)
    for (int i = 0; i < kProbes; i++) {
      const auto draw = [&](int range) {
        random_ = random_ * 1664525 + 1013904223;
        return static_cast<int>((random_ >> 8) % static_cast<uint32_t>(range));
      };
      // The subpixel position and the position modulo 8 stay the same, because compression works on blocks of 8 pixels.
      const Vector2d shift(8 * draw(width_ / 8), 8 * draw(height_ / 8));
      Vector2d at = blob.centre + shift;
      at = {std::fmod(at.x(), width_), std::fmod(at.y(), height_)};
      const double reach = kMomentReach * std::sqrt(std::max(blob.shape(0, 0), blob.shape(1, 1)));
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
              gone = std::max(2 * kMinAbove, 6 * noise);
  for (int y = 0; y < height_; y++)
    for (int x = 0; x < width_; x++) {
      const size_t i = static_cast<size_t>(y) * width_ + x;
      const float d = difference_[i];
      // A light that was static from the start has moved away.
      if (d < -gone)
        background_[i] = grey[y * stride + x];
      else if (lit_[i])
        background_[i] += kUp * (d > 0);
      else
        background_[i] += d > 0 ? step : d < 0 ? -step : 0;
    }
}

namespace {

constexpr double kPathReach = 10;         // maximum prediction error, pixels
constexpr double kFirstPathReach = 0.06;  // maximum first displacement, relative to the image width
constexpr double kTurn = 0.6;             // additional reach, relative to the last displacement
constexpr double kBrightness = 12;        // cost of a brightness ratio of e, pixels
constexpr double kStillLight = 4;         // extent of a static light, pixels
constexpr size_t kMinPathPoints = 4;
constexpr size_t kMinRhythmFrames = 20;
constexpr double kJitter = 0.15;  // relative to the frame time

struct OpenPath {
  LightPath path;
  Vec2 expected(double time) const {
    const auto& p = path.points;
    if (p.size() < 2) return p.back().sight.pixel;
    const LightPath::Point &a = p[p.size() - 2], &b = p.back();
    return b.sight.pixel + (b.sight.pixel - a.sight.pixel) * ((time - b.time) / (b.time - a.time));
  }
  double reach(double width) const {
    const auto& p = path.points;
    if (p.size() < 2) return std::max(kPathReach, kFirstPathReach * width);
    return kPathReach + kTurn * glm::length(p.back().sight.pixel - p[p.size() - 2].sight.pixel);
  }
};

void close(OpenPath& open, std::vector<LightPath>& paths) {
  auto& points = open.path.points;
  if (points.size() < kMinPathPoints) return;
  std::vector<double> brightness;
  Vec2 least = points[0].sight.pixel, most = least;
  for (const LightPath::Point& point : points) {
    brightness.push_back(point.sight.brightness);
    least = glm::min(least, point.sight.pixel), most = glm::max(most, point.sight.pixel);
  }
  open.path.brightness = median(std::move(brightness));
  open.path.still = glm::length(most - least) < kStillLight;
  paths.push_back(std::move(open.path));
}

}  // namespace

double frame_time_of(const LightDetections::Camera& camera) {
  std::vector<double> steps;
  for (size_t i = 1; i < camera.frames.size(); i++) steps.push_back(camera.frames[i].time - camera.frames[i - 1].time);
  return steps.empty() ? 0 : median(std::move(steps));
}

namespace {

// Removes the jitter of the stamps by fitting a constant frame rate with missing frames. Returns the original stamps if
// the frame rate is not constant.
std::vector<double> regularised_stamps(const LightDetections::Camera& camera) {
  std::vector<double> stamps;
  for (const LightDetections::Frame& frame : camera.frames) stamps.push_back(frame.time);
  const double step = frame_time_of(camera);
  if (stamps.size() < kMinRhythmFrames || !(step > 0)) return stamps;
  // Frame numbers are counted from frame to frame, so that errors of the step do not accumulate.
  std::vector<double> beats{0};
  for (size_t i = 1; i < stamps.size(); i++)
    beats.push_back(beats.back() + std::max(1.0, std::round((stamps[i] - stamps[i - 1]) / step)));
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (size_t i = 0; i < stamps.size(); i++)
    n++, x += beats[i], y += stamps[i], xx += beats[i] * beats[i], xy += beats[i] * stamps[i];
  const double slope = (n * xy - x * y) / (n * xx - x * x), start = (y - slope * x) / n;
  std::vector<double> even;
  for (size_t i = 0; i < stamps.size(); i++) {
    even.push_back(start + slope * beats[i]);
    if (std::abs(even.back() - stamps[i]) > kJitter * step) return stamps;
  }
  return even;
}

}  // namespace

std::vector<LightPath> link_light_paths(const LightDetections::Camera& camera) {
  std::vector<LightPath> paths;
  std::vector<OpenPath> open;
  const double gap = (kMaxMissedFrames + 1.5) * frame_time_of(camera);
  struct Link {
    double cost;
    size_t path, sight;
  };
  const std::vector<double> stamps = regularised_stamps(camera);
  for (size_t n = 0; n < camera.frames.size(); n++) {
    const LightDetections::Frame frame{stamps[n], camera.frames[n].sights};
    std::erase_if(open, [&](OpenPath& o) {
      if (frame.time - o.path.points.back().time <= gap) return false;
      close(o, paths);
      return true;
    });
    std::vector<Link> links;
    for (size_t i = 0; i < open.size(); i++)
      for (size_t k = 0; k < frame.sights.size(); k++) {
        const double distance = glm::length(frame.sights[k].pixel - open[i].expected(frame.time));
        const double ratio = std::log(frame.sights[k].brightness / open[i].path.points.back().sight.brightness);
        if (distance < open[i].reach(camera.width)) links.push_back({distance + kBrightness * std::abs(ratio), i, k});
      }
    std::sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.cost < b.cost; });
    std::vector<char> continued(open.size()), taken(frame.sights.size());
    for (const Link& link : links) {
      if (continued[link.path] || taken[link.sight]) continue;
      continued[link.path] = taken[link.sight] = true;
      open[link.path].path.points.push_back({frame.time, frame.sights[link.sight]});
    }
    for (size_t k = 0; k < frame.sights.size(); k++)
      if (!taken[k]) open.push_back({{{{frame.time, frame.sights[k]}}, 0, false}});
  }
  for (OpenPath& o : open) close(o, paths);
  return paths;
}

std::optional<PathSample> interpolate_path(const LightPath& path, double time, double frame_time) {
  const auto& p = path.points;
  const auto after =
      std::upper_bound(p.begin(), p.end(), time, [](double t, const LightPath::Point& q) { return t < q.time; });
  if (after == p.begin() || (after == p.end() && time > p.back().time)) return std::nullopt;
  const auto last = static_cast<ptrdiff_t>(p.size()) - 1;
  const ptrdiff_t k = std::clamp<ptrdiff_t>(after - p.begin() - 1, 0, last - 1);
  const double gap = (kMaxMissedFrames + 0.5) * frame_time;
  if (p[k + 1].time - p[k].time > gap) return std::nullopt;
  ptrdiff_t from = k, to = k + 1;
  if (from > 0 && p[from].time - p[from - 1].time <= gap) from--;
  if (to < last && p[to + 1].time - p[to].time <= gap) to++;
  PathSample place;
  double variance = 0;
  for (ptrdiff_t i = from; i <= to; i++) {
    double value = 1, slope = 0;
    for (ptrdiff_t j = from; j <= to; j++) {
      if (j == i) continue;
      const double span = p[i].time - p[j].time;
      slope = slope * (time - p[j].time) / span + value / span;
      value *= (time - p[j].time) / span;
    }
    place.pixel += value * p[i].sight.pixel;
    place.velocity += slope * p[i].sight.pixel;
    variance += value * value * p[i].sight.sigma * p[i].sight.sigma;
  }
  place.sigma = std::sqrt(variance);
  const bool later = time - p[k].time > p[k + 1].time - time;
  place.brightness = p[later ? k + 1 : k].sight.brightness;
  return place;
}

void CoverageGrid::come(const Vec2& pixel) {
  const int column = static_cast<int>((pixel.x + 0.5) * kColumns / width_);
  const int row = static_cast<int>((pixel.y + 0.5) * kRows / height_);
  covered_[static_cast<size_t>(std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1))] = true;
}

double CoverageGrid::share() const {
  return static_cast<double>(std::ranges::count(covered_, true)) / static_cast<double>(covered_.size());
}

std::vector<CoverageGrid::Gap> CoverageGrid::gaps() const {
  static constexpr const char* kAcross[] = {"left", "right"};
  static constexpr const char* kDown[] = {"upper", "middle", "lower"};
  std::vector<Gap> gaps;
  for (int row = 0; row < kRows; row++)
    for (int half = 0; half < 2; half++) {
      const int places = !has(2 * half, row) + !has(2 * half + 1, row);
      if (places > 0) gaps.push_back({std::string(kDown[row]) + " " + kAcross[half], places});
    }
  return gaps;
}

std::string gap_names(const std::vector<CoverageGrid::Gap>& gaps) {
  std::string all;
  for (const CoverageGrid::Gap& gap : gaps) all += (all.empty() ? "" : ", ") + gap.name;
  return all;
}

namespace {

constexpr double kLongest = 1;      // seconds between two looks for interpolation
constexpr double kMinAngle = 0.02;  // radians between rays; smaller angles give no depth
constexpr double kMeet = 0.1;       // maximum distance between rays, relative to the depth
constexpr size_t kMinDepths = 8;
constexpr double kTail = 0.05;    // ignored share of the depths at either end
constexpr double kThrough = 1.6;  // minimum ratio of far to near depth
constexpr double kNear = 1.5;     // near distance, in array sizes
constexpr size_t kNamed = 2;

// Returns the depth from camera `a` of the point on its ray that is nearest to the ray of `b`. Rays are (u, v, 1).
std::optional<double> depth_before(const Pose& a, const Vec2& of_a, const Pose& b, const Vec2& of_b) {
  const Vec3 p = a.rotation() * Vec3(of_a, 1), q = b.rotation() * Vec3(of_b, 1), way = b.position - a.position;
  const Vec3 across = glm::cross(p, q);
  const double square = glm::dot(across, across);
  if (std::sqrt(square) < kMinAngle * glm::length(p) * glm::length(q)) return std::nullopt;
  const double depth = glm::dot(glm::cross(way, q), across) / square;
  const double other = glm::dot(glm::cross(way, p), across) / square;
  if (!(depth > 0) || !(other > 0)) return std::nullopt;
  if (glm::length(p * depth - (way + q * other)) > kMeet * depth) return std::nullopt;
  return depth;
}

}  // namespace

LightCoverage::LightCoverage(const Rig& rig, int lights) : rig_(rig), lights_(static_cast<size_t>(lights)) {
  if (lights < 1) throw Error("lights: must be at least 1");
  for (const lf::Camera& camera : rig.cameras) {
    cameras_.emplace_back(camera);
    for (const lf::Camera& other : rig.cameras)
      size_ = std::max(size_, glm::length(camera.pose.position - other.pose.position));
  }
}

void LightCoverage::add_frame(CameraIndex index, double time, const std::vector<LightDetection>& sights) {
  Camera& camera = cameras_[index];
  camera.num_frames++;
  camera.lit |= !sights.empty();
  Vec2 sum(0);
  const size_t seen = std::min(sights.size(), lights_);
  for (size_t i = 0; i < seen; i++) {
    camera.places.come(sights[i].pixel);
    sum += sights[i].pixel;
  }
  const std::optional<TimedPosition> before = camera.last;
  camera.last.reset();
  if (seen < lights_) return;
  camera.last = TimedPosition{time, sum / static_cast<double>(seen)};
  if (before && time > before->time && time - before->time < kLongest) measure_depth(index, *before, *camera.last);
}

void LightCoverage::measure_depth(CameraIndex index, const TimedPosition& before, const TimedPosition& now) {
  const lf::Camera& planned = rig_.cameras[index];
  std::optional<CameraIndex> farthest;
  double distance = 0;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    const std::optional<TimedPosition>& look = cameras_[i].last;
    if (i == index || !look || look->time < before.time || look->time > now.time) continue;
    const double d = glm::length(rig_.cameras[i].pose.position - planned.pose.position);
    if (d > distance) farthest = i, distance = d;
  }
  if (!farthest) return;
  const TimedPosition& other = *cameras_[*farthest].last;
  const double t = (other.time - before.time) / (now.time - before.time);
  const auto of_this = planned.lens.unproject(before.pixel + t * (now.pixel - before.pixel));
  const auto of_other = rig_.cameras[*farthest].lens.unproject(other.pixel);
  if (!of_this || !of_other) return;
  if (const auto depth = depth_before(planned.pose, *of_this, rig_.cameras[*farthest].pose, *of_other))
    cameras_[index].depths.push_back(*depth);
}

std::string LightCoverage::depth_wanted(CameraIndex index) const {
  std::vector<double> depths = cameras_[index].depths;
  if (depths.size() < kMinDepths) return "";
  std::ranges::sort(depths);
  const auto tail = static_cast<size_t>(kTail * static_cast<double>(depths.size()));
  const double near = depths[tail], far = depths[depths.size() - 1 - tail];
  if (far >= kThrough * near) return "";
  return near < kNear * size_ ? "farther" : "nearer";
}

std::string LightCoverage::wanted(CameraIndex index) const {
  const std::string places = gap_names(cameras_[index].places.gaps()), depth = depth_wanted(index);
  return places + (places.empty() || depth.empty() ? "" : ", ") + depth;
}

std::string LightCoverage::most_wanted(CameraIndex index) const {
  std::vector<CoverageGrid::Gap> gaps = cameras_[index].places.gaps();
  std::ranges::stable_sort(gaps, std::greater(), &CoverageGrid::Gap::places);
  if (gaps.size() > kNamed) gaps.resize(kNamed);
  const std::string places = gap_names(gaps), depth = depth_wanted(index);
  return places + (places.empty() || depth.empty() ? "" : ", ") + depth;
}

std::string LightCoverage::summary() const {
  struct GapCount {
    int places = 0, cameras = 0;
  };
  std::map<std::string, GapCount> places, depths;
  const auto most = [](const std::map<std::string, GapCount>& lacks) {
    const auto& [name, lack] =
        *std::ranges::max_element(lacks, {}, [](const auto& entry) { return entry.second.places; });
    return name + " (" + std::to_string(lack.cameras) + (lack.cameras == 1 ? " camera)" : " cameras)");
  };
  std::vector<CameraIndex> dark, lacking;
  size_t looked = 0;
  double share = 0;
  for (CameraIndex i = 0; i < cameras_.size(); i++) {
    const Camera& camera = cameras_[i];
    if (camera.num_frames == 0) continue;
    looked++;
    share += camera.places.share();
    if (!camera.lit) {
      dark.push_back(i);
      continue;
    }
    for (const CoverageGrid::Gap& gap : camera.places.gaps())
      places[gap.name].places += gap.places, places[gap.name].cameras++;
    if (const std::string depth = depth_wanted(i); !depth.empty()) depths[depth].places++, depths[depth].cameras++;
    if (!wanted(i).empty()) lacking.push_back(i);
  }
  if (looked == 0) return "No frames from any camera yet.";
  if (dark.size() == looked) return "No camera has seen a moving light yet: is it on, and in view?";
  std::string text = format_text("The light has covered %.0f %% of the images.",
                                 std::floor(100 * share / static_cast<double>(looked)));
  if (lacking.empty() && dark.empty()) return text + " Nothing is missing, neither near nor far.";
  std::string next = places.empty() ? "" : most(places);
  if (!depths.empty()) next += (next.empty() ? "" : ", ") + most(depths);
  if (!next.empty()) text += " Next: " + next + ".";
  const auto name = [&](CameraIndex i) {
    const lf::Camera& camera = rig_.cameras[i];
    return " Camera " + std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
  };
  for (size_t i = 0; i < std::min(kNamed, dark.size()); i++) text += name(dark[i]) + " has seen no light.";
  std::ranges::stable_sort(lacking, {}, [&](CameraIndex i) { return cameras_[i].places.share(); });
  for (size_t i = 0; i < std::min(kNamed, lacking.size()); i++)
    text += name(lacking[i]) + format_text(" %.0f %%: ", std::floor(100 * cameras_[lacking[i]].places.share())) +
            most_wanted(lacking[i]) + ".";
  return text;
}

}  // namespace lf
