// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/frame_times.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/percentiles.h"

namespace lf {
namespace {

constexpr double kSameRate = 0.01;

}  // namespace

FrameTimes measure_frame_times(std::span<const double> times) {
  FrameTimes result{.frames = times.size()};
  std::vector<double> forward;
  for (const double time : times) {
    if (!forward.empty() && !(time > forward.back()))
      result.backwards++;
    else
      forward.push_back(time);
  }
  if (forward.size() < 3) return result;
  std::vector<double> intervals;
  for (size_t i = 1; i < forward.size(); i++) intervals.push_back(forward[i] - forward[i - 1]);
  const double usual = median(intervals);

  // Each frame's number, then the line through (number, time).
  std::vector<double> numbers{0};
  for (const double interval : intervals)
    numbers.push_back(numbers.back() + std::max(1.0, std::round(interval / usual)));
  const double n = static_cast<double>(forward.size());
  double mean_number = 0, mean_time = 0, covariance = 0, variance = 0;
  for (size_t i = 0; i < forward.size(); i++) mean_number += numbers[i] / n, mean_time += (forward[i] - forward[0]) / n;
  for (size_t i = 0; i < forward.size(); i++) {
    covariance += (numbers[i] - mean_number) * (forward[i] - forward[0] - mean_time);
    variance += (numbers[i] - mean_number) * (numbers[i] - mean_number);
  }
  result.period = covariance / variance;
  const double begin = mean_time - result.period * mean_number;
  result.first = forward[0] + begin;
  double squares = 0;
  for (size_t i = 0; i < forward.size(); i++) {
    const double error = forward[i] - forward[0] - begin - result.period * numbers[i];
    squares += error * error;
  }
  result.jitter = std::sqrt(squares / n);
  result.missing = static_cast<size_t>(numbers.back()) + 1 - forward.size();
  return result;
}

Skew measure_skew(std::span<const FrameTimes> cameras) {
  Skew skew;
  skew.phase.assign(cameras.size(), NAN);
  std::vector<double> periods;
  for (const FrameTimes& camera : cameras)
    if (camera.period > 0) periods.push_back(camera.period);
  if (periods.empty()) return skew;
  const double period = median(periods);
  const auto counts = [&](const FrameTimes& camera) {
    return camera.period > 0 && std::abs(camera.period / period - 1) <= kSameRate;
  };
  // Phases are angles: their middle is the direction of the sum of their unit vectors. Of all cameras at the time when
  // the last of them began, so that clocks that differ have not drifted far.
  double begin = -INFINITY;
  for (const FrameTimes& camera : cameras)
    if (counts(camera)) begin = std::max(begin, camera.first);
  const auto late = [&](const FrameTimes& camera) {
    return camera.first + std::ceil((begin - camera.first) / camera.period) * camera.period - begin;
  };
  double x = 0, y = 0;
  for (const FrameTimes& camera : cameras) {
    if (!counts(camera)) continue;
    const double angle = 2 * std::numbers::pi * late(camera) / period;
    x += std::cos(angle), y += std::sin(angle);
  }
  const double middle = std::atan2(y, x) / (2 * std::numbers::pi) * period;
  double least = INFINITY, most = -INFINITY, shortest = INFINITY, longest = 0;
  for (size_t i = 0; i < cameras.size(); i++) {
    if (!counts(cameras[i])) continue;
    const double phase = std::remainder(late(cameras[i]) - middle, period);
    skew.phase[i] = phase;
    least = std::min(least, phase), most = std::max(most, phase);
    shortest = std::min(shortest, cameras[i].period), longest = std::max(longest, cameras[i].period);
  }
  skew.spread = most - least;
  skew.drift = longest / shortest - 1;
  return skew;
}

}  // namespace lf
