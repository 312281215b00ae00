// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_projection.h"

namespace lf {

CameraProjection::CameraProjection(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera)
    : has_map_(plan.view().focus.map != nullptr),
      eye_distance_(plan.eye_distance()),
      lens_(rig_camera.lens),
      distorted_(rig_camera.lens.has_distortion()),
      right_(rig_camera.width - 0.5),
      bottom_(rig_camera.height - 0.5) {
  if (const Mat3* told = plan.told_matrix(camera)) {
    camera_from_ray_ = *told;
    return;
  }
  const Pose& view = plan.view().pose;
  const Mat3 camera_from_world = glm::transpose(rig_camera.pose.rotation());
  const Mat3 camera_from_view = camera_from_world * view.rotation();
  const Vec3 eye_in_camera = camera_from_world * (view.position - rig_camera.pose.position);
  if (has_map_) {
    camera_from_ray_ = camera_from_view;
    per_inverse_ = glm::outerProduct(eye_in_camera, plan.focal_normal()) - eye_distance_ * camera_from_view;
    return;
  }
  const double c = plan.focal_offset(), sign = c > 0 ? 1 : -1;
  camera_from_ray_ = sign * (c * camera_from_view + glm::outerProduct(eye_in_camera, plan.focal_normal()));
}

}  // namespace lf
