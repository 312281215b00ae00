// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/plane_coordinates.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.h"

namespace lf {

namespace {

double largest_component(const Vec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

int exponent_of(double v) {  // v in [2^(e-1), 2^e)
  int e = 0;
  std::frexp(v, &e);
  return e;
}

// Divides by the power of two 2^e that brings the largest component into [1/2, 1); returns e. Not for all zeros.
int scale_to_unit(std::vector<Vec3>& points) {
  double reach = 0;
  for (const Vec3& p : points) reach = std::max(reach, largest_component(p));
  const int e = exponent_of(reach);
  for (Vec3& p : points) p = {std::ldexp(p.x, -e), std::ldexp(p.y, -e), std::ldexp(p.z, -e)};
  return e;
}

double length2(const Vec3& v) { return glm::dot(v, v); }

Vec3 unit(const Vec3& v) { return v / std::sqrt(length2(v)); }

}  // namespace

CameraCentres normalised_centres(std::span<const Vec3> positions) {
  CameraCentres centres;
  if (positions.empty()) return centres;
  double magnitude = 0;
  centres.at.reserve(positions.size());
  for (size_t i = 0; i < positions.size(); ++i) {
    if (!is_finite(positions[i])) throw Error("cameras[" + std::to_string(i) + "].position: must be finite numbers");
    // Relative to a camera first: exact for arrays far from the origin. Quarters, so that nothing overflows below.
    centres.at.push_back(0.25 * positions[i] - 0.25 * positions[0]);
    magnitude = std::max(magnitude, 0.25 * largest_component(positions[i]));
  }
  if (std::all_of(centres.at.begin(), centres.at.end(), [](const Vec3& c) { return c == Vec3(0); })) return centres;
  const int e = scale_to_unit(centres.at);
  Vec3 mean(0);
  for (const Vec3& c : centres.at) mean += c;
  mean /= static_cast<double>(positions.size());
  for (Vec3& c : centres.at) c -= mean;
  const int unit_exponent = e + scale_to_unit(centres.at);
  // A double of magnitude 2^k is known to 2^(k-53); four of these leave room for the rotation into the plane.
  centres.quantum = std::max(0x1p-23, std::ldexp(1.0, exponent_of(magnitude) - 51 - unit_exponent));
  return centres;
}

PlaneAxes principal_axes(std::span<const Vec3> points) {
  Vec3 mean(0);
  for (const Vec3& p : points) mean += p;
  if (!points.empty()) mean /= static_cast<double>(points.size());
  double s[3][3] = {};  // scatter; ends up diagonal
  for (const Vec3& p : points) {
    const Vec3 d = p - mean;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) s[i][j] += d[i] * d[j];
    }
  }
  Vec3 axis[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  constexpr int kMaxSweeps = 32;  // converges quadratically: 5 or 6 are usual
  bool rotated = true;
  for (int sweep = 0; sweep < kMaxSweeps && rotated; ++sweep) {
    rotated = false;
    for (const auto& [p, q] : {std::pair{0, 1}, {0, 2}, {1, 2}}) {
      if (std::abs(s[p][q]) <= 0x1p-60 * (s[p][p] + s[q][q])) continue;
      rotated = true;
      const double theta = (s[q][q] - s[p][p]) / (2 * s[p][q]);
      const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
      const double cosine = 1 / std::sqrt(t * t + 1), sine = t * cosine;
      const int r = 3 - p - q;
      const double spr = s[p][r], sqr = s[q][r], shift = t * s[p][q];
      s[p][p] -= shift;
      s[q][q] += shift;
      s[p][q] = s[q][p] = 0;
      s[p][r] = s[r][p] = cosine * spr - sine * sqr;
      s[q][r] = s[r][q] = sine * spr + cosine * sqr;
      const Vec3 ap = axis[p], aq = axis[q];
      axis[p] = cosine * ap - sine * aq;
      axis[q] = sine * ap + cosine * aq;
    }
  }
  int order[3] = {0, 1, 2};
  std::stable_sort(order, order + 3, [&](int a, int b) { return s[a][a] > s[b][b]; });
  PlaneAxes axes;
  axes.normal = unit(axis[order[2]]);
  axes.x = unit(axis[order[0]] - axes.normal * glm::dot(axes.normal, axis[order[0]]));
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

PlaneAxes best_fit_plane(std::span<const Vec3> points, const Vec3& right, const Vec3& forward) {
  PlaneAxes axes = principal_axes(points);
  if (glm::dot(axes.normal, forward) < 0) axes.normal = -axes.normal;
  const Vec3 upright = right - axes.normal * glm::dot(axes.normal, right);
  const double enough = 0.1 * static_cast<double>(points.size());
  if (length2(upright) > enough * enough) axes.x = unit(upright);
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

PlaneAxes plane_with_normal(const Vec3& normal, const PlaneAxes& reference) {
  PlaneAxes axes;
  axes.normal = unit(normal / largest_component(normal));
  const double along_x = glm::dot(axes.normal, reference.x);
  const Vec3& guide = along_x * along_x <= 0.5 ? reference.x : reference.y;
  axes.x = unit(guide - axes.normal * glm::dot(axes.normal, guide));
  axes.y = glm::cross(axes.normal, axes.x);
  return axes;
}

IntPoint quantise(const Vec3& centre, const PlaneAxes& axes, double quantum) {
  // |centre| <= sqrt(3) and quantum >= 2^-23, so this stays below 2^24.
  return {static_cast<int32_t>(std::floor(glm::dot(centre, axes.x) / quantum + 0.5)),
          static_cast<int32_t>(std::floor(glm::dot(centre, axes.y) / quantum + 0.5))};
}

bool on_one_line(const Vec3& a, const Vec3& b, const Vec3& c, double tolerance) {
  const Vec3 ab = b - a, ac = c - a, bc = c - b;
  const double longest2 = std::max({length2(ab), length2(ac), length2(bc)});
  return length2(glm::cross(ab, ac)) <= tolerance * tolerance * longest2;
}

}  // namespace lf
