// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/placement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/maths.h"
#include "base/text.h"
#include "calibration/multiview_geometry.h"

namespace lf {
namespace {

constexpr double kAt = 0.35;            // maximum distance from a place, relative to the place's nearest neighbour
constexpr double kOtherWay = 0.6;       // radians; maximum difference in orientation
constexpr double kTooFar = 0.5;         // distance, in the same unit, beyond which a camera is not at a place
constexpr double kUsualShift = 0.05;    // typical deviation of arrays, in the same unit
constexpr double kUsualTurn = 0.0175;   // radians
constexpr double kUsualCounts = 2;      // weight of the typical deviations, in cameras
constexpr double kAlignmentRobust = 3;  // sigmas beyond which cameras are down-weighted
constexpr double kClearlyBetter = 1.5;  // required gain of another order, in cameras
constexpr int kAlignmentRounds = 12;
constexpr int kAlignmentSamples = 200;
constexpr size_t kSample = 3;

Eigen::Vector3d eigen(const Vec3& v) { return {v.x, v.y, v.z}; }
Eigen::Matrix3d eigen(const Mat3& m) {
  Eigen::Matrix3d e;
  for (int c = 0; c < 3; c++) e.col(c) = eigen(m[c]);
  return e;
}

// Returns the proper rotation nearest to the correlation matrix `m`.
Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Quat quaternion(const Eigen::Matrix3d& m) {
  Mat3 r;
  for (int c = 0; c < 3; c++) r[c] = {m(0, c), m(1, c), m(2, c)};
  return glm::normalize(glm::quat_cast(r));
}

class LayoutAligner {
 public:
  LayoutAligner(const std::vector<Pose>& found, const std::vector<Pose>& layout, std::optional<double> scale,
                double common_turn)
      : found_(found), layout_(layout), scale_(scale), common_turn_(common_turn), spacing_(layout.size()) {
    for (size_t i = 0; i < layout.size(); i++) {
      spacing_[i] = std::numeric_limits<double>::infinity();
      for (size_t j = 0; j < layout.size(); j++) {
        const double apart = glm::length(layout[i].position - layout[j].position);
        if (apart > 0) spacing_[i] = std::min(spacing_[i], apart);
      }
    }
    usual_shift_ = kUsualShift * median(spacing_);
  }

  LayoutAlignment refine(Similarity start, std::vector<size_t> places) const {
    LayoutAlignment now{start, std::move(places), std::vector<char>(found_.size(), true), usual_shift_, kUsualTurn};
    for (int round = 0; round < kAlignmentRounds; round++) {
      judge(now);
      step(now);
    }
    judge(now);
    return now;
  }

  // Counts the cameras that are at their places with the right orientation; doubtful ones count partly. Positions alone
  // would also fit an array seen from behind.
  double score(const LayoutAlignment& a) const {
    double sum = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      const double d = off(a.layout_from_scene, i, a.place[i]) / (kTooFar * spacing_[a.place[i]]);
      const double t = turn(a.layout_from_scene, i, a.place[i]) / kOtherWay;
      sum += std::max(0.0, 1 - d * d) * std::max(0.0, 1 - t * t);
    }
    return sum;
  }

  LayoutAlignment as_named(const std::vector<size_t>& own) const {
    LayoutAlignment best = refine(similarity_of(own, all()), own);
    double most = score(best);
    std::mt19937 random(1);
    const double enough = 0.8 * static_cast<double>(found_.size());
    for (int n = 0; n < kAlignmentSamples && most < enough && found_.size() > kSample; n++) {
      std::vector<size_t> sample = all();
      std::shuffle(sample.begin(), sample.end(), random);
      sample.resize(kSample);
      LayoutAlignment trial{similarity_of(own, sample), own, {}, 0, 0};
      if (score(trial) <= 0.7 * most) continue;
      trial = refine(trial.layout_from_scene, own);
      if (score(trial) > most) most = score(trial), best = std::move(trial);
    }
    return best;
  }

  LayoutAlignment align_by_position(const std::vector<size_t>& own) const {
    LayoutAlignment now{whole(own), own, {}, 0, 0};
    std::vector<size_t> before;
    for (int round = 0; round < kAlignmentRounds && before != now.place; round++) {
      before = now.place;
      now.place = nearest_places(now.layout_from_scene, own);
      now = refine(now.layout_from_scene, std::move(now.place));
    }
    return now;
  }

  std::vector<size_t> nearest_places(const Similarity& s, const std::vector<size_t>& own) const {
    std::vector<std::tuple<double, size_t, size_t>> ways;
    for (size_t i = 0; i < found_.size(); i++)
      for (size_t j = 0; j < layout_.size(); j++) ways.emplace_back(off(s, i, j) / spacing_[j], i, j);
    std::sort(ways.begin(), ways.end());
    std::vector<char> taken(layout_.size()), placed(found_.size());
    std::vector<size_t> places = own;
    for (const auto& [way, i, j] : ways) {
      if (placed[i] || taken[j]) continue;
      places[i] = j, placed[i] = taken[j] = true;
    }
    return places;
  }

  void name_places(LayoutAlignment& a, const std::vector<size_t>& own) const {
    const std::vector<size_t> nearest = nearest_places(a.layout_from_scene, own);
    a.place = own;
    for (size_t i = 0; i < found_.size(); i++)
      if (off(a.layout_from_scene, i, own[i]) > kTooFar * spacing_[own[i]] &&
          off(a.layout_from_scene, i, nearest[i]) < kAt * spacing_[nearest[i]])
        a.place[i] = nearest[i];
    for (bool changed = true; changed;) {
      changed = false;
      std::vector<int> at(layout_.size());
      for (const size_t place : a.place) at[place]++;
      for (size_t i = 0; i < found_.size(); i++)
        if (a.place[i] != own[i] && at[a.place[i]] > 1) a.place[i] = own[i], changed = true;
    }
  }

 private:
  std::vector<size_t> all() const {
    std::vector<size_t> list(found_.size());
    for (size_t i = 0; i < list.size(); i++) list[i] = i;
    return list;
  }

  double off(const Similarity& s, size_t i, size_t place) const {
    return glm::length(s(found_[i].position) - layout_[place].position);
  }

  Similarity similarity_of(const std::vector<size_t>& places, const std::vector<size_t>& cameras) const {
    std::vector<Pose> a, b;
    for (const size_t i : cameras) a.push_back(found_[i]), b.push_back(layout_[places[i]]);
    if (scale_)
      for (Pose& pose : a) pose.position *= *scale_;
    Similarity s = align(a, b, scale_.has_value());
    if (scale_) s.scale = *scale_;
    return s;
  }

  Similarity whole(const std::vector<size_t>& own) const {
    Eigen::Matrix3d looks = Eigen::Matrix3d::Zero();
    Vec3 a(0, 0, 0), b(0, 0, 0);
    std::vector<Vec3> from, to;
    for (size_t i = 0; i < found_.size(); i++) {
      looks += eigen(layout_[own[i]].rotation()) * eigen(found_[i].rotation()).transpose();
      from.push_back(found_[i].position), to.push_back(layout_[own[i]].position);
      a += from.back(), b += to.back();
    }
    Similarity s;
    s.scale = scale_.value_or(spread(to) / spread(from));
    s.rotation = quaternion(rotation_of(looks));
    s.translation = (b - s.scale * (s.rotation * a)) / static_cast<double>(found_.size());
    return s;
  }

  double turn(const Similarity& s, size_t i, size_t place) const {
    return angle_of(s.rotation * found_[i].orientation * glm::conjugate(layout_[place].orientation));
  }

  // Estimates the deviations as medians over cameras near their places, so that wrong cameras do not count.
  void judge(LayoutAlignment& a) const {
    std::vector<double> shifts, turns;
    for (size_t i = 0; i < found_.size(); i++) {
      const double shift = off(a.layout_from_scene, i, a.place[i]);
      a.fits[i] = shift < kTooFar * spacing_[a.place[i]];
      if (!a.fits[i]) continue;
      shifts.push_back(shift * shift / 3);
      turns.push_back(std::pow(turn(a.layout_from_scene, i, a.place[i]), 2) / 3);
    }
    const auto sigma = [](std::vector<double> squares, double usual) {
      constexpr double kMedian = 0.789;  // median of the squared length of a 3D normal vector, relative to its mean
      const auto n = static_cast<double>(squares.size());
      const double found = squares.empty() ? 0 : median(std::move(squares)) / kMedian;
      return std::sqrt((n * found + kUsualCounts * usual * usual) / (n + kUsualCounts));
    };
    a.position_sigma = sigma(std::move(shifts), usual_shift_);
    a.turn_sigma = sigma(std::move(turns), kUsualTurn);
  }

  void step(LayoutAlignment& a) const {
    Similarity& s = a.layout_from_scene;
    std::vector<double> weight(found_.size());
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
    double sum = 0, fitting = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      if (!a.fits[i]) continue;
      const double e = off(s, i, a.place[i]) / (kAlignmentRobust * a.position_sigma);
      weight[i] = 1 / std::pow(1 + e * e, 2);
      from += weight[i] * eigen(found_[i].position), to += weight[i] * eigen(layout_[a.place[i]].position);
      sum += weight[i], fitting++;
    }
    if (fitting < 2) return;
    from /= sum, to /= sum;
    const double shift_variance = a.position_sigma * a.position_sigma;
    // Averaging over cameras does not reduce the common error of orientations.
    const double turn_variance = a.turn_sigma * a.turn_sigma + fitting * common_turn_ * common_turn_;
    Eigen::Matrix3d centres = Eigen::Matrix3d::Zero(), looks = centres;
    double squares = 0;
    for (size_t i = 0; i < found_.size(); i++) {
      if (!a.fits[i]) continue;
      const Eigen::Vector3d p = eigen(found_[i].position) - from, q = eigen(layout_[a.place[i]].position) - to;
      centres += weight[i] * q * p.transpose(), squares += weight[i] * p.squaredNorm();
      const double e = turn(s, i, a.place[i]) / (kAlignmentRobust * a.turn_sigma);
      // Each rotation moves two of the three axes, so each axis counts half.
      looks += 0.5 / std::pow(1 + e * e, 2) * eigen(layout_[a.place[i]].rotation()) *
               eigen(found_[i].rotation()).transpose();
    }
    Eigen::Matrix3d r = rotation_of(s.scale / shift_variance * centres + looks / turn_variance);
    if (!scale_ && squares > 0) {
      const double scale = (r * centres.transpose()).trace() / squares;
      if (scale > 0) s.scale = scale;
    }
    s.rotation = quaternion(r);
    s.translation = Vec3(to.x(), to.y(), to.z()) - s.scale * (s.rotation * Vec3(from.x(), from.y(), from.z()));
  }

  const std::vector<Pose>& found_;
  const std::vector<Pose>& layout_;
  std::optional<double> scale_;
  double common_turn_, usual_shift_;
  std::vector<double> spacing_;  // distance from each place to its nearest neighbour
};

}  // namespace

LayoutAlignment align_to_layout(const std::vector<Pose>& found, const std::vector<Pose>& layout,
                                const std::vector<size_t>& own, std::optional<double> scale, double common_turn) {
  if (found.size() < 2 || own.size() != found.size()) throw Error("alignment needs at least two cameras");
  const LayoutAligner fit(found, layout, scale, common_turn);
  LayoutAlignment best = fit.as_named(own);
  if (fit.score(best) < static_cast<double>(found.size()) - kClearlyBetter) {
    LayoutAlignment other = fit.align_by_position(own);
    if (fit.score(other) > fit.score(best) + kClearlyBetter) best = std::move(other);
  }
  fit.name_places(best, own);
  return fit.refine(best.layout_from_scene, best.place);
}

namespace {

// Frame at the centre of the cameras, along their mean axes.
Similarity own_frame(const std::vector<Pose>& poses) {
  Vec3 mean(0, 0, 0), forward(0, 0, 0), right(0, 0, 0), down(0, 0, 0);
  for (const Pose& p : poses) mean += p.position, forward += p.forward(), right += p.right(), down += p.down();
  mean /= static_cast<double>(poses.size());
  // cameras look in all directions
  if (!(glm::length(forward) > 1e-3)) forward = poses[0].forward(), right = poses[0].right();
  const Vec3 z = glm::normalize(forward);
  Vec3 x = right - glm::dot(right, z) * z;
  if (!(glm::length(x) > 1e-3)) x = glm::cross(down, z);
  if (!(glm::length(x) > 1e-3)) x = poses[0].right() - glm::dot(poses[0].right(), z) * z;
  x = glm::normalize(x);
  Similarity s;
  s.rotation = glm::conjugate(glm::normalize(glm::quat_cast(Mat3(x, glm::cross(z, x), z))));
  s.translation = -(s.rotation * mean);
  return s;
}

Similarity scaled(Similarity s, double factor) {
  s.scale *= factor;
  s.translation *= factor;
  return s;
}

// Returns the uncertainty of the cameras' common orientation for known centres: radians, per axis.
double common_turn(const Solution& solution) {
  const Uncertainty& u = solution.uncertainty;
  const auto used = static_cast<double>(
      std::count_if(u.camera_row.begin(), u.camera_row.end(), [](const int row) { return row >= 0; }));
  double variance = 0;
  for (int axis = 0; axis < 3 && used > 0; axis++) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(u.covariance.rows());
    for (const int row : u.camera_row)
      if (row >= 0) mean[row + axis] = 1 / used;
    variance += mean.dot(u.covariance * mean) / 3;
  }
  return std::sqrt(std::max(0.0, variance));
}

}  // namespace

double neighbour_distance(const std::vector<Pose>& poses) {
  std::vector<double> nearest(poses.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < poses.size(); i++)
    for (size_t j = 0; j < poses.size(); j++)
      if (i != j) nearest[i] = std::min(nearest[i], glm::length(poses[i].position - poses[j].position));
  return median(std::move(nearest));
}

Placement place_solution(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                         const PlacementOptions& placement) {
  const std::vector<Pose> poses = solution.scene.used_poses();
  std::vector<size_t> used, own;
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    used.push_back(i);
    if (options.prior) own.push_back(*options.prior->index_of_id(tracks.cameras[i].id));
  }
  Placement result;
  double scale = 0;
  if (!tracks.board.empty()) {
    scale = 1;
    result.scale_from = "the board's size";
  } else if (placement.bar_length > 0) {
    if (!tracks.bar)
      throw Error("the bar's length is given, but the tracks are of one light; run the step track again with --bar");
    scale = placement.bar_length;
    result.scale_from = "the bar's length";
  } else if (placement.distance) {
    const auto position = [&](uint32_t id) {
      for (size_t i = 0; i < tracks.cameras.size(); i++)
        if (tracks.cameras[i].id == id && solution.scene.cameras[i].used)
          return solution.scene.cameras[i].pose().position;
      throw Error("the distance refers to camera " + std::to_string(id) +
                  ", which was not placed; choose two cameras that see the light often");
    };
    const double distance = glm::length(position(placement.distance->a) - position(placement.distance->b));
    if (!(placement.distance->metres > 0) || !(distance > 0))
      throw Error("the distance between two cameras must be positive");
    scale = placement.distance->metres / distance;
    result.scale_from = "the distance of two cameras";
  } else if (placement.pitch > 0) {
    scale = placement.pitch / neighbour_distance(poses);
    result.scale_from = "the pitch";
  }
  // A prior rig has a layout unless all its cameras are at one position.
  std::vector<Pose> layout;
  double extent = 0;
  if (options.prior)
    for (const Camera& camera : options.prior->cameras) layout.push_back(camera.pose);
  for (const size_t i : own) extent = std::max(extent, glm::length(layout[i].position - layout[own[0]].position));
  if (extent > 0) {
    const LayoutAlignment aligned =
        align_to_layout(poses, layout, own, scale > 0 ? std::optional(scale) : std::nullopt, common_turn(solution));
    result.world_from_scene = aligned.layout_from_scene;
    if (!(scale > 0)) result.scale_from = "the prior rig's layout";
    for (const Tracks::Camera& camera : tracks.cameras) result.stands_at.push_back(camera.id);
    for (size_t k = 0; k < used.size(); k++) result.stands_at[used[k]] = options.prior->cameras[aligned.place[k]].id;
    return result;
  }
  result.world_from_scene = scaled(own_frame(poses), scale > 0 ? scale : 1 / neighbour_distance(poses));
  return result;
}

Rig make_rig(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement) {
  std::vector<std::pair<size_t, Camera>> placed;  // by the place in the prior rig
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    const CameraState& state = solution.scene.cameras[i];
    if (!state.used) continue;
    const uint32_t id = tracks.cameras[i].id;
    auto& [place, camera] = placed.emplace_back(i, Camera());
    if (options.prior) {
      camera = options.prior->cameras[*options.prior->index_of_id(id)];
      place = *options.prior->index_of_id(placement.stands_at.empty() ? id : placement.stands_at[i]);
    } else {
      camera.id = id;
      camera.name = "cam_" + std::to_string(id);
      camera.width = state.width, camera.height = state.height;
    }
    camera.lens = state.lens();
    camera.pose = placement.world_from_scene(state.pose());
  }
  std::ranges::sort(placed, {}, [](const auto& entry) { return entry.first; });
  Rig rig;
  for (auto& [place, camera] : placed) rig.cameras.push_back(std::move(camera));
  if (!options.prior) return rig;
  if (placed.size() == options.prior->cameras.size()) rig.topology = options.prior->topology;
  rig.directory = options.prior->directory;
  return rig;
}

CameraCovariance covariance_in_rig(const Uncertainty& uncertainty, const Reconstruction& scene, size_t index,
                                   const Similarity& world_from_scene) {
  const int row = uncertainty.camera_row[index], n = uncertainty.camera_size, lens = n - 6;
  Eigen::MatrixXd to = Eigen::MatrixXd::Zero(n, n);
  const Mat3 turn = glm::mat3_cast(world_from_scene.rotation);
  for (int k = 0; k < lens; k++) to(k, 6 + k) = 1;
  for (int r = 0; r < 3; r++)
    for (int c = 0; c < 3; c++) {
      to(lens + r, 3 + c) = world_from_scene.scale * turn[c][r];
      to(lens + 3 + r, c) = turn[c][r];
    }
  const Eigen::MatrixXd m = to * uncertainty.covariance.block(row, row, n, n) * to.transpose();
  CameraCovariance covariance;
  for (const int term : uncertainty.lens_terms) covariance.parameters.push_back(scene.cameras[index].term_name(term));
  for (const char* name : {"x", "y", "z", "rx", "ry", "rz"}) covariance.parameters.push_back(name);
  for (int r = 0; r < n; r++)
    for (int c = 0; c < n; c++) covariance.matrix.push_back(m(r, c));
  return covariance;
}

}  // namespace lf
