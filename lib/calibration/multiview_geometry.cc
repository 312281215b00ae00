// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/multiview_geometry.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <glm/gtc/type_ptr.hpp>
#include <opencv2/calib3d.hpp>

namespace lf {
namespace {

constexpr int kPointSamples = 30;
constexpr int kPointRounds = 6;

struct Ray {
  const CameraState* camera;
  const Observation* observation;
  Vec3 origin, direction;
  double f;
};

// Returns the midpoint between two rays, or nullopt if they are parallel or meet behind a camera.
std::optional<Vec3> meet(const Ray& a, const Ray& b) {
  const Vec3 w = b.origin - a.origin;
  const double d = glm::dot(a.direction, b.direction), det = 1 - d * d;
  if (!(det > 1e-14)) return std::nullopt;
  const double wa = glm::dot(w, a.direction), wb = glm::dot(w, b.direction);
  const double s = (wa - d * wb) / det, t = (d * wa - wb) / det;
  if (!(s > 0 && t > 0)) return std::nullopt;
  return (a.origin + a.direction * s + b.origin + b.direction * t) / 2.0;
}

double error_of(const Ray& ray, const Vec3& point) {
  const auto e = residual(*ray.camera, TargetState::at(point), *ray.observation);
  return e ? glm::length(*e) : 1e9;
}

double agreement(const std::vector<Ray>& rays, const Vec3& point, double threshold) {
  double sum = 0;
  for (const Ray& ray : rays) {
    const double e = error_of(ray, point) / threshold;
    sum += std::max(0.0, 1 - e * e);
  }
  return sum;
}

Vec3 refine(const std::vector<Ray>& rays, Vec3 point, double threshold) {
  for (int round = 0; round < kPointRounds; round++) {
    Mat3 a(0.0);
    Vec3 b(0.0);
    for (const Ray& ray : rays) {
      const double e = error_of(ray, point) / threshold, depth = glm::dot(point - ray.origin, ray.direction);
      if (!(depth > 0)) continue;
      const double robust = 1 / (1 + e * e), w = robust * robust * ray.f * ray.f / (depth * depth);
      const Mat3 across = Mat3(1.0) - glm::outerProduct(ray.direction, ray.direction);
      a += w * across;
      b += w * (across * (ray.origin - point));
    }
    if (!(std::abs(glm::determinant(a)) > 0)) break;
    const Vec3 step = glm::inverse(a) * b;
    if (!is_finite(step)) break;
    point += step;
  }
  return point;
}

}  // namespace

std::vector<std::vector<uint32_t>> observations_of_positions(const Tracks& tracks) {
  std::vector<std::vector<uint32_t>> lists(tracks.num_positions);
  for (uint32_t i = 0; i < tracks.observations.size(); i++) lists[tracks.observations[i].position].push_back(i);
  return lists;
}

std::vector<std::vector<uint32_t>> observations_of_cameras(const Tracks& tracks) {
  std::vector<std::vector<uint32_t>> lists(tracks.cameras.size());
  for (uint32_t i = 0; i < tracks.observations.size(); i++) lists[tracks.observations[i].camera].push_back(i);
  return lists;
}

std::optional<TriangulatedPoint> triangulate(const std::vector<CameraState>& cameras, const Tracks& tracks,
                                             const std::vector<uint32_t>& observations, double threshold) {
  std::vector<Ray> rays;
  for (const uint32_t index : observations) {
    const Observation& o = tracks.observations[index];
    const CameraState& camera = cameras[o.camera];
    if (!camera.used) continue;
    const auto uv = camera.lens().unproject(o.pixel);
    if (!uv) continue;
    const Pose pose = camera.pose();
    rays.push_back({&camera, &o, pose.position, pose.rotation() * glm::normalize(Vec3(*uv, 1)), camera.v[7]});
  }
  if (rays.size() < 2) return std::nullopt;
  std::mt19937 random(1);
  const size_t pairs = rays.size() * (rays.size() - 1) / 2;
  TriangulatedPoint best;
  const auto attempt = [&](size_t i, size_t j) {
    const auto point = meet(rays[i], rays[j]);
    if (!point) return;
    const double score = agreement(rays, *point, threshold);
    if (score > best.agreement) best = {*point, score};
  };
  if (pairs <= kPointSamples)
    for (size_t i = 0; i < rays.size(); i++)
      for (size_t j = 0; j < i; j++) attempt(i, j);
  else
    for (int sample = 0; sample < kPointSamples; sample++) {
      const size_t i = random() % rays.size(), j = random() % rays.size();
      if (i != j) attempt(i, j);
    }
  if (best.agreement < 1) return std::nullopt;
  const Vec3 refined = refine(rays, best.point, threshold);
  const double score = agreement(rays, refined, threshold);
  if (score > best.agreement) best = {refined, score};
  return best;
}

void triangulate_targets(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto lists = observations_of_positions(tracks);
  for (size_t j = 0; j < lists.size(); j++) {
    std::optional<TriangulatedPoint> found[2];
    double now = 0;
    for (uint32_t light = 0; light < (tracks.bar ? 2u : 1u); light++) {
      std::vector<uint32_t> list;
      for (const uint32_t index : lists[j]) {
        const Observation& o = tracks.observations[index];
        if (o.light != light || !scene.cameras[o.camera].used) continue;
        list.push_back(index);
        if (!scene.targets[j].has(light)) continue;
        const auto e = residual(scene.cameras[o.camera], scene.targets[j], o);
        if (e) now += std::max(0.0, 1 - glm::dot(*e, *e) / (threshold * threshold));
      }
      found[light] = triangulate(scene.cameras, tracks, list, threshold);
    }
    const double then = (found[0] ? found[0]->agreement : 0) + (found[1] ? found[1]->agreement : 0);
    if (then <= now) continue;
    TargetState& target = scene.targets[j];
    const bool bar = found[0] && found[1];
    target.kind = bar ? TargetState::Kind::kBar : TargetState::Kind::kPoint;
    target.light = found[0] ? 0 : 1;
    const Vec3 first = found[target.light]->point, second = bar ? found[1]->point : first;
    const Vec3 middle = (first + second) / 2.0, along = second - first;
    const double length = glm::length(along);
    for (int i = 0; i < 3; i++) {
      target.v[i] = middle[i];
      target.v[3 + i] = length > 0 ? along[i] / length : (i == 0);
    }
  }
}

namespace {

constexpr size_t kMinShared = 12;
constexpr size_t kPartners = 6;
constexpr double kWideEnough = 0.3;  // radians between rays; a larger angle does not improve the score

struct PairMatches {
  size_t a, b;
  std::vector<cv::Point2d> in_a, in_b;
};

std::vector<PairMatches> best_overlap_pairs(const Reconstruction& scene, const Tracks& tracks) {
  const uint32_t lights = tracks.bar ? 2 : 1;
  std::vector<std::vector<std::optional<Vec2>>> uv(tracks.cameras.size(),
                                                   std::vector<std::optional<Vec2>>(tracks.num_positions * lights));
  for (const Observation& o : tracks.observations)
    uv[o.camera][o.position * lights + o.light] = scene.cameras[o.camera].lens().unproject(o.pixel);
  std::vector<PairMatches> pairs;
  for (size_t a = 0; a < uv.size(); a++)
    for (size_t b = 0; b < a; b++) {
      PairMatches pair{a, b, {}, {}};
      for (size_t j = 0; j < uv[a].size(); j++)
        if (uv[a][j] && uv[b][j]) {
          pair.in_a.emplace_back(uv[a][j]->x, uv[a][j]->y);
          pair.in_b.emplace_back(uv[b][j]->x, uv[b][j]->y);
        }
      if (pair.in_a.size() >= kMinShared) pairs.push_back(std::move(pair));
    }
  std::sort(pairs.begin(), pairs.end(), [](const auto& x, const auto& y) { return x.in_a.size() > y.in_a.size(); });
  std::vector<size_t> partners(tracks.cameras.size());
  std::erase_if(pairs, [&](const PairMatches& pair) {
    if (partners[pair.a] >= kPartners && partners[pair.b] >= kPartners) return true;
    partners[pair.a]++, partners[pair.b]++;
    return false;
  });
  return pairs;
}

// Returns the pose of b relative to a with unit distance. `score`: inliers, weighted by the median angle between rays.
std::optional<Pose> pose_of_pair(const PairMatches& pair, double reach, double& score) {
  cv::Mat fit, rotation, shift;
  const cv::Mat k = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat essential = cv::findEssentialMat(pair.in_a, pair.in_b, k, cv::USAC_MAGSAC, 0.999, reach, fit);
  if (essential.rows < 3) return std::nullopt;
  essential = essential.rowRange(0, 3).clone();
  const int inliers = cv::recoverPose(essential, pair.in_a, pair.in_b, k, rotation, shift, fit);
  if (inliers < static_cast<int>(kMinShared) / 2) return std::nullopt;
  const Mat3 world_from_b = glm::make_mat3(rotation.ptr<double>());  // transposed
  const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
  std::vector<double> angles;
  for (size_t j = 0; j < pair.in_a.size(); j++)
    if (fit.at<uchar>(static_cast<int>(j)))
      angles.push_back(
          std::acos(std::clamp(glm::dot(glm::normalize(Vec3(pair.in_a[j].x, pair.in_a[j].y, 1)),
                                        glm::normalize(world_from_b * Vec3(pair.in_b[j].x, pair.in_b[j].y, 1))),
                               -1.0, 1.0)));
  score = inliers * std::min(median(std::move(angles)), kWideEnough);
  return Pose{-(world_from_b * t), glm::quat_cast(world_from_b)};
}

}  // namespace

std::vector<RelativePose> relative_poses(const Reconstruction& scene, const Tracks& tracks, double threshold) {
  cv::setRNGSeed(1);
  std::vector<RelativePose> poses;
  for (const PairMatches& pair : best_overlap_pairs(scene, tracks)) {
    RelativePose relative{pair.a, pair.b};
    const auto found = pose_of_pair(pair, threshold / scene.cameras[pair.a].lens_terms()[kF], relative.score);
    if (!found) continue;
    relative.a_from_b = *found;
    poses.push_back(relative);
  }
  return poses;
}

namespace {

constexpr int kPoseRounds = 30;
constexpr double kClosed = 0.1;        // radians
constexpr double kFirstScale = 0.3;    // radians; initial scale beyond which pairs are down-weighted
constexpr double kScale = 0.03;        // final scale, radians
constexpr double kPoseSettled = 1e-9;  // radians

Vec3 turn_of(Quat q) {
  if (q.w < 0) q = -q;
  const Vec3 axis(q.x, q.y, q.z);
  const double s = glm::length(axis);
  return s > 0 ? axis * (2 * std::atan2(s, q.w) / s) : Vec3(0, 0, 0);
}

// Returns for each pair the number of consistent triplets.
std::vector<int> closed_triangles(size_t num_cameras, const std::vector<RelativeRotation>& pairs) {
  std::vector<std::vector<std::optional<Quat>>> between(num_cameras, std::vector<std::optional<Quat>>(num_cameras));
  for (const RelativeRotation& pair : pairs) {
    between[pair.a][pair.b] = pair.a_from_b;
    between[pair.b][pair.a] = glm::conjugate(pair.a_from_b);
  }
  std::vector<int> count;
  for (const RelativeRotation& pair : pairs) {
    count.push_back(0);
    for (size_t c = 0; c < num_cameras; c++)
      if (between[pair.b][c] && between[c][pair.a])
        count.back() += angle_of(pair.a_from_b * *between[pair.b][c] * *between[c][pair.a]) < kClosed;
  }
  return count;
}

std::vector<std::optional<Quat>> spanning_tree(size_t num_cameras, const std::vector<RelativeRotation>& pairs) {
  std::vector<size_t> group(num_cameras);
  std::iota(group.begin(), group.end(), 0);
  const auto root = [&](size_t i) {
    while (group[i] != i) i = group[i] = group[group[i]];
    return i;
  };
  std::vector<const RelativeRotation*> tree;
  for (const RelativeRotation& pair : pairs)
    if (root(pair.a) != root(pair.b)) group[root(pair.a)] = root(pair.b), tree.push_back(&pair);
  std::map<size_t, size_t> size;
  for (size_t i = 0; i < num_cameras; i++) size[root(i)]++;
  const auto largest =
      std::max_element(size.begin(), size.end(), [](const auto& x, const auto& y) { return x.second < y.second; });
  std::vector<std::optional<Quat>> rotations(num_cameras);
  if (largest == size.end() || largest->second < 2) return rotations;
  rotations[largest->first] = Quat(1, 0, 0, 0);
  for (size_t placed = 1; placed < largest->second;)
    for (const RelativeRotation* pair : tree) {
      auto &a = rotations[pair->a], &b = rotations[pair->b];
      if (a.has_value() == b.has_value()) continue;
      if (a)
        b = *a * pair->a_from_b;
      else
        a = *b * glm::conjugate(pair->a_from_b);
      placed++;
    }
  return rotations;
}

}  // namespace

Quat turned_by(const Vec3& turn) {
  const double angle = glm::length(turn);
  return angle > 0 ? glm::angleAxis(angle, turn / angle) : Quat(1, 0, 0, 0);
}

double angle_of(const Quat& rotation) { return glm::length(turn_of(rotation)); }

std::vector<std::optional<Quat>> average_rotations(size_t num_cameras, std::vector<RelativeRotation> pairs) {
  const std::vector<int> closed = closed_triangles(num_cameras, pairs);
  std::vector<size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](size_t x, size_t y) {
    return closed[x] != closed[y] ? closed[x] > closed[y] : pairs[x].weight > pairs[y].weight;
  });
  std::vector<RelativeRotation> sorted;
  for (const size_t i : order) sorted.push_back(pairs[i]);
  auto rotations = spanning_tree(num_cameras, sorted);
  std::erase_if(pairs, [&](const RelativeRotation& pair) { return !rotations[pair.a] || !rotations[pair.b]; });
  if (pairs.empty()) return rotations;
  // exp(step_a) R_a R_ab (exp(step_b) R_b)' = 1 is, to first order, a Laplacian of the graph. One camera is fixed.
  const auto n = static_cast<Eigen::Index>(num_cameras);
  double scale = kFirstScale;
  for (int round = 0; round < kPoseRounds; round++, scale = std::max(kScale, 0.7 * scale)) {
    Eigen::MatrixXd laplacian = Eigen::MatrixXd::Zero(n, n);
    Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(n, 3);
    for (const RelativeRotation& pair : pairs) {
      const Vec3 off = turn_of(*rotations[pair.a] * pair.a_from_b * glm::conjugate(*rotations[pair.b]));
      const double part = glm::dot(off, off) / (scale * scale), w = pair.weight / ((1 + part) * (1 + part));
      const auto a = static_cast<Eigen::Index>(pair.a), b = static_cast<Eigen::Index>(pair.b);
      laplacian(a, a) += w, laplacian(b, b) += w;
      laplacian(a, b) -= w, laplacian(b, a) -= w;
      const Eigen::RowVector3d pull = w * Eigen::RowVector3d(off.x, off.y, off.z);
      right.row(a) -= pull, right.row(b) += pull;
    }
    const auto held = static_cast<Eigen::Index>(pairs[0].a);
    laplacian(held, held) += laplacian.diagonal().maxCoeff();
    for (Eigen::Index i = 0; i < n; i++)
      if (laplacian(i, i) == 0) laplacian(i, i) = 1;
    const Eigen::MatrixX3d step = laplacian.ldlt().solve(right);
    if (!step.allFinite()) break;
    for (Eigen::Index i = 0; i < n; i++)
      if (auto& r = rotations[i]) r = glm::normalize(turned_by({step(i, 0), step(i, 1), step(i, 2)}) * *r);
    if (scale == kScale && step.cwiseAbs().maxCoeff() < kPoseSettled) break;
  }
  return rotations;
}

}  // namespace lf
