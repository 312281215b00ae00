// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "render/view_plan.h"
#include "rig/rig.h"

namespace lf {

// Where a view's line of sight takes its colour in one camera's image: through the focal surface and the camera's lens.
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
    return project_beyond(ray, inverse, pixel) && pixel.x >= -0.5 && pixel.x <= right_ && pixel.y >= -0.5 && pixel.y <= bottom_;
  }
  // The same, but positions outside the image are good too.
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

}  // namespace lf
