// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/camera_clock.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "base/maths.h"
#include "base/text.h"

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

constexpr double kStep = CameraMotion::kStep;
constexpr double kFast = 3;  // limit of the speed, as a multiple of the median
constexpr size_t kMinClockSamples = 20;
constexpr double kCorrelated = 0.5;  // minimum correlation, and minimum sum of two squared canonical correlations
constexpr double kBest = 1e-4;       // minimum share of unexplained variance

// Mean velocities of the brightest lights.
CameraMotion motion_of(const std::vector<LightPath>& paths, double frame_time, size_t num_lights) {
  double from = std::numeric_limits<double>::infinity(), to = -from;
  for (const LightPath& path : paths)
    if (!path.still) from = std::min(from, path.points.front().time), to = std::max(to, path.points.back().time);
  CameraMotion motion;
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
    auto& mean = motion.velocity.emplace_back();
    mean.setZero();
    if (motion.known.back()) {
      for (size_t i = 0; i < num_lights; i++) mean.head<2>() += Vector2d(lights[i].second.x, lights[i].second.y);
      mean /= static_cast<double>(num_lights);
      speeds.push_back(mean.norm());
      motion.count++;
    }
  }
  if (speeds.empty()) return motion;
  const double most = kFast * median(std::move(speeds));
  for (auto& v : motion.velocity)
    if (v.norm() > most) v *= most / v.norm();
  return motion;
}

// Calls `use` with the velocities that both cameras know, if b's stamps are `lag` steps behind a's.
template <class Use>
void for_each_common(const CameraMotion& a, const CameraMotion& b, int64_t lag, const Use& use) {
  const int64_t shift = a.first - b.first - lag;
  const int64_t from = std::max<int64_t>(0, -shift);
  const int64_t to = std::min(static_cast<int64_t>(a.velocity.size()), static_cast<int64_t>(b.velocity.size()) - shift);
  for (int64_t i = from; i < to; i++)
    if (a.known[i] && b.known[i + shift]) use(a.velocity[i], b.velocity[i + shift]);
}

// Returns the share of the motion that is not common, or 1 if the correlation is weak. Counts the samples.
double unexplained_linear(const CameraMotion& a, const CameraMotion& b, int64_t lag, size_t& n) {
  Matrix2d aa = Matrix2d::Zero(), bb = aa, ab = aa;
  for_each_common(a, b, lag, [&](const auto& u, const auto& v) {
    const Vector2d p = u.template head<2>(), q = v.template head<2>();
    aa += p * p.transpose(), bb += q * q.transpose(), ab += p * q.transpose(), n++;
  });
  if (!(aa.determinant() > 0) || !(bb.determinant() > 0)) return 1;
  const Matrix2d squares = aa.inverse() * ab * bb.inverse() * ab.transpose();
  return squares.trace() < kCorrelated ? 1 : (Matrix2d::Identity() - squares).determinant();
}

double unexplained_equal(const CameraMotion& a, const CameraMotion& b, int64_t lag, size_t& n) {
  double aa = 0, bb = 0, ab = 0;
  for_each_common(a, b, lag,
                  [&](const auto& u, const auto& v) { aa += u.dot(u), bb += v.dot(v), ab += u.dot(v), n++; });
  if (!(aa > 0) || !(bb > 0)) return 1;
  const double correlation = ab / std::sqrt(aa * bb);
  return correlation < kCorrelated ? 1 : 1 - correlation * correlation;
}

}  // namespace

MotionMatch match_motions(const CameraMotion& a, const CameraMotion& b, double reach, bool same_axes) {
  const auto furthest = static_cast<int64_t>(std::lround(reach / kStep));
  std::vector<double> scores;
  for (int64_t lag = -furthest; lag <= furthest; lag++) {
    size_t n = 0;
    const double left = same_axes ? unexplained_equal(a, b, lag, n) : unexplained_linear(a, b, lag, n);
    scores.push_back(n < kMinClockSamples ? 0 : -0.5 * static_cast<double>(n) * std::log(std::max(left, kBest)));
  }
  const auto at = static_cast<size_t>(std::ranges::max_element(scores) - scores.begin());
  double fine = 0;
  if (at > 0 && at + 1 < scores.size())
    if (const double bend = scores[at - 1] - 2 * scores[at] + scores[at + 1]; bend < 0)
      fine = std::clamp((scores[at - 1] - scores[at + 1]) / (2 * bend), -0.5, 0.5);
  return {scores[at], (static_cast<double>(at) - static_cast<double>(furthest) + fine) * kStep};
}

size_t coarse_clocks(const std::vector<std::vector<LightPath>>& paths, const std::vector<double>& frame_times,
                     size_t num_lights, double reach, std::vector<CameraClock>& clocks) {
  std::vector<CameraMotion> motions;
  for (size_t i = 0; i < paths.size(); i++) motions.push_back(motion_of(paths[i], frame_times[i], num_lights));
  const auto most = std::ranges::max_element(motions, {}, &CameraMotion::count);
  const auto reference = static_cast<size_t>(most - motions.begin());
  clocks.assign(paths.size(), {});
  clocks[reference].known = most->count > 0;
  for (size_t i = 0; i < paths.size(); i++) {
    if (i == reference) continue;
    const MotionMatch found = match_motions(*most, motions[i], reach, false);
    if (found.score > 0) clocks[i].offset = found.offset, clocks[i].known = true;
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

std::vector<lightfield::Finding> diagnose_clock(unsigned id, const CameraClock& clock, double seconds,
                                                double expected) {
  constexpr double kDrifted = 2e-3;  // seconds over the whole recording
  constexpr double kLate = 0.1;      // seconds
  std::vector<lightfield::Finding> findings;
  if (!clock.known) return findings;
  const auto warn = [&](const char* code, std::string text) {
    findings.push_back({lightfield::Finding::Severity::kWarning, code, std::move(text)});
  };
  for (const CameraClock::Step& step : clock.steps)
    warn("dropped-frames",
         format_text(step.frames > 0 ? "camera %u lost %d frame%s at %.2f s without a gap in its stamps"
                                     : "camera %u has %d extra frame%s at %.2f s according to its stamps",
                     id, std::abs(step.frames), std::abs(step.frames) == 1 ? "" : "s", step.stamp));
  if (std::abs(clock.drift) * seconds > kDrifted)
    warn(
        "clock-drift",
        format_text("camera %u: its clock is %s by %.0f ppm, so its offset is not constant: synchronise all cameras to "
                    "one clock",
                    id, clock.drift < 0 ? "fast" : "slow", std::abs(clock.drift) * 1e6));
  if (const double late = clock.offset - expected; std::abs(late) > kLate)
    warn("late-camera",
         format_text("camera %u: its stamps are %.1f ms %s, more than free-running cameras explain: did all recordings "
                     "use the same clock?",
                     id, 1e3 * std::abs(late), late > 0 ? "early" : "late"));
  return findings;
}

void add_clock(const CameraClock& clock, nlohmann::ordered_json& camera) {
  if (!clock.known) return;
  camera["time_offset_ms"] = 1e3 * clock.offset;
  camera["time_offset_sigma_ms"] = 1e3 * clock.sigma;
  camera["clock_drift_ppm"] = 1e6 * clock.drift;
  camera["dropped_frames"] = nlohmann::ordered_json::array();
  for (const CameraClock::Step& step : clock.steps)
    camera["dropped_frames"].push_back({{"stamp", step.stamp}, {"frames", step.frames}});
}

}  // namespace lf
