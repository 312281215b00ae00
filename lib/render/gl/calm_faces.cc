// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <cmath>

#include "render/gl/face_cover.h"
#include "render/gl/sum_shader.h"
#include "render/gl/sum_tables.h"

namespace lf::gl {
namespace {

// Of a function.
struct Range {
  double low = INFINITY, high = -INFINITY;
  void add(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  double largest() const { return std::max(std::abs(low), std::abs(high)); }
};

Range product(const Range& a, const Range& b) {
  Range r;
  for (const double x : {a.low, a.high})
    for (const double y : {b.low, b.high}) r.add(x * y);
  return r;
}

Range square(const Range& a) {
  const double least = a.low > 0 ? a.low : a.high < 0 ? a.high : 0;
  return {least * least, a.largest() * a.largest()};
}

bool weights_are_calm(const simd::SumTask& task, const FacePlan& face, const Rect& part) {
  const Rays& rays = task.plan->rays();
  const Vec2 first = rays.at(0, 0), anchor = anchor_of(face.rect);
  const Vec2 step(rays.at(1, 0).x - first.x, rays.at(0, 1).y - first.y);
  const Vec2 at_anchor = first + anchor * step;
  const Vec3 whole = face.edge[0] + face.edge[1] + face.edge[2];
  const double slope = std::abs(whole.x * step.x) + std::abs(whole.y * step.y);  // a pixel
  double terms = 0;
  Range sum;
  for (const double x : {part.x0, part.x1 - 1})
    for (const double y : {part.y0, part.y1 - 1}) {
      double of_corner = 0, value = 0;
      for (const Vec3& e : face.edge) {
        const double along = e.x * step.x * (x - anchor.x), down = e.y * step.y * (y - anchor.y);
        const double from = FacePlan::evaluate(e, at_anchor);
        of_corner += std::abs(along) + std::abs(down) + std::abs(from);
        value += along + down + from;
      }
      terms = std::max(terms, of_corner);
      sum.add(value);
    }
  const double least = sum.low > 0 ? sum.low : sum.high < 0 ? -sum.high : 0;
  // The mean of four pixels' weights is that in the middle but for the square of how much the sum changes on the way.
  return terms * kFloatRounding < kMaxWeightError * least && slope * slope < 4 * kMaxWeightError * least * least;
}

// What the focal surface's inverse distances are in a part of the view; false where it comes near to the eye.
bool distances_in(const ViewPlan& plan, const Rect& part, Range& inverse) {
  const FocalMap* map = plan.view().focus.map.get();
  if (!map) {
    inverse = {0, 0};
    return true;
  }
  const FocalMap::LevelRange levels = map->range_of(map->levels, part.x0, part.y0, part.x1, part.y1);
  inverse.add(map->inverse_of(levels.least));
  inverse.add(map->inverse_of(levels.largest));
  const double eye = std::max(inverse.low * plan.eye_distance(), inverse.high * plan.eye_distance());
  return eye < 1 - 1e-3 && std::abs(inverse.largest() * plan.eye_distance()) < 1e3;
}

// Numerators and denominators of a camera's homography are linear in each of the pixel's coordinates and the inverse
// distance, so that they and their quotients have their extremes in the corners.
bool is_seen(const simd::SumTask& task, const simd::Slot& slot, const FacePlan& face, const Rect& part,
             const Range& inverse) {
  const ViewPlan& plan = *task.plan;
  const Vec2 anchor = anchor_of(face.rect);
  const double near = plan.view().focus.map ? plan.inverse_at(anchor.x, anchor.y) : 0;
  const Mat3 from_pixel = slot.from_pixel + near * slot.per_inverse;
  const Vec3 from = from_pixel * Vec3(anchor, 1), per_from = slot.per_inverse * Vec3(anchor, 1);
  Range x, y, z;
  Vec3 terms(0);
  for (const double i : {part.x0 - anchor.x, part.x1 - 1 - anchor.x})
    for (const double j : {part.y0 - anchor.y, part.y1 - 1 - anchor.y})
      for (const double nearer : {inverse.low - near, inverse.high - near}) {
        const Vec3 along = i * from_pixel[0], down = j * from_pixel[1];
        const Vec3 per_along = i * slot.per_inverse[0], per_down = j * slot.per_inverse[1];
        const Vec3 at = from + along + down + nearer * (per_from + per_along + per_down);
        if (!(at.z > 0)) return false;
        terms = glm::max(terms, glm::abs(from) + glm::abs(along) + glm::abs(down) +
                                    std::abs(nearer) * (glm::abs(per_from) + glm::abs(per_along) + glm::abs(per_down)));
        x.add(at.x / at.z);
        y.add(at.y / at.z);
        z.add(at.z);
      }
  const Vec3 rounding = kFloatRounding * terms;
  if (!(rounding.z < z.low)) return false;
  double off_x = (rounding.x + x.largest() * rounding.z) / z.low,
         off_y = (rounding.y + y.largest() * rounding.z) / z.low;
  if (slot.radial || slot.tangential) {
    const Range xx = square(x), yy = square(y), r2{xx.low + yy.low, xx.high + yy.high};
    if (!(r2.high < 0.9 * slot.max_r2)) return false;
    const auto factor = [&](double r) { return 1 + r * (slot.k1 + r * slot.k2); };
    Range radial;
    radial.add(factor(r2.low));
    radial.add(factor(r2.high));
    if (const double turn = -slot.k1 / (2.0 * slot.k2); turn > r2.low && turn < r2.high) radial.add(factor(turn));
    const double shift = (std::abs(slot.p1) + std::abs(slot.p2)) * 4 * r2.high;
    const double more = 1 + 3 * std::abs(slot.k1) * r2.high + 5 * std::abs(slot.k2) * r2.high * r2.high +
                        6 * (std::abs(slot.p1) + std::abs(slot.p2)) * std::sqrt(r2.high);
    x = product(x, radial);
    y = product(y, radial);
    for (Range* of : {&x, &y}) *of = {of->low - shift, of->high + shift};
    off_x *= more;
    off_y *= more;
  }
  const double border = 2;  // of chroma, too
  const auto fits = [&](const Range& u, double off, double focal, double centre, int size) {
    const double total = focal * off + 2e-7 * (focal * u.largest() + std::abs(centre));
    return focal * u.low + centre > border && focal * u.high + centre < size - 1 - border && total < kMaxPositionError;
  };
  return fits(x, off_x, slot.fx, slot.cx, slot.image.width) && fits(y, off_y, slot.fy, slot.cy, slot.image.height);
}

}  // namespace

bool is_calm(const simd::SumTask& task, const FacePlan& face, uint8_t ours, const Rect& part) {
  if (!weights_are_calm(task, face, part)) return false;
  Range inverse;
  if (!distances_in(*task.plan, part, inverse)) return false;
  for (int k = 0; k < 3; k++) {
    if (!(ours >> k & 1)) continue;
    const simd::Slot& slot = task.slots[static_cast<size_t>(task.slot_of_camera[face.camera[k]])];
    if (slot.image.family == PixelFamily::kNone || !is_seen(task, slot, face, part, inverse)) return false;
  }
  return true;
}

}  // namespace lf::gl
