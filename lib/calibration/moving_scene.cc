// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/moving_scene.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "calibration/triangulation.h"

namespace lf {
namespace {

constexpr size_t kLeastTrackSights = 5;  // of a track, two of whose numbers its place and its motion take
constexpr double kMost = 30;        // sigmas that a residual counts as at most
constexpr double kAlike = 0.7;      // share of a track's squared residuals that a motion must explain
constexpr double kSure = 25;        // squared sigmas that it explains
constexpr double kAlone = 0.5;      // share of the squared times that is one camera's: it is wrong, not late
constexpr int kMostLeftOut = 4;

struct MovingSight {
  Eigen::Index camera;
  Vec2 error;  // pixels
};
struct MovingTrack {
  std::vector<MovingSight> sights;
  bool good = false;  // the solution relies on it
};

std::vector<MovingTrack> tracks_of(const Solution& solution, const Tracks& tracks) {
  std::vector<MovingTrack> list;
  const double most = kMost * solution.sigma;
  for (const auto& sights : observations_of_positions(tracks)) {
    MovingTrack track;
    size_t good = 0;
    for (const uint32_t index : sights) {
      const Observation& o = tracks.observations[index];
      const CameraState& camera = solution.scene.cameras[o.camera];
      const TargetState& target = solution.scene.targets[o.position];
      if (!camera.used || !target.has(o.light)) continue;
      const auto e = residual(camera, target, o);
      if (!e) continue;
      const double length = glm::length(*e);
      track.sights.push_back({static_cast<Eigen::Index>(o.camera), length > most ? *e * (most / length) : *e});
      good += solution.inliers[index];
    }
    track.good = 2 * good > track.sights.size();
    if (track.sights.size() >= kLeastTrackSights) list.push_back(std::move(track));
  }
  return list;
}

// What the cameras' residuals have in common; nothing where each errs by itself.
Eigen::VectorXd times_of(const std::vector<MovingTrack>& tracks, size_t cameras) {
  const auto n = static_cast<Eigen::Index>(cameras);
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(n, n);
  for (const MovingTrack& track : tracks)
    for (const MovingSight& a : track.sights)
      for (const MovingSight& b : track.sights) common(a.camera, b.camera) += glm::dot(a.error, b.error);
  for (int left_out = 0; left_out <= kMostLeftOut; left_out++) {
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
    for (const MovingSight& s : track.sights) {
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
  found.taken_in = good > 0 ? good_moved / good : 0;
  found.shift_px = sights > 0 ? std::sqrt(squares / sights) : 0;
  return found;
}

}  // namespace lf
