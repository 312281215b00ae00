// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/camera_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>

#include "base/maths.h"

namespace lf {

double CameraClock::true_time(double stamp) const {
  double time = stamp + offset + drift * (stamp - middle);
  for (const Step& step : steps)
    if (stamp >= step.stamp) time += step.seconds;
  return time;
}

double CameraClock::stamp_of(double true_time) const {
  double late = 0;
  for (const Step& step : steps) {
    const double begins = step.stamp + offset + drift * (step.stamp - middle) + late + step.seconds;
    if (true_time < begins) break;
    late += step.seconds;
  }
  return middle + (true_time - offset - late - middle) / (1 + drift);
}

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double kStep = 1.0 / 30;  // seconds between samples of a velocity
constexpr double kFast = 3;         // limit of the speed, as a multiple of the median
constexpr size_t kMinClockSamples = 20;
constexpr double kCorrelated = 0.5;  // minimum sum of squared correlations, of at most 2
constexpr double kBest = 1e-4;       // minimum share of unexplained variance

// Mean velocities of the brightest lights, at multiples of kStep on the camera's clock.
struct Motion {
  int64_t first = 0;
  std::vector<Vector2d> velocity;
  std::vector<char> known;
  size_t count = 0;
};

Motion motion_of(const std::vector<LightPath>& paths, double frame_time, size_t num_lights) {
  double from = std::numeric_limits<double>::infinity(), to = -from;
  for (const LightPath& path : paths)
    if (!path.still) from = std::min(from, path.points.front().time), to = std::max(to, path.points.back().time);
  Motion motion;
  if (!(from < to)) return motion;
  motion.first = static_cast<int64_t>(std::ceil(from / kStep));
  std::vector<double> speeds;
  for (int64_t k = motion.first; static_cast<double>(k) * kStep <= to; k++) {
    std::vector<std::pair<double, Vec2>> lights;
    for (const LightPath& path : paths)
      if (!path.still)
        if (const auto place = interpolate_path(path, static_cast<double>(k) * kStep, frame_time))
          lights.emplace_back(path.brightness, place->velocity);
    std::sort(lights.begin(), lights.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    motion.known.push_back(lights.size() >= num_lights);
    Vector2d mean(0, 0);
    if (motion.known.back()) {
      for (size_t i = 0; i < num_lights; i++) mean += Vector2d(lights[i].second.x, lights[i].second.y);
      mean /= static_cast<double>(num_lights);
      speeds.push_back(mean.norm());
      motion.count++;
    }
    motion.velocity.push_back(mean);
  }
  if (speeds.empty()) return motion;
  const double most = kFast * median(std::move(speeds));
  for (Vector2d& v : motion.velocity)
    if (v.norm() > most) v *= most / v.norm();
  return motion;
}

// Compares the hypothesis of a common motion, with b's stamps `lag` steps behind a's, with independent motions. Returns
// the log likelihood ratio, which follows from the canonical correlations, or 0 if the correlations are weak.
double likelihood(const Motion& a, const Motion& b, int64_t lag) {
  Matrix2d aa = Matrix2d::Zero(), bb = aa, ab = aa;
  size_t n = 0;
  const int64_t shift = a.first - b.first - lag;
  const int64_t from = std::max<int64_t>(0, -shift);
  const int64_t to = std::min(static_cast<int64_t>(a.velocity.size()), static_cast<int64_t>(b.velocity.size()) - shift);
  for (int64_t i = from; i < to; i++) {
    if (!a.known[i] || !b.known[i + shift]) continue;
    const Vector2d &u = a.velocity[i], &v = b.velocity[i + shift];
    aa += u * u.transpose(), bb += v * v.transpose(), ab += u * v.transpose();
    n++;
  }
  if (n < kMinClockSamples || !(aa.determinant() > 0) || !(bb.determinant() > 0)) return 0;
  const Matrix2d squares = aa.inverse() * ab * bb.inverse() * ab.transpose();
  if (squares.trace() < kCorrelated) return 0;
  const double left = (Matrix2d::Identity() - squares).determinant();
  return -0.5 * static_cast<double>(n) * std::log(std::max(left, kBest));
}

}  // namespace

size_t coarse_clocks(const std::vector<std::vector<LightPath>>& paths, const std::vector<double>& frame_times,
                     size_t num_lights, double reach, std::vector<CameraClock>& clocks) {
  std::vector<Motion> motions;
  for (size_t i = 0; i < paths.size(); i++) motions.push_back(motion_of(paths[i], frame_times[i], num_lights));
  const auto most = std::max_element(motions.begin(), motions.end(),
                                     [](const Motion& a, const Motion& b) { return a.count < b.count; });
  const auto reference = static_cast<size_t>(most - motions.begin());
  clocks.assign(paths.size(), {});
  clocks[reference].known = motions[reference].count > 0;
  const auto furthest = static_cast<int64_t>(std::lround(reach / kStep));
  for (size_t i = 0; i < paths.size(); i++) {
    if (i == reference || motions[i].count == 0) continue;
    std::vector<double> scores;
    for (int64_t lag = -furthest; lag <= furthest; lag++) scores.push_back(likelihood(*most, motions[i], lag));
    const int64_t at = std::max_element(scores.begin(), scores.end()) - scores.begin() - furthest;
    const double best = scores[at + furthest];
    if (!(best > 0)) continue;
    clocks[i].known = true;
    double fine = 0;
    if (std::abs(at) < furthest) {
      const double before = scores[at - 1 + furthest], next = scores[at + 1 + furthest];
      if (const double bend = before - 2 * best + next; bend < 0)
        fine = std::clamp((before - next) / (2 * bend), -0.5, 0.5);
    }
    clocks[i].offset = (static_cast<double>(at) + fine) * kStep;
  }
  return reference;
}

namespace {

constexpr int kClockRounds = 5;
constexpr double kClockRobust = 3;    // sigmas beyond which samples are down-weighted
constexpr double kWholeFrame = 0.25;  // allowed deviation of a step from whole frames, in frames
constexpr double kChangeGain = 60;    // minimum decrease of the robust cost for a step or a drift
constexpr double kHint = 25;          // the same, for a suspected step
constexpr double kDriftSigmas = 6;
constexpr size_t kMinSide = 8;

struct ClockLine {
  double value = 0, slope = 0;
  double variance = 0, slope_variance = 0;
};

// Iteratively reweighted least squares; `sloped` frees the slope.
ClockLine fit_line(const std::vector<ClockSample>& samples, double middle, double scale, bool sloped) {
  std::vector<double> values;
  for (const ClockSample& s : samples) values.push_back(s.seconds);
  ClockLine line;
  line.value = median(std::move(values));
  for (int round = 0; round < kClockRounds; round++) {
    Matrix2d a = Matrix2d::Zero();
    Vector2d b = Vector2d::Zero();
    for (const ClockSample& s : samples) {
      const Vector2d by(1, sloped ? s.stamp - middle : 0);
      const double sigma = scale * s.sigma, e = (s.seconds - line.value - line.slope * by.y()) / (kClockRobust * sigma);
      const double w = 1 / (sigma * sigma) / std::pow(1 + e * e, 2);
      a += w * by * by.transpose(), b += w * s.seconds * by;
    }
    if (!sloped) a(1, 1) = 1;
    const Matrix2d inverse = a.inverse();
    const Vector2d x = inverse * b;
    line = {x.x(), x.y(), inverse(0, 0), inverse(1, 1)};
  }
  return line;
}

double error_of(const ClockSample& s, double value, double scale) {
  const double e = std::abs(s.seconds - value) / (scale * s.sigma);
  return e < kClockRobust ? e * e : kClockRobust * (2 * e - kClockRobust);
}

// Returns the median ratio of errors to their sigmas, at least 1. A running median removes slow changes first.
double scale_of(const std::vector<ClockSample>& samples) {
  std::vector<double> errors;
  constexpr size_t kAround = 5;
  for (size_t i = 0; i < samples.size(); i++) {
    const size_t from = i > kAround ? i - kAround : 0, to = std::min(samples.size(), i + kAround + 1);
    std::vector<double> near;
    for (size_t j = from; j < to; j++) near.push_back(samples[j].seconds);
    errors.push_back(std::abs(samples[i].seconds - median(std::move(near))) / samples[i].sigma);
  }
  return std::max(1.0, 1.4826 * median(std::move(errors)));
}

double value_of(const std::vector<ClockSample>& samples, size_t from, size_t to) {
  std::vector<double> values;
  for (size_t i = from; i < to; i++) values.push_back(samples[i].seconds);
  return median(std::move(values));
}

size_t best_split(const std::vector<ClockSample>& samples, size_t from, size_t to, double scale, double least) {
  if (to - from < 2 * kMinSide) return 0;
  const auto cost = [&](size_t a, size_t b) {
    const double value = value_of(samples, a, b);
    double sum = 0;
    for (size_t i = a; i < b; i++) sum += error_of(samples[i], value, scale);
    return sum;
  };
  const double whole = cost(from, to);
  double best = least;
  size_t at = 0;
  for (size_t i = from + kMinSide; i + kMinSide <= to; i++) {
    const double gain = whole - cost(from, i) - cost(i, to);
    if (gain > best) best = gain, at = i;
  }
  return at;
}

void find_steps(const std::vector<ClockSample>& samples, size_t from, size_t to, double scale, double frame_time,
                std::vector<CameraClock::Step>& steps) {
  const size_t at = best_split(samples, from, to, scale, kChangeGain);
  if (at == 0) return;
  const double seconds = value_of(samples, at, to) - value_of(samples, from, at);
  const double frames = std::round(seconds / frame_time);
  find_steps(samples, from, at, scale, frame_time, steps);
  if (frames != 0 && std::abs(seconds / frame_time - frames) < kWholeFrame)
    steps.push_back({(samples[at - 1].stamp + samples[at].stamp) / 2, frames * frame_time, static_cast<int>(frames)});
  find_steps(samples, at, to, scale, frame_time, steps);
}

}  // namespace

double refine_clock(CameraClock& clock, std::vector<ClockSample> samples, double frame_time, double shown) {
  if (samples.size() < kMinSide) return 0;
  std::sort(samples.begin(), samples.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  clock.known = true;
  // Removes the current steps and drift from the samples, because they are estimated again.
  const auto late = [](const std::vector<CameraClock::Step>& steps, double stamp) {
    double sum = 0;
    for (const CameraClock::Step& step : steps) sum += stamp >= step.stamp ? step.seconds : 0;
    return sum;
  };
  for (ClockSample& s : samples) s.seconds += late(clock.steps, s.stamp) + clock.drift * (s.stamp - clock.middle);
  const double scale = scale_of(samples);
  clock.steps.clear();
  if (frame_time > 0) find_steps(samples, 0, samples.size(), scale, frame_time, clock.steps);
  for (ClockSample& s : samples) s.seconds -= late(clock.steps, s.stamp);
  const double middle = (samples.front().stamp + samples.back().stamp) / 2;
  ClockLine line = fit_line(samples, middle, scale, true);
  if (std::abs(line.slope) < kDriftSigmas * std::sqrt(line.slope_variance / shown))
    line = fit_line(samples, middle, scale, false);
  clock.offset += line.value;
  clock.drift = line.slope;
  clock.middle = middle;
  clock.sigma = std::sqrt(line.variance / shown);
  return line.value;
}

std::optional<double> suspected_step(std::vector<ClockSample> samples) {
  if (samples.size() < 2 * kMinSide) return std::nullopt;
  std::sort(samples.begin(), samples.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  const size_t at = best_split(samples, 0, samples.size(), scale_of(samples), kHint);
  if (at == 0) return std::nullopt;
  return (samples[at - 1].stamp + samples[at].stamp) / 2;
}

}  // namespace lf
