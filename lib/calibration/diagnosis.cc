// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include <Eigen/Eigenvalues>

#include "base/text.h"
#include "calibration/initial_layout.h"
#include "calibration/multiview_geometry.h"

namespace lf {
namespace {

constexpr size_t kMinTrackDetections = 5;  // per track; its position and motion absorb some residuals
constexpr double kMost = 30;               // sigmas; upper limit of a residual
constexpr double kAlike = 0.7;             // minimum explained share of a track's squared residuals
constexpr double kSure = 25;               // minimum explained squared residuals, in squared sigmas
// If one camera has a larger share of the squared times, its pose is wrong, not its time.
constexpr double kAlone = 0.5;
constexpr int kMaxLeftOut = 4;

struct MovingObservation {
  Eigen::Index camera;
  Vec2 error;  // pixels
};
struct MovingTrack {
  std::vector<MovingObservation> sights;
  bool good = false;  // true if the solution relies on the track
};

std::vector<MovingTrack> tracks_of(const Solution& solution, const Tracks& tracks) {
  std::vector<MovingTrack> list;
  const double most = kMost * solution.sigma;
  for (const auto& sights : observations_of_positions(tracks)) {
    MovingTrack track;
    size_t good = 0;
    for (const uint32_t index : sights) {
      const Observation& o = tracks.observations[index];
      const auto e = solution.scene.residual_of(o);
      if (!e) continue;
      const double length = glm::length(*e);
      track.sights.push_back({static_cast<Eigen::Index>(o.camera), length > most ? *e * (most / length) : *e});
      good += solution.inliers[index];
    }
    track.good = 2 * good > track.sights.size();
    if (track.sights.size() >= kMinTrackDetections) list.push_back(std::move(track));
  }
  return list;
}

// Returns the component that the residuals of all tracks have in common, as one number per camera; empty if the errors
// are independent.
Eigen::VectorXd times_of(const std::vector<MovingTrack>& tracks, size_t cameras) {
  const auto n = static_cast<Eigen::Index>(cameras);
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(n, n);
  for (const MovingTrack& track : tracks)
    for (const MovingObservation& a : track.sights)
      for (const MovingObservation& b : track.sights) common(a.camera, b.camera) += glm::dot(a.error, b.error);
  for (int left_out = 0; left_out <= kMaxLeftOut; left_out++) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(common);
    const Eigen::VectorXd times = eigen.eigenvectors().col(n - 1);
    Eigen::Index alone;
    if (times.cwiseAbs2().maxCoeff(&alone) < kAlone) return times;
    common.row(alone).setZero(), common.col(alone).setZero();
  }
  return {};
}

}  // namespace

MovingScene find_motion(const Solution& solution, const Tracks& tracks) {
  MovingScene found;
  const std::vector<MovingTrack> list = tracks_of(solution, tracks);
  const Eigen::VectorXd times = times_of(list, tracks.cameras.size());
  if (list.empty() || times.size() == 0) return found;
  double moved = 0, good = 0, good_moved = 0, squares = 0, sights = 0;
  const double variance = solution.sigma * solution.sigma;
  for (const MovingTrack& track : list) {
    Vec2 along(0, 0);
    double all = 0, weight = 0;
    for (const MovingObservation& s : track.sights) {
      along += s.error * times[s.camera];
      weight += times[s.camera] * times[s.camera], all += glm::dot(s.error, s.error);
    }
    const double explained = weight > 0 ? glm::dot(along, along) / weight : 0;
    const bool moves = explained > kAlike * all && explained > kSure * variance;
    good += track.good;
    if (!moves) continue;
    moved++, good_moved += track.good;
    squares += explained, sights += static_cast<double>(track.sights.size());
  }
  found.share = moved / static_cast<double>(list.size());
  found.used_share = good > 0 ? good_moved / good : 0;
  found.shift_px = sights > 0 ? std::sqrt(squares / sights) : 0;
  return found;
}

namespace {

using Severity = Finding::Severity;

constexpr double kUninformative = 0.8;  // ratio to the prior sigma
constexpr double kSoftDepth = 0.01;     // share of the depth
constexpr double kSoftPosition = 0.1;   // in units of the distance between neighbours
constexpr double kSoftRotation = 0.01;  // radians
constexpr double kRow = 0.1;            // width of a row of cameras, relative to its length
constexpr double kManyOutliers = 0.2;   // share of a camera's observations
constexpr int kMaxFrames = 5;
constexpr double kBatchContradiction = 4;        // sigmas of the batch mean
constexpr double kAgreement = 1.2;               // disagreement of halves of the tracks below which it may be chance
constexpr double kClosest = 1e-3, kWidest = 10;  // metres between neighbours
constexpr double kMoved = 0.04;                  // share of the tracks; fewer are mismatches
constexpr size_t kMaxNamed = 12;

class Diagnosis {
 public:
  Diagnosis(const Solution& solution, const Tracks& tracks, const SolveOptions& options, const Placement& placement)
      : solution_(solution),
        tracks_(tracks),
        options_(options),
        placement_(placement),
        by_camera_(observations_of_cameras(tracks)) {}

  std::vector<Finding> run() {
    for (size_t i = 0; i < tracks_.cameras.size(); i++) judge_camera(i);
    find_groups();
    find_swaps();
    judge_lenses();
    judge_poses();
    judge_modes();
    judge_halves();
    judge_motion();
    judge_scale();
    return std::move(findings_);
  }

 private:
  void add(Severity severity, const char* code, std::string what) {
    findings_.push_back({severity, code, std::move(what)});
  }
  const char* target() const { return tracks_.board.empty() ? "light" : "board"; }
  unsigned id(size_t camera) const { return tracks_.cameras[camera].id; }
  const Reconstruction& scene() const { return solution_.scene; }

  void judge_camera(size_t i) {
    const auto& list = by_camera_[i];
    if (list.empty()) {
      add(Severity::kError, "dead-camera",
          format_text("camera %u never saw the %s: it is not in the rig", id(i), target()));
      return;
    }
    size_t outliers = 0;
    for (const uint32_t index : list) outliers += !solution_.inliers[index];
    const double share = static_cast<double>(outliers) / static_cast<double>(list.size());
    const bool found = scene().cameras[i].used;
    const double noise = i < solution_.camera_noise.size() ? solution_.camera_noise[i] : 1;
    if (found && share <= kManyOutliers && noise <= 1) return;
    if (const int frames = frames_late(i); frames != 0) {
      add(Severity::kError, "late-camera",
          format_text("camera %u is %d frame%s %s: its tracks fit after a shift by that number of frames", id(i),
                      std::abs(frames), std::abs(frames) == 1 ? "" : "s", frames > 0 ? "late" : "early"));
      return;
    }
    if (!found)
      add(Severity::kError, "camera-not-found",
          format_text("camera %u could not be placed (%zu observations): it is not in the rig. %s", id(i), list.size(),
                      options_.prior ? "Is its id correct, was it moved, or does its lens differ from the prior rig?"
                                     : "Is it another camera's recording, or was the camera moved?"));
    else if (share <= kManyOutliers)
      add(Severity::kWarning, "noisy-camera",
          format_text("camera %u: its residuals are %.1f times the median: is it out of focus, or was it moved?", id(i),
                      noise));
    else if (share > 2 * typical_outliers())
      add(Severity::kWarning, "many-outliers",
          format_text("camera %u: %.0f %% of its observations are outliers", id(i), share * 100));
  }

  double typical_outliers() const {
    const auto bad = std::count(solution_.inliers.begin(), solution_.inliers.end(), 0);
    return static_cast<double>(bad) / static_cast<double>(std::max<size_t>(1, solution_.inliers.size()));
  }

  // Returns the shift in frames that makes a camera's tracks fit, or 0. The pose is estimated again for each shift,
  // because a pose between the neighbours could fit the same positions.
  int frames_late(size_t i) const {
    if (!tracks_.ordered) return 0;
    int best = 0;
    double most = 0, now = 0;
    for (int frames = -kMaxFrames; frames <= kMaxFrames; frames++) {
      Tracks moved = tracks_;
      for (const uint32_t index : by_camera_[i]) {
        const int64_t position = int64_t{moved.observations[index].position} - frames;
        moved.observations[index].position =
            static_cast<uint32_t>(std::clamp<int64_t>(position, 0, static_cast<int64_t>(tracks_.num_positions) - 1));
      }
      Reconstruction trial = scene();
      trial.cameras[i].used = false;
      if (resect_cameras(trial, moved, kResection) < 1 || !trial.cameras[i].used) continue;
      double fit = 0;
      for (const uint32_t index : by_camera_[i]) {
        const auto e = trial.residual_of(moved.observations[index]);
        if (e) fit += std::max(0.0, 1 - glm::dot(*e, *e) / (kResection * kResection));
      }
      if (frames == 0) now = fit;
      if (fit > most) most = fit, best = frames;
    }
    return most > 1.5 * now + 4 ? best : 0;
  }

  void find_groups() {
    std::vector<size_t> group(tracks_.cameras.size());
    std::iota(group.begin(), group.end(), 0);
    const auto root = [&](size_t i) {
      while (group[i] != i) i = group[i] = group[group[i]];
      return i;
    };
    const auto positions = observations_of_positions(tracks_);
    for (const auto& list : positions)
      for (const uint32_t index : list)
        group[root(tracks_.observations[index].camera)] = root(tracks_.observations[list[0]].camera);
    std::map<size_t, std::vector<size_t>> groups;
    for (size_t i = 0; i < group.size(); i++)
      if (!by_camera_[i].empty()) groups[root(i)].push_back(i);
    if (groups.size() < 2) return;
    std::string names;
    for (const auto& [first, members] : groups) {
      names += names.empty() ? "{" : ", {";
      for (size_t k = 0; k < members.size() && k < 8; k++) names += (k ? " " : "") + std::to_string(id(members[k]));
      names += members.size() > 8 ? " ...}" : "}";
    }
    add(Severity::kError, "disconnected-groups",
        format_text("these groups of cameras never see the %s at the same time, so their relative poses are unknown: ",
                    target()) +
            names);
  }

  // Reports cameras at another camera's place in the prior rig. Each cycle of the permutation is one finding.
  void find_swaps() {
    std::map<unsigned, unsigned> at;  // occupied place, for each camera that is not at its own place
    for (size_t i = 0; i < placement_.stands_at.size(); i++)
      if (scene().cameras[i].used && placement_.stands_at[i] != id(i)) at[id(i)] = placement_.stands_at[i];
    if (at.size() > kMaxNamed) {
      std::string all;
      for (const auto& [camera, place] : at) all += format_text("%s%u at %u", all.empty() ? "" : ", ", camera, place);
      add(Severity::kError, "swapped-cameras",
          format_text(
              "%zu cameras are not at their places in the prior rig%s. The new rig lists cameras in the order of their "
              "actual places. Cameras and their places: ",
              at.size(), 4 * at.size() > 3 * scene().cameras.size() ? " (is the array mounted upside down?)" : "") +
              all);
      return;
    }
    while (!at.empty()) {
      const unsigned first = at.begin()->first;
      std::vector<unsigned> circle;
      for (auto next = at.find(first); next != at.end(); next = at.find(circle.back())) {
        if (circle.empty()) circle.push_back(first);
        circle.push_back(next->second);
        at.erase(next);
      }
      if (circle.size() == 3 && circle[2] == first) {
        add(Severity::kError, "swapped-cameras",
            format_text(
                "cameras %u and %u have swapped places in the prior rig: check their ids and cables. The new rig lists "
                "cameras in the order of their places",
                circle[0], circle[1]));
        continue;
      }
      std::string names;
      for (size_t k = 0; k + 1 < circle.size(); k++)
        names += format_text("%s%u at %u", k ? ", " : "", circle[k], circle[k + 1]);
      add(Severity::kError, "swapped-cameras",
          "cameras are at each other's places in the prior rig: " + names +
              ". The new rig lists cameras in the order of their places");
    }
  }

  // A parameter counts as not calibrated if its uncertainty is unchanged, in one camera or in the mean over all
  // cameras.
  void judge_lenses() {
    static constexpr const char* kCodes[] = {"unknown-focal-length",
                                             "unknown-principal-point",
                                             "unknown-principal-point",
                                             "unknown-k1",
                                             "unknown-k2",
                                             "unknown-p1",
                                             "unknown-p2"};
    static constexpr const char* kNames[] = {
        "focal length", "principal point (x)", "principal point (y)", "k1", "k2", "p1", "p2"};
    const Uncertainty& u = solution_.uncertainty;
    const int terms = static_cast<int>(u.lens_terms.size());
    std::vector<size_t> used;
    for (size_t i = 0; i < scene().cameras.size(); i++)
      if (scene().cameras[i].used) used.push_back(i);
    const auto n = static_cast<double>(used.size());
    for (int t = 0; t < terms; t++) {
      const int k = u.lens_terms[t];
      Eigen::VectorXd mean = Eigen::VectorXd::Zero(u.covariance.rows());
      Eigen::VectorXd mean_before = Eigen::VectorXd::Zero(u.prior_covariance.rows());
      size_t alone = 0;
      double offset = 0;
      for (size_t rank = 0; rank < used.size(); rank++) {
        const int row = u.camera_row[used[rank]] + 6 + t;
        const auto before = static_cast<Eigen::Index>(rank * terms + t);
        mean[row] = mean_before[before] = 1 / n;
        alone += u.covariance(row, row) > kUninformative * kUninformative * u.prior_covariance(before, before);
        const double expected =
            scene().measured(used[rank], k) ? scene().lens_priors[used[rank]]->mean[k] : scene().batch.mean[k];
        offset += (scene().cameras[used[rank]].lens_terms()[k] - expected) / n;
      }
      const double after = u.sigma_of(mean), before = std::sqrt(mean_before.dot(u.prior_covariance * mean_before));
      const double f = scene().cameras[used[0]].lens_terms()[kF];
      const std::string size = k == kF ? format_text("+-%.2g %%", after / f * 100) : format_text("+-%.2g", after);
      if (after > kUninformative * before)
        add(scene().measured(k) ? Severity::kWarning : Severity::kError, kCodes[k],
            format_text("%s: the tracks do not determine the mean of all cameras: %s%s", kNames[k], size.c_str(),
                        k <= kCy && !tracks_.rigid_targets() ? "; use a bar with two lights" : ""));
      else if (alone > 0)
        add(Severity::kNote, kCodes[k],
            format_text("%s: the tracks did not reduce the uncertainty of the prior in %zu of %zu cameras", kNames[k],
                        alone, used.size()));
      const double surprise = std::sqrt(std::max(before * before - after * after, 1e-30));
      if (scene().measured(k) && std::abs(offset) > kBatchContradiction * surprise &&
          std::abs(offset) > kBatchContradiction * after)
        add(Severity::kError, "prior-contradicted",
            format_text(
                "%s: the tracks differ from the prior rig by %+.3g on average, %.0f times the expected deviation",
                kNames[k], offset, std::abs(offset) / surprise));
    }
  }

  void judge_poses() {
    for (const size_t i : solution_.contradicted_poses)
      add(Severity::kError, "prior-contradicted",
          format_text(
              "camera %u: its pose is far outside the covariance in the prior rig, so this covariance was ignored",
              id(i)));
  }

  void judge_modes() {
    const Uncertainty& u = solution_.uncertainty;
    double f = 0, position = 0, rotation = 0, n = 0;
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(u.covariance.rows());
    for (size_t i = 0; i < scene().cameras.size(); i++) {
      const int row = u.camera_row[i];
      if (row < 0) continue;
      n++, f += scene().cameras[i].lens_terms()[kF];
      if (u.camera_size > 6) mean[row + 6] = 1;
      position += u.covariance.diagonal().segment(row + 3, 3).sum();
      rotation += u.covariance.diagonal().segment(row, 3).sum();
    }
    const double depth = u.sigma_of(mean) / f, pitch = neighbour_distance(scene().used_poses());
    const bool board = !tracks_.board.empty();
    const char* cure = board         ? "tilt the board more, and show it closer and at more depths"
                       : tracks_.bar ? "move the bar closer, and through a larger range of depths"
                                     : "use a bar with two lights, or measure the lenses first";
    if (!(depth < kSoftDepth))
      add(Severity::kWarning, "soft-depth",
          format_text("depth scale and focal lengths are uncertain by %.2g %%: %s", depth * 100, cure));
    const double shift = std::sqrt(position / n) / pitch;
    double turn = std::sqrt(rotation / n);
    if (!(shift < kSoftPosition))
      add(Severity::kError, "soft-positions",
          format_text("positions are uncertain by %.2g of the distance between neighbours: move the %s closer, and "
                      "through a volume, not along a plane or a line",
                      shift, target()));
    if (const double roll = roll_about_row(); !(turn < kSoftRotation) && roll > 0) {
      const double rest = std::sqrt(std::max(0.0, rotation / n - roll * roll));
      add(Severity::kNote, "unknown-roll",
          format_text("the cameras are in a row, and their positions do not tell how the row is turned about its own "
                      "axis: the roll of all cameras together is uncertain by %.2g degrees. Their other turns, and "
                      "their turns relative to each other, are uncertain by %.2g degrees",
                      roll * 180 / M_PI, rest * 180 / M_PI));
      turn = rest;
    }
    if (!(turn < kSoftRotation))
      add(Severity::kWarning, "soft-rotations",
          format_text("orientations are uncertain by %.2g degrees: %s", turn * 180 / M_PI, cure));
  }

  // Returns the standard deviation of the common turn of all cameras about the line through them, in radians, or 0 if
  // the cameras are not on a line. This turn is only relative to the coordinate system, and changes no picture.
  double roll_about_row() const {
    std::vector<Eigen::Vector3d> centres;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Pose& pose : scene().used_poses()) {
      centres.emplace_back(pose.position.x, pose.position.y, pose.position.z);
      mean += centres.back();
    }
    const auto n = static_cast<double>(centres.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& centre : centres) spread += (centre - mean / n) * (centre - mean / n).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
    if (!(std::sqrt(eigen.eigenvalues()[1]) < kRow * std::sqrt(eigen.eigenvalues()[2]))) return 0;
    const Uncertainty& u = solution_.uncertainty;
    Eigen::VectorXd roll = Eigen::VectorXd::Zero(u.covariance.rows());
    for (const int row : u.camera_row)
      if (row >= 0) roll.segment<3>(row) = eigen.eigenvectors().col(2) / n;
    return u.sigma_of(roll);
  }

  void judge_halves() {
    if (solution_.disagreement > kAgreement)
      add(Severity::kNote, "halves-disagree",
          format_text("two halves of the tracks disagree %.1f times more than independent errors of %.2g px explain: "
                      "errors are correlated. All uncertainties are scaled by this factor",
                      solution_.disagreement, solution_.sigma));
  }

  // Tracks of a light always move; tracks of features must not.
  void judge_motion() {
    if (tracks_.ordered) return;
    const MovingScene motion = find_motion(solution_, tracks_);
    if (motion.share < kMoved) return;
    const bool harms = motion.used_share > kMoved / 2;
    add(harms ? Severity::kWarning : Severity::kNote, "moving-scene",
        format_text("the scene moved during the recording: %.0f %% of the tracks shift between cameras, by %.2g px, as "
                    "if images were taken at different times. ",
                    100 * motion.share, motion.shift_px) +
            (harms
                 ? format_text(
                       "%.0f %% of the tracks in the solution move and bias the cameras: capture images of one instant "
                       "(lf-rig snapshot reports time differences), or of a static scene",
                       100 * motion.used_share)
                 : std::string("These tracks are left out of the solution")));
  }

  void judge_scale() {
    if (placement_.scale_from.empty()) {
      add(Severity::kWarning, "no-scale",
          "the scale is unknown: the distance between neighbours is set to 1. Give --bar, --pitch, --distance or "
          "--prior");
      return;
    }
    std::vector<Pose> poses = scene().used_poses();
    for (Pose& pose : poses) pose = placement_.world_from_scene(pose);
    const double pitch = neighbour_distance(poses);
    if (pitch < kClosest || pitch > kWidest)
      add(Severity::kError, "odd-scale",
          format_text(
              "neighbouring cameras are %.3g m apart according to %s: was it given in millimetres instead of metres?",
              pitch, placement_.scale_from.c_str()));
  }

  static constexpr double kResection = 8;  // pixels

  const Solution& solution_;
  const Tracks& tracks_;
  const SolveOptions& options_;
  const Placement& placement_;
  const std::vector<std::vector<uint32_t>> by_camera_;
  std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> diagnose(const Solution& solution, const Tracks& tracks, const SolveOptions& options,
                              const Placement& placement) {
  return Diagnosis(solution, tracks, options, placement).run();
}

}  // namespace lf
