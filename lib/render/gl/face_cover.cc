// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/face_cover.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/gl/sum_tables.h"

namespace lf::gl {
namespace {

// Parts that are not calm are halved down to this, pixels: what is left to careful programs is a seam.
constexpr int kLeastPart = 32;

// Pixels: what corners are rounded by (GL_SUBPIXEL_BITS is 4 at least), and then some; and how far from a pixel the
// middle of its block is.
constexpr double kPixelMargin = 1.0 / 8, kBlockMargin = kPixelMargin + 0.75;

// A convex polygon.
class Polygon {
 public:
  // The pixels of the rectangle.
  explicit Polygon(const Rect& rect) : count_(4) {
    const double x0 = rect.x0 - 0.5, y0 = rect.y0 - 0.5, x1 = rect.x1 - 0.5, y1 = rect.y1 - 0.5;
    corners_[0] = {x0, y0};
    corners_[1] = {x1, y0};
    corners_[2] = {x1, y1};
    corners_[3] = {x0, y1};
  }
  bool empty() const { return count_ == 0; }
  // Keeps what is where the function h of the pixel is more than minus `margin` pixels from where it is 0.
  void clip(const Vec3& h, double margin) {
    // What rounding has left of a function does not clip.
    constexpr double kRounding = 1e-10;
    const double slope = std::hypot(h.x, h.y);
    if (!(slope > kRounding * std::abs(h.z))) return;
    Vec2 clipped[kMaxCorners];
    size_t n = 0;
    for (size_t i = 0; i < count_; i++) {
      const Vec2 &a = corners_[i], &b = corners_[(i + 1) % count_];
      const double va = h.x * a.x + h.y * a.y + h.z + margin * slope, vb = h.x * b.x + h.y * b.y + h.z + margin * slope;
      if (va >= 0) clipped[n++] = a;
      if ((va >= 0) != (vb >= 0)) clipped[n++] = a + (b - a) * (va / (va - vb));
    }
    count_ = n;
    std::copy_n(clipped, n, corners_);
  }
  // Whole pixels that it touches.
  Rect bounds() const {
    Vec2 low(std::numeric_limits<double>::infinity()), high(-low);
    for (size_t i = 0; i < count_; i++) {
      low = glm::min(low, corners_[i]);
      high = glm::max(high, corners_[i]);
    }
    return {static_cast<int>(std::floor(low.x)), static_cast<int>(std::floor(low.y)),
            static_cast<int>(std::ceil(high.x)) + 1, static_cast<int>(std::ceil(high.y)) + 1};
  }
  void add_to(std::vector<CoverCorner>& triangles, uint32_t face) const {
    const auto corner = [&](size_t i) {
      return CoverCorner{static_cast<float>(corners_[i].x), static_cast<float>(corners_[i].y), face};
    };
    for (size_t i = 2; i < count_; i++)
      for (const size_t k : {size_t{0}, i - 1, i}) triangles.push_back(corner(k));
  }

 private:
  static constexpr size_t kMaxCorners = 8;  // of a rectangle, and one more for each half-plane
  Vec2 corners_[kMaxCorners];
  size_t count_;
};

// Covers the faces of a task, one after the other.
class Coverer {
 public:
  Coverer(const simd::SumTask& task, FaceCover& out)
      : task_(task), i420_(task.family == PixelFamily::kI420), separable_(task.plan->rays().separable()), out_(out) {
    if (!separable_) return;
    const Rays& rays = task.plan->rays();
    first_ = rays.at(0, 0);
    step_ = Vec2(rays.at(1, 0).x - first_.x, rays.at(0, 1).y - first_.y);
  }

  void add(uint32_t number, const Rect& rect) {
    const FacePlan& face = task_.plan->faces()[number];
    if (!task_.face_corners[number]) return;
    Rect part = intersect(face.rect, rect);
    if (part.empty()) return;
    if (i420_) part = {part.x0 & ~1, part.y0 & ~1, (part.x1 + 1) & ~1, (part.y1 + 1) & ~1};
    if (separable_)
      split(number, face, part);
    else
      add_part(out_.careful, number, Polygon(part), Polygon(part), part);
  }

 private:
  // The face in a part of the view, a margin around: where all edge functions have one sign. Where it straddles the
  // eye's plane there are two such places: all of the part, so that nothing is covered twice.
  Polygon clipped(const FacePlan& face, const Rect& part, double margin) const {
    Polygon of[2] = {Polygon(part), Polygon(part)};
    for (const Vec3& e : face.edge) {
      const Vec3 h(e.x * step_.x, e.y * step_.y, FacePlan::evaluate(e, first_));
      of[0].clip(h, margin);
      of[1].clip(-h, margin);
    }
    if (!of[0].empty() && !of[1].empty()) return Polygon(part);
    return of[0].empty() ? of[1] : of[0];
  }

  void split(uint32_t number, const FacePlan& face, const Rect& part) {
    const Polygon pixels = clipped(face, part, kPixelMargin);
    const Polygon blocks = i420_ ? clipped(face, part, kBlockMargin) : pixels;
    if (blocks.empty()) return;
    const Rect bounds = blocks.bounds();
    if (is_calm(task_, face, task_.face_corners[number], bounds))
      return add_part(out_.calm, number, pixels, blocks, part);
    if (std::max(part.width(), part.height()) <= kLeastPart) {
      out_.careful_rect = unite(out_.careful_rect, intersect(part, bounds));
      return add_part(out_.careful, number, pixels, blocks, part);
    }
    const bool across = part.width() >= part.height();
    const int middle = (across ? part.x0 + part.x1 : part.y0 + part.y1) / 2 & ~1;
    Rect first = part, second = part;
    (across ? first.x1 : first.y1) = middle;
    (across ? second.x0 : second.y0) = middle;
    split(number, face, first);
    split(number, face, second);
  }

  void add_part(FaceCover::Triangles& to, uint32_t number, const Polygon& pixels, const Polygon& blocks,
                const Rect& part) {
    if (&to == &out_.careful && !separable_) out_.careful_rect = unite(out_.careful_rect, part);
    pixels.add_to(to.pixels, number);
    if (i420_) blocks.add_to(to.blocks, number);
  }

  const simd::SumTask& task_;
  const bool i420_, separable_;
  Vec2 first_, step_;  // lines of sight
  FaceCover& out_;
};

}  // namespace

FaceCover cover_faces(const simd::SumTask& task, const Rect& rect) {
  FaceCover cover;
  Coverer coverer(task, cover);
  for (uint32_t i = 0; i < task.plan->faces().size(); i++) coverer.add(i, rect);
  Rect& careful = cover.careful_rect;
  if (task.family == PixelFamily::kI420)
    careful = {careful.x0 & ~1, careful.y0 & ~1, (careful.x1 + 1) & ~1, (careful.y1 + 1) & ~1};
  careful = intersect(careful, rect);
  if (careful.empty()) careful = {};
  return cover;
}

}  // namespace lf::gl
