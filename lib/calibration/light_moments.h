// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/LU>

namespace lf {

// Sums over a light's image under a weight that is a normal distribution.
inline constexpr double kMomentsReach = 3.5;  // sigmas of the weight that are looked at
inline constexpr int kMomentsLargest = 80;    // pixels from the middle that are looked at

struct LightMoments {
  double weight = 0;                                 // sum of weight x image
  double clipped = 0;                                // the part of `weight` that is of clipped pixels
  double squares = 0;                                // variance of `weight` under noise of variance 1
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();    // first moment about the weight's middle
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();  // second moment about the weight's middle
  Eigen::Vector2d skew = Eigen::Vector2d::Zero();    // third moment, in sigmas of the weight
  Eigen::Matrix2d by_noise = Eigen::Matrix2d::Zero();  // covariance of `mean` under noise of variance 1
};

// A pixel of a light's image.
struct LightSample {
  double value = 0;
  double gain = 1;  // by how much noise of the picture moves the value; 0: it is clipped, and does not
};

// The sums over the pixels within reach of a weight's middle; `sample(x, y)` is a pixel's LightSample.
template <class Sample>
LightMoments light_moments(const Eigen::Vector2d& centre, const Eigen::Matrix2d& shape, int width, int height,
                           Sample&& sample) {
  LightMoments m;
  const Eigen::Matrix2d inverse = shape.inverse();
  const int rx = std::min(kMomentsLargest, static_cast<int>(std::ceil(kMomentsReach * std::sqrt(shape(0, 0)))));
  const int ry = std::min(kMomentsLargest, static_cast<int>(std::ceil(kMomentsReach * std::sqrt(shape(1, 1)))));
  const int x0 = std::max(0, static_cast<int>(centre.x()) - rx),
            x1 = std::min(width - 1, static_cast<int>(centre.x()) + rx + 1);
  const int y0 = std::max(0, static_cast<int>(centre.y()) - ry),
            y1 = std::min(height - 1, static_cast<int>(centre.y()) + ry + 1);
  for (int y = y0; y <= y1; y++)
    for (int x = x0; x <= x1; x++) {
      const Eigen::Vector2d from(x - centre.x(), y - centre.y());
      const double distance = from.dot(inverse * from);
      if (distance > kMomentsReach * kMomentsReach) continue;
      const auto [d, gain] = sample(x, y);
      const double w = std::exp(-distance / 2), noise = w * w * gain * gain;
      m.weight += w * d;
      m.mean += w * d * from;
      m.spread += w * d * from * from.transpose();
      m.skew += w * d * distance * from;
      m.squares += noise;
      m.by_noise += noise * from * from.transpose();
      if (gain == 0) m.clipped += w * d;
    }
  return m;
}

}  // namespace lf
