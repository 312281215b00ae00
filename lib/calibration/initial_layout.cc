// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/initial_layout.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include <Eigen/Eigenvalues>
#include <glm/gtc/type_ptr.hpp>
#include <opencv2/calib3d.hpp>

#include "base/maths.h"
#include "calibration/multiview_geometry.h"

namespace lf {
namespace {

constexpr int kDisparitySamples = 200;
constexpr int kDisparityRounds = 12;
constexpr int kMinCommon = 6;  // detections that two cameras must share

double weight_of(double squared_error, double threshold) {
  const double w = threshold * threshold / (threshold * threshold + squared_error);
  return w * w;  // Geman-McClure weight; large errors have no influence
}

// A line y = offset + slope t through 2D points y.
struct DisparityLine {
  Vec2 offset{0, 0}, slope{0, 0};
  double score = 0;
};

struct LinePoint {
  double t;
  Vec2 y;
  double weight = 1;
};

double line_score(const std::vector<LinePoint>& points, const DisparityLine& line, double threshold) {
  double score = 0;
  for (const LinePoint& p : points) {
    const Vec2 e = p.y - line.offset - line.slope * p.t;
    score += p.weight * std::max(0.0, 1 - glm::dot(e, e) / (threshold * threshold));
  }
  return score;
}

void refine_line(const std::vector<LinePoint>& points, double threshold, int rounds, DisparityLine& line) {
  for (int round = 0; round < rounds; round++) {
    double s = 0, st = 0, stt = 0;
    Vec2 sy(0, 0), sty(0, 0);
    for (const LinePoint& p : points) {
      const Vec2 e = p.y - line.offset - line.slope * p.t;
      const double w = p.weight * weight_of(glm::dot(e, e), threshold);
      s += w, st += w * p.t, stt += w * p.t * p.t, sy += w * p.y, sty += w * p.t * p.y;
    }
    const double det = s * stt - st * st;
    if (!(det > 1e-12 * s * stt)) return;
    line.slope = (s * sty - st * sy) / det;
    line.offset = (sy - line.slope * st) / s;
  }
  line.score = line_score(points, line, threshold);
}

DisparityLine fit_line(const std::vector<LinePoint>& points, double threshold, std::mt19937& random) {
  DisparityLine best;
  for (int sample = 0; sample < kDisparitySamples; sample++) {
    const LinePoint& a = points[random() % points.size()];
    const LinePoint& b = points[random() % points.size()];
    if (a.t == b.t) continue;
    DisparityLine line;
    line.slope = (b.y - a.y) / (b.t - a.t);
    line.offset = a.y - line.slope * a.t;
    line.score = line_score(points, line, threshold);
    if (line.score > best.score) best = line;
  }
  refine_line(points, threshold, 5, best);
  return best;
}

class Factorisation {
 public:
  Factorisation(const std::vector<ColumnDetection>& sights, size_t num_cameras, size_t num_columns, double threshold)
      : threshold_(threshold), by_camera_(num_cameras), by_column_(num_columns) {
    for (const ColumnDetection& s : sights) {
      by_camera_[s.camera].push_back(s);
      by_column_[s.column].push_back(s);
    }
    factors_.cameras.resize(num_cameras);
    factors_.columns.resize(num_columns);
  }

  DisparityFactors run() {
    if (!start()) return factors_;
    for (int round = 0; round < kDisparityRounds; round++) {
      for (size_t j = 0; j < by_column_.size(); j++) solve_column(j, round <= 1 || !factors_.columns[j].known);
      for (size_t i = 0; i < by_camera_.size(); i++) solve_camera(i, round <= 1);
    }
    upgrade();
    count();
    return factors_;
  }

 private:
  bool start() {
    const auto reference =
        static_cast<uint32_t>(std::max_element(by_camera_.begin(), by_camera_.end(),
                                               [](const auto& a, const auto& b) { return a.size() < b.size(); }) -
                              by_camera_.begin());
    std::vector<std::optional<Vec2>> at(by_column_.size());
    for (const ColumnDetection& s : by_camera_[reference]) at[s.column] = s.uv;
    const auto differences = [&](size_t i) {
      std::vector<std::pair<size_t, Vec2>> list;
      for (const ColumnDetection& s : by_camera_[i])
        if (at[s.column]) list.push_back({s.column, s.uv - *at[s.column]});
      return list;
    };
    double best_score = 0;
    std::vector<std::optional<double>> t(by_column_.size());
    for (size_t i = 0; i < by_camera_.size(); i++) {
      const auto list = differences(i);
      if (i == reference || list.size() < kMinCommon) continue;
      double score = 0;
      Vec2 origin(0, 0), along(0, 0);
      for (int sample = 0; sample < kDisparitySamples; sample++) {
        const Vec2 a = list[random_() % list.size()].second, b = list[random_() % list.size()].second;
        const double length = glm::length(b - a);
        if (!(length > threshold_)) continue;
        const Vec2 u = (b - a) / length;
        double agree = 0;
        std::vector<double> places;
        for (const auto& [column, y] : list) {
          const double off = u.x * (y - a).y - u.y * (y - a).x;
          if (std::abs(off) > threshold_) continue;
          agree += 1 - off * off / (threshold_ * threshold_);
          places.push_back(glm::dot(u, y - a));
        }
        if (places.size() < kMinCommon) continue;
        std::sort(places.begin(), places.end());
        const double range = places[places.size() - 1 - places.size() / 5] - places[places.size() / 5];
        const double s = agree * std::min(range, 20 * threshold_);
        if (s > score) score = s, origin = a, along = u;
      }
      if (score <= best_score) continue;
      best_score = score;
      std::fill(t.begin(), t.end(), std::nullopt);
      for (const auto& [column, y] : list)
        if (std::abs(along.x * (y - origin).y - along.y * (y - origin).x) <= threshold_)
          t[column] = glm::dot(along, y - origin);
    }
    if (best_score == 0) return false;
    known_.assign(by_camera_.size(), false);
    known_[reference] = true;
    for (size_t i = 0; i < by_camera_.size(); i++) {
      if (i == reference) continue;
      std::vector<LinePoint> points;
      for (const auto& [column, y] : differences(i))
        if (t[column]) points.push_back({*t[column], y});
      if (points.size() < kMinCommon) continue;
      const DisparityLine line = fit_line(points, threshold_, random_);
      if (line.score < std::max(4.0, 0.25 * static_cast<double>(points.size()))) continue;
      factors_.cameras[i].centre = -line.slope;
      factors_.cameras[i].turn = line.offset;
      known_[i] = true;
    }
    return true;
  }

  // Solves direction - C d = uv - o. Samples pairs of cameras if there is no estimate yet.
  void solve_column(size_t j, bool search) {
    DisparityFactors::ColumnFactor& column = factors_.columns[j];
    const std::vector<ColumnDetection>& sights = by_column_[j];
    const auto error = [&](const ColumnDetection& s, const Vec2& direction, double d) {
      const auto& camera = factors_.cameras[s.camera];
      const Vec2 e = direction - camera.centre * d + camera.turn - s.uv;
      return glm::dot(e, e);
    };
    if (search) {
      column.known = false;
      if (sights.empty()) return;
      double best = 0;
      for (int sample = 0; sample < kDisparitySamples; sample++) {
        const ColumnDetection& a = sights[random_() % sights.size()];
        const ColumnDetection& b = sights[random_() % sights.size()];
        if (!known_[a.camera] || !known_[b.camera]) continue;
        const auto &ca = factors_.cameras[a.camera], &cb = factors_.cameras[b.camera];
        const Vec2 base = ca.centre - cb.centre;
        const double squared = glm::dot(base, base);
        if (!(squared > 1e-18)) continue;
        const double d = -glm::dot(base, (a.uv - ca.turn) - (b.uv - cb.turn)) / squared;
        const Vec2 direction = a.uv - ca.turn + ca.centre * d;
        double score = 0;
        for (const ColumnDetection& s : sights)
          if (known_[s.camera]) score += std::max(0.0, 1 - error(s, direction, d) / (threshold_ * threshold_));
        if (score > best) best = score, column.direction = direction, column.disparity = d;
      }
      if (best < 1.5) return;
      column.known = true;
    }
    if (!column.known) return;
    for (int round = 0; round < (search ? 5 : 1); round++) {
      double s = 0, cc = 0, cy = 0;
      Vec2 c(0, 0), y(0, 0);
      for (const ColumnDetection& sight : sights) {
        if (!known_[sight.camera]) continue;
        const auto& camera = factors_.cameras[sight.camera];
        const double w = weight_of(error(sight, column.direction, column.disparity), threshold_);
        const Vec2 value = sight.uv - camera.turn;
        s += w, c += w * camera.centre, y += w * value;
        cc += w * glm::dot(camera.centre, camera.centre), cy += w * glm::dot(camera.centre, value);
      }
      const double det = s * cc - glm::dot(c, c);
      if (!(det > 1e-12 * s * cc)) return;
      column.disparity = (glm::dot(c, y) - s * cy) / det;
      column.direction = (y + c * column.disparity) / s;
    }
  }

  void solve_camera(size_t i, bool search) {
    DisparityFactors::CameraFactor& camera = factors_.cameras[i];
    std::vector<LinePoint> points;
    for (const ColumnDetection& s : by_camera_[i]) {
      const auto& column = factors_.columns[s.column];
      if (column.known) points.push_back({column.disparity, s.uv - column.direction});
    }
    if (points.size() < kMinCommon) return;
    DisparityLine line{camera.turn, -camera.centre};
    if (search || !known_[i]) {
      const DisparityLine found = fit_line(points, threshold_, random_);
      if (!known_[i] || found.score > line_score(points, line, threshold_)) line = found;
    }
    refine_line(points, threshold_, 1, line);
    known_[i] = line.score > std::max(4.0, 0.25 * static_cast<double>(points.size()));
    camera.centre = -line.slope;
    camera.turn = line.offset;
  }

  // Fixes the gauge: C centred with unit spread, rotations without a component along C, positive disparities.
  void upgrade() {
    double n = 0;
    Vec2 mean_c(0, 0), mean_o(0, 0);
    for (size_t i = 0; i < known_.size(); i++)
      if (known_[i]) n++, mean_c += factors_.cameras[i].centre, mean_o += factors_.cameras[i].turn;
    mean_c /= n, mean_o /= n;
    double cc = 0, co = 0;
    for (size_t i = 0; i < known_.size(); i++) {
      auto& camera = factors_.cameras[i];
      camera.centre -= mean_c, camera.turn -= mean_o;
      if (known_[i]) cc += glm::dot(camera.centre, camera.centre), co += glm::dot(camera.centre, camera.turn);
    }
    if (!(cc > 0)) return;
    const double slope = co / cc, spread = std::sqrt(cc / n);
    std::vector<double> disparities;
    for (auto& column : factors_.columns) {
      column.direction += mean_o - mean_c * column.disparity;
      column.disparity -= slope;
      if (column.known) disparities.push_back(column.disparity);
    }
    if (disparities.empty()) return;
    const double middle = median(std::move(disparities)), scale = middle < 0 ? -spread : spread;
    for (auto& camera : factors_.cameras) {
      camera.turn -= camera.centre * slope;
      camera.centre /= scale;
    }
    const double least = std::abs(middle * spread) / 20;
    for (auto& column : factors_.columns) column.disparity = std::max(column.disparity * scale, least);
  }

  void count() {
    double all = 0, agree = 0;
    for (size_t i = 0; i < by_camera_.size(); i++) {
      double fit = 0;
      for (const ColumnDetection& s : by_camera_[i]) {
        const auto& column = factors_.columns[s.column];
        const Vec2 e =
            column.direction - factors_.cameras[i].centre * column.disparity + factors_.cameras[i].turn - s.uv;
        if (known_[i] && column.known && glm::dot(e, e) < threshold_ * threshold_) fit++;
      }
      all += static_cast<double>(by_camera_[i].size()), agree += fit;
      factors_.cameras[i].inliers = known_[i] ? fit / static_cast<double>(by_camera_[i].size()) : 0;
    }
    factors_.inliers = all > 0 ? agree / all : 0;
  }

  double threshold_;
  std::vector<std::vector<ColumnDetection>> by_camera_, by_column_;
  std::vector<char> known_;
  DisparityFactors factors_;
  std::mt19937 random_{1};
};

}  // namespace

DisparityFactors factorise_disparities(const std::vector<ColumnDetection>& sights, size_t num_cameras,
                                       size_t num_columns, double threshold) {
  return Factorisation(sights, num_cameras, num_columns, threshold).run();
}

namespace {

// The threshold allows for lens errors, rolled cameras and different depths of the cameras: 8 pixels at a focal length
// of 400.
constexpr double kFactorThreshold = 0.02;
constexpr double kMinFit = 0.3;

// Treats each end of a bar as a separate point, because the scale is unknown at this stage.
Tracks without_bars(Tracks tracks) {
  if (!tracks.bar) return tracks;
  tracks.bar = false;
  tracks.num_positions *= 2;
  for (Observation& o : tracks.observations) o.position = o.position * 2 + o.light, o.light = 0;
  return tracks;
}

}  // namespace

double layout_from_disparities(Reconstruction& scene, const Tracks& tracks) {
  const uint32_t lights = tracks.bar ? 2 : 1;
  std::vector<ColumnDetection> sights;
  for (const Observation& o : tracks.observations)
    if (const auto uv = scene.cameras[o.camera].lens().unproject(o.pixel))
      sights.push_back({o.camera, o.position * lights + o.light, *uv});
  const DisparityFactors factors =
      factorise_disparities(sights, tracks.cameras.size(), tracks.num_positions * lights, kFactorThreshold);
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    const auto& factor = factors.cameras[i];
    CameraState& camera = scene.cameras[i];
    camera.used = factor.inliers > kMinFit;
    // The image of the forward point moves to `turn`, so the camera rotates in the opposite direction.
    if (camera.used) camera.set_pose({Vec3(factor.centre, 0), turned_by({factor.turn.y, -factor.turn.x, 0})});
  }
  triangulate_from_poses(scene, tracks, kFactorThreshold * scene.batch_mean[kF]);
  return factors.inliers;
}

void triangulate_from_poses(Reconstruction& scene, const Tracks& tracks, double threshold) {
  scene.targets.assign(tracks.num_positions, {});
  if (!tracks.bar) return triangulate_targets(scene, tracks, threshold);
  const Tracks single = without_bars(tracks);
  Reconstruction points = scene;
  points.targets.assign(single.num_positions, {});
  triangulate_targets(points, single, threshold);
  std::vector<double> lengths;
  for (size_t j = 0; j < tracks.num_positions; j++)
    if (points.targets[2 * j].has(0) && points.targets[2 * j + 1].has(0))
      lengths.push_back(glm::length(points.targets[2 * j].point(0) - points.targets[2 * j + 1].point(0)));
  if (lengths.empty()) return;
  const double length = median(std::move(lengths));
  for (CameraState& camera : scene.cameras)
    for (int i = 4; i < 7; i++) camera.v[i] /= length;
  triangulate_targets(scene, tracks, threshold);
}

namespace {

constexpr int kMinPairPoints = 6;
constexpr int kLayoutSamples = 500;
constexpr double kMinInlierShare = 0.4;

struct RobustCentre {
  Vec3 centre;
  double distance;
};
RobustCentre middle_of(const std::vector<Vec3>& places) {
  RobustCentre m;
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
    if (places.size() < kMinPairPoints) continue;
    // OpenCV merges points closer than about 0.1, so points are normalised to the origin and unit distance.
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
    } catch (const cv::Exception&) {  // degenerate: points nearly coincide
      continue;
    }
    if (static_cast<double>(fit.size()) <
        std::max<double>(kMinPairPoints, kMinInlierShare * static_cast<double>(points.size())))
      continue;
    cv::Rodrigues(turn, rotation);  // camera_from_world
    const Mat3 r = glm::make_mat3(rotation.ptr<double>());  // transposed
    const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    camera.set_pose({centre - size * (r * t), glm::quat_cast(r)});
    camera.used = true;
    placed++;
  }
  return placed;
}

namespace {

constexpr double kAgree = 0.1;  // radians between a relative rotation and the averaged rotations
constexpr int kLayoutRounds = 20;
constexpr double kStraight = 0.05;   // radians; rays with a larger error are down-weighted
constexpr double kDegenerate = 0.3;  // ratio of the smallest eigenvalue to the next

// Improves a layout that starts from poses with errors of up to `reach` pixels: triangulates, adjusts, and resects
// further cameras. Returns the number of placed cameras.
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
  triangulate_from_poses(scene, tracks, threshold);
  return static_cast<int>(scene.used_poses().size());
}

void forget_poses(Reconstruction& scene) {
  for (CameraState& camera : scene.cameras) camera.used = false;
}

struct LineOfSight {
  Eigen::Index camera;
  size_t light;
  Eigen::Vector3d along;
};

// Estimates camera and light positions for known rotations. Minimises the squared angular distances between lights and
// rays, with iterative reweighting. Returns nullopt if more than the scale is undetermined.
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

int global_layout(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto pairs = relative_poses(scene, tracks, threshold);
  std::vector<RelativeRotation> relative;
  for (const RelativePose& pair : pairs) relative.push_back({pair.a, pair.b, pair.a_from_b.orientation, pair.score});
  const auto rotations = average_rotations(scene.cameras.size(), relative);
  // A rotation without a consistent pair is unknown.
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

int incremental_layout(Reconstruction& scene, const Tracks& tracks, double threshold) {
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
