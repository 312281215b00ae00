// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "render/view_plan.h"
#include "rig/rig.h"

namespace lf {

// Where a view's line of sight takes its colour in one camera's image: through the focal plane (a homography) and the
// camera's lens.
//
// With the plane (p . d) t = c in view coordinates, X_view = t d, and X_camera = R X_view + T:
// (p . d) X_camera = (c R + T p^T) d. The sign of c makes the factor positive for t > 0.
class CameraProjection {
 public:
  // `rig_camera`: what the rig says of `camera`; only its lens and size count where the plan was told.
  CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera);

  // The homography from a line of sight (u, v, 1) to camera coordinates, up to a positive factor for t > 0.
  const Mat3& camera_from_ray() const { return camera_from_ray_; }
  const Lens& lens() const { return lens_; }

  // False if the sample is lost: behind the camera or outside its image. `pixel`: position in the image.
  bool project(const Vec2& ray, Vec2& pixel) const {
    return project_beyond(ray, pixel) && pixel.x >= -0.5 && pixel.x <= right_ && pixel.y >= -0.5 && pixel.y <= bottom_;
  }
  // The same, but positions outside the image are good too.
  bool project_beyond(const Vec2& ray, Vec2& pixel) const {
    const Vec3 x = camera_from_ray_ * Vec3(ray, 1);
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
  const Lens lens_;
  bool distorted_;
  double right_, bottom_;  // edges of the image's domain, pixels
};

}  // namespace lf
