// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/initial_layout.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <opencv2/calib3d.hpp>

#include "base/percentiles.h"
#include "calibration/disparity_factorisation.h"
#include "calibration/relative_poses.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

// Lens errors, rolled cameras and differences of depth among the cameras: 8 pixels of 400.
constexpr double kFactorThreshold = 0.02;
constexpr double kLeastFit = 0.3;

Quat small_turn(const Vec2& turn) {
  // The point straight ahead appears at `turn`: the camera looks the other way.
  const Vec3 axis(turn.y, -turn.x, 0);
  const double angle = glm::length(axis);
  return angle > 0 ? glm::angleAxis(angle, axis / angle) : Quat(1, 0, 0, 0);
}

}  // namespace

double layout_from_disparities(Reconstruction& scene, const Tracks& tracks) {
  const uint32_t lights = tracks.bar ? 2 : 1;
  std::vector<ColumnSight> sights;
  for (const Observation& o : tracks.observations)
    if (const auto uv = scene.cameras[o.camera].lens().unproject(o.pixel))
      sights.push_back({o.camera, o.position * lights + o.light, *uv});
  const DisparityFactors factors =
      factorise_disparities(sights, tracks.cameras.size(), tracks.num_positions * lights, kFactorThreshold);
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    const auto& factor = factors.cameras[i];
    CameraState& camera = scene.cameras[i];
    camera.used = factor.inliers > kLeastFit;
    if (camera.used) camera.set_pose({Vec3(factor.centre, 0), small_turn(factor.turn)});
  }
  targets_from_poses(scene, tracks, kFactorThreshold * scene.batch_mean[kF]);
  return factors.inliers;
}

void targets_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold) {
  scene.targets.assign(tracks.num_positions, {});
  if (!tracks.bar) return triangulate_targets(scene, tracks, threshold);
  // How long is the bar in the scale of these poses?
  Tracks single = tracks;
  single.bar = false;
  single.num_positions = tracks.num_positions * 2;
  for (Observation& o : single.observations) o.position = o.position * 2 + o.light, o.light = 0;
  Reconstruction points = scene;
  points.targets.assign(single.num_positions, {});
  triangulate_targets(points, single, threshold);
  std::vector<double> lengths;
  for (size_t j = 0; j < tracks.num_positions; j++)
    if (points.targets[2 * j].has(0) && points.targets[2 * j + 1].has(0))
      lengths.push_back(glm::length(points.targets[2 * j].point(0) - points.targets[2 * j + 1].point(0)));
  if (lengths.empty()) return;
  std::nth_element(lengths.begin(), lengths.begin() + lengths.size() / 2, lengths.end());
  const double length = lengths[lengths.size() / 2];
  for (CameraState& camera : scene.cameras)
    for (int i = 4; i < 7; i++) camera.v[i] /= length;
  triangulate_targets(scene, tracks, threshold);
}

namespace {

constexpr int kLeastPairPoints = 6;
constexpr int kLayoutSamples = 500;
constexpr double kLeastAgreeing = 0.4;  // of the points

struct Middle {
  Vec3 centre;
  double distance;  // from it
};
Middle middle_of(const std::vector<Vec3>& places) {
  Middle m;
  std::vector<double> values(places.size());
  for (int axis = 0; axis < 3; axis++) {
    for (size_t i = 0; i < places.size(); i++) values[i] = places[i][axis];
    m.centre[axis] = median(values);
  }
  for (size_t i = 0; i < places.size(); i++) values[i] = glm::length(places[i] - m.centre);
  m.distance = median(values);
  return m;
}

}  // namespace

int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto lists = observations_of_cameras(tracks);
  int placed = 0;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    CameraState& camera = scene.cameras[i];
    if (camera.used) continue;
    std::vector<Vec3> places;
    std::vector<cv::Point2d> sights;
    for (const uint32_t index : lists[i]) {
      const Observation& o = tracks.observations[index];
      const auto uv = camera.lens().unproject(o.pixel);
      if (!scene.targets[o.position].has(o.light) || !uv) continue;
      places.push_back(scene.targets[o.position].point(o.light));
      sights.emplace_back(uv->x, uv->y);
    }
    if (places.size() < kLeastPairPoints) continue;
    // OpenCV takes points for one that are less than some 0.1 apart: around the origin, at unit distance.
    const auto [centre, size] = middle_of(places);
    if (!(size > 0)) continue;
    std::vector<cv::Point3d> points;
    for (const Vec3& p : places) {
      const Vec3 near = (p - centre) / size;
      points.emplace_back(near.x, near.y, near.z);
    }
    cv::Mat turn, shift, rotation;
    std::vector<int> fit;
    const double reach = threshold / camera.lens_terms()[kF];
    try {
      if (!cv::solvePnPRansac(points, sights, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, shift, false,
                              kLayoutSamples, static_cast<float>(reach), 0.999, fit, cv::SOLVEPNP_SQPNP))
        continue;
    } catch (const cv::Exception&) {  // the points are nearly one
      continue;
    }
    if (static_cast<double>(fit.size()) <
        std::max<double>(kLeastPairPoints, kLeastAgreeing * static_cast<double>(points.size())))
      continue;
    cv::Rodrigues(turn, rotation);  // camera_from_world
    Mat3 r;
    for (int row = 0; row < 3; row++)
      for (int column = 0; column < 3; column++) r[row][column] = rotation.at<double>(row, column);  // transposed
    const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    camera.set_pose({centre - size * (r * t), glm::quat_cast(r)});
    camera.used = true;
    placed++;
  }
  return placed;
}

namespace {

constexpr double kAgree = 0.1;  // radians between a pair and the average
constexpr int kLayoutRounds = 20;
constexpr double kStraight = 0.05;   // radians: lines of sight that are farther off count less and less
constexpr double kDegenerate = 0.3;  // of the next eigenvalue

// Each end of a bar a point of its own: there is no scale yet.
Tracks without_bars(Tracks tracks) {
  if (!tracks.bar) return tracks;
  tracks.bar = false;
  tracks.num_positions *= 2;
  for (Observation& o : tracks.observations) o.position = o.position * 2 + o.light, o.light = 0;
  return tracks;
}

// Targets, the adjustment and further cameras from those that have a pose, which may be off by `reach` pixels. Returns
// how many have one then.
int grow(Reconstruction& scene, const Tracks& tracks, double reach, double threshold) {
  const Tracks points = without_bars(tracks);
  scene.targets.assign(points.num_positions, {});
  const auto settle = [&](double pixels) {
    triangulate_targets(scene, points, pixels);
    AdjustmentOptions o;
    o.robust = 2, o.sigma = pixels / 4, o.max_iterations = 6, o.tolerance = 1e-3;
    adjust(scene, points.observations, Inliers(points.observations.size(), true), o);
  };
  for (; reach > threshold; reach /= 2) settle(reach);
  for (int more = 1; more > 0;) {
    settle(threshold);
    more = resect_cameras(scene, points, 2 * threshold);
  }
  targets_from_poses(scene, tracks, threshold);
  return static_cast<int>(
      std::count_if(scene.cameras.begin(), scene.cameras.end(), [](const CameraState& c) { return c.used; }));
}

void forget_poses(Reconstruction& scene) {
  for (CameraState& camera : scene.cameras) camera.used = false;
}

struct LineOfSight {
  Eigen::Index camera;  // a row
  size_t light;
  Eigen::Vector3d along;
};

// Places of cameras whose rotations are known, and of the lights: the sum of the squared distances of lights from lines
// of sight, in angles, is least (reweighted). The lights are eliminated; what is left is the smallest eigenvector that
// is no shift. Nothing where that leaves more than a scale open.
std::optional<Eigen::VectorXd> places_by_lines_of_sight(Eigen::Index cameras, size_t lights,
                                                        const std::vector<LineOfSight>& lines) {
  std::vector<std::vector<const LineOfSight*>> of_light(lights);
  for (const LineOfSight& line : lines) of_light[line.light].push_back(&line);
  std::vector<double> weight(lines.size(), 1);
  Eigen::VectorXd places;
  bool open = true;
  for (int round = 0; round < kLayoutRounds; round++) {
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(3 * cameras, 3 * cameras);
    const auto across = [&](const LineOfSight& line) -> Eigen::Matrix3d {
      return weight[&line - lines.data()] * (Eigen::Matrix3d::Identity() - line.along * line.along.transpose());
    };
    std::vector<Eigen::Matrix3d> own(lights, Eigen::Matrix3d::Zero());
    for (size_t j = 0; j < lights; j++) {
      for (const LineOfSight* line : of_light[j]) own[j] += across(*line);
      if (of_light[j].size() < 2 || !(own[j].determinant() > 0)) continue;
      own[j] = own[j].inverse().eval();
      for (const LineOfSight* a : of_light[j]) {
        m.block<3, 3>(3 * a->camera, 3 * a->camera) += across(*a);
        const Eigen::Matrix3d gain = across(*a) * own[j];
        for (const LineOfSight* b : of_light[j]) m.block<3, 3>(3 * a->camera, 3 * b->camera) -= gain * across(*b);
      }
    }
    // Shifts are taken out of the way.
    const double stiff = m.diagonal().maxCoeff() / static_cast<double>(cameras);
    for (Eigen::Index i = 0; i < m.rows(); i++)
      for (Eigen::Index j = i % 3; j < m.rows(); j += 3) m(i, j) += stiff;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(m);
    open = !(eigen.eigenvalues()[0] < kDegenerate * eigen.eigenvalues()[1]);
    places = eigen.eigenvectors().col(0);
    std::vector<Eigen::Vector3d> apart(lines.size(), Eigen::Vector3d::Zero());
    double before = 0;
    for (size_t j = 0; j < lights; j++) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const LineOfSight* line : of_light[j]) sum += across(*line) * places.segment<3>(3 * line->camera);
      const Eigen::Vector3d at = own[j] * sum;
      for (const LineOfSight* line : of_light[j]) {
        apart[line - lines.data()] = at - places.segment<3>(3 * line->camera);
        before += weight[line - lines.data()] * apart[line - lines.data()].normalized().dot(line->along);
      }
    }
    const double side = before < 0 ? -1 : 1;
    places *= side;
    const double straight = std::max(kStraight, 0.5 * std::pow(0.7, round));
    for (size_t i = 0; i < lines.size(); i++) {
      const double off = std::atan2(apart[i].cross(lines[i].along).norm(), side * apart[i].dot(lines[i].along)),
                   far = 1 + off * off / (straight * straight);
      weight[i] = 1 / (far * far);
    }
  }
  if (open) return std::nullopt;
  return places;
}

}  // namespace

int layout_from_averages(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto pairs = relative_poses(scene, tracks, threshold);
  std::vector<RelativeRotation> relative;
  for (const RelativePose& pair : pairs) relative.push_back({pair.a, pair.b, pair.a_from_b.orientation, pair.score});
  const auto rotations = average_rotations(scene.cameras.size(), relative);
  // Rotations that no pair agrees with are not known.
  std::vector<Eigen::Index> row(scene.cameras.size(), -1);
  Eigen::Index count = 0;
  for (const RelativePose& pair : pairs) {
    const auto &a = rotations[pair.a], &b = rotations[pair.b];
    if (!a || !b || angle_of(*a * pair.a_from_b.orientation * glm::conjugate(*b)) > kAgree) continue;
    for (const size_t i : {pair.a, pair.b})
      if (row[i] < 0) row[i] = count++;
  }
  const Tracks points = without_bars(tracks);
  std::vector<LineOfSight> lines;
  for (const Observation& o : points.observations) {
    if (row[o.camera] < 0) continue;
    const auto uv = scene.cameras[o.camera].lens().unproject(o.pixel);
    if (!uv) continue;
    const Vec3 along = *rotations[o.camera] * glm::normalize(Vec3(*uv, 1));
    lines.push_back({row[o.camera], o.position, {along.x, along.y, along.z}});
  }
  if (count < 2) return 0;
  const auto places = places_by_lines_of_sight(count, points.num_positions, lines);
  if (!places) return 0;
  forget_poses(scene);
  for (size_t i = 0; i < row.size(); i++) {
    if (row[i] < 0) continue;
    const Eigen::Vector3d at = places->segment<3>(3 * row[i]);
    scene.cameras[i].set_pose({{at[0], at[1], at[2]}, *rotations[i]});
    scene.cameras[i].used = true;
  }
  return grow(scene, tracks, kAgree * scene.batch_mean[kF], threshold);
}

int layout_from_a_pair(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto pairs = relative_poses(scene, tracks, threshold);
  const auto best =
      std::max_element(pairs.begin(), pairs.end(), [](const auto& x, const auto& y) { return x.score < y.score; });
  if (best == pairs.end() || !(best->score > 0)) return 0;
  forget_poses(scene);
  scene.cameras[best->a].set_pose({});
  scene.cameras[best->b].set_pose(best->a_from_b);
  scene.cameras[best->a].used = scene.cameras[best->b].used = true;
  return grow(scene, tracks, threshold, threshold);
}

}  // namespace lf
