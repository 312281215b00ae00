// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/epipolar_check.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "base/text.h"
#include "rig/mesh.h"

namespace lf {
namespace {

constexpr double kLongestSide = 400;  // pixels; larger images are reduced
constexpr int kCorners = 300;
constexpr double kQuality = 0.01;  // minimum corner quality, relative to the best corner
constexpr double kSpacing = 5;     // pixels between corners
constexpr int kRadius = 6;         // pixels, of the patch around a corner
constexpr int kPatch = (2 * kRadius + 1) * (2 * kRadius + 1);
constexpr double kMinContrast = 4;  // standard deviation of a patch, grey levels
constexpr float kMinCorrelation = 0.8f;
constexpr float kMaxRatio = 0.8f;  // distance to the best match over the distance to the second-best match

constexpr double kMaxGradient = 1;  // of the disparity
constexpr size_t kNeighbours = 6, kMinSupport = 4;

// Displacements and residuals are fractions of the width of the image. Poses and lenses of nominal rigs are inexact,
// and corners are located to about a pixel.
constexpr double kTolerance = 0.006;   // smaller displacements and residuals prove nothing
constexpr double kMaxResidual = 0.03;  // larger residuals contradict the geometry
constexpr double kMaxSine = 0.4;       // residual over displacement, about 25 degrees from the epipolar line

// Correct rigs of the test data have at most 20 % of contradicting matches in a pair, and 3 % on average.
constexpr size_t kMinMatches = 16;
constexpr double kMinMatched = 0.1;  // share of the corners; a chance agreement of repeated textures is smaller
constexpr double kMaxFitting = 0.35, kMinContradicting = 0.5;  // shares of contradicting matches

constexpr double kMaxUnexplained = 0.05;  // share of contradicting pairs between cameras that are not misplaced
// If at most this number of cameras are in contradicting pairs, all pairs of these cameras are compared.
constexpr size_t kMaxSuspects = 16;
constexpr size_t kMinCameras = 4;  // needed to name cameras: fewer cameras have no majority

using Match = std::pair<size_t, size_t>;  // corners of two images

struct Corners {
  std::vector<Vec2> at;    // pixels of the reduced image
  std::vector<Vec3> rays;  // unit vectors in camera coordinates
  cv::Mat patches;         // one row of kPatch values per corner, with zero mean and unit length
};

Corners find_corners(const Camera& camera, const Image& image) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  cv::Mat grey, smooth;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  const double scale = std::min(1.0, kLongestSide / std::max(image.width(), image.height()));
  if (scale < 1) {
    cv::Mat reduced;
    cv::resize(grey, reduced, {}, scale, scale, cv::INTER_AREA);
    grey = reduced;
  }
  Corners corners;
  if (grey.cols <= 2 * kRadius || grey.rows <= 2 * kRadius) return corners;
  cv::GaussianBlur(grey, smooth, {}, 1);
  std::vector<cv::Point2f> found;
  cv::goodFeaturesToTrack(smooth, found, kCorners, kQuality, kSpacing);
  for (const cv::Point2f& corner : found) {
    const int x = cvRound(corner.x), y = cvRound(corner.y);
    if (x < kRadius || y < kRadius || x >= smooth.cols - kRadius || y >= smooth.rows - kRadius) continue;
    const std::optional<Vec2> at = camera.lens.unproject(
        {(x + 0.5) * image.width() / grey.cols - 0.5, (y + 0.5) * image.height() / grey.rows - 0.5});
    if (!at) continue;
    cv::Mat patch;
    smooth(cv::Rect(x - kRadius, y - kRadius, 2 * kRadius + 1, 2 * kRadius + 1)).convertTo(patch, CV_32F);
    patch = patch.reshape(1, 1);
    patch -= cv::mean(patch);
    const double length = cv::norm(patch);
    if (!(length > kMinContrast * std::sqrt(kPatch))) continue;
    corners.patches.push_back(cv::Mat(patch / length));
    corners.at.emplace_back(x, y);
    corners.rays.push_back(glm::normalize(Vec3(*at, 1)));
  }
  return corners;
}

// Returns the column of the largest correlation in each row, or -1 if that column is not clearly the best.
std::vector<int> clear_maxima(const cv::Mat& correlations) {
  std::vector<int> columns;
  for (int i = 0; i < correlations.rows; i++) {
    const float* const row = correlations.ptr<float>(i);
    int column = -1;
    float best = -1, second = -1;
    for (int j = 0; j < correlations.cols; j++) {
      if (row[j] > best) {
        second = best;
        best = row[j];
        column = j;
      } else {
        second = std::max(second, row[j]);
      }
    }
    // The squared distance between two unit vectors is 2 - 2 correlation.
    const bool clear = best > kMinCorrelation && 1 - best < kMaxRatio * kMaxRatio * (1 - second);
    columns.push_back(clear ? column : -1);
  }
  return columns;
}

// Removes matches that move otherwise than the matches around them: the disparity gradient, which is the difference of
// two displacements over the distance, is at most 1 on smooth surfaces (Pollard, Mayhew and Frisby 1985).
std::vector<Match> coherent(const std::vector<Match>& matches, const Corners& a, const Corners& b) {
  std::vector<Match> kept;
  for (const Match& match : matches) {
    const Vec2 at = a.at[match.first], displacement = b.at[match.second] - at;
    std::vector<std::pair<double, bool>> others;  // distance, supports the match
    for (const Match& other : matches) {
      if (other == match) continue;
      const Vec2 other_at = a.at[other.first];
      const double distance = glm::distance(at, other_at);
      others.emplace_back(distance,
                          glm::distance(displacement, b.at[other.second] - other_at) < kMaxGradient * distance);
    }
    const size_t nearest = std::min(others.size(), kNeighbours);
    std::partial_sort(others.begin(), others.begin() + static_cast<ptrdiff_t>(nearest), others.end());
    size_t support = 0;
    for (size_t i = 0; i < nearest; i++) support += others[i].second;
    if (support >= kMinSupport) kept.push_back(match);
  }
  return kept;
}

std::vector<Match> match(const Corners& a, const Corners& b) {
  std::vector<Match> matches;
  if (a.rays.empty() || b.rays.empty()) return matches;
  const cv::Mat correlations = a.patches * b.patches.t();
  const std::vector<int> forth = clear_maxima(correlations), back = clear_maxima(correlations.t());
  for (size_t i = 0; i < forth.size(); i++)
    if (forth[i] >= 0 && back[static_cast<size_t>(forth[i])] == static_cast<int>(i))
      matches.emplace_back(i, static_cast<size_t>(forth[i]));
  return coherent(matches, a, b);
}

double angle_between(const Vec3& a, const Vec3& b) { return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)); }

// Returns the angle from a line of sight to the arc of a great circle between two directions. The arc is shorter than
// half a circle. All are unit vectors.
double angle_to_arc(const Vec3& ray, const Vec3& from, const Vec3& to) {
  const Vec3 normal = glm::cross(from, to);
  const double length = glm::length(normal);
  if (length > 0 && glm::dot(glm::cross(normal, from), ray) > 0 && glm::dot(glm::cross(to, normal), ray) > 0)
    return std::abs(std::asin(std::clamp(glm::dot(normal, ray) / length, -1.0, 1.0)));
  return std::min(angle_between(ray, from), angle_between(ray, to));
}

// Counts the matches of a pair. The points on a line of sight of camera a are seen by camera b on an arc, from the
// direction of infinity to the direction of camera a.
void count_matches(const Rig& rig, const Corners& a, const Corners& b, EpipolarPair& pair) {
  const Pose& pose_a = rig.cameras[pair.a].pose;
  const Camera& camera = rig.cameras[pair.b];
  const Vec3 baseline = camera.pose.camera_from_world(pose_a.position);
  if (!(glm::length(baseline) > 0)) return;
  const Vec3 epipole = glm::normalize(baseline);
  const Mat3 turn = glm::transpose(camera.pose.rotation()) * pose_a.rotation();
  const double width = camera.width / camera.lens.fx();
  pair.corners = std::min(a.rays.size(), b.rays.size());
  for (const auto& [i, j] : match(a, b)) {
    const Vec3 infinity = turn * a.rays[i];
    const Vec3& ray = b.rays[j];
    const double displacement = angle_between(ray, infinity) / width;
    if (displacement < kTolerance) continue;
    const double residual = angle_to_arc(ray, infinity, epipole) / width;
    const bool fits = residual < std::clamp(kMaxSine * displacement, kTolerance, kMaxResidual);
    (fits ? pair.fitting : pair.contradicting)++;
  }
}

using Edge = std::pair<CameraIndex, CameraIndex>;

std::vector<Edge> mesh_edges(const Rig& rig) {
  std::set<Edge> edges;
  for (const MeshFace& face : build_mesh(rig).faces)
    for (int k = 0, n = face.corners(); n > 1 && k < n; k++)
      edges.insert(std::minmax(face.camera[k], face.camera[(k + 1) % n]));
  return {edges.begin(), edges.end()};
}

// Orders edges so that every beginning of the result touches many cameras in all parts of the array. The shuffle avoids
// a regular choice, such as horizontal pairs only.
std::vector<Edge> in_order_of_choice(std::vector<Edge> edges, size_t num_cameras) {
  std::mt19937 random(1);
  for (size_t i = edges.size(); i > 1; i--) std::swap(edges[i - 1], edges[random() % i]);
  std::vector<bool> touched(num_cameras);
  std::vector<Edge> ordered;
  for (const int new_cameras : {2, 1, 0}) {
    std::vector<Edge> rest;
    for (const auto& [a, b] : edges) {
      const bool chosen = (touched[a] ? 0 : 1) + (touched[b] ? 0 : 1) >= new_cameras;
      if (chosen) touched[a] = touched[b] = true;
      (chosen ? ordered : rest).emplace_back(a, b);
    }
    edges = std::move(rest);
  }
  return ordered;
}

bool has_camera(const EpipolarPair& pair, CameraIndex camera) { return pair.a == camera || pair.b == camera; }

// Finds a few cameras that explain the contradictions, starting with the camera in most contradicting pairs. At least
// half of a misplaced camera's pairs contradict. Some pairs of swapped neighbours fit, because the baseline to other
// neighbours only becomes longer or shorter. If two cameras explain a pair equally well, both are misplaced.
void find_misplaced(size_t num_cameras, EpipolarCheck& check) {
  using Verdict = EpipolarPair::Verdict;
  std::vector<size_t> decided(num_cameras), contradicting(num_cameras);
  std::vector<const EpipolarPair*> left;
  const auto count = [&](const EpipolarPair& pair, size_t sign) {
    for (const CameraIndex i : {pair.a, pair.b}) {
      decided[i] += sign;
      if (pair.verdict() == Verdict::kContradicts) contradicting[i] += sign;
    }
  };
  for (const EpipolarPair& pair : check.pairs)
    if (pair.verdict() != Verdict::kUnknown) {
      count(pair, 1);
      left.push_back(&pair);
    }
  const auto all = static_cast<size_t>(std::ranges::count_if(decided, [](size_t pairs) { return pairs > 0; }));
  std::vector<CameraIndex> misplaced;
  while (misplaced.size() < all) {
    const auto rank = [&](CameraIndex i) { return 2 * contradicting[i] >= decided[i] ? contradicting[i] : 0; };
    CameraIndex worst = 0;
    for (CameraIndex i = 1; i < num_cameras; i++)
      if (rank(i) > rank(worst)) worst = i;
    if (rank(worst) == 0) break;
    std::vector<CameraIndex> found = {worst};
    if (rank(worst) == 1)
      for (const EpipolarPair* pair : left) {
        if (!has_camera(*pair, worst) || pair->verdict() != Verdict::kContradicts) continue;
        if (const CameraIndex other = pair->a == worst ? pair->b : pair->a; rank(other) == 1) found.push_back(other);
      }
    for (const CameraIndex camera : found) {
      misplaced.push_back(camera);
      std::erase_if(left, [&](const EpipolarPair* pair) {
        if (!has_camera(*pair, camera)) return false;
        count(*pair, static_cast<size_t>(-1));
        return true;
      });
    }
  }
  const auto still = static_cast<size_t>(
      std::ranges::count_if(left, [](const EpipolarPair* pair) { return pair->verdict() == Verdict::kContradicts; }));
  const bool explained = static_cast<double>(still) <= kMaxUnexplained * static_cast<double>(left.size());
  const bool is_minority = check.count(Verdict::kContradicts) < check.count(Verdict::kFits);
  if (explained && is_minority && misplaced.size() <= std::max<size_t>(2, all / 8) && all >= kMinCameras) {
    std::ranges::sort(misplaced);
    check.misplaced = misplaced;
  } else {
    check.has_contradiction = !explained || !misplaced.empty();
  }
}

std::string places_of(const std::vector<CameraIndex>& cameras) {
  constexpr size_t kMost = 8;
  std::string text;
  for (size_t i = 0; i < std::min(cameras.size(), kMost); i++)
    text += (i ? ", cameras[" : "cameras[") + std::to_string(cameras[i]) + "]";
  return cameras.size() > kMost ? text + " and " + std::to_string(cameras.size() - kMost) + " more" : text;
}

}  // namespace

EpipolarPair::Verdict EpipolarPair::verdict() const {
  const size_t matches = fitting + contradicting;
  if (matches < kMinMatches || static_cast<double>(matches) < kMinMatched * static_cast<double>(corners))
    return Verdict::kUnknown;
  const double share = static_cast<double>(contradicting) / static_cast<double>(matches);
  return share <= kMaxFitting ? Verdict::kFits : share < kMinContradicting ? Verdict::kUnknown : Verdict::kContradicts;
}

size_t EpipolarCheck::count(EpipolarPair::Verdict verdict) const {
  return static_cast<size_t>(
      std::ranges::count_if(pairs, [verdict](const EpipolarPair& pair) { return pair.verdict() == verdict; }));
}

EpipolarCheck check_epipolar_geometry(const Rig& rig, const CameraImages& images, size_t max_pairs) {
  std::vector<std::optional<Corners>> corners(rig.cameras.size());
  const auto corners_of = [&](CameraIndex i) -> const Corners& {
    if (corners[i]) return *corners[i];
    corners[i].emplace();
    try {
      corners[i] = find_corners(rig.cameras[i], images(i));
    } catch (const Error&) {  // the camera has no corners
    }
    return *corners[i];
  };
  EpipolarCheck check;
  const auto compare = [&](const Edge& edge) {
    EpipolarPair pair{.a = edge.first, .b = edge.second};
    count_matches(rig, corners_of(pair.a), corners_of(pair.b), pair);
    check.pairs.push_back(pair);
  };
  const std::vector<Edge> edges = in_order_of_choice(mesh_edges(rig), rig.cameras.size());
  const size_t chosen = std::min(edges.size(), max_pairs);
  for (size_t i = 0; i < chosen; i++) compare(edges[i]);

  // If there are only a few suspicious cameras, compares all their pairs to find the misplaced camera of a pair.
  std::set<CameraIndex> suspects;
  for (const EpipolarPair& pair : check.pairs)
    if (pair.verdict() == EpipolarPair::Verdict::kContradicts) suspects.insert({pair.a, pair.b});
  if (suspects.size() <= kMaxSuspects)
    for (size_t i = chosen; i < edges.size(); i++)
      if (suspects.contains(edges[i].first) || suspects.contains(edges[i].second)) compare(edges[i]);
  find_misplaced(rig.cameras.size(), check);
  return check;
}

std::vector<RigFinding> describe(const EpipolarCheck& check) {
  using Verdict = EpipolarPair::Verdict;
  const auto share = [&](auto&& counts) {
    size_t decided = 0, contradicting = 0;
    for (const EpipolarPair& pair : check.pairs) {
      if (!counts(pair) || pair.verdict() == Verdict::kUnknown) continue;
      decided++;
      contradicting += pair.verdict() == Verdict::kContradicts;
    }
    return std::to_string(contradicting) + " of " + std::to_string(decided);
  };
  std::vector<RigFinding> findings;
  if (check.has_contradiction)
    findings.push_back(
        {RigFinding::Severity::kWarning,
         "cameras: the positions, orientations or lenses do not fit the images: " +
             share([](const EpipolarPair&) { return true; }) +
             " pairs of neighbouring cameras contradict the rig, so views show objects more than once. Check the order "
             "of the image files. In an imported rig, check the axes convention and whether the extrinsics are "
             "inverted. If the layout is right but was never calibrated, lf-calibrate features and lf-calibrate solve "
             "compute the poses from the images"});
  if (!check.misplaced.empty()) {
    const auto is_misplaced = [&](CameraIndex i) { return std::ranges::binary_search(check.misplaced, i); };
    findings.push_back(
        {RigFinding::Severity::kWarning,
         places_of(check.misplaced) + ": position, orientation or lens does not fit the images: " +
             share([&](const EpipolarPair& pair) { return is_misplaced(pair.a) || is_misplaced(pair.b); }) +
             " pairs with neighbouring cameras contradict the rig. The rest of the array fits. Check whether images "
             "are swapped or a camera was moved. lf-calibrate features and lf-calibrate solve compute the poses from "
             "the images"});
  }
  return findings;
}

}  // namespace lf
