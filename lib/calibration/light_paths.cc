// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_paths.h"

#include <algorithm>
#include <cmath>

#include "base/percentiles.h"

namespace lf {
namespace {

constexpr double kPathReach = 10;         // pixels that a light may be off where it is expected
constexpr double kFirstPathReach = 0.06;  // of the image's width: from the first place to the second
constexpr double kTurn = 0.6;         // of the way from frame to frame: what a change of motion may add
constexpr double kBrightness = 12;    // pixels that a brightness e times as large counts as
constexpr double kStillLight = 4;          // pixels across that no moved light stays within
constexpr size_t kLeastPathPoints = 4;
constexpr size_t kLeastEven = 20;  // frames that show a rhythm
constexpr double kJitter = 0.15;   // of the time of a frame

struct Open {
  LightPath path;
  Vec2 expected(double time) const {
    const auto& p = path.points;
    if (p.size() < 2) return p.back().sight.pixel;
    const LightPath::Point &a = p[p.size() - 2], &b = p.back();
    return b.sight.pixel + (b.sight.pixel - a.sight.pixel) * ((time - b.time) / (b.time - a.time));
  }
  double reach(double width) const {
    const auto& p = path.points;
    if (p.size() < 2) return std::max(kPathReach, kFirstPathReach * width);
    return kPathReach + kTurn * glm::length(p.back().sight.pixel - p[p.size() - 2].sight.pixel);
  }
};

void close(Open& open, std::vector<LightPath>& paths) {
  auto& points = open.path.points;
  if (points.size() < kLeastPathPoints) return;
  std::vector<double> brightness;
  Vec2 least = points[0].sight.pixel, most = least;
  for (const LightPath::Point& point : points) {
    brightness.push_back(point.sight.brightness);
    least = glm::min(least, point.sight.pixel), most = glm::max(most, point.sight.pixel);
  }
  open.path.brightness = median(std::move(brightness));
  open.path.still = glm::length(most - least) < kStillLight;
  paths.push_back(std::move(open.path));
}

}  // namespace

double frame_time_of(const LightSights::Camera& camera) {
  std::vector<double> steps;
  for (size_t i = 1; i < camera.frames.size(); i++) steps.push_back(camera.frames[i].time - camera.frames[i - 1].time);
  return steps.empty() ? 0 : median(std::move(steps));
}

std::vector<double> evened_stamps(const LightSights::Camera& camera) {
  std::vector<double> stamps;
  for (const LightSights::Frame& frame : camera.frames) stamps.push_back(frame.time);
  const double step = frame_time_of(camera);
  if (stamps.size() < kLeastEven || !(step > 0)) return stamps;
  // Which beat each frame is of: counted from frame to frame, so that no error of the step adds up.
  std::vector<double> beats{0};
  for (size_t i = 1; i < stamps.size(); i++)
    beats.push_back(beats.back() + std::max(1.0, std::round((stamps[i] - stamps[i - 1]) / step)));
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (size_t i = 0; i < stamps.size(); i++)
    n++, x += beats[i], y += stamps[i], xx += beats[i] * beats[i], xy += beats[i] * stamps[i];
  const double slope = (n * xy - x * y) / (n * xx - x * x), start = (y - slope * x) / n;
  std::vector<double> even;
  for (size_t i = 0; i < stamps.size(); i++) {
    even.push_back(start + slope * beats[i]);
    if (std::abs(even.back() - stamps[i]) > kJitter * step) return stamps;
  }
  return even;
}

std::vector<LightPath> link_light_paths(const LightSights::Camera& camera) {
  std::vector<LightPath> paths;
  std::vector<Open> open;
  const double gap = (kMostMissed + 1.5) * frame_time_of(camera);
  struct Link {
    double cost;
    size_t path, sight;
  };
  const std::vector<double> stamps = evened_stamps(camera);
  for (size_t n = 0; n < camera.frames.size(); n++) {
    const LightSights::Frame frame{stamps[n], camera.frames[n].sights};
    std::erase_if(open, [&](Open& o) {
      if (frame.time - o.path.points.back().time <= gap) return false;
      close(o, paths);
      return true;
    });
    std::vector<Link> links;
    for (size_t i = 0; i < open.size(); i++)
      for (size_t k = 0; k < frame.sights.size(); k++) {
        const double distance = glm::length(frame.sights[k].pixel - open[i].expected(frame.time));
        const double ratio = std::log(frame.sights[k].brightness / open[i].path.points.back().sight.brightness);
        if (distance < open[i].reach(camera.width)) links.push_back({distance + kBrightness * std::abs(ratio), i, k});
      }
    std::sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.cost < b.cost; });
    std::vector<char> continued(open.size()), taken(frame.sights.size());
    for (const Link& link : links) {
      if (continued[link.path] || taken[link.sight]) continue;
      continued[link.path] = taken[link.sight] = true;
      open[link.path].path.points.push_back({frame.time, frame.sights[link.sight]});
    }
    for (size_t k = 0; k < frame.sights.size(); k++)
      if (!taken[k]) open.push_back({{{{frame.time, frame.sights[k]}}, 0, false}});
  }
  for (Open& o : open) close(o, paths);
  return paths;
}

std::optional<PathPlace> place_at(const LightPath& path, double time, double frame_time) {
  const auto& p = path.points;
  const auto after =
      std::upper_bound(p.begin(), p.end(), time, [](double t, const LightPath::Point& q) { return t < q.time; });
  if (after == p.begin() || (after == p.end() && time > p.back().time)) return std::nullopt;
  const auto last = static_cast<ptrdiff_t>(p.size()) - 1;
  const ptrdiff_t k = std::clamp<ptrdiff_t>(after - p.begin() - 1, 0, last - 1);
  const double gap = (kMostMissed + 0.5) * frame_time;
  if (p[k + 1].time - p[k].time > gap) return std::nullopt;
  ptrdiff_t from = k, to = k + 1;
  if (from > 0 && p[from].time - p[from - 1].time <= gap) from--;
  if (to < last && p[to + 1].time - p[to].time <= gap) to++;
  // Lagrange's polynomials and their slopes.
  PathPlace place;
  double variance = 0;
  for (ptrdiff_t i = from; i <= to; i++) {
    double value = 1, slope = 0;
    for (ptrdiff_t j = from; j <= to; j++) {
      if (j == i) continue;
      const double span = p[i].time - p[j].time;
      slope = slope * (time - p[j].time) / span + value / span;
      value *= (time - p[j].time) / span;
    }
    place.pixel += value * p[i].sight.pixel;
    place.velocity += slope * p[i].sight.pixel;
    variance += value * value * p[i].sight.sigma * p[i].sight.sigma;
  }
  place.sigma = std::sqrt(variance);
  const bool later = time - p[k].time > p[k + 1].time - time;
  place.brightness = p[later ? k + 1 : k].sight.brightness;
  return place;
}

}  // namespace lf
