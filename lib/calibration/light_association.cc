// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_association.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Core>
#include <Eigen/LU>

#include "base/percentiles.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using PathName = std::pair<uint32_t, uint32_t>;  // camera, path

constexpr size_t kLeastSupport = 3;  // cameras that agree on a point; two rays always meet nearly
constexpr size_t kMostPoints = 6;    // at an instant: lights and their reflections
constexpr double kBarOff = 0.3;      // of its length: before the clocks are known

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

// The brightest of a camera, as many as there are lights; empty where it has fewer.
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

// Observations count by their sigmas over the usual one, so that residuals stay pixels.
LightAssociation weighted(LightAssociation result) {
  std::vector<double> sigmas;
  for (const Observation& o : result.tracks.observations) sigmas.push_back(o.sigma);
  if (sigmas.empty()) return result;
  const double usual = median(std::move(sigmas));
  for (Observation& o : result.tracks.observations) o.sigma = std::clamp(o.sigma / usual, 0.5, 10.0);
  return result;
}

Vector2d eigen(const Vec2& v) { return {v.x, v.y}; }

}  // namespace

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
        const auto place = place_at(paths[i][k], stamp, frame_times[i]);
        if (place) lists[j].push_back({i, k, *place, place->brightness / usual});
      }
    }
  }
  return lists;
}

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
    // How the middle moves in this camera's picture where it moves in the reference's.
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
    // Paths are long: all instants of two pairs of paths say together which is which.
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

namespace {

struct Point {
  Vec3 at;
  std::vector<const LightCandidate*> seen;  // one a camera
  double brightness = 0;                    // mean of the logarithms
};

class Geometry {
 public:
  Geometry(const Tracks& cameras, const std::vector<CameraState>& states, double reach)
      : cameras_(cameras), states_(states), reach_(reach) {
    size_t used = 0;
    for (const CameraState& state : states) used += state.used;
    least_ = std::min(kLeastSupport, used);
  }

  // Points that cameras agree on, each with what it explains.
  std::vector<Point> points(const LightCandidates& candidates, const std::set<PathName>& none) const {
    std::vector<const LightCandidate*> left;
    for (const LightCandidate& c : candidates)
      if (states_[c.camera].used && !none.count({c.camera, c.path})) left.push_back(&c);
    std::vector<Point> found;
    while (left.size() >= least_ && found.size() < kMostPoints) {
      Tracks all;
      all.num_positions = 1;
      std::vector<uint32_t> indices;
      for (const LightCandidate* c : left) {
        indices.push_back(static_cast<uint32_t>(all.observations.size()));
        all.observations.push_back({c->camera, 0, 0, c->place.pixel, c->place.sigma});
      }
      const auto point = triangulate(states_, all, indices, reach_);
      if (!point) break;
      TargetState target;
      target.kind = TargetState::Kind::kPoint;
      for (int k = 0; k < 3; k++) target.v[k] = point->point[k];
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

  // The lights among them: one, or the two of a bar, or none.
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

}  // namespace

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
    // The same light has the same number as long as it is seen.
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

}  // namespace lf
