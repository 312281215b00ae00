// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/feature_tracks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "base/text.h"

namespace lf {
namespace {

constexpr double kSoftEdge = 6;    // pixels: sigma of the weights
constexpr float kMinContrast = 2;  // grey levels, above noise
constexpr int kMaxSteps = 12;
constexpr float kSmallStep = 2e-3;  // pixels
constexpr double kFarthest = 2;
constexpr double kMaxWarp = 0.6;   // difference from the identity
constexpr double kMinScale = 0.2;  // minimum scale of the area per step, so that the patch does not collapse
// Minimum condition of the information matrix. It rejects edges, because a position along an edge is ambiguous.
constexpr float kMinCondition = 1e-4;

cv::Mat grey_of(const Image& image) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

}  // namespace

const Patch::Values& Patch::weights() {
  static const Values values = [] {
    Values w;
    int k = 0;
    for (int y = -kRadius; y <= kRadius; y++)
      for (int x = -kRadius; x <= kRadius; x++, k++)
        w[k] = static_cast<float>(std::exp(-(x * x + y * y) / (2 * kSoftEdge * kSoftEdge)));
    return Values(w / w.sum());
  }();
  return values;
}

bool Patch::normalise(Values& values) {
  values.array() -= weights().dot(values);
  const float contrast = std::sqrt(weights().dot(values.cwiseAbs2()));
  if (!(contrast > kMinContrast)) return false;
  values /= contrast;
  return true;
}

std::optional<Patch> Patch::cut(const SplineImage& image, const Vec2& point) {
  if (!image.has(point.x - kRadius, point.y - kRadius) || !image.has(point.x + kRadius, point.y + kRadius))
    return std::nullopt;
  Patch patch;
  Eigen::Matrix<float, kSize, kTerms> slopes;  // derivatives by the terms
  int k = 0;
  for (int y = -kRadius; y <= kRadius; y++)
    for (int x = -kRadius; x <= kRadius; x++, k++) {
      const SplineImage::Sample s = image.sample(point.x + x, point.y + y);
      const auto u = static_cast<float>(x) / kRadius, v = static_cast<float>(y) / kRadius;
      patch.values_[k] = s.value;
      slopes.row(k) << s.dx, s.dy, s.dx * u, s.dx * v, s.dy * u, s.dy * v;
    }
  const Values original = patch.values_;
  if (!normalise(patch.values_)) return std::nullopt;
  // Removes the components that only change brightness or contrast.
  const float contrast = weights().cwiseProduct(original).dot(patch.values_);
  slopes /= contrast;
  const Eigen::Matrix<float, 1, kTerms> brightness = weights().transpose() * slopes;
  slopes.rowwise() -= brightness;
  const Eigen::Matrix<float, 1, kTerms> same = weights().cwiseProduct(patch.values_).transpose() * slopes;
  slopes -= patch.values_ * same;
  const Eigen::Matrix<float, kTerms, kTerms> information = slopes.transpose() * weights().asDiagonal() * slopes;
  const Eigen::LDLT<Eigen::Matrix<float, kTerms, kTerms>> ldlt(information);
  if (!(ldlt.vectorD().minCoeff() > kMinCondition * ldlt.vectorD().maxCoeff())) return std::nullopt;
  patch.step_ = ldlt.solve(slopes.transpose() * weights().asDiagonal());
  return patch;
}

std::optional<Patch::Match> Patch::find(const SplineImage& image, const Vec2& guess) const {
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  Match match{guess};
  Values seen;
  for (int step = 0; step < kMaxSteps; step++) {
    int k = 0;
    for (int y = -kRadius; y <= kRadius; y++)
      for (int x = -kRadius; x <= kRadius; x++, k++) {
        const double at_x = match.point.x + warp(0, 0) * x + warp(0, 1) * y;
        const double at_y = match.point.y + warp(1, 0) * x + warp(1, 1) * y;
        if (!image.has(at_x, at_y)) return std::nullopt;
        seen[k] = image.value(at_x, at_y);
      }
    if (!normalise(seen)) return std::nullopt;
    match.correlation = weights().cwiseProduct(seen).dot(values_);
    const Eigen::Matrix<float, kTerms, 1> change = step_ * (seen - values_);
    Eigen::Matrix2d back;
    back << 1 + change[2] / kRadius, change[3] / kRadius, change[4] / kRadius, 1 + change[5] / kRadius;
    if (!(back.determinant() > kMinScale)) return std::nullopt;
    warp = warp * back.inverse();
    const Eigen::Vector2d shift = warp * change.head<2>().cast<double>();
    match.point -= Vec2(shift.x(), shift.y());
    if (!(glm::length(match.point - guess) < kFarthest) || !((warp - Eigen::Matrix2d::Identity()).norm() < kMaxWarp))
      return std::nullopt;
    if (change.norm() < kSmallStep) break;
  }
  return match;
}

namespace {

// Recursive prefilter of spline interpolation, forward and backward over one row or column.
void prefilter(float* p, int count, int stride) {
  const float pole = std::sqrt(3.0f) - 2;
  constexpr int kReach = 12;  // pole^12 is 1e-7
  float sum = 0, weight = 1;
  for (int k = 0; k < std::min(count, kReach); k++, weight *= pole) sum += weight * p[k * stride];
  p[0] = 6 * sum;
  for (int k = 1; k < count; k++) p[k * stride] = 6 * p[k * stride] + pole * p[(k - 1) * stride];
  float& last = p[(count - 1) * stride];
  last = pole / (pole * pole - 1) * (last + pole * p[std::max(count - 2, 0) * stride]);
  for (int k = count - 2; k >= 0; k--) p[k * stride] = pole * (p[(k + 1) * stride] - p[k * stride]);
}

struct Weights {
  float w[4];
};

Weights weights(float t) {
  const float u = 1 - t;
  return {{u * u * u / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * u * u * u - 6 * u * u + 4) / 6, t * t * t / 6}};
}

Weights slopes(float t) {
  const float u = 1 - t;
  return {{-u * u / 2, (3 * t * t - 4 * t) / 2, -(3 * u * u - 4 * u) / 2, t * t / 2}};
}

float dot(const Weights& a, const float* p) { return a.w[0] * p[0] + a.w[1] * p[1] + a.w[2] * p[2] + a.w[3] * p[3]; }

}  // namespace

SplineImage::SplineImage(const Image& rgb)
    : width_(rgb.width()), height_(rgb.height()), coefficients_(static_cast<size_t>(width_) * height_) {
  cv::Mat smooth(height_, width_, CV_32F, coefficients_.data());
  grey_of(rgb).convertTo(smooth, CV_32F);
  for (int y = 0; y < height_; y++) prefilter(coefficients_.data() + static_cast<size_t>(y) * width_, width_, 1);
  for (int x = 0; x < width_; x++) prefilter(coefficients_.data() + x, height_, width_);
}

float SplineImage::value(double x, double y) const {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const Weights across = weights(static_cast<float>(x - left)), down = weights(static_cast<float>(y - top));
  float sum = 0;
  for (int j = 0; j < 4; j++)
    sum += down.w[j] * dot(across, &coefficients_[static_cast<size_t>(top - 1 + j) * width_ + left - 1]);
  return sum;
}

SplineImage::Sample SplineImage::sample(double x, double y) const {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const auto fx = static_cast<float>(x - left), fy = static_cast<float>(y - top);
  const Weights across = weights(fx), down = weights(fy), slope_across = slopes(fx), slope_down = slopes(fy);
  Sample s{0, 0, 0};
  for (int j = 0; j < 4; j++) {
    const float* row = &coefficients_[static_cast<size_t>(top - 1 + j) * width_ + left - 1];
    const float value = dot(across, row);
    s.value += down.w[j] * value;
    s.dx += down.w[j] * dot(slope_across, row);
    s.dy += slope_down.w[j] * value;
  }
  return s;
}

namespace {

constexpr int kFlowWindow = 15;        // pixels; larger windows span several depths, smaller ones are noisier
constexpr int kLevels = 3;             // pyramid levels below full resolution
constexpr double kQuality = 0.01;      // minimum corner quality, relative to the best corner
constexpr double kSpacing = 6;         // pixels between corners
constexpr double kRoundTrip = 0.3;     // maximum error after tracking forward and backward, pixels
constexpr double kEpipolar = 1;        // maximum distance from the epipolar line, pixels
constexpr double kMaxDifference = 12;  // mean difference over a window, grey levels; larger: a different point
// Minimum correlation of a track's patches. A lower value means that the patch contains the edge of an object in front
// of another.
constexpr double kCorrelation = 0.95;
constexpr size_t kMinForEpipolar = 20;
constexpr size_t kMinTracks = 20;

using Pyramid = std::vector<cv::Mat>;

std::vector<size_t> cameras_far_apart(const Rig& rig, size_t count) {
  Vec3 middle(0, 0, 0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / static_cast<double>(rig.cameras.size());
  std::vector<size_t> chosen;
  std::vector<double> distance(rig.cameras.size());
  for (size_t i = 0; i < distance.size(); i++) distance[i] = glm::length(rig.cameras[i].pose.position - middle);
  size_t next = std::min_element(distance.begin(), distance.end()) - distance.begin();
  std::fill(distance.begin(), distance.end(), INFINITY);
  while (chosen.size() < std::min(count, rig.cameras.size())) {
    chosen.push_back(next);
    for (size_t i = 0; i < distance.size(); i++)
      distance[i] = std::min(distance[i], glm::length(rig.cameras[i].pose.position - rig.cameras[next].pose.position));
    next = std::max_element(distance.begin(), distance.end()) - distance.begin();
  }
  return chosen;
}

struct FeatureTrack {
  cv::Point2f start;
  std::vector<std::pair<size_t, cv::Point2f>> seen;  // camera and position; the reference first

  // Predicts the position in a camera, from the observation that displacements are proportional to the distance between
  // cameras.
  cv::Point2f foretell(const Rig& rig, size_t camera) const {
    const Camera& reference = rig.cameras[seen[0].first];
    const Mat3 axes = glm::transpose(reference.pose.rotation());
    const auto offset = [&](size_t i) { return Vec2(axes * (rig.cameras[i].pose.position - reference.pose.position)); };
    double along = 0, square = 0, nearest_distance = INFINITY;
    const std::pair<size_t, cv::Point2f>* nearest = nullptr;
    for (const auto& other : seen) {
      const Vec2 o = offset(other.first);
      along += o.x * (other.second.x - start.x) + o.y * (other.second.y - start.y);
      square += glm::dot(o, o);
      const double distance = glm::length(o - offset(camera));
      if (distance >= nearest_distance) continue;
      nearest_distance = distance;
      nearest = &other;
    }
    const double disparity = square > 0 ? along / square : 0;
    const Vec2 step = (offset(camera) - offset(nearest->first)) * disparity;
    return nearest->second + cv::Point2f(static_cast<float>(step.x), static_cast<float>(step.y));
  }
};

class Tracker {
 public:
  Tracker(const Rig& rig, const std::vector<Image>& images, const FeatureOptions& options)
      : rig_(rig), options_(options) {
    for (const Image& image : images) {
      Pyramid pyramid;
      cv::buildOpticalFlowPyramid(grey_of(image), pyramid, {kFlowWindow, kFlowWindow}, kLevels, false);
      pyramids_.push_back(std::move(pyramid));
      smooth_.emplace_back(image);
    }
  }

  std::vector<FeatureTrack> follow(size_t reference, const std::vector<cv::Point2f>& taken) const {
    const cv::Mat grey = pyramids_[reference][0];
    cv::Mat mask(grey.size(), CV_8U, cv::Scalar(255));
    for (const cv::Point2f& point : taken) cv::circle(mask, point, static_cast<int>(kSpacing), 0, cv::FILLED);
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(grey, corners, options_.features, kQuality, kSpacing, mask);
    std::vector<FeatureTrack> tracks;
    if (corners.empty()) return tracks;
    cv::cornerSubPix(grey, corners, {3, 3}, {-1, -1}, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 1e-2});
    for (const cv::Point2f& corner : corners) tracks.push_back({corner, {{reference, corner}}});

    std::vector<size_t> order(rig_.cameras.size());
    std::iota(order.begin(), order.end(), size_t{0});
    const auto distance = [&](size_t i) {
      return glm::length(rig_.cameras[i].pose.position - rig_.cameras[reference].pose.position);
    };
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return distance(a) < distance(b); });
    for (const size_t camera : order)
      if (camera != reference) follow_into(camera, tracks);
    for (FeatureTrack& track : tracks) refine(track);
    std::erase_if(tracks, [&](const FeatureTrack& track) {
      return track.seen.size() < static_cast<size_t>(std::max(options_.least_cameras, 2));
    });
    return tracks;
  }

 private:
  void follow_into(size_t camera, std::vector<FeatureTrack>& tracks) const {
    const size_t reference = tracks[0].seen[0].first;
    std::vector<cv::Point2f> start, there, back;
    for (const FeatureTrack& track : tracks) {
      start.push_back(track.start);
      there.push_back(track.foretell(rig_, camera));
    }
    std::vector<uint8_t> found, came_back;
    std::vector<float> difference;
    match(reference, camera, start, there, found, difference);
    back = start;
    std::vector<float> ignored;
    match(camera, reference, there, back, came_back, ignored);
    const cv::Mat& image = pyramids_[camera][0];
    const cv::Rect inside(kFlowWindow / 2, kFlowWindow / 2, image.cols - kFlowWindow + 1, image.rows - kFlowWindow + 1);
    std::vector<size_t> kept;
    std::vector<cv::Point2f> from, to;
    for (size_t i = 0; i < tracks.size(); i++) {
      if (!found[i] || !came_back[i] || !(difference[i] < kMaxDifference) || !inside.contains(there[i]) ||
          !(cv::norm(back[i] - start[i]) < kRoundTrip))
        continue;
      kept.push_back(i);
      from.push_back(start[i]);
      to.push_back(there[i]);
    }
    std::vector<uint8_t> agrees(kept.size(), 1);
    if (kept.size() >= kMinForEpipolar)
      cv::findFundamentalMat(from, to, cv::USAC_MAGSAC, kEpipolar, 0.999, 1000, agrees);
    for (size_t k = 0; k < kept.size(); k++)
      if (k < agrees.size() && agrees[k]) tracks[kept[k]].seen.emplace_back(camera, to[k]);
  }

  // Optical flow assumes a pure translation of the window. This finds the corner, but is off by a few tenths of a pixel
  // on slanted surfaces and with lens distortion.
  void refine(FeatureTrack& track) const {
    const auto& [reference, start] = track.seen[0];
    const auto patch = Patch::cut(smooth_[reference], Vec2(start.x, start.y));
    std::vector<std::pair<size_t, cv::Point2f>> seen = {track.seen[0]};
    for (size_t i = 1; patch && i < track.seen.size(); i++) {
      const auto& [camera, at] = track.seen[i];
      const auto found = patch->find(smooth_[camera], Vec2(at.x, at.y));
      if (found && found->correlation > kCorrelation)
        seen.emplace_back(camera, cv::Point2f(static_cast<float>(found->point.x), static_cast<float>(found->point.y)));
    }
    track.seen = std::move(seen);
  }

  void match(size_t from, size_t to, const std::vector<cv::Point2f>& start, std::vector<cv::Point2f>& end,
             std::vector<uint8_t>& found, std::vector<float>& difference) const {
    cv::calcOpticalFlowPyrLK(pyramids_[from], pyramids_[to], start, end, found, difference, {kFlowWindow, kFlowWindow},
                             kLevels, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 1e-3},
                             cv::OPTFLOW_USE_INITIAL_FLOW);
  }

  const Rig& rig_;
  const FeatureOptions& options_;
  std::vector<Pyramid> pyramids_;
  std::vector<SplineImage> smooth_;
};

}  // namespace

Tracks track_features(const Rig& rig, const std::vector<Image>& images, const FeatureOptions& options) {
  if (rig.cameras.size() < 2 || images.size() != rig.cameras.size())
    throw Error(
        "features: at least two cameras with images are required, because features are matched between cameras");
  const Tracker tracker(rig, images, options);
  Tracks tracks;
  tracks.ordered = false;
  for (const Camera& camera : rig.cameras) tracks.cameras.push_back({camera.id, camera.width, camera.height});
  std::vector<std::vector<cv::Point2f>> taken(rig.cameras.size());
  for (const size_t reference : cameras_far_apart(rig, static_cast<size_t>(std::max(options.references, 1)))) {
    if (options.progress) options.progress("following corners of camera " + std::to_string(rig.cameras[reference].id));
    for (const FeatureTrack& track : tracker.follow(reference, taken[reference])) {
      for (const auto& [camera, point] : track.seen) {
        tracks.observations.push_back(
            {static_cast<uint32_t>(camera), static_cast<uint32_t>(tracks.num_positions), 0, Vec2(point.x, point.y)});
        taken[camera].push_back(point);
      }
      tracks.num_positions++;
    }
  }
  if (tracks.num_positions < kMinTracks)
    throw Error("features: only " + std::to_string(tracks.num_positions) +
                " corners were found again in other cameras: the scene needs more texture, or the cameras are too far "
                "apart");
  return tracks;
}

}  // namespace lf
