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

// Finds where a view's line of sight takes its colour in one camera's image: through the focal surface and the camera's
// lens.
//
// With the plane (p . d) t = c in view coordinates, X_view = t d, and X_camera = R X_view + T:
// (p . d) X_camera = (c R + T p^T) d. The sign of c makes the factor positive for t > 0: a homography.
// With a map, (p . d) t = 1/s - h at inverse distance s and h = ViewPlan::eye_distance():
// s (p . d) X_camera = ((1 - s h) R + s T p^T) d, a homography for each s, linear in it.
class CameraProjection {
 public:
  // `rig_camera`: what the rig says of `camera`; only its lens and size count where the plan was told.
  CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

  // The homography from a line of sight (u, v, 1) to camera coordinates, up to a positive factor for t > 0: with a map,
  // of inverse distance 0, and what an inverse distance of 1 adds to it.
  const Mat3& camera_from_ray() const { return camera_from_ray_; }
  const Mat3& per_inverse() const { return per_inverse_; }
  bool has_map() const { return has_map_; }
  const Lens& lens() const { return lens_; }

  // False if the sample is lost: behind the camera or outside its image. `pixel`: position in the image.
  // `inverse`: distance of the focal map there; any number without one.
  bool project(const Vec2& ray, double inverse, Vec2& pixel) const {
    return project_beyond(ray, inverse, pixel) && pixel.x >= -0.5 && pixel.x <= right_ && pixel.y >= -0.5 &&
           pixel.y <= bottom_;
  }
  // As project(), but positions outside the image are good too.
  bool project_beyond(const Vec2& ray, double inverse, Vec2& pixel) const {
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

// The pixels of a camera's image that its contribution to the view may be sampled from, with those that interpolation
// and chroma reach: what has to be decoded of it. `rect`: of the view, where the camera may have a weight. The whole
// image where that can't be told; empty if none of it is seen.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera);
// The source region through a focal map with other levels than the view's own: `levels` are the least and the largest
// that there are in `rect`.
Rect source_region(const ViewPlan& plan, const Rect& rect, CameraIndex camera, const Camera& rig_camera,
                   const FocalMap::LevelRange& levels);

// The pixels of a contributing camera's image that all of its part in the view needs: source_region(), grown to whole
// chroma samples; one pixel where none is seen, because the part is lost weight then.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);
// The needed pixels through all of several focal maps with other levels than the view's own; but empty where nothing is
// seen.
Rect needed_pixels(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera,
                   std::span<const std::vector<uint8_t>> maps);

// Whether a view shows what bilinear samples of a camera's image lose, so that sharpening (image/correction.h) helps.

// A view shows no such detail that is so much coarser than the image that sharpened samples alias: from 0.75 of the
// camera's focal length down, pictures of the built-in scene are better without.
inline bool is_coarse(const Lens& view, const Lens& camera) { return view.fy() < 0.75 * camera.fy(); }

// A view from the camera's own place, pixel for pixel, shows no such detail either: the samples are the pixels, and
// nothing is lost.
bool is_pixel_for_pixel(const View& view, const Camera& camera);

inline bool shows_detail(const View& view, const Camera& camera) {
  return !is_coarse(view.lens, camera.lens) && !is_pixel_for_pixel(view, camera);
}

}  // namespace lf

// Samples of cameras' images one by one, where SIMD would not pay.
namespace lf::plain {

// A bilinear sample of one 8-bit channel; coordinates are clamped to the outer pixel centres.
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
    float weight;  // of the second
  };
  Axis across_, down_;
};

}  // namespace lf::plain
