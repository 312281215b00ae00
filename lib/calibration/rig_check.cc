// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/rig_check.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "calibration/multiview_geometry.h"

namespace lf {
namespace {

constexpr double kPlaceReach = 6;      // maximum reprojection error of an inlier, pixels
constexpr size_t kMinSights = 12;      // 24 equations for the 6 pose parameters
constexpr double kOutlierRatio = 4;    // ratio to the median displacement of cameras
constexpr double kCertain = 5;         // sigmas
constexpr double kMinFocal = 2e-3;     // relative
constexpr double kBetterByLens = 0.8;  // maximum ratio of residuals with and without a focal length change
constexpr int kMaxCheckRounds = 8, kSteps = 25;
constexpr int kPose = 6, kWithFocal = 7;

// A camera's observation of a light position from other cameras.
struct PointObservation {
  Vec3 at;  // in camera coordinates, with the rig's pose
  Vec2 pixel;
};

using Change = Eigen::Matrix<double, kWithFocal, 1>;  // translation, rotation, relative focal length

std::optional<Vec2> projected(const Camera& camera, const Vec3& at, const Change& change) {
  const Quat rotation = turned_by({change[3], change[4], change[5]});
  const auto pixel = camera.lens.project(glm::conjugate(rotation) * (at - Vec3(change[0], change[1], change[2])));
  if (!pixel) return std::nullopt;
  const Vec2 centre = camera.principal_point();
  return centre + (1 + change[6]) * (*pixel - centre);
}

struct ChangeFit {
  Change change = Change::Zero();
  Change sigma = Change::Zero();
  double left = 0;
};

double median_residual(const Camera& camera, const std::vector<PointObservation>& observations, const Change& change) {
  std::vector<double> lengths;
  for (const PointObservation& s : observations) {
    const auto pixel = projected(camera, s.at, change);
    lengths.push_back(pixel ? glm::length(*pixel - s.pixel) : 1e3);
  }
  return median(std::move(lengths));
}

// Fits a pose change, and a focal length change if `terms` is kWithFocal, to the observations: Gauss-Newton with Cauchy
// weights, scaled by the current residuals.
ChangeFit fit_change(const Camera& camera, const std::vector<PointObservation>& observations, int terms) {
  ChangeFit fit;
  using Information = Eigen::Matrix<double, kWithFocal, kWithFocal>;
  Information information;
  for (int step = 0; step < kSteps; step++) {
    const double scale = std::max(0.02, 2 * median_residual(camera, observations, fit.change));
    information = 1e-9 * Information::Identity();
    Change gradient = Change::Zero();
    for (const PointObservation& s : observations) {
      const auto now = projected(camera, s.at, fit.change);
      if (!now) continue;
      Eigen::Matrix<double, 2, kWithFocal> by = Eigen::Matrix<double, 2, kWithFocal>::Zero();
      bool known = true;
      for (int k = 0; k < terms; k++) {
        constexpr double kTiny = 1e-6;
        Change there = fit.change;
        there[k] += kTiny;
        const auto moved = projected(camera, s.at, there);
        if (!(known = known && moved)) break;
        by.col(k) << (moved->x - now->x) / kTiny, (moved->y - now->y) / kTiny;
      }
      if (!known) continue;
      const Eigen::Vector2d e(s.pixel.x - now->x, s.pixel.y - now->y);
      const double weight = 1 / (1 + e.squaredNorm() / (scale * scale));
      information += weight * by.transpose() * by;
      gradient += weight * by.transpose() * e;
    }
    const Change moved = information.ldlt().solve(gradient);
    if (!moved.allFinite()) break;
    fit.change += moved;
    if (moved.norm() < 1e-10) break;
  }
  fit.left = median_residual(camera, observations, fit.change);
  // For normal errors in x and y, the median length is 1.1774 sigmas.
  fit.sigma = information.inverse().diagonal().cwiseMax(0).cwiseSqrt() * (fit.left / 1.1774);
  for (int k = terms; k < kWithFocal; k++) fit.sigma[k] = 0;
  return fit;
}

class Checker {
 public:
  Checker(const Rig& rig, const Tracks& tracks) : tracks_(tracks) {
    lights_ = tracks.bar ? 2 : 1;
    lists_.resize(tracks.num_positions * lights_);
    for (uint32_t i = 0; i < tracks.observations.size(); i++) {
      const Observation& o = tracks.observations[i];
      lists_[o.position * lights_ + o.light].push_back(i);
    }
    for (const Tracks::Camera& seen : tracks.cameras) {
      const auto index = rig.index_of_id(seen.id);
      if (!index)
        throw Error("camera " + std::to_string(seen.id) +
                    " of the recording is not in the rig; use the rig file that the recording was made with");
      Camera camera = rig.cameras[*index];
      if (camera.width != seen.width || camera.height != seen.height)
        throw Error("camera " + std::to_string(seen.id) + " has " + size_text(seen.width, seen.height) +
                    " pixels in the recording, " + size_text(camera.width, camera.height) +
                    " in the rig: record with the size that the rig is calibrated for");
      // Relative to the first camera, to keep precision far from the origin.
      camera.pose.position -= rig.cameras[0].pose.position;
      CameraState state;
      state.set_pose(camera.pose);
      state.set_lens(camera.lens);
      state.width = camera.width, state.height = camera.height;
      state.used = true;
      cameras_.push_back(camera);
      states_.push_back(state);
    }
  }

  RigCheck run() {
    for (int round = 0; round < kMaxCheckRounds; round++) {
      place_lights();
      for (size_t i = 0; i < cameras_.size(); i++) judge(i);
      if (!remove_worst_cameras()) break;
    }
    return finish();
  }

 private:
  void place_lights() {
    points_.assign(lists_.size(), std::nullopt);
    for (size_t j = 0; j < lists_.size(); j++) {
      // Two cameras nearly always agree, so a third is required.
      if (const auto found = triangulate(states_, tracks_, lists_[j], kPlaceReach); found && found->agreement > 2)
        points_[j] = found->point;
    }
    observations_.assign(cameras_.size(), {});
    for (size_t j = 0; j < lists_.size(); j++)
      for (const uint32_t index : lists_[j]) {
        const Observation& o = tracks_.observations[index];
        if (points_[j])
          observations_[o.camera].push_back({cameras_[o.camera].pose.camera_from_world(*points_[j]), o.pixel});
      }
    if (std::ranges::none_of(points_, [](const auto& point) { return point.has_value(); }))
      throw Error(
          "no three cameras see the light consistently with this rig: does the rig belong to these cameras, and do the "
          "recordings have the right names?");
  }

  void judge(size_t i) {
    RigCheck::Camera& result = result_[i];
    result = {};
    result.id = cameras_[i].id;
    const std::vector<PointObservation>& seen = observations_[i];
    result.sights = seen.size();
    if (seen.size() < kMinSights) return;
    result.state = RigCheck::State::kHolds;
    result.residual_px = median_residual(cameras_[i], seen, Change::Zero());
    ChangeFit fit = fit_change(cameras_[i], seen, kPose);
    const ChangeFit with_focal = fit_change(cameras_[i], seen, kWithFocal);
    const double focal = std::abs(with_focal.change[6]);
    const bool lens =
        with_focal.left < kBetterByLens * fit.left && focal > kMinFocal && focal > kCertain * with_focal.sigma[6];
    if (lens) fit = with_focal, result.focal_change = fit.change[6];
    std::vector<double> shifts;
    for (const PointObservation& s : seen) {
      const auto then = projected(cameras_[i], s.at, Change::Zero()), now = projected(cameras_[i], s.at, fit.change);
      if (then && now) shifts.push_back(glm::length(*now - *then));
    }
    if (!shifts.empty()) result.shift_px = median(std::move(shifts));
    for (int k = 0; k < 3; k++) {
      result.move[k] = fit.change[k], result.move_sigma[k] = fit.sigma[k];
      result.turn[k] = fit.change[3 + k], result.turn_sigma[k] = fit.sigma[3 + k];
    }
  }

  double usual_shift() const {
    std::vector<double> shifts;
    for (size_t i = 0; i < cameras_.size(); i++)
      if (states_[i].used && result_[i].state != RigCheck::State::kUnknown) shifts.push_back(result_[i].shift_px);
    return shifts.empty() ? 0 : median(std::move(shifts));
  }
  double bound() const { return std::max(kMinShift, kOutlierRatio * usual_shift()); }

  // Excludes the cameras with the largest displacements, which bias the light positions. Readmits cameras that fit
  // again. Returns true if the selection changed.
  bool remove_worst_cameras() {
    const double most = bound();
    double worst = 0;
    size_t used = 0;
    bool changed = false;
    for (size_t i = 0; i < cameras_.size(); i++) {
      if (!states_[i].used && result_[i].shift_px <= most) states_[i].used = changed = true;
      used += states_[i].used;
      if (states_[i].used) worst = std::max(worst, result_[i].shift_px);
    }
    if (worst <= most) return changed;
    for (size_t i = 0; i < cameras_.size() && used > 3; i++)
      if (states_[i].used && result_[i].shift_px > std::max(most, worst / 2))
        states_[i].used = false, used--, changed = true;
    return changed;
  }

  RigCheck finish() {
    RigCheck check;
    const double most = bound();
    std::vector<double> residuals;
    size_t known = 0, off = 0;
    for (size_t i = 0; i < cameras_.size(); i++) {
      RigCheck::Camera& camera = result_[i];
      if (camera.state == RigCheck::State::kUnknown) continue;
      known++;
      if (camera.shift_px > most) {
        camera.state = camera.focal_change != 0 ? RigCheck::State::kLens : RigCheck::State::kMoved;
        off++;
      } else {
        residuals.push_back(camera.residual_px);
      }
    }
    check.is_lost = known < 3 || 2 * off >= known;
    check.shift_px = usual_shift();
    check.lights = static_cast<size_t>(std::ranges::count_if(points_, [](const auto& p) { return p.has_value(); }));
    if (!residuals.empty()) check.residual_px = median(std::move(residuals));
    measure_bar(check);
    check.cameras = std::move(result_);
    return check;
  }

  void measure_bar(RigCheck& check) const {
    if (lights_ < 2) return;
    std::vector<double> lengths;
    for (size_t j = 0; j + 1 < points_.size(); j += 2)
      if (points_[j] && points_[j + 1]) lengths.push_back(glm::length(*points_[j] - *points_[j + 1]));
    if (lengths.empty()) return;
    check.bar = median(lengths);
    for (double& length : lengths) length = std::abs(length - *check.bar);
    check.bar_spread = 1.4826 * median(std::move(lengths));
  }

  const Tracks& tracks_;
  size_t lights_ = 1;
  std::vector<std::vector<uint32_t>> lists_;  // observations of each light at each position
  std::vector<Camera> cameras_;
  std::vector<CameraState> states_;  // `used`: contributes to the light positions
  std::vector<std::optional<Vec3>> points_;
  std::vector<std::vector<PointObservation>> observations_;
  std::vector<RigCheck::Camera> result_ = std::vector<RigCheck::Camera>(tracks_.cameras.size());
};

}  // namespace

bool RigCheck::holds() const {
  return !is_lost && shift_px <= kMinShift && std::ranges::all_of(cameras, [](const Camera& camera) {
    return camera.state == State::kHolds || camera.state == State::kUnknown;
  });
}

RigCheck check_calibration(const Rig& rig, const Tracks& tracks) { return Checker(rig, tracks).run(); }

namespace {

using nlohmann::ordered_json;
using Severity = Finding::Severity;
using State = RigCheck::State;

constexpr double kDegrees = 180 / M_PI;
constexpr double kScaleOff = 0.01;  // relative
constexpr double kWorthSaying = 3;  // sigmas
constexpr double kMinTurn = 3e-4;   // radians
constexpr double kMinMove = 3e-4;   // metres

// Returns the significant components, largest first, e.g. "0.40 up, 0.12 left". Changes below `least` are within a
// rig's normal accuracy.
std::string parts(const Vec3& value, const Vec3& sigma, double least, double unit, const char* const names[3][2]) {
  std::array<int, 3> order = {0, 1, 2};
  std::ranges::sort(order, [&](int a, int b) { return std::abs(value[a]) > std::abs(value[b]); });
  std::string all;
  for (const int k : order)
    if (std::abs(value[k]) > std::max(least, kWorthSaying * sigma[k]) && std::abs(value[k]) > 0.1 * glm::length(value))
      all += (all.empty() ? "" : ", ") + format_text("%.2f %s", std::abs(value[k]) * unit, names[k][value[k] > 0]);
  return all;
}

std::string motion_of(const RigCheck::Camera& camera) {
  // Effect of positive angles about the axes right, down and forward.
  static constexpr const char* kTurns[3][2] = {
      {"down", "up"}, {"to the left", "to the right"}, {"anticlockwise", "clockwise"}};
  static constexpr const char* kMoves[3][2] = {{"to the left", "to the right"}, {"up", "down"}, {"back", "forward"}};
  std::string all;
  if (const std::string turn = parts(camera.turn, camera.turn_sigma, kMinTurn, kDegrees, kTurns); !turn.empty())
    all = "turned by " + turn + " (degrees)";
  if (const std::string move = parts(camera.move, camera.move_sigma, kMinMove, 1e3, kMoves); !move.empty())
    all += (all.empty() ? "" : ", ") + ("moved by " + move + " (mm)");
  return all.empty() ? "" : ": " + all;
}

const char* name_of(State state) {
  switch (state) {
    case State::kHolds: return "holds";
    case State::kMoved: return "moved";
    case State::kLens: return "lens";
    case State::kUnknown: break;
  }
  return "unknown";
}

const Camera& camera_of(const Rig& rig, const RigCheck::Camera& camera) {
  return rig.cameras[rig.index_of_id(camera.id).value()];
}

}  // namespace

std::vector<Finding> diagnose_check(const Rig& rig, const RigCheck& check, double bar_length) {
  std::vector<Finding> findings;
  if (check.is_lost) {
    findings.push_back({Severity::kError, "rig-lost",
                        "too many cameras deviate to identify the cameras that moved: calibrate the rig again"});
  } else {
    for (const RigCheck::Camera& camera : check.cameras) {
      const std::string who = camera_of(rig, camera).label();
      if (camera.state == State::kMoved)
        findings.push_back({Severity::kError, "moved-camera",
                            format_text("%s has moved, its image by %.1f pixels%s. Put it back, or calibrate again",
                                        who.c_str(), camera.shift_px, motion_of(camera).c_str())});
      if (camera.state == State::kLens)
        findings.push_back(
            {Severity::kError, "changed-lens",
             format_text(
                 "%s: its focal length has changed by %+.1f %%, displacing its image by %.1f pixels: was focus or zoom "
                 "turned, or is autofocus on? Fix the focus, then calibrate again",
                 who.c_str(), 100 * camera.focal_change, camera.shift_px)});
    }
    if (check.shift_px > kMinShift)
      findings.push_back({Severity::kError, "rig-off",
                          format_text("all cameras are off by about %.1f pixels in different directions: the rig was "
                                      "bent, or its calibration is "
                                      "less accurate than stated. Calibrate again",
                                      check.shift_px)});
  }
  for (const RigCheck::Camera& camera : check.cameras)
    if (camera.state == State::kUnknown)
      findings.push_back(
          {Severity::kWarning, "unseen-camera",
           format_text("%s saw the light at only %zu positions, too few for a check. Move the light in front of this "
                       "camera too",
                       camera_of(rig, camera).label().c_str(), camera.sights)});
  if (check.bar && bar_length > 0 && std::abs(*check.bar / bar_length - 1) > kScaleOff)
    findings.push_back({Severity::kWarning, "wrong-scale",
                        format_text("the bar measures %.1f mm in this rig instead of %.1f mm: %s", 1e3 * *check.bar,
                                    1e3 * bar_length, "the rig's scale is wrong, or it is a different bar")});
  return findings;
}

ordered_json check_report(const Rig& rig, const RigCheck& check, const std::vector<Finding>& findings) {
  const auto triple = [](const Vec3& v, double unit) {
    return ordered_json::array({v.x * unit, v.y * unit, v.z * unit});
  };
  ordered_json report = {{"format", "lightfield-check"}, {"version", 1},           {"from", "tracks"},
                         {"holds", check.holds()},       {"lights", check.lights}, {"residual_px", check.residual_px},
                         {"shift_px", check.shift_px}};
  if (check.bar) report["bar_metres"] = *check.bar;
  report["findings"] = to_json(findings);
  report["cameras"] = ordered_json::array();
  for (const RigCheck::Camera& camera : check.cameras) {
    report["cameras"].push_back({{"id", camera.id},
                                 {"name", camera_of(rig, camera).name},
                                 {"state", name_of(camera.state)},
                                 {"sights", camera.sights},
                                 {"residual_px", camera.residual_px},
                                 {"shift_px", camera.shift_px},
                                 {"move_mm", triple(camera.move, 1e3)},
                                 {"move_sigma_mm", triple(camera.move_sigma, 1e3)},
                                 {"turn_deg", triple(camera.turn, kDegrees)},
                                 {"turn_sigma_deg", triple(camera.turn_sigma, kDegrees)},
                                 {"focal_change", camera.focal_change}});
  }
  return report;
}

}  // namespace lf
