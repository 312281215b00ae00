// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/moving_light.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/percentiles.h"
#include "calibration/light_association.h"
#include "calibration/noise.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

constexpr size_t kMostInstants = 400;    // more tell little more
constexpr size_t kFirstInstants = 120;   // for a first layout
constexpr int kMostClockRounds = 16;          // of clocks and geometry in turn
constexpr int kMostModels = 3;           // of the lenses, that clocks are read with
constexpr double kClockSettled = 5e-5;        // seconds
constexpr double kNearlySettled = 3e-3;  // seconds: what is off by more is no step yet
constexpr double kWholeStep = 0.25;          // of a frame, that a step may differ from whole ones
constexpr size_t kEnoughForClocks = 12000;        // observations that clocks are read off in a round
constexpr double kFirstLightReach = 8;        // pixels: a frame of time between cameras at first
constexpr double kNearer = 0.7;          // from round to round
constexpr double kLightReach = 1.5;           // pixels, or
constexpr double kReachSigmas = 6;       // of what is left of errors
constexpr double kDrifted = 2e-3;        // seconds, from the beginning to the end
constexpr double kLate = 0.1;            // seconds
constexpr double kSlow = 5;              // pixels a second: no clock is read off a light that rests

// How much of a wrong offset in time a camera's pose and lens hide once they are adjusted to it: it moves all places
// along their velocities, which these parameters' steps can do in part.
class HiddenTime {
 public:
  void add(const CameraState& camera, const Vec3& point, const Vec2& velocity) {
    const Vec3 at = camera.pose().camera_from_world(point);
    const double u = at.x / at.z, v = at.y / at.z, f = camera.lens_terms()[kF];
    Eigen::Matrix<double, 2, kSteps> steps;  // of position, orientation, principal point, focal length
    steps << f / at.z, 0, -f * u / at.z, f * u * v, -f * (1 + u * u), f * v, 1, 0, u,  //
        0, f / at.z, -f * v / at.z, f * (1 + v * v), -f * u * v, -f * u, 0, 1, v;
    const Eigen::Vector2d along(velocity.x, velocity.y);
    square_ += steps.transpose() * steps, product_ += steps.transpose() * along, all_ += along.squaredNorm();
  }
  double shown() const {
    if (!(all_ > 0)) return 1;
    return std::clamp(1 - product_.dot(square_.ldlt().solve(product_)) / all_, 0.2, 1.0);
  }

 private:
  static constexpr int kSteps = 9;
  Eigen::Matrix<double, kSteps, kSteps> square_ = 1e-9 * Eigen::Matrix<double, kSteps, kSteps>::Identity();
  Eigen::Matrix<double, kSteps, 1> product_ = Eigen::Matrix<double, kSteps, 1>::Zero();
  double all_ = 0;
};

class LightSolver {
 public:
  LightSolver(const LightSights& sights, const LightSolveOptions& options) : options_(options) {
    cameras_.bar = sights.bar;
    for (const LightSights::Camera& camera : sights.cameras) {
      cameras_.cameras.push_back({camera.id, camera.width, camera.height});
      frame_times_.push_back(frame_time_of(camera));
      paths_.push_back(link_light_paths(camera));
    }
  }

  LightSolution run() {
    result_.reach = options_.reach;
    step("clocks: a first guess");
    const size_t reference = coarse_clocks(paths_, frame_times_, cameras_.bar ? 2 : 1, options_.reach, result_.clocks);
    choose_instants(reference);
    candidates_ = candidates_at(paths_, frame_times_, result_.clocks, result_.instants);
    Tracks first = associate_by_brightness(cameras_, candidates_, reference).tracks;
    thin_out(first);
    const Solution begun = solve_tracks(first, options_.solve);
    scene_ = begun.scene;
    model_ = begun.model;
    double first_reach = kFirstLightReach;
    // Clocks that are only guessed hide what lenses do: where more of that shows with the clocks that come out, these
    // are read again, of lenses that are right.
    for (int turn = 0; turn < kMostModels; turn++) {
      double moved = 1;
      for (int round = 0; round < kMostClockRounds && (moved > kClockSettled || first_reach > reach()); round++) {
        step("clocks: round " + std::to_string(round + 1));
        moved = read_clocks(std::max(reach(), first_reach));
        // Slowly: of a camera that is still late what moves fast would be left out, and it would never be found late.
        first_reach *= kNearer;
      }
      centre_clocks();
      candidates_ = candidates_at(paths_, frame_times_, result_.clocks, result_.instants);
      LightAssociation last = associate_by_geometry(cameras_, candidates_, scene_.cameras, reach());
      keep_lost_cameras(last.tracks, reference);
      result_.reflections = std::move(last.reflections);
      result_.tracks = std::move(last.tracks);
      result_.solution = solve_tracks(result_.tracks, options_.solve);
      const AdjustmentOptions& found = result_.solution.model;
      if (found.free == model_.free && found.shared == model_.shared) break;
      scene_ = result_.solution.scene;
      model_ = found;
    }
    return std::move(result_);
  }

 private:
  void step(const std::string& what) {
    if (options_.solve.progress) options_.solve.progress(what);
  }
  double reach() const { return std::max(kLightReach, kReachSigmas * left_); }

  // No closer than the slowest camera's frames, so that each has a say of its own.
  void choose_instants(size_t reference) {
    double spacing = 0, from = std::numeric_limits<double>::infinity(), to = -from;
    for (size_t i = 0; i < paths_.size(); i++) {
      if (!result_.clocks[i].known) continue;
      spacing = std::max(spacing, frame_times_[i]);
      for (const LightPath& path : paths_[i]) {
        from = std::min(from, result_.clocks[i].true_time(path.points.front().time));
        to = std::max(to, result_.clocks[i].true_time(path.points.back().time));
      }
    }
    if (!(to > from) || !(spacing > 0) || !result_.clocks[reference].known)
      throw Error("no camera sees a light that moves");
    spacing = std::max(spacing, (to - from) / kMostInstants);
    for (double time = from; time <= to; time += spacing) result_.instants.push_back(time);
  }

  static void thin_out(Tracks& tracks) {
    const size_t n = (tracks.num_positions + kFirstInstants - 1) / kFirstInstants;
    if (n > 1) std::erase_if(tracks.observations, [&](const Observation& o) { return o.position % n != 0; });
  }

  // The geometry adjusted to what the clocks make of the sights, then the clocks to the geometry. Returns how far that
  // moved one at most, seconds.
  double read_clocks(double reach) {
    candidates_ = candidates_at(paths_, frame_times_, result_.clocks, result_.instants);
    size_t all = 0;
    for (const LightCandidates& list : candidates_) all += list.size();
    if (const size_t n = all / kEnoughForClocks; n > 1)
      for (size_t j = 0; j < candidates_.size(); j++)
        if (j % n != 0) candidates_[j].clear();
    const LightAssociation now = associate_by_geometry(cameras_, candidates_, scene_.cameras, reach);
    const auto& observations = now.tracks.observations;
    if (observations.empty()) throw Error("the cameras agree on no place of the light");
    scene_.targets.assign(now.tracks.num_positions, {});
    triangulate_targets(scene_, now.tracks, reach);
    AdjustmentOptions o = model_;
    o.robust = 2;
    o.max_iterations = 10;
    o.tolerance = 1e-5;
    o.sigma = std::max(0.01, robust_sigma(residual_lengths(scene_, observations)));
    // Clocks and cameras at once: one after the other, a camera's pose hides most of what its clock is off by.
    ClockAdjustment clocks;
    clocks.cameras.resize(paths_.size());
    for (size_t i = 0; i < observations.size(); i++) {
      const Observation& seen = observations[i];
      clocks.velocity.push_back(now.made_of[i].place.velocity);
      clocks.stamp.push_back(result_.clocks[seen.camera].stamp_of(result_.instants[seen.position]));
    }
    for (size_t i = 0; i < paths_.size(); i++) clocks.cameras[i].middle = middle_of(clocks.stamp, observations, i);
    adjust(scene_, observations, Inliers(observations.size(), true), o, &clocks);
    Samples read = samples_of(now, clocks);
    left_ = robust_sigma(std::move(read.left));
    // A pose hides a part of a step, too: where there may be one, how large it is comes out with all else.
    if (settled_) {
      ClockAdjustment stepped = clocks;
      bool any = false;
      for (size_t i = 0; i < paths_.size(); i++)
        if (const auto at = suspected_step(read.of_camera[i])) stepped.cameras[i].step_at = *at, any = true;
      if (any) {
        adjust(scene_, observations, Inliers(observations.size(), true), o, &stepped);
        bool new_step = false;
        for (size_t i = 0; i < paths_.size(); i++) new_step |= add_step(i, stepped.cameras[i]);
        // What was adjusted to a step that is none goes on from there in the next round.
        if (new_step) return 1;
        read = samples_of(now, stepped);
      }
    }
    double moved = 0;
    std::vector<double> moves;
    for (size_t i = 0; i < read.of_camera.size(); i++)
      if (!read.of_camera[i].empty())
        moves.push_back(
            improve_clock(result_.clocks[i], std::move(read.of_camera[i]), frame_times_[i], read.hidden[i].shown()));
    if (moves.empty()) return 0;
    // That all clocks are late alike, or fast, would be no other than that the light is.
    const double middle = median(moves);
    for (const double move : moves) moved = std::max(moved, std::abs(move - middle));
    std::vector<double> drifts;
    for (const CameraClock& clock : result_.clocks)
      if (clock.known) drifts.push_back(clock.drift);
    const double common = median(std::move(drifts));
    for (CameraClock& clock : result_.clocks)
      if (clock.known) clock.drift -= common;
    settled_ = moved < kNearlySettled;
    return moved;
  }

  // What each camera's clock is off by at each place of the light, after an adjustment.
  struct Samples {
    std::vector<std::vector<ClockSample>> of_camera;
    std::vector<HiddenTime> hidden;
    std::vector<double> left;  // lengths of what is left of errors
  };
  Samples samples_of(const LightAssociation& now, const ClockAdjustment& clocks) const {
    Samples read{std::vector<std::vector<ClockSample>>(paths_.size()), std::vector<HiddenTime>(paths_.size()), {}};
    for (size_t i = 0; i < now.tracks.observations.size(); i++) {
      const Observation& seen = now.tracks.observations[i];
      const CameraState& camera = scene_.cameras[seen.camera];
      const TargetState& target = scene_.targets[seen.position];
      if (!camera.used || !target.has(seen.light)) continue;
      const auto e = residual(camera, target, seen);
      if (!e) continue;
      const Vec2 velocity = clocks.velocity[i];
      double late = 0;
      const auto by = clocks.cameras[seen.camera].by(clocks.stamp[i]);
      for (size_t k = 0; k < by.size(); k++) late += by[k] * clocks.cameras[seen.camera].terms[k];
      read.left.push_back(glm::length(*e + velocity * late));
      const double speed = glm::length(velocity);
      if (speed < kSlow) continue;
      read.hidden[seen.camera].add(camera, target.point(seen.light), velocity);
      read.of_camera[seen.camera].push_back(
          {clocks.stamp[i], -glm::dot(*e, velocity) / (speed * speed), now.made_of[i].place.sigma / speed});
    }
    return read;
  }

  static double middle_of(const std::vector<double>& stamps, const std::vector<Observation>& observations, size_t i) {
    double from = std::numeric_limits<double>::infinity(), to = -from;
    for (size_t k = 0; k < stamps.size(); k++)
      if (observations[k].camera == i) from = std::min(from, stamps[k]), to = std::max(to, stamps[k]);
    return from <= to ? (from + to) / 2 : 0;
  }

  // Frames that were lost, where the step that was adjusted is of whole ones.
  bool add_step(size_t i, const ClockAdjustment::Camera& camera) {
    if (!std::isfinite(camera.step_at) || !(frame_times_[i] > 0)) return false;
    const double frames = std::round(camera.terms[2] / frame_times_[i]);
    if (frames == 0 || std::abs(camera.terms[2] / frame_times_[i] - frames) > kWholeStep) return false;
    std::vector<CameraClock::Step>& steps = result_.clocks[i].steps;
    steps.push_back({camera.step_at, frames * frame_times_[i], static_cast<int>(frames)});
    std::sort(steps.begin(), steps.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
    return true;
  }

  // Nothing tells when the whole was: most cameras keep the time that they have.
  void centre_clocks() {
    std::vector<double> offsets;
    for (const CameraClock& clock : result_.clocks)
      if (clock.known) offsets.push_back(clock.offset);
    const double middle = median(std::move(offsets));
    for (CameraClock& clock : result_.clocks)
      if (clock.known) clock.offset -= middle;
    for (double& instant : result_.instants) instant -= middle;
  }

  // Cameras that the first layout had no place for have another chance, and are named otherwise.
  void keep_lost_cameras(Tracks& tracks, size_t reference) {
    const LightAssociation all = associate_by_brightness(cameras_, candidates_, reference);
    for (const Observation& o : all.tracks.observations)
      if (!scene_.cameras[o.camera].used) tracks.observations.push_back(o);
  }

  const LightSolveOptions& options_;
  Tracks cameras_;  // nothing but these
  std::vector<double> frame_times_;
  std::vector<std::vector<LightPath>> paths_;
  std::vector<LightCandidates> candidates_;
  Reconstruction scene_;
  AdjustmentOptions model_;
  double left_ = 1;       // sigma of residuals, pixels
  bool settled_ = false;  // clocks are about right
  LightSolution result_;
};

}  // namespace

LightSolution solve_lights(const LightSights& sights, const LightSolveOptions& options) {
  return LightSolver(sights, options).run();
}

std::vector<Finding> diagnose_clocks(const LightSolution& solution) {
  using Severity = Finding::Severity;
  std::vector<Finding> findings;
  char text[512];
  const auto add = [&](Severity severity, const char* code, auto... args) {
    std::snprintf(text, sizeof text, args...);
    findings.push_back({severity, code, text});
  };
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    const CameraClock& clock = solution.clocks[i];
    const unsigned id = solution.tracks.cameras[i].id;
    if (!clock.known) {
      add(Severity::kError, "unknown-clock",
          "camera %u: its light moves as in no other camera within %.0f s of its stamps: is it of another recording?",
          id, solution.reach);
      continue;
    }
    for (const CameraClock::Step& step : clock.steps)
      add(Severity::kWarning, "dropped-frames",
          step.frames > 0 ? "camera %u lost %d frame%s at %.2f s, and its stamps do not show it"
                          : "camera %u has %d frame%s too many at %.2f s by its stamps",
          id, std::abs(step.frames), std::abs(step.frames) == 1 ? "" : "s", step.stamp);
    if (std::abs(clock.drift) * solution.seconds() > kDrifted)
      add(Severity::kWarning, "clock-drift",
          "camera %u: its clock is %s by %.0f millionths, so that its offset does not last: give all cameras one clock",
          id, clock.drift < 0 ? "fast" : "slow", std::abs(clock.drift) * 1e6);
    if (std::abs(clock.offset) > kLate)
      add(Severity::kWarning, "late-camera",
          "camera %u: its stamps are %.1f ms %s: more than frames that run freely differ by. Did all recordings begin "
          "with "
          "one clock?",
          id, 1e3 * std::abs(clock.offset), clock.offset > 0 ? "early" : "late");
  }
  return findings;
}

void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report) {
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    const CameraClock& clock = solution.clocks[i];
    auto& camera = report["cameras"][i];
    camera["reflections"] = solution.reflections[i];
    if (!clock.known) continue;
    camera["time_offset_ms"] = 1e3 * clock.offset;
    camera["time_offset_sigma_ms"] = 1e3 * clock.sigma;
    camera["clock_drift_ppm"] = 1e6 * clock.drift;
    camera["dropped_frames"] = nlohmann::ordered_json::array();
    for (const CameraClock::Step& step : clock.steps)
      camera["dropped_frames"].push_back({{"stamp", step.stamp}, {"frames", step.frames}});
  }
}

}  // namespace lf
