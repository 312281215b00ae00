// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/reference_lens.h"

#include <limits>

namespace lf::reference {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

// Halves [low, high] until nothing lies between; `beyond(x)` is false below the place sought and true above it.
template <typename Predicate>
Real bisect(Real low, Real high, const Predicate& beyond) {
  for (;;) {
    const Real middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return middle;
    (beyond(middle) ? high : low) = middle;
  }
}

// The slope of r (1 + k1 r^2 + k2 r^4) is a parabola in q = r^2 that starts at 1: its first zero is before the vertex
// if the parabola opens upwards, and the only one if it opens downwards.
Real find_fold(Real k1, Real k2) {
  const auto slope = [&](Real q) { return 1 + q * (3 * k1 + q * 5 * k2); };
  Real end = 1;
  if (k2 > 0) {
    end = -3 * k1 / (10 * k2);
    if (!(end > 0) || slope(end) > 0) return kInfinity;
  } else if (k2 < 0 || k1 < 0) {
    while (slope(end) > 0) end *= 2;
  } else {
    return kInfinity;
  }
  return std::sqrt(bisect(0, end, [&](Real q) { return slope(q) <= 0; }));
}

}  // namespace

ReferenceLens::ReferenceLens(const lf::Lens& lens) {
  const auto& p = lens.params();
  switch (lens.model()) {
    case LensModel::kSimplePinhole:
    case LensModel::kSimpleRadial:
    case LensModel::kRadial:
      fx_ = fy_ = p[0];
      cx_ = p[1];
      cy_ = p[2];
      if (lens.model() != LensModel::kSimplePinhole) k1_ = p[3];
      if (lens.model() == LensModel::kRadial) k2_ = p[4];
      break;
    case LensModel::kPinhole:
    case LensModel::kOpenCv:
      fx_ = p[0];
      fy_ = p[1];
      cx_ = p[2];
      cy_ = p[3];
      if (lens.model() == LensModel::kOpenCv) {
        k1_ = p[4];
        k2_ = p[5];
        p1_ = p[6];
        p2_ = p[7];
      }
      break;
  }
  fold_ = find_fold(k1_, k2_);
}

P2 ReferenceLens::distort(const P2& u) const {
  const Real r2 = u.x * u.x + u.y * u.y;
  const Real radial = 1 + k1_ * r2 + k2_ * r2 * r2;
  return {u.x * radial + 2 * p1_ * u.x * u.y + p2_ * (r2 + 2 * u.x * u.x),
          u.y * radial + 2 * p2_ * u.x * u.y + p1_ * (r2 + 2 * u.y * u.y)};
}

std::optional<P2> ReferenceLens::project(const V3& x) const {
  if (!(x.z > 0)) return std::nullopt;
  const P2 u{x.x / x.z, x.y / x.z};
  if (std::hypot(u.x, u.y) > fold_) return std::nullopt;
  const P2 d = distort(u);
  return P2{fx_ * d.x + cx_, fy_ * d.y + cy_};
}

std::optional<P2> ReferenceLens::line_of_sight(const P2& pixel) const {
  const P2 target{(pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_};
  if (k1_ == 0 && k2_ == 0 && p1_ == 0 && p2_ == 0) return target;
  const bool radial_only = p1_ == 0 && p2_ == 0;

  const auto grown = [&](Real r) { return r + k1_ * r * r * r + k2_ * r * r * r * r * r; };
  const Real length = std::hypot(target.x, target.y);
  Real end = fold_;
  if (std::isinf(end))
    for (end = 1; grown(end) < length;) end *= 2;
  if (radial_only && grown(end) < length) return std::nullopt;
  const Real r = length > 0 ? bisect(0, end, [&](Real x) { return grown(x) >= length; }) : 0;
  P2 u = length > 0 ? P2{target.x * r / length, target.y * r / length} : P2{};
  if (radial_only) return u;

  for (int i = 0; i < 60; i++) {
    constexpr Real kStep = 1e-6L;
    const P2 at = distort(u);
    const P2 right = distort({u.x + kStep, u.y}), left = distort({u.x - kStep, u.y});
    const P2 down = distort({u.x, u.y + kStep}), up = distort({u.x, u.y - kStep});
    const Real xx = (right.x - left.x) / (2 * kStep), xy = (down.x - up.x) / (2 * kStep);
    const Real yx = (right.y - left.y) / (2 * kStep), yy = (down.y - up.y) / (2 * kStep);
    const Real det = xx * yy - xy * yx;
    const P2 miss{target.x - at.x, target.y - at.y};
    u.x += (yy * miss.x - xy * miss.y) / det;
    u.y += (xx * miss.y - yx * miss.x) / det;
  }
  const P2 check = distort(u);
  if (!(std::hypot(check.x - target.x, check.y - target.y) < 1e-15L * (1 + length))) return std::nullopt;
  if (std::hypot(u.x, u.y) > fold_) return std::nullopt;
  return u;
}

}  // namespace lf::reference
