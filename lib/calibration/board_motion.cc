// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/board_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>
#include <Eigen/QR>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "calibration/light_detector.h"
#include "calibration/noise.h"

namespace lf {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kLongestGap = 0.5;  // seconds between two views; the board may do anything in longer gaps
constexpr double kFast = 3;          // limit of the speed, as a multiple of the median

Vector6 rate_between(const Pose& a, const Pose& b, double seconds) {
  Quat turn = glm::conjugate(a.orientation) * b.orientation;
  if (turn.w < 0) turn = -turn;
  const Vec3 shift = glm::conjugate(a.orientation) * (b.position - a.position);
  Vector6 rate;
  rate << 2 * turn.x, 2 * turn.y, 2 * turn.z, shift.x, shift.y, shift.z;
  return rate / seconds;
}

// Returns the turn and the shift of the board in its own axes. Dividing both by their medians
// gives them the same weight.
CameraMotion motion_of(const std::vector<std::pair<double, Pose>>& poses) {
  std::vector<std::pair<double, Vector6>> rates;
  for (size_t k = 1; k < poses.size(); k++) {
    const double seconds = poses[k].first - poses[k - 1].first;
    if (seconds > 0 && seconds <= kLongestGap)
      rates.emplace_back(poses[k].first - seconds / 2, rate_between(poses[k - 1].second, poses[k].second, seconds));
  }
  CameraMotion motion;
  if (rates.empty()) return motion;
  for (const int part : {0, 3}) {
    std::vector<double> speeds;
    for (const auto& [time, rate] : rates) speeds.push_back(rate.segment<3>(part).norm());
    const double usual = std::max(1e-9, median(std::move(speeds)));
    for (auto& [time, rate] : rates) rate.segment<3>(part) /= std::max(usual, rate.segment<3>(part).norm() / kFast);
  }
  motion.first = static_cast<int64_t>(std::ceil(rates.front().first / CameraMotion::kStep));
  size_t k = 0;
  for (int64_t i = motion.first; static_cast<double>(i) * CameraMotion::kStep <= rates.back().first; i++) {
    const double time = static_cast<double>(i) * CameraMotion::kStep;
    while (k + 2 < rates.size() && rates[k + 1].first < time) k++;
    const size_t next = std::min(k + 1, rates.size() - 1);
    const double gap = rates[next].first - rates[k].first;
    motion.known.push_back(gap > 0 && gap <= kLongestGap);
    motion.count += motion.known.back();
    const double share = gap > 0 ? (time - rates[k].first) / gap : 0;
    motion.velocity.emplace_back(rates[k].second + share * (rates[next].second - rates[k].second));
  }
  return motion;
}

}  // namespace

std::vector<CameraClock> coarse_board_clocks(const BoardFilms& films, double reach, const SolveOptions& options) {
  BoardSightings all{films.board, films.cameras, 0, {}};
  std::vector<double> stamps;
  for (uint32_t i = 0; i < films.frames.size(); i++)
    for (const BoardFilms::Frame& frame : films.frames[i]) {
      all.sightings.push_back({i, 0, frame.view});
      stamps.push_back(frame.stamp);
    }
  const auto poses = board_poses(all, options);
  std::vector<std::vector<std::pair<double, Pose>>> of_camera(films.cameras.size());
  for (size_t k = 0; k < poses.size(); k++)
    if (poses[k]) of_camera[all.sightings[k].camera].emplace_back(stamps[k], *poses[k]);
  std::vector<CameraMotion> motions;
  for (const auto& list : of_camera) motions.push_back(motion_of(list));
  const auto most = std::ranges::max_element(motions, {}, &CameraMotion::count);
  std::vector<CameraClock> clocks(motions.size());
  clocks[static_cast<size_t>(most - motions.begin())].known = most->count > 0;
  // A maximum spanning tree: not all cameras see the board at the same times as the first camera.
  std::vector<MotionMatch> best(motions.size());
  for (size_t last = static_cast<size_t>(most - motions.begin());;) {
    size_t next = motions.size();
    for (size_t i = 0; i < motions.size(); i++) {
      if (clocks[i].known) continue;
      MotionMatch found = match_motions(motions[last], motions[i], reach, true);
      found.offset += clocks[last].offset;
      if (found.score > best[i].score) best[i] = found;
      if (best[i].score > 0 && (next == motions.size() || best[i].score > best[next].score)) next = i;
    }
    if (next == motions.size()) return clocks;
    clocks[next].offset = best[next].offset;
    clocks[next].known = true;
    last = next;
  }
}

namespace {

// Replaces the velocities of the corners of one view by the nearest quadratic functions of the corners' pixels. The
// image of a rigid plane moves like that, and the noise of a velocity that multiplies an unknown readout time would
// make the readout time too small (regression dilution).
void smooth_velocities(const std::vector<Vec2>& pixels, double width, std::span<Vec2> velocities) {
  const auto n = static_cast<Eigen::Index>(pixels.size());
  Eigen::MatrixXd by(n, 6), values(n, 2);
  for (Eigen::Index k = 0; k < n; k++) {
    const Vec2 p = (pixels[k] - pixels[0]) / width;
    by.row(k) << 1, p.x, p.y, p.x * p.x, p.x * p.y, p.y * p.y;
    values.row(k) << velocities[k].x, velocities[k].y;
  }
  values = by * by.colPivHouseholderQr().solve(values);
  for (Eigen::Index k = 0; k < n; k++) velocities[k] = {values(k, 0), values(k, 1)};
}

constexpr double kFastest = 0.04;  // movement between two frames, relative to the image width
constexpr size_t kMinCorners = 4;
constexpr int kRowRounds = 3;
constexpr int kMaxRounds = 12;
constexpr int kOffsetRounds = 2;          // rounds that estimate offsets alone, because wrong offsets hide the rest
constexpr double kSettled = 5e-5;         // seconds
constexpr double kClockKnown = 0.01;      // seconds; largest standard deviation of a known offset
constexpr double kMoves = 5;              // least movement between two frames, in sigmas of a corner
constexpr double kSignificant = 5;        // sigmas of a readout time or a drift
constexpr double kMostDrift = 1e-3;       // clocks drift by less; uneven stamps of short films look like a drift
constexpr double kLeastReadout = 1e-3;    // seconds
constexpr double kLongestReadout = 1.05;  // frames

class MovingBoardSolver {
 public:
  MovingBoardSolver(const BoardFilms& films, const std::vector<double>& instants, std::vector<CameraClock> clocks,
                    const SolveOptions& options)
      : films_(films), options_(options), instants_(instants), start_(std::move(clocks)), free_(films.cameras.size()) {
    result_.clocks = start_;
    for (const CameraClock& clock : start_) result_.expected.push_back(clock.offset);
    result_.shutters.resize(films.cameras.size());
    if (!instants.empty()) result_.seconds = instants.back() - instants.front();
    for (size_t i = 0; i < films.frames.size(); i++) {
      add_films(i);
      if (!films.frames[i].empty())
        result_.clocks[i].middle = (films.frames[i].front().stamp + films.frames[i].back().stamp) / 2;
    }
  }

  MovingBoardSolution run() {
    sample();
    SolveOptions quick = options_;
    if (!quick.distortion) quick.distortion = DistortionModel{2, false, false};
    Solution& solution = result_.solution;
    solution = solve_boards(sightings_, quick).solution;
    keep_late_cameras(solution.scene);
    for (int turn = 0; turn < 2; turn++) {
      settle(solution);
      step("cameras at the estimated times");
      const AdjustmentOptions before = solution.model;
      solution = solve_from_layout(std::move(solution.scene), result_.tracks, options_);
      if (solution.model.free == before.free && solution.model.shared == before.shared) break;
    }
    finish();
    return std::move(result_);
  }

 private:
  // True for the terms of a camera's clock that are estimated, besides the offset.
  struct Free {
    bool drift = true, readout = true;
  };

  void step(const std::string& what) {
    if (options_.progress) options_.progress(what);
  }

  // A part of a film. The board moves slowly enough to be interpolated.
  struct Shot {
    double from = 0, to = 0;           // stamps
    std::vector<LightPath> corners{};  // the path of each corner
  };

  void add_films(size_t i) {
    std::vector<Shot>& shots = shots_.emplace_back();
    const BoardFilms::Frame* before = nullptr;
    for (const BoardFilms::Frame& frame : films_.frames[i]) {
      if (!before || !is_near(*before, frame, i)) shots.push_back({frame.stamp, frame.stamp, {}});
      Shot& shot = shots.back();
      shot.to = frame.stamp;
      shot.corners.resize(films_.board.num_corners());
      for (size_t k = 0; k < frame.view.corners.size(); k++)
        shot.corners[frame.view.id(k)].points.push_back({frame.stamp, {frame.view.corners[k], 1, 1}});
      before = &frame;
    }
  }

  bool is_near(const BoardFilms::Frame& a, const BoardFilms::Frame& b, size_t camera) const {
    std::vector<std::optional<Vec2>> before(films_.board.num_corners());
    for (size_t k = 0; k < a.view.corners.size(); k++) before[a.view.id(k)] = a.view.corners[k];
    double moved = 0, count = 0;
    for (size_t k = 0; k < b.view.corners.size(); k++)
      if (const auto& other = before[b.view.id(k)]) moved += glm::length(b.view.corners[k] - *other), count++;
    const double frames = std::max(1.0, (b.stamp - a.stamp) / films_.frame_times[camera]);
    return count > 0 && moved <= kFastest * films_.cameras[camera].width * frames * count;
  }

  // Wrong times make the residuals of a late camera so large that solve_boards() leaves the camera out.
  void keep_late_cameras(Reconstruction& scene) const {
    Reconstruction all = scene;
    for (CameraState& camera : all.cameras) camera.used = true;
    const auto lengths = residual_lengths(all, result_.tracks.observations);
    std::vector<std::vector<double>> of_camera(all.cameras.size());
    for (size_t k = 0; k < lengths.size(); k++) of_camera[result_.tracks.observations[k].camera].push_back(lengths[k]);
    for (size_t i = 0; i < of_camera.size(); i++)
      if (!of_camera[i].empty() && median(std::move(of_camera[i])) < kFastest * films_.cameras[i].width)
        scene.cameras[i].used = true;
  }

  // Interpolates the corners at the instants, according to the current clocks and readout times.
  void sample() {
    sightings_ = {films_.board, films_.cameras, instants_.size(), {}};
    ClockAdjustment& adjustment = result_.adjustment;
    adjustment = {};
    for (size_t i = 0; i < shots_.size(); i++) {
      ClockAdjustment::Camera& camera = adjustment.cameras.emplace_back();
      camera.middle = result_.clocks[i].middle;
      camera.drifts = free_[i].drift, camera.rolls = free_[i].readout;
    }
    for (uint32_t j = 0; j < instants_.size(); j++)
      for (uint32_t i = 0; i < shots_.size(); i++) add_view(i, j);
    result_.tracks = board_tracks(sightings_);
  }

  void add_view(uint32_t i, uint32_t j) {
    const double stamp = result_.clocks[i].stamp_of(instants_[j]), height = films_.cameras[i].height;
    const auto shot = std::ranges::lower_bound(shots_[i], stamp, {}, &Shot::to);
    if (shot == shots_[i].end() || stamp < shot->from) return;
    BoardSightings::Sighting sighting{i, j, {}};
    ClockAdjustment& adjustment = result_.adjustment;
    std::vector<Vec2> velocities;
    std::vector<double> rows;
    for (size_t corner = 0; corner < shot->corners.size(); corner++) {
      if (shot->corners[corner].points.size() < 2) continue;
      // A row that is read later shows the instant in an earlier frame. The stamp depends on the row, and the row on
      // the stamp.
      std::optional<PathSample> place;
      double row = 0;
      for (int round = 0; round < kRowRounds; round++) {
        const double at = stamp - result_.shutters[i].readout * row;
        place = interpolate_path(shot->corners[corner], at, films_.frame_times[i]);
        if (!place) break;
        row = (place->pixel.y - (height - 1) / 2) / height;
      }
      if (!place) continue;
      sighting.view.ids.push_back(static_cast<int>(corner));
      sighting.view.corners.push_back(place->pixel);
      sighting.sigmas.push_back(place->sigma);
      velocities.push_back(place->velocity);
      rows.push_back(row);
    }
    if (rows.size() < kMinCorners) return;
    smooth_velocities(sighting.view.corners, films_.cameras[i].width, velocities);
    adjustment.velocity.insert(adjustment.velocity.end(), velocities.begin(), velocities.end());
    adjustment.row.insert(adjustment.row.end(), rows.begin(), rows.end());
    adjustment.stamp.resize(adjustment.row.size(), stamp);
    sightings_.sightings.push_back(std::move(sighting));
  }

  // Adjusts the scene and the clocks in turn with the interpolation, until both agree.
  void settle(Solution& solution) {
    int rounds = 0;
    const auto refine = [&](bool offsets_only) {
      step("times: round " + std::to_string(++rounds));
      return adjust_clocks(solution, offsets_only);
    };
    for (int round = 0; round < kMaxRounds; round++)
      if (refine(round < kOffsetRounds) < kSettled && round > kOffsetRounds) break;
    if (std::exchange(judged_, true) || !drop_insignificant(solution)) return;
    for (int round = 0; round < kMaxRounds / 2; round++)
      if (refine(false) < kSettled) break;
  }

  // Returns the largest change of a clock or of a readout time, seconds.
  double adjust_clocks(Solution& solution, bool offsets_only) {
    AdjustmentOptions o = solution.model;
    o.robust = 2, o.max_iterations = 10, o.tolerance = 1e-6;
    const auto& observations = result_.tracks.observations;
    o.sigma = std::max(1e-3, robust_sigma(residual_lengths(solution.scene, observations)));
    ClockAdjustment adjustment = result_.adjustment;
    if (offsets_only)
      for (ClockAdjustment::Camera& camera : adjustment.cameras) camera.drifts = camera.rolls = false;
    adjust(solution.scene, observations, Inliers(observations.size(), true), o, &adjustment);
    std::vector<double> offsets, drifts;
    for (size_t i = 0; i < adjustment.cameras.size(); i++) {
      if (!solution.scene.cameras[i].used) continue;
      offsets.push_back(adjustment.cameras[i].terms[0]), drifts.push_back(adjustment.cameras[i].terms[1]);
    }
    if (offsets.empty()) return 0;
    // A common delay or drift of all clocks cannot be distinguished from the motion of the board.
    const double offset = median(std::move(offsets)), drift = median(std::move(drifts));
    double moved = 0;
    for (size_t i = 0; i < adjustment.cameras.size(); i++) {
      if (!solution.scene.cameras[i].used) continue;
      const auto& terms = adjustment.cameras[i].terms;
      result_.clocks[i].offset += terms[0] - offset;
      if (free_[i].drift) result_.clocks[i].drift += terms[1] - drift;
      if (adjustment.cameras[i].rolls) result_.shutters[i].readout += terms[2];
      moved = std::max({moved, std::abs(terms[0] - offset), std::abs(adjustment.cameras[i].rolls ? terms[2] : 0)});
    }
    sample();
    return moved;
  }

  // Sets readout times and drifts to 0 that are not significant or not plausible. Returns true if there are any.
  bool drop_insignificant(const Solution& solution) {
    const Uncertainty u = uncertainty(solution);
    bool any = false;
    for (size_t i = 0; i < free_.size(); i++) {
      if (!solution.scene.cameras[i].used) continue;
      CameraClock& clock = result_.clocks[i];
      RollingShutter& shutter = result_.shutters[i];
      const double drift = u.clock_sigmas[i][1], readout = u.clock_sigmas[i][2];
      if (free_[i].readout) shutter.sigma = readout;
      const double rate = std::abs(clock.drift);
      if (free_[i].drift && (rate < kSignificant * drift || rate > kMostDrift))
        free_[i].drift = false, clock.drift = 0, any = true;
      const double size = std::abs(shutter.readout);
      if (free_[i].readout &&
          (size < kSignificant * readout || size < kLeastReadout || size > kLongestReadout * films_.frame_times[i]))
        free_[i].readout = false, shutter.readout = 0, any = true;
    }
    if (any) sample();
    return any;
  }

  Uncertainty uncertainty(const Solution& solution) const {
    const auto& observations = result_.tracks.observations;
    const auto lengths = residual_lengths(solution.scene, observations);
    AdjustmentOptions o = solution.model;
    o.sigma = std::max(1e-3, robust_sigma(lengths));
    return estimate_uncertainty(solution.scene, observations, within(lengths, kOutlier, o.sigma), o,
                                &result_.adjustment);
  }

  // True if the corners of a camera move faster than the noise of their velocities.
  bool moves(size_t camera) const {
    double squares = 0, count = 0;
    for (size_t k = 0; k < result_.tracks.observations.size(); k++) {
      if (result_.tracks.observations[k].camera != camera) continue;
      squares += glm::dot(result_.adjustment.velocity[k], result_.adjustment.velocity[k]);
      count++;
    }
    return count > 0 && std::sqrt(squares / count) * films_.frame_times[camera] > kMoves * result_.solution.sigma;
  }

  void finish() {
    Solution& solution = result_.solution;
    std::vector<Observation> observations = result_.tracks.observations;
    for (Observation& o : observations)
      if (!solution.camera_noise.empty()) o.sigma *= std::max(1.0, solution.camera_noise[o.camera]);
    solution.uncertainty =
        estimate_uncertainty(solution.scene, observations, solution.inliers, solution.model, &result_.adjustment);
    std::vector<double> offsets, squares(free_.size()), counts(free_.size());
    for (size_t k = 0; k < observations.size(); k++) {
      const uint32_t i = observations[k].camera;
      const double row = result_.adjustment.row[k];
      squares[i] += glm::dot(result_.adjustment.velocity[k], result_.adjustment.velocity[k]) * row * row;
      counts[i]++;
    }
    for (size_t i = 0; i < free_.size(); i++) {
      CameraClock& clock = result_.clocks[i];
      RollingShutter& shutter = result_.shutters[i];
      clock.sigma = solution.uncertainty.clock_sigmas[i][0];
      clock.known = solution.scene.cameras[i].used && clock.sigma < kClockKnown && moves(i);
      if (free_[i].readout) shutter.sigma = solution.uncertainty.clock_sigmas[i][2];
      if (counts[i] > 0) {
        const double per_second = std::sqrt(squares[i] / counts[i]);
        shutter.shift = std::abs(shutter.readout) * per_second;
        if (shutter.readout == 0 && moves(i)) shutter.uncertain = 2 * shutter.sigma * per_second;
      }
      if (clock.known)
        offsets.push_back(clock.offset);
      else
        clock.offset = start_[i].offset;
    }
    if (offsets.empty()) return;
    // The common time is arbitrary, so the median camera keeps its time.
    const double middle = median(std::move(offsets));
    for (CameraClock& clock : result_.clocks) clock.offset -= middle;
  }

  const BoardFilms& films_;
  const SolveOptions& options_;
  const std::vector<double>& instants_;
  const std::vector<CameraClock> start_;
  std::vector<std::vector<Shot>> shots_;  // per camera
  std::vector<Free> free_;
  bool judged_ = false;  // terms that are not significant have been dropped
  BoardSightings sightings_;
  MovingBoardSolution result_;
};

}  // namespace

MovingBoardSolution solve_moving_board(const BoardFilms& films, const std::vector<double>& instants,
                                       std::vector<CameraClock> clocks, const SolveOptions& options) {
  return MovingBoardSolver(films, instants, std::move(clocks), options).run();
}

std::vector<Finding> diagnose_times(const MovingBoardSolution& solution) {
  constexpr double kLargeShift = 1;        // pixels; the model is linear in the velocity
  constexpr double kUncertainShift = 0.5;  // pixels; more than most errors of corners
  std::vector<Finding> findings;
  for (size_t i = 0; i < solution.shutters.size(); i++) {
    const unsigned id = solution.tracks.cameras[i].id;
    for (Finding& finding : diagnose_clock(id, solution.clocks[i], solution.seconds, solution.expected[i]))
      findings.push_back(std::move(finding));
    const RollingShutter& shutter = solution.shutters[i];
    if (shutter.uncertain > kUncertainShift)
      findings.push_back(
          {Finding::Severity::kNote, "readout-unknown",
           format_text("camera %u may have a rolling shutter: the standard deviation of its readout time is %.0f ms. "
                       "Twice this time moves the corners by %.1f px, which is not corrected. Make a longer film in "
                       "which the board moves past all parts of the image, in all directions",
                       id, 1e3 * shutter.sigma, shutter.uncertain)});
    if (shutter.readout == 0) continue;
    const bool large = shutter.shift > kLargeShift;
    findings.push_back(
        {large ? Finding::Severity::kWarning : Finding::Severity::kNote, "rolling-shutter",
         format_text("camera %u has a rolling shutter with a readout time of %.1f ms +-%.1f ms. It moved "
                     "the corners by %.2f px, which is corrected%s",
                     id, 1e3 * shutter.readout, 1e3 * shutter.sigma, shutter.shift,
                     large ? ". Move the board more slowly" : "")});
  }
  return findings;
}

void add_times(const MovingBoardSolution& solution, nlohmann::ordered_json& report) {
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    auto& camera = report["cameras"][i];
    add_clock(solution.clocks[i], camera);
    if (!solution.solution.scene.cameras[i].used) continue;
    const RollingShutter& shutter = solution.shutters[i];
    camera["readout_ms"] = 1e3 * shutter.readout;
    camera["readout_sigma_ms"] = 1e3 * shutter.sigma;
    camera["rolling_shutter_px"] = shutter.shift;
  }
}

}  // namespace lf
