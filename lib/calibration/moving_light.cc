// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/moving_light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"
#include "calibration/light_detector.h"
#include "calibration/multiview_geometry.h"
#include "calibration/noise.h"

namespace lf {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using PathName = std::pair<uint32_t, uint32_t>;  // camera, path

// A light or a reflection that one camera sees at one instant, according to the clock of the camera.
struct LightCandidate {
  uint32_t camera = 0, path = 0;  // `path`: index of a path of the camera
  PathSample place;
  double brightness = 0;  // relative to the median path of the camera
};
using LightCandidates = std::vector<LightCandidate>;

// Tracks with one position per instant, and the candidate that each observation comes from.
struct LightAssociation {
  Tracks tracks;
  std::vector<LightCandidate> made_of;
  std::vector<size_t> reflections;  // number of candidates of each camera that are reflections
};

constexpr size_t kMinSupport = 3;  // minimum number of agreeing cameras; two rays always meet nearly
constexpr size_t kMaxPoints = 6;   // per instant: lights and their reflections
constexpr double kBarOff = 0.3;    // relative tolerance of the length of a bar

void add(LightAssociation& result, const LightCandidate& c, uint32_t position, uint32_t light) {
  result.tracks.observations.push_back({c.camera, position, light, c.place.pixel, c.place.sigma});
  result.made_of.push_back(c);
}

LightAssociation begin(const Tracks& cameras, size_t positions) {
  LightAssociation result;
  result.tracks.cameras = cameras.cameras;
  result.tracks.bar = cameras.bar;
  result.tracks.num_positions = positions;
  result.reflections.resize(cameras.cameras.size());
  return result;
}

std::vector<const LightCandidate*> brightest(const LightCandidates& list, uint32_t camera, size_t num_lights) {
  std::vector<const LightCandidate*> own;
  for (const LightCandidate& c : list)
    if (c.camera == camera) own.push_back(&c);
  if (own.size() < num_lights) return {};
  std::sort(own.begin(), own.end(),
            [](const auto* a, const auto* b) { return a->place.brightness > b->place.brightness; });
  own.resize(num_lights);
  std::sort(own.begin(), own.end(), [](const auto* a, const auto* b) { return a->path < b->path; });
  return own;
}

// Makes sigmas relative to the median, so that residuals remain in pixels.
LightAssociation weighted(LightAssociation result) {
  std::vector<double> sigmas;
  for (const Observation& o : result.tracks.observations) sigmas.push_back(o.sigma);
  if (sigmas.empty()) return result;
  const double usual = median(std::move(sigmas));
  for (Observation& o : result.tracks.observations) o.sigma = std::clamp(o.sigma / usual, 0.5, 10.0);
  return result;
}

Vector2d eigen(const Vec2& v) { return {v.x, v.y}; }

std::vector<LightCandidates> candidates_at(const std::vector<std::vector<LightPath>>& paths,
                                           const std::vector<double>& frame_times,
                                           const std::vector<CameraClock>& clocks,
                                           const std::vector<double>& instants) {
  std::vector<LightCandidates> lists(instants.size());
  for (uint32_t i = 0; i < paths.size(); i++) {
    std::vector<double> all;
    for (const LightPath& path : paths[i])
      if (!path.still) all.push_back(path.brightness);
    if (all.empty() || !clocks[i].known) continue;
    const double usual = median(std::move(all));
    for (size_t j = 0; j < instants.size(); j++) {
      const double stamp = clocks[i].stamp_of(instants[j]);
      for (uint32_t k = 0; k < paths[i].size(); k++) {
        if (paths[i][k].still) continue;
        const auto place = interpolate_path(paths[i][k], stamp, frame_times[i]);
        if (place) lists[j].push_back({i, k, *place, place->brightness / usual});
      }
    }
  }
  return lists;
}

// Assigns candidates to the lights without knowing the cameras: the brightest candidates are the lights. The direction
// of a bar distinguishes its two lights, because directions map from camera `reference` to any other camera like
// velocities. Observations of a bar require that camera `reference` sees both lights.
LightAssociation associate_by_brightness(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                         size_t reference) {
  LightAssociation result = begin(cameras, candidates.size());
  const auto num_cameras = static_cast<uint32_t>(cameras.cameras.size());
  if (!cameras.bar) {
    for (uint32_t j = 0; j < candidates.size(); j++)
      for (uint32_t i = 0; i < num_cameras; i++)
        for (const LightCandidate* c : brightest(candidates[j], i, 1)) add(result, *c, j, 0);
    return weighted(std::move(result));
  }
  for (uint32_t i = 0; i < num_cameras; i++) {
    // Maps the motion of the bar's centre in the reference camera to its motion in this camera.
    Matrix2d from = Matrix2d::Zero(), across = from;
    struct Pair {
      uint32_t position;
      std::vector<const LightCandidate*> there, here;
    };
    std::vector<Pair> pairs;
    for (uint32_t j = 0; j < candidates.size(); j++) {
      Pair pair{j, brightest(candidates[j], static_cast<uint32_t>(reference), 2), brightest(candidates[j], i, 2)};
      if (pair.there.empty() || pair.here.empty()) continue;
      const Vector2d u = eigen(pair.there[0]->place.velocity + pair.there[1]->place.velocity);
      const Vector2d v = eigen(pair.here[0]->place.velocity + pair.here[1]->place.velocity);
      from += u * u.transpose() / (1 + u.squaredNorm()), across += v * u.transpose() / (1 + u.squaredNorm());
      pairs.push_back(std::move(pair));
    }
    if (pairs.empty() || !(from.determinant() > 0)) continue;
    const Matrix2d map = across * from.inverse();
    // Paths are long, so all instants with two paths in both cameras vote together.
    std::map<std::array<uint32_t, 4>, double> same;
    const auto name = [](const Pair& p) {
      return std::array{p.there[0]->path, p.there[1]->path, p.here[0]->path, p.here[1]->path};
    };
    for (const Pair& p : pairs)
      same[name(p)] += (map * eigen(p.there[1]->place.pixel - p.there[0]->place.pixel))
                           .dot(eigen(p.here[1]->place.pixel - p.here[0]->place.pixel));
    for (const Pair& p : pairs) {
      const uint32_t first = same[name(p)] > 0 ? 0 : 1;
      add(result, *p.here[0], p.position, first);
      add(result, *p.here[1], p.position, 1 - first);
    }
  }
  return weighted(std::move(result));
}

struct Point {
  Vec3 at;
  std::vector<const LightCandidate*> seen;
  double brightness = 0;
};

class Geometry {
 public:
  Geometry(const Tracks& cameras, const std::vector<CameraState>& states, double reach)
      : cameras_(cameras), states_(states), reach_(reach) {
    size_t used = 0;
    for (const CameraState& state : states) used += state.used;
    least_ = std::min(kMinSupport, used);
  }

  std::vector<Point> points(const LightCandidates& candidates, const std::set<PathName>& none) const {
    std::vector<const LightCandidate*> left;
    for (const LightCandidate& c : candidates)
      if (states_[c.camera].used && !none.count({c.camera, c.path})) left.push_back(&c);
    std::vector<Point> found;
    while (left.size() >= least_ && found.size() < kMaxPoints) {
      Tracks all;
      all.num_positions = 1;
      std::vector<uint32_t> indices;
      for (const LightCandidate* c : left) {
        indices.push_back(static_cast<uint32_t>(all.observations.size()));
        all.observations.push_back({c->camera, 0, 0, c->place.pixel, c->place.sigma});
      }
      const auto point = triangulate(states_, all, indices, reach_);
      if (!point) break;
      const TargetState target = TargetState::at(point->point);
      std::map<uint32_t, std::pair<double, const LightCandidate*>> nearest;
      for (size_t i = 0; i < left.size(); i++) {
        const auto e = residual(states_[left[i]->camera], target, all.observations[i]);
        if (!e || glm::length(*e) > reach_) continue;
        auto& best = nearest[left[i]->camera];
        if (!best.second || glm::length(*e) < best.first) best = {glm::length(*e), left[i]};
      }
      if (nearest.size() < least_) break;
      Point& p = found.emplace_back(Point{point->point, {}, 0});
      for (const auto& [camera, one] : nearest) {
        p.seen.push_back(one.second);
        p.brightness += std::log(one.second->brightness);
      }
      p.brightness /= static_cast<double>(p.seen.size());
      std::erase_if(left, [&](const auto* c) { return std::find(p.seen.begin(), p.seen.end(), c) != p.seen.end(); });
    }
    return found;
  }

  std::vector<Point> lights(std::vector<Point> points) const {
    if (!cameras_.bar) {
      if (points.empty()) return {};
      return {*std::max_element(points.begin(), points.end(),
                                [](const Point& a, const Point& b) { return a.brightness < b.brightness; })};
    }
    std::vector<Point> best;
    double most = -1e9;
    for (size_t i = 0; i < points.size(); i++)
      for (size_t k = 0; k < i; k++) {
        if (std::abs(glm::length(points[i].at - points[k].at) - 1) > kBarOff) continue;
        const double brightness = points[i].brightness + points[k].brightness;
        if (brightness > most) most = brightness, best = {points[i], points[k]};
      }
    return best;
  }

 private:
  const Tracks& cameras_;
  const std::vector<CameraState>& states_;
  double reach_;
  size_t least_;
};

// Assigns candidates to the lights if the cameras are approximately known: a light is a point where all used cameras
// agree within `reach` pixels. The two points of a bar must be one bar length (the unit of length) apart. Reflections
// in a flat window also form such points. The brighter point is the light, and a path that is a reflection at most
// instants is excluded completely.
LightAssociation associate_by_geometry(const Tracks& cameras, const std::vector<LightCandidates>& candidates,
                                       const std::vector<CameraState>& states, double reach) {
  const Geometry geometry(cameras, states, reach);
  std::set<PathName> none;
  std::vector<std::vector<Point>> chosen(candidates.size());
  for (int round = 0; round < 2; round++) {
    std::map<PathName, int> votes;
    for (size_t j = 0; j < candidates.size(); j++) {
      chosen[j] = geometry.lights(geometry.points(candidates[j], none));
      if (chosen[j].empty()) continue;
      for (const LightCandidate& c : candidates[j]) {
        const bool light = std::any_of(chosen[j].begin(), chosen[j].end(), [&](const Point& p) {
          return std::find(p.seen.begin(), p.seen.end(), &c) != p.seen.end();
        });
        votes[{c.camera, c.path}] += light ? 1 : -1;
      }
    }
    if (round == 0)
      for (const auto& [name, sum] : votes)
        if (sum < 0 && states[name.first].used) none.insert(name);
  }
  LightAssociation result = begin(cameras, candidates.size());
  const std::vector<Point>* before = nullptr;
  for (uint32_t j = 0; j < candidates.size(); j++) {
    std::vector<Point>& now = chosen[j];
    if (now.empty()) continue;
    if (before && now.size() == 2) {
      const auto apart = [&](int a, int b) { return glm::length(now[a].at - (*before)[b].at); };
      if (apart(0, 0) + apart(1, 1) > apart(0, 1) + apart(1, 0)) std::swap(now[0], now[1]);
    }
    before = &now;
    for (uint32_t light = 0; light < now.size(); light++)
      for (const LightCandidate* c : now[light].seen) add(result, *c, j, light);
    for (const LightCandidate& c : candidates[j])
      result.reflections[c.camera] += states[c.camera].used && none.count({c.camera, c.path});
  }
  return weighted(std::move(result));
}

constexpr size_t kMaxInstants = 400;  // more add little accuracy
constexpr size_t kFirstInstants = 120;
constexpr int kMaxClockRounds = 16;
constexpr int kMaxModels = 3;            // lens models that clocks are refined with
constexpr double kClockSettled = 5e-5;   // seconds
constexpr double kNearlySettled = 3e-3;  // seconds; larger clock errors are not searched for steps
constexpr double kWholeStep = 0.25;      // allowed deviation of a step from whole frames, in frames
constexpr size_t kEnoughForClocks = 12000;
constexpr double kFirstLightReach = 8;  // pixels; allows for about a frame of time between cameras
constexpr double kNearer = 0.7;         // decrease of the reach per round
constexpr double kLightReach = 1.5;     // pixels, or
constexpr double kReachSigmas = 6;      // multiple of the residual sigma
constexpr double kSlow = 5;             // pixels per second; slower lights carry no timing information

// Share of a clock error that a camera's pose and lens absorb when they are adjusted to it.
class ClockObservability {
 public:
  void add(const CameraState& camera, const Vec3& point, const Vec2& velocity) {
    const Vec3 at = camera.pose().camera_from_world(point);
    const double u = at.x / at.z, v = at.y / at.z, f = camera.lens_terms()[kF];
    Eigen::Matrix<double, 2, kSteps> steps;  // by position, orientation, principal point, focal length
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
  LightSolver(const LightDetections& sights, const LightSolveOptions& options) : options_(options) {
    cameras_.bar = sights.bar;
    for (const LightDetections::Camera& camera : sights.cameras) {
      cameras_.cameras.push_back({camera.id, camera.width, camera.height});
      frame_times_.push_back(frame_time_of(camera));
      paths_.push_back(link_light_paths(camera));
    }
  }

  LightSolution run() {
    result_.reach = options_.reach;
    step("clocks: first estimate");
    const size_t reference = coarse_clocks(paths_, frame_times_, cameras_.bar ? 2 : 1, options_.reach, result_.clocks);
    choose_instants(reference);
    candidates_ = candidates_at(paths_, frame_times_, result_.clocks, result_.instants);
    Tracks first = associate_by_brightness(cameras_, candidates_, reference).tracks;
    thin_out(first);
    const Solution begun = solve_tracks(first, options_.solve);
    scene_ = begun.scene;
    model_ = begun.model;
    double first_reach = kFirstLightReach;
    // Rough clocks hide effects of the lens. If better clocks justify a larger lens model, the clocks are refined again
    // with that model.
    for (int turn = 0; turn < kMaxModels; turn++) {
      double moved = 1;
      for (int round = 0; round < kMaxClockRounds && (moved > kClockSettled || first_reach > reach()); round++) {
        step("clocks: round " + std::to_string(round + 1));
        moved = read_clocks(std::max(reach(), first_reach));
        // The reach decreases slowly, because otherwise the fast observations of a late camera would be rejected too
        // early.
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
  double reach() const { return std::max(kLightReach, kReachSigmas * residual_sigma_); }

  // The spacing is at least the frame interval of the slowest camera, so that instants are independent.
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
      throw Error("no camera sees a moving light; darken the room and move the light in front of the cameras");
    spacing = std::max(spacing, (to - from) / kMaxInstants);
    for (double time = from; time <= to; time += spacing) result_.instants.push_back(time);
  }

  static void thin_out(Tracks& tracks) {
    const size_t n = (tracks.num_positions + kFirstInstants - 1) / kFirstInstants;
    if (n > 1) std::erase_if(tracks.observations, [&](const Observation& o) { return o.position % n != 0; });
  }

  // Adjusts geometry and clocks to the detections. Returns the largest change of a clock, seconds.
  double read_clocks(double reach) {
    candidates_ = candidates_at(paths_, frame_times_, result_.clocks, result_.instants);
    size_t all = 0;
    for (const LightCandidates& list : candidates_) all += list.size();
    if (const size_t n = all / kEnoughForClocks; n > 1)
      for (size_t j = 0; j < candidates_.size(); j++)
        if (j % n != 0) candidates_[j].clear();
    const LightAssociation now = associate_by_geometry(cameras_, candidates_, scene_.cameras, reach);
    const auto& observations = now.tracks.observations;
    if (observations.empty())
      throw Error(
          "the cameras do not agree on any position of the light; check that all recordings show the same light at the "
          "same time");
    scene_.targets.assign(now.tracks.num_positions, {});
    triangulate_targets(scene_, now.tracks, reach);
    AdjustmentOptions o = model_;
    o.robust = 2;
    o.max_iterations = 10;
    o.tolerance = 1e-5;
    o.sigma = std::max(0.01, robust_sigma(residual_lengths(scene_, observations)));
    // Clocks and cameras must be adjusted together. In alternation, the pose of a camera would hide most of its clock
    // error.
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
    residual_sigma_ = robust_sigma(std::move(read.left));
    // A pose also absorbs part of a step, so the size of a suspected step is estimated together with everything else.
    if (settled_) {
      ClockAdjustment stepped = clocks;
      bool any = false;
      for (size_t i = 0; i < paths_.size(); i++)
        if (const auto at = suspected_step(read.of_camera[i])) stepped.cameras[i].step_at = *at, any = true;
      if (any) {
        adjust(scene_, observations, Inliers(observations.size(), true), o, &stepped);
        bool new_step = false;
        for (size_t i = 0; i < paths_.size(); i++) new_step |= add_step(i, stepped.cameras[i]);
        // Without a valid step, the next round starts from the adjusted scene.
        if (new_step) return 1;
        read = samples_of(now, stepped);
      }
    }
    double moved = 0;
    std::vector<double> moves;
    for (size_t i = 0; i < read.of_camera.size(); i++)
      if (!read.of_camera[i].empty())
        moves.push_back(
            refine_clock(result_.clocks[i], std::move(read.of_camera[i]), frame_times_[i], read.hidden[i].shown()));
    if (moves.empty()) return 0;
    // A common delay or drift of all clocks cannot be distinguished from the motion of the light.
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

  // Clock errors of each camera at each light position, after an adjustment.
  struct Samples {
    std::vector<std::vector<ClockSample>> of_camera;
    std::vector<ClockObservability> hidden;
    std::vector<double> left;  // remaining residuals, pixels
  };
  Samples samples_of(const LightAssociation& now, const ClockAdjustment& clocks) const {
    Samples read{
        std::vector<std::vector<ClockSample>>(paths_.size()), std::vector<ClockObservability>(paths_.size()), {}};
    for (size_t i = 0; i < now.tracks.observations.size(); i++) {
      const Observation& seen = now.tracks.observations[i];
      const auto e = scene_.residual_of(seen);
      if (!e) continue;
      const Vec2 velocity = clocks.velocity[i];
      double late = 0;
      const auto by = clocks.by(seen.camera, i);
      for (size_t k = 0; k < by.size(); k++) late += by[k] * clocks.cameras[seen.camera].terms[k];
      read.left.push_back(glm::length(*e + velocity * late));
      const double speed = glm::length(velocity);
      if (speed < kSlow) continue;
      read.hidden[seen.camera].add(scene_.cameras[seen.camera], scene_.targets[seen.position].point(seen.light),
                                   velocity);
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

  // Adds dropped frames if the estimated step is a whole number of frames.
  bool add_step(size_t i, const ClockAdjustment::Camera& camera) {
    if (!std::isfinite(camera.step_at) || !(frame_times_[i] > 0)) return false;
    const double frames = std::round(camera.terms[2] / frame_times_[i]);
    if (frames == 0 || std::abs(camera.terms[2] / frame_times_[i] - frames) > kWholeStep) return false;
    std::vector<CameraClock::Step>& steps = result_.clocks[i].steps;
    steps.push_back({camera.step_at, frames * frame_times_[i], static_cast<int>(frames)});
    std::sort(steps.begin(), steps.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
    return true;
  }

  // The common time is arbitrary, so the median camera keeps its time.
  void centre_clocks() {
    std::vector<double> offsets;
    for (const CameraClock& clock : result_.clocks)
      if (clock.known) offsets.push_back(clock.offset);
    const double middle = median(std::move(offsets));
    for (CameraClock& clock : result_.clocks)
      if (clock.known) clock.offset -= middle;
    for (double& instant : result_.instants) instant -= middle;
  }

  // Keeps the observations of cameras that the first layout could not place, for another attempt or for the report.
  void keep_lost_cameras(Tracks& tracks, size_t reference) {
    const LightAssociation all = associate_by_brightness(cameras_, candidates_, reference);
    for (const Observation& o : all.tracks.observations)
      if (!scene_.cameras[o.camera].used) tracks.observations.push_back(o);
  }

  const LightSolveOptions& options_;
  Tracks cameras_;
  std::vector<double> frame_times_;
  std::vector<std::vector<LightPath>> paths_;
  std::vector<LightCandidates> candidates_;
  Reconstruction scene_;
  AdjustmentOptions model_;
  double residual_sigma_ = 1;  // pixels
  bool settled_ = false;  // true if clocks are nearly correct
  LightSolution result_;
};

}  // namespace

LightSolution solve_lights(const LightDetections& sights, const LightSolveOptions& options) {
  return LightSolver(sights, options).run();
}

std::vector<Finding> diagnose_clocks(const LightSolution& solution) {
  std::vector<Finding> findings;
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    const unsigned id = solution.tracks.cameras[i].id;
    if (!solution.clocks[i].known)
      findings.push_back({Finding::Severity::kError, "unknown-clock",
                          format_text("camera %u: its light moves differently from all other cameras within %.0f s: is "
                                      "it another recording?",
                                      id, solution.reach)});
    for (Finding& finding : diagnose_clock(id, solution.clocks[i], solution.seconds(), 0))
      findings.push_back(std::move(finding));
  }
  return findings;
}

void add_clocks(const LightSolution& solution, nlohmann::ordered_json& report) {
  for (size_t i = 0; i < solution.clocks.size(); i++) {
    report["cameras"][i]["reflections"] = solution.reflections[i];
    add_clock(solution.clocks[i], report["cameras"][i]);
  }
}

namespace {

constexpr double kBlack = 20, kBlackBrightest = 40;  // grey levels of an empty frame; video black may be 16
constexpr double kBright = 50;                       // grey levels of a room that is not dark
constexpr double kMaxBusy = 0.2;                     // share of the frames
constexpr double kMinCoverageShare = 0.5;
constexpr double kShorter = 0.9;  // relative to the longest recording

double seconds_of(const LightDetections::Camera& camera) {
  if (camera.frames.size() < 2) return 0;
  return camera.frames.back().time - camera.frames.front().time;
}

std::optional<std::string> trouble_of(const LightDetections::Camera& camera, const LightDetectorStats& record,
                                      bool moves) {
  const auto frames = static_cast<double>(std::max<size_t>(1, record.frames));
  if (record.frames < 3) return "has only " + std::to_string(record.frames) + " frames";
  if (record.background < kBlack && record.brightest < kBlackBrightest && record.lit == 0)
    return "is black from beginning to end: is there a cap on the lens, or is the exposure far too short?";
  if (static_cast<double>(record.busy) > kMaxBusy * frames)
    return format_text(
        "is full of changes in %.0f %% of its frames, so lights cannot be detected: darken the room, lock the "
        "exposure, and keep people and screens out of view",
        100 * static_cast<double>(record.busy) / frames);
  if (record.lit == 0)
    return record.background > kBright
               ? format_text(
                     "shows no light: the room is not dark (%.0f of 255 on average). Draw the curtains, or shorten the "
                     "exposure",
                     record.background)
               : std::string("shows no light: is it on, in the picture, and bright enough to be seen in the dark?");
  if (!moves)
    return camera.frames.size() < 10 ? "is too short to track a light"
                                     : "shows only static lights, or lights that vanish after a moment";
  return std::nullopt;
}

}  // namespace

LightSummary summarize_lights(const LightDetections::Camera& camera, const LightDetectorStats& record) {
  LightSummary summary;
  summary.seconds = seconds_of(camera);
  summary.lit = static_cast<double>(record.lit) / static_cast<double>(std::max<size_t>(1, record.frames));
  CoverageGrid places(camera.width, camera.height);
  std::vector<double> sigmas;
  bool moves = false;
  for (const LightPath& path : link_light_paths(camera)) {
    if (path.still) continue;
    moves = true;
    for (const LightPath::Point& point : path.points) places.come(point.sight.pixel);
  }
  for (const LightDetections::Frame& frame : camera.frames)
    if (!frame.sights.empty()) sigmas.push_back(frame.sights[0].sigma);
  if (!sigmas.empty()) summary.sigma = median(std::move(sigmas));
  summary.coverage = places.share();
  summary.trouble = trouble_of(camera, record, moves);
  if (summary.trouble) return summary;
  if (summary.coverage < kMinCoverageShare)
    summary.remarks.push_back(format_text("the light covered %.0f %% of the image: move it to the %s as well",
                                          100 * summary.coverage, gap_names(places.gaps()).c_str()));
  if (record.background > kBright)
    summary.remarks.push_back(
        format_text("the room is not dark (%.0f of 255 on average): weak lights are missed", record.background));
  return summary;
}

std::vector<Finding> compare_recordings(const LightDetections& sights) {
  std::vector<Finding> findings;
  double longest = 0;
  for (const LightDetections::Camera& camera : sights.cameras) longest = std::max(longest, seconds_of(camera));
  for (const LightDetections::Camera& camera : sights.cameras) {
    const double seconds = seconds_of(camera);
    if (seconds > 0 && seconds < kShorter * longest)
      findings.push_back(
          {Finding::Severity::kNote, "short-recording",
           format_text("camera %u has %.1f s, other recordings %.1f s: is the file incomplete? The rest is used",
                       camera.id, seconds, longest)});
  }
  return findings;
}

}  // namespace lf
