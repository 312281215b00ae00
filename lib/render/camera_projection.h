// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/maths.h"
#include "image/image.h"
#include "render/view_plan.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Maps pixels of a view to positions in a camera's image, where the renderer then samples the pixel's colour. The
// pixel's line of sight d meets the focal surface (the surface in focus) at a point, and the camera sees this point
// through its lens.
//
// If the focal surface is a plane, it is (p . d) t = c in view coordinates, with X_view = t d and X_camera = R X_view +
// T. Then
//     (p . d) X_camera = (c R + T p^T) d,
// which is a homography. The sign of c is chosen so that its factor is positive for t > 0.
//
// If the focal surface is a map, (p . d) t = 1/s - h at inverse distance s, with h = ViewPlan::eye_distance(). Then
//     s (p . d) X_camera = ((1 - s h) R + s T p^T) d,
// which is a homography for each s, and linear in s.
class CameraProjection {
 public:
  // Prepares the projection into `camera`. `rig_camera` is the description of the same camera in the rig. If the plan
  // has explicit homographies, only the lens and size of the camera are used.
  CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

  // Returns the homography from a line of sight (u, v, 1) to camera coordinates, up to a positive factor for t > 0. If
  // there is a map, the homography is for inverse distance 0, and per_inverse() is its derivative by the inverse
  // distance.
  const Mat3& camera_from_ray() const { return camera_from_ray_; }
  const Mat3& per_inverse() const { return per_inverse_; }
  bool has_map() const { return has_map_; }
  const Lens& lens() const { return lens_; }

  // Computes the position in the camera's image that shows the point of a line of sight. Returns false if the camera
  // does not see the point, because the point is behind the camera or outside its image. `inverse` is the focal map's
  // inverse distance at that point; it is ignored without a map.
  bool project(const Vec2& ray, double inverse, Vec2& pixel) const {
    return project_unbounded(ray, inverse, pixel) && pixel.x >= -0.5 && pixel.x <= right_ && pixel.y >= -0.5 &&
           pixel.y <= bottom_;
  }
  // Returns the point of a line of sight in camera coordinates, up to a positive factor.
  Vec3 point(const Vec2& ray, double inverse) const {
    const Vec3 d(ray, 1), x = camera_from_ray_ * d;
    return has_map_ ? x + inverse * (per_inverse_ * d) : x;
  }
  bool project_unbounded(const Vec2& ray, double inverse, Vec2& pixel) const {
    if (has_map_ && !(1 - inverse * eye_distance_ > 0)) return false;  // the surface is behind the eye
    const Vec3 x = point(ray, inverse);
    if (distorted_) {
      const std::optional<Vec2> seen = lens_.project(x);
      if (seen) pixel = *seen;
      return seen.has_value();
    }
    if (!(x.z > 0)) return false;
    pixel = {lens_.fx() * (x.x / x.z) + lens_.cx(), lens_.fy() * (x.y / x.z) + lens_.cy()};
    return true;
  }

 private:
  Mat3 camera_from_ray_;
  Mat3 per_inverse_{0};
  const bool has_map_;
  const double eye_distance_;
  const Lens lens_;
  bool distorted_;
  double right_, bottom_;  // edges of the image, half a pixel beyond the outermost pixel centres
};

// Returns the region of a camera's image that must be decoded to render the camera's contribution to `rect`. The region
// includes the margins that interpolation and chroma need. `rect` must contain all pixels with a weight of the camera.
// Returns the whole image if the region is unknown, and an empty region if the view shows no part of the image.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera);
// Returns the region of a camera's image that must be decoded if the focal map has other levels than the view's map,
// for example for a depth hypothesis. `levels` are the smallest and largest level in `rect`.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera,
                   const FocalMap::LevelRange& levels);

// Returns the region of a camera's image that its whole contribution to the view needs: source_region(), extended to
// whole chroma samples. Returns one pixel if the view shows none of the image, because the contribution is then missing
// weight.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// Returns the region that the camera needs for several focal maps together, for example for the depth hypotheses of a
// request. Returns an empty region if the view shows none of the image.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                   std::span<const std::vector<uint8_t>> maps);

// The functions below decide whether images are sharpened (image/image_filters.h). Sharpening restores detail that
// bilinear sampling loses, so it helps only if the view shows such detail.

// Returns true if the view is much coarser than the image, so that sharpened samples would alias. The limit is
// empirical: below 0.75, the built-in scene looks better without sharpening.
inline bool is_coarse(const Lens& view, const Lens& camera) { return view.fy() < 0.75 * camera.fy(); }

// Returns true if the view's pixels are exactly the camera's pixels, seen from the camera's position.
bool is_pixel_for_pixel(const View& view, const Camera& camera);

inline bool shows_detail(const View& view, const Camera& camera) {
  return !is_coarse(view.lens, camera.lens) && !is_pixel_for_pixel(view, camera);
}

}  // namespace lf

namespace lf::plain {

// Takes bilinear samples of one 8-bit channel. Coordinates are clamped to the outermost pixel centres.
class Sampler {
 public:
  Sampler(const Vec2& position, int width, int height) : across_(position.x, width), down_(position.y, height) {}
  float sample(const uint8_t* plane, ptrdiff_t stride, int pixel_stride) const {
    const auto value = [&](int x, int y) { return static_cast<float>(plane[y * stride + x * pixel_stride]); };
    const auto along = [&](int y) {
      const float left = value(across_.first, y);
      return left + (value(across_.second, y) - left) * across_.weight;
    };
    const float upper = along(down_.first);
    return upper + (along(down_.second) - upper) * down_.weight;
  }

 private:
  struct Axis {
    Axis(double position, int size) {
      const double x = std::clamp(position, 0.0, size - 1.0);
      first = static_cast<int>(x);
      second = std::min(first + 1, size - 1);
      weight = static_cast<float>(x - first);
    }
    int first, second;
    float weight;
  };
  Axis across_, down_;
};

}  // namespace lf::plain
