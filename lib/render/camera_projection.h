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

// Finds the position in a camera's image that a view's line of sight samples, through the focal surface and the
// camera's lens.
//
// A plane is (p . d) t = c in view coordinates, X_view = t d, and X_camera = R X_view + T:
//     (p . d) X_camera = (c R + T p^T) d.
// The sign of c makes the factor positive for t > 0: a homography.
//
// A map has (p . d) t = 1/s - h at inverse distance s, with h = ViewPlan::eye_distance():
//     s (p . d) X_camera = ((1 - s h) R + s T p^T) d,
// a homography for each s, linear in s.
class CameraProjection {
 public:
  // `rig_camera`: `camera` in the rig. If the plan has explicit homographies, only its lens and size are used.
  CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

  // Homography from a line of sight (u, v, 1) to camera coordinates, up to a positive factor for t > 0. With a map,
  // camera_from_ray() is for inverse distance 0, and per_inverse() is its derivative by the inverse distance.
  const Mat3& camera_from_ray() const { return camera_from_ray_; }
  const Mat3& per_inverse() const { return per_inverse_; }
  bool has_map() const { return has_map_; }
  const Lens& lens() const { return lens_; }

  // Computes the position in the image. Returns false if the sample is missing: behind the camera or outside its image.
  // `inverse`: inverse distance of the focal map there; ignored without a map.
  bool project(const Vec2& ray, double inverse, Vec2& pixel) const {
    return project_unbounded(ray, inverse, pixel) && pixel.x >= -0.5 && pixel.x <= right_ && pixel.y >= -0.5 &&
           pixel.y <= bottom_;
  }
  bool project_unbounded(const Vec2& ray, double inverse, Vec2& pixel) const {
    const Vec3 d(ray, 1);
    Vec3 x = camera_from_ray_ * d;
    if (has_map_) {
      if (!(1 - inverse * eye_distance_ > 0)) return false;  // the surface is behind the eye
      x += inverse * (per_inverse_ * d);
    }
    if (!(x.z > 0)) return false;
    const Vec2 undistorted(x.x / x.z, x.y / x.z);
    if (distorted_) {
      const std::optional<Vec2> d = lens_.distort(undistorted);
      if (!d) return false;
      pixel = {lens_.fx() * d->x + lens_.cx(), lens_.fy() * d->y + lens_.cy()};
    } else {
      pixel = {lens_.fx() * undistorted.x + lens_.cx(), lens_.fy() * undistorted.y + lens_.cy()};
    }
    return true;
  }

 private:
  Mat3 camera_from_ray_;
  Mat3 per_inverse_{0};
  const bool has_map_;
  const double eye_distance_;
  const Lens lens_;
  bool distorted_;
  double right_, bottom_;  // edges of the image's domain, pixels
};

// Returns the pixels of a camera's image that its contribution to `rect` of the view may sample, including the margins
// of interpolation and chroma. This is the region to decode. `rect` bounds the pixels with a weight of the camera.
// Returns the whole image if the region is unknown, and an empty region if none of it is seen.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera);
// The same for a focal map with other levels than the view's. `levels`: smallest and largest level in `rect`.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera,
                   const FocalMap::LevelRange& levels);

// Returns the pixels of a contributing camera's image that its whole part of the view needs: source_region(), extended
// to whole chroma samples. Returns one pixel if none is seen, because the part is then missing weight.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// The same for the union of several focal maps with other levels than the view's. Empty if none is seen.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                   std::span<const std::vector<uint8_t>> maps);

// Sharpening (image/image_filters.h) helps if a view shows the detail that bilinear sampling loses.

// True if the view is so much coarser than the image that sharpened samples alias. The built-in
// scene looks better without sharpening in views of less than 0.75 of the camera's focal length.
inline bool is_coarse(const Lens& view, const Lens& camera) { return view.fy() < 0.75 * camera.fy(); }

// True if the view's pixels are the camera's pixels, seen from the camera's position. Sampling then loses nothing.
bool is_pixel_for_pixel(const View& view, const Camera& camera);

inline bool shows_detail(const View& view, const Camera& camera) {
  return !is_coarse(view.lens, camera.lens) && !is_pixel_for_pixel(view, camera);
}

}  // namespace lf

// Samples of camera images one by one, where SIMD is not worthwhile.
namespace lf::plain {

// Bilinear sample of one 8-bit channel. Coordinates are clamped to the outermost pixel centres.
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
    float weight;  // of `second`
  };
  Axis across_, down_;
};

}  // namespace lf::plain
