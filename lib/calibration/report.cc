// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/report.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "calibration/multiview_geometry.h"
#include "calibration/noise.h"

namespace lf {
namespace {

using nlohmann::ordered_json;

struct ErrorStatistics {
  std::vector<double> lengths;

  double mean() const {
    double sum = 0;
    for (const double l : lengths) sum += l;
    return lengths.empty() ? 0 : sum / static_cast<double>(lengths.size());
  }
  double rms() const {
    double sum = 0;
    for (const double l : lengths) sum += l * l;
    return lengths.empty() ? 0 : std::sqrt(sum / static_cast<double>(lengths.size()));
  }
  void put(ordered_json& value) const {
    value["mean_px"] = mean();
    value["median_px"] = lengths.empty() ? 0 : median(lengths);
    value["rms_px"] = rms();
  }
};

}  // namespace

const char* name_of(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::kNote: return "note";
    case Finding::Severity::kWarning: return "warning";
    case Finding::Severity::kError: break;
  }
  return "error";
}

ordered_json to_json(const std::vector<Finding>& findings) {
  ordered_json list = ordered_json::array();
  for (const Finding& f : findings)
    list.push_back({{"severity", name_of(f.severity)}, {"code", f.code}, {"text", f.text}});
  return list;
}

ordered_json calibration_report(const Solution& solution, const Tracks& tracks, const Placement& placement,
                                const std::vector<Finding>& findings) {
  const auto lengths = residual_lengths(solution.scene, tracks.observations);
  ErrorStatistics all, inliers;
  std::vector<ErrorStatistics> cameras(tracks.cameras.size());
  std::vector<size_t> given(tracks.cameras.size()), outliers(tracks.cameras.size());
  size_t unplaced = 0;
  for (size_t i = 0; i < lengths.size(); i++) {
    const uint32_t camera = tracks.observations[i].camera;
    given[camera]++;
    if (lengths[i] < 0) {
      unplaced++;
      continue;
    }
    all.lengths.push_back(lengths[i]);
    if (solution.inliers[i]) {
      inliers.lengths.push_back(lengths[i]);
      cameras[camera].lengths.push_back(lengths[i]);
    } else {
      outliers[camera]++;
    }
  }
  ordered_json report = {{"format", "lightfield-calibration"}, {"version", 1}};
  all.put(report);
  report["expected_rms_px"] = solution.expected_rms;
  report["observations"] = tracks.observations.size();
  report["unplaced"] = unplaced;
  report["outliers"] = all.lengths.size() - inliers.lengths.size();
  report["inliers"] = {{"observations", inliers.lengths.size()}};
  inliers.put(report["inliers"]);
  report["sigma_px"] = solution.sigma;
  if (solution.disagreement > 0) report["disagreement_of_halves"] = solution.disagreement;
  report["model"] = solution.distortion.name();
  report["models"] = ordered_json::array();
  for (const ModelTrial& trial : solution.trials)
    report["models"].push_back({{"model", trial.model},
                                {"bic", trial.bic},
                                {"transfer_px", trial.transfer_px ? ordered_json(*trial.transfer_px) : nullptr},
                                {"chosen", trial.chosen}});
  report["scale_from"] = placement.scale_from;
  report["findings"] = to_json(findings);
  report["cameras"] = ordered_json::array();
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    report["cameras"].push_back({{"id", tracks.cameras[i].id},
                                 {"found", solution.scene.cameras[i].used},
                                 {"observations", given[i]},
                                 {"outliers", outliers[i]},
                                 {"rms_px", cameras[i].rms()}});
    if (!placement.stands_at.empty() && placement.stands_at[i] != tracks.cameras[i].id)
      report["cameras"].back()["stands_at"] = placement.stands_at[i];
  }
  return report;
}

nlohmann::json rig_record(const Solution& solution, const Tracks& tracks, const Placement& placement,
                          nlohmann::json original, const std::string& program) {
  using nlohmann::json;
  json kept = json::array();
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    if (!solution.scene.cameras[i].used) continue;
    json camera = {{"id", tracks.cameras[i].id}};
    if (original.contains("cameras"))
      for (const json& known : original["cameras"])
        if (known["id"] == tracks.cameras[i].id) camera = known;
    camera["covariance"] = json::parse(
        to_json(covariance_in_rig(solution.uncertainty, solution.scene, i, placement.world_from_scene)).dump());
    kept.push_back(std::move(camera));
  }
  original["cameras"] = kept;
  original["provenance"]["calibration"] = {
      {"program", program}, {"sigma_px", solution.sigma}, {"scale_from", placement.scale_from}};
  return original;
}

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Minimum length of the mean viewing direction for an array that looks in one direction.
constexpr double kOneWay = 0.8;
constexpr double kFlat = 0.1;       // share of the array's extent below which it has no extent along an axis
constexpr double kSoftPercent = 1;  // percent, of depth and of aspect ratio
constexpr double kSoftTurn = 0.5;   // degrees
constexpr double kSoftPlace = 0.1;  // in units of the distance between neighbours
constexpr int kModeDepths = 12;

// Centre and axes of the array, in the frame and scale of the solution.
struct ArrayFrame {
  Vec3 middle{0, 0, 0}, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  double extent = 0;  // RMS distance from the centre
  bool one_way = false;

  explicit ArrayFrame(const Reconstruction& scene) {
    Vec3 forward(0, 0, 0), right(0, 0, 0);
    std::vector<Vec3> centres;
    for (const Pose& pose : scene.used_poses()) {
      centres.push_back(pose.position), middle += pose.position, forward += pose.forward(), right += pose.right();
    }
    const auto n = static_cast<double>(centres.size());
    middle /= n;
    extent = spread(centres);
    one_way = glm::length(forward) / n > kOneWay;
    if (!one_way) return;
    z = glm::normalize(forward);
    x = glm::normalize(right - glm::dot(right, z) * z);
    y = glm::cross(z, x);
  }
};

class SoftModeFinder {
 public:
  SoftModeFinder(const Solution& solution, const Placement& placement)
      : scene_(solution.scene), u_(solution.uncertainty), scale_(placement.world_from_scene.scale), frame_(scene_) {
    for (size_t i = 0; i < scene_.cameras.size(); i++)
      if (u_.camera_row[i] >= 0) used_.push_back(i);
    neighbours_ = neighbour_distance(scene_.used_poses());
    n_ = static_cast<double>(used_.size());
  }

  std::vector<SoftMode> run() {
    depth();
    if (frame_.one_way) {
      gaze();
      toe_in();
      bow();
      proportions();
    }
    each();
    std::ranges::stable_sort(all_, std::greater<>(), [](const SoftMode& m) { return m.sigma / m.limit; });
    return std::move(all_);
  }

 private:
  VectorXd nothing() const { return VectorXd::Zero(u_.covariance.rows()); }
  void add(const char* code, double sigma, const char* unit, double limit, std::string what) {
    all_.push_back({code, std::move(what), sigma, unit, limit});
  }
  double along(size_t camera, const Vec3& axis) const {
    return glm::dot(scene_.cameras[camera].pose().position - frame_.middle, axis);
  }
  bool reaches(const Vec3& axis) const {
    double sum = 0;
    for (const size_t i : used_) sum += along(i, axis) * along(i, axis);
    return std::sqrt(sum / n_) > kFlat * frame_.extent;
  }
  void put(VectorXd& weights, int row, const Vec3& axis, double factor) const {
    for (int k = 0; k < 3; k++) weights[row + k] += factor * axis[k];
  }

  void depth() {
    if (u_.lens_terms.empty() || u_.lens_terms[0] != kF) return;
    VectorXd w = nothing();
    for (const size_t i : used_) w[u_.camera_row[i] + 6] = 1 / (n_ * scene_.cameras[i].lens_terms()[kF]);
    const double percent = 100 * u_.sigma_of(w);
    add("depth", percent, "%", kSoftPercent,
        format_text(
            "Depth scale: the common error of focal lengths and depths has a standard deviation of %.2g %%, or %.2g cm "
            "at 2 m",
            percent, 2 * percent));
  }

  void gaze() {
    double most = 0;
    for (const Vec3& axis : {frame_.x, frame_.y}) {
      VectorXd w = nothing();
      for (const size_t i : used_) put(w, u_.camera_row[i], axis, 1 / n_);
      most = std::max(most, glm::degrees(u_.sigma_of(w)));
    }
    add("gaze", most, "degrees", kSoftTurn,
        format_text("Common viewing direction relative to the array's surface: standard deviation %.2g degrees. An "
                    "error shears the whole scene without visible residuals",
                    most));
  }

  void toe_in() {
    double most = 0;
    for (const auto& [across, about] : {std::pair(frame_.x, frame_.y), std::pair(frame_.y, frame_.x)}) {
      if (!reaches(across)) continue;
      double squares = 0, widest = 0;
      for (const size_t i : used_) {
        squares += along(i, across) * along(i, across);
        widest = std::max(widest, std::abs(along(i, across)));
      }
      VectorXd w = nothing();
      for (const size_t i : used_) put(w, u_.camera_row[i], about, widest * along(i, across) / squares);
      most = std::max(most, glm::degrees(u_.sigma_of(w)));
    }
    if (most > 0)
      add("toe-in", most, "degrees", kSoftTurn,
          format_text("Toe-in of the cameras at the edges: standard deviation %.2g degrees. An error bends depths",
                      most));
  }

  void bow() {
    if (!reaches(frame_.x) && !reaches(frame_.y)) return;
    std::vector<double> radii;
    double mean = 0, squares = 0;
    for (const size_t i : used_) {
      const double x = along(i, frame_.x), y = along(i, frame_.y);
      radii.push_back(x * x + y * y), mean += radii.back() / n_;
    }
    for (double& r : radii) r -= mean, squares += r * r;
    if (!(squares > 1e-12 * std::pow(frame_.extent, 4))) return;  // on a ring, all radii are equal
    const double range = *std::ranges::max_element(radii) - *std::ranges::min_element(radii);
    VectorXd w = nothing();
    for (size_t k = 0; k < used_.size(); k++) put(w, u_.camera_row[used_[k]] + 3, frame_.z, range * radii[k] / squares);
    const double mm = 1e3 * scale_ * u_.sigma_of(w);
    add("bow", mm, "mm", 1e3 * scale_ * kSoftPlace * neighbours_,
        format_text("Forward bulge in the middle of the array: standard deviation %.2g mm", mm));
  }

  void proportions() {
    if (!reaches(frame_.x) || !reaches(frame_.y)) return;
    double xx = 0, yy = 0;
    for (const size_t i : used_) xx += std::pow(along(i, frame_.x), 2), yy += std::pow(along(i, frame_.y), 2);
    VectorXd w = nothing();
    for (const size_t i : used_) {
      put(w, u_.camera_row[i] + 3, frame_.x, along(i, frame_.x) / xx);
      put(w, u_.camera_row[i] + 3, frame_.y, -along(i, frame_.y) / yy);
    }
    const double percent = 100 * u_.sigma_of(w);
    add("proportions", percent, "%", kSoftPercent,
        format_text("Ratio of width to height of the array: standard deviation %.2g %%", percent));
  }

  void each() {
    double place = 0, turn = 0;
    for (const size_t i : used_) {
      place += u_.covariance.diagonal().segment(u_.camera_row[i] + 3, 3).sum() / n_;
      turn += u_.covariance.diagonal().segment(u_.camera_row[i], 3).sum() / n_;
    }
    const double mm = 1e3 * scale_ * std::sqrt(place), degrees = glm::degrees(std::sqrt(turn));
    add("places", mm, "mm", 1e3 * scale_ * kSoftPlace * neighbours_,
        format_text("Positions of single cameras in the array: standard deviation %.2g mm (RMS)", mm));
    add("directions", degrees, "degrees", kSoftTurn,
        format_text("Orientations of single cameras: standard deviation %.2g degrees (RMS)", degrees));
  }

  const Reconstruction& scene_;
  const Uncertainty& u_;
  const double scale_;
  const ArrayFrame frame_;
  std::vector<size_t> used_;
  double n_ = 0, neighbours_ = 0;
  std::vector<SoftMode> all_;
};

// Derivatives of a projection by the camera's parameters and by the point. Returns nullopt if the point is not visible.
struct PointProjection {
  MatrixXd by_camera;
  Eigen::Matrix<double, 2, 3> by_point;
};
std::optional<PointProjection> project(const CameraState& camera, const Vec3& point, const Uncertainty& u) {
  const auto pixel = [](const CameraState& state, const Vec3& at) { return residual(state, TargetState::at(at), {}); };
  const auto at = pixel(camera, point);
  if (!at || at->x < -0.5 || at->y < -0.5 || at->x > camera.width - 0.5 || at->y > camera.height - 0.5)
    return std::nullopt;
  PointProjection result{MatrixXd(2, u.camera_size), {}};
  const double depth = glm::length(point - camera.pose().position);
  const auto difference = [&](const CameraState& state, const Vec3& there, double step) -> Eigen::Vector2d {
    const auto moved = pixel(state, there);
    return moved ? Eigen::Vector2d((moved->x - at->x) / step, (moved->y - at->y) / step) : Eigen::Vector2d::Zero();
  };
  for (int k = 0; k < u.camera_size; k++) {
    CameraState moved = camera;
    double step = 1e-6;
    if (k < 3) {
      Vec3 axis(0, 0, 0);
      axis[k] = 1;
      const Pose pose = camera.pose();
      moved.set_pose({pose.position, glm::angleAxis(step, axis) * pose.orientation});
    } else if (k < 6) {
      step *= depth;
      moved.v[static_cast<size_t>(4 + k - 3)] += step;
    } else {
      const int term = u.lens_terms[static_cast<size_t>(k - 6)];
      step *= std::max(1.0, std::abs(camera.lens_terms()[term]));
      moved.lens_terms()[term] += step;
    }
    result.by_camera.col(k) = difference(moved, point, step);
  }
  for (int k = 0; k < 3; k++) {
    Vec3 there = point;
    const double step = 1e-6 * depth;
    there[k] += step;
    result.by_point.col(k) = difference(camera, there, step);
  }
  return result;
}

std::optional<double> squared_error(const Solution& solution, size_t of, const Vec3& point) {
  const Uncertainty& u = solution.uncertainty;
  const auto own = project(solution.scene.cameras[of], point, u);
  if (!own) return std::nullopt;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  MatrixXd weights = MatrixXd::Zero(3, u.covariance.rows());
  int others = 0;
  for (size_t i = 0; i < solution.scene.cameras.size(); i++) {
    if (i == of || u.camera_row[i] < 0) continue;
    const auto seen = project(solution.scene.cameras[i], point, u);
    if (!seen) continue;
    others++;
    information += seen->by_point.transpose() * seen->by_point;
    weights.middleCols(u.camera_row[i], u.camera_size) = seen->by_point.transpose() * seen->by_camera;
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(information);
  if (others < 2 || !lu.isInvertible()) return std::nullopt;
  MatrixXd by_steps = own->by_point * -lu.solve(weights);
  by_steps.middleCols(u.camera_row[of], u.camera_size) += own->by_camera;
  return (by_steps * u.covariance * by_steps.transpose()).trace();
}

}  // namespace

std::vector<SoftMode> soft_modes(const Solution& solution, const Placement& placement) {
  return SoftModeFinder(solution, placement).run();
}

LightRange light_range(const Solution& solution, const Placement& placement) {
  const ArrayFrame frame(solution.scene);
  std::vector<double> depths;
  for (const TargetState& target : solution.scene.targets) {
    if (target.kind == TargetState::Kind::kNone) continue;
    const Vec3 at = Vec3(target.v[0], target.v[1], target.v[2]) - frame.middle;
    depths.push_back(placement.world_from_scene.scale * (frame.one_way ? glm::dot(at, frame.z) : glm::length(at)));
  }
  if (depths.empty()) return {};
  std::ranges::sort(depths);
  return {depths[depths.size() / 20], depths[depths.size() - 1 - depths.size() / 20]};
}

std::vector<ProjectionError> projection_errors(const Solution& solution, const Placement& placement) {
  const ArrayFrame frame(solution.scene);
  const LightRange range = light_range(solution, placement);
  std::vector<ProjectionError> errors;
  if (!frame.one_way || !(range.near > 0)) return errors;
  for (int d = 0; d < kModeDepths; d++) {
    const double share = d / (kModeDepths - 1.0);
    ProjectionError error;
    error.depth = range.near / 2 * std::pow(4 * range.far / range.near, share);
    std::vector<double> cameras;
    for (size_t i = 0; i < solution.scene.cameras.size(); i++) {
      const CameraState& camera = solution.scene.cameras[i];
      if (!camera.used) continue;
      double sum = 0, count = 0;
      for (const Vec2& place : {Vec2(0.5, 0.5), Vec2(0.25, 0.25), Vec2(0.75, 0.7)}) {
        const auto ray = camera.lens().unproject({place.x * camera.width - 0.5, place.y * camera.height - 0.5});
        if (!ray) continue;
        const Pose pose = camera.pose();
        const Vec3 direction = pose.rotation() * Vec3(*ray, 1);
        const double along = glm::dot(direction, frame.z);
        if (!(along > 0)) continue;
        const double depth = error.depth / placement.world_from_scene.scale;
        const Vec3 point =
            pose.position + direction * ((depth - glm::dot(pose.position - frame.middle, frame.z)) / along);
        if (const auto squared = squared_error(solution, i, point)) sum += *squared, count++;
      }
      if (count > 0) cameras.push_back(std::sqrt(sum / count));
    }
    if (cameras.empty()) continue;
    error.worst = *std::ranges::max_element(cameras);
    error.middle = median(std::move(cameras));
    errors.push_back(error);
  }
  return errors;
}

namespace {

constexpr int kColumns = 8, kRows = 6;  // cells of the coverage map per image
constexpr size_t kMaxResiduals = 60;

double rounded(double value) { return std::round(value * 1e4) / 1e4; }

ordered_json triple(const Vec3& v) { return {v.x, v.y, v.z}; }

void add_observations(const Solution& solution, const Tracks& tracks, const std::vector<uint32_t>& own, size_t camera,
                      ordered_json& value) {
  const CameraState& state = solution.scene.cameras[camera];
  std::vector<int> counts(kColumns * kRows);
  ordered_json residuals = ordered_json::array();
  const size_t every = (own.size() + kMaxResiduals - 1) / kMaxResiduals;
  for (size_t k = 0; k < own.size(); k++) {
    const Observation& o = tracks.observations[own[k]];
    if (!solution.inliers[own[k]]) continue;
    const int column = static_cast<int>((o.pixel.x + 0.5) * kColumns / state.width);
    const int row = static_cast<int>((o.pixel.y + 0.5) * kRows / state.height);
    counts[static_cast<size_t>(std::clamp(row, 0, kRows - 1) * kColumns + std::clamp(column, 0, kColumns - 1))]++;
    if (k % every != 0) continue;
    if (const auto e = solution.scene.residual_of(o))
      residuals.push_back({rounded(o.pixel.x), rounded(o.pixel.y), rounded(e->x), rounded(e->y)});
  }
  value["coverage"] = counts;
  value["residuals"] = std::move(residuals);
}

}  // namespace

void add_details(const Solution& solution, const Tracks& tracks, const Placement& placement, const Rig& rig,
                 ordered_json& report) {
  const LightRange range = light_range(solution, placement);
  report["lights"] = {{"near_m", range.near}, {"far_m", range.far}};
  report["projection"] = ordered_json::array();
  for (const ProjectionError& error : projection_errors(solution, placement))
    report["projection"].push_back({{"depth_m", error.depth}, {"median_px", error.middle}, {"worst_px", error.worst}});
  report["soft_modes"] = ordered_json::array();
  for (const SoftMode& mode : soft_modes(solution, placement))
    report["soft_modes"].push_back({{"code", mode.code},
                                    {"text", mode.text},
                                    {"sigma", mode.sigma},
                                    {"unit", mode.unit},
                                    {"limit", mode.limit},
                                    {"soft", mode.is_soft()}});
  report["coverage"] = {{"columns", kColumns}, {"rows", kRows}};
  const auto lists = observations_of_cameras(tracks);
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    ordered_json& value = report["cameras"][i];
    value["width"] = tracks.cameras[i].width, value["height"] = tracks.cameras[i].height;
    add_observations(solution, tracks, lists[i], i, value);
    const auto index = rig.index_of_id(tracks.cameras[i].id);
    if (!index || !solution.scene.cameras[i].used) continue;
    value["name"] = rig.cameras[*index].name;
    value["position"] = triple(rig.cameras[*index].pose.position);
    value["forward"] = triple(rig.cameras[*index].pose.forward());
    const CameraCovariance covariance =
        covariance_in_rig(solution.uncertainty, solution.scene, i, placement.world_from_scene);
    const size_t first = *covariance.index_of("x");
    value["position_covariance"] = ordered_json::array();
    for (size_t r = 0; r < 3; r++)
      value["position_covariance"].push_back(
          {covariance.at(first + r, first), covariance.at(first + r, first + 1), covariance.at(first + r, first + 2)});
  }
}

}  // namespace lf
