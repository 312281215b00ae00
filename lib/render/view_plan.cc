// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/view_plan.h"

#include <algorithm>
#include <limits>
#include <string>

#include "base/error.h"
#include "render/camera_weights.h"
#include "render/rays.h"
#include "render/view_warp.h"

namespace lf {
namespace {

// Cameras as one view sees them: nothing but differences of world positions ever meets a rotation, so that arrays at
// 1e6 m keep their precision.
class CamerasInView {
 public:
  CamerasInView(const Rig& rig, const Pose& world_from_view)
      : rig_(rig), view_from_world_(glm::transpose(world_from_view.rotation())), eye_(world_from_view.position) {}

  Vec3 forward(CameraIndex i) const { return view_from_world_ * rig_.cameras[i].pose.forward(); }

  // e_ij = d . ((C_i - E) x (C_j - E)), as (C_n - E) x (C_j - C_i) with n the end nearer to the eye: rounding is then
  // relative to the distance of the nearer end, so that the edges that meet in a camera agree on which side of them the
  // eye is however near it is to that camera (exactly 0 at it). Canonical order makes e_ij = -e_ji exact.
  Vec3 edge(CameraIndex i, CameraIndex j) const {
    if (i > j) return -edge(j, i);
    const Vec3 a = position(i) - eye_, b = position(j) - eye_;
    return normal_of_sight(glm::dot(a, a) <= glm::dot(b, b) ? a : b, position(j) - position(i), i);
  }
  // The same for the end of a strip, a line along `extent` through camera i.
  Vec3 strip_edge(CameraIndex i, const Vec3& extent) const { return normal_of_sight(position(i) - eye_, extent, i); }

 private:
  // Of the plane through the eye and a line through camera i, in view coordinates: 0 where the eye is on the line as
  // far as positions can tell. What rounding would leave there has a direction of its own: it would hide half a picture
  // from an eye on the array's border, and let a triangle without area contain whatever an eye in line with it looks
  // at. Zeros only add to what a face contains, so no cracks come of it.
  Vec3 normal_of_sight(const Vec3& to_line, const Vec3& along, CameraIndex i) const {
    constexpr double kPositionRounding = 8 * std::numeric_limits<double>::epsilon();  // of a position's length
    const Vec3 normal = glm::cross(to_line, along);
    const double tolerance = kPositionRounding * (glm::length(position(i)) + glm::length(eye_)) * glm::length(along);
    return glm::dot(normal, normal) <= tolerance * tolerance ? Vec3(0) : view_from_world_ * normal;
  }

  const Vec3& position(CameraIndex i) const { return rig_.cameras[i].pose.position; }

  const Rig& rig_;
  Mat3 view_from_world_;
  Vec3 eye_;
};

FacePlan plan_face(const CamerasInView& cameras, const MeshFace& face, uint32_t number) {
  FacePlan plan;
  plan.face = number;
  plan.camera = face.camera;
  plan.facing = Vec3(0);
  for (int k = 0; k < face.corners(); k++) plan.facing += cameras.forward(face.camera[k]);
  for (Vec3& edge : plan.edge) edge = Vec3(0);
  const auto& [a, b, c] = face.camera;
  switch (face.corners()) {
    case 3:
      plan.edge[0] = cameras.edge(b, c);
      plan.edge[1] = cameras.edge(c, a);
      plan.edge[2] = cameras.edge(a, b);
      break;
    case 2:
      // The limit of a triangle whose third corner is infinitely far away in both directions of `extent`.
      plan.edge[0] = -cameras.strip_edge(b, face.extent);
      plan.edge[1] = cameras.strip_edge(a, face.extent);
      break;
    default: plan.edge[0] = plan.facing;  // any functional: the only corner has weight e / e = 1
  }
  return plan;
}

// A face without corners that contains what is in front.
FacePlan whole_view(const Vec3& in_front, const Rect& rect) {
  FacePlan plan;
  plan.camera.fill(MeshFace::kNone);
  plan.edge[0] = plan.facing = in_front;
  plan.edge[1] = plan.edge[2] = Vec3(0);
  plan.rect = rect;
  return plan;
}

}  // namespace

ViewPlan::ViewPlan(const Rig& rig, const Mesh& mesh, const View& view, const ParallelFor& parallel)
    : view_(view), rays_(view.lens, view.width, view.height, parallel), camera_rects_(rig.cameras.size()) {
  const Plane& plane = view.focus.map ? view.focus.map->from : view.focus.plane;
  focal_normal_ = glm::transpose(view.pose.rotation()) * plane.normal;
  focal_offset_ = -plane.signed_distance(view.pose.position);
  if (view.focus.map) {
    eye_distance_ = -focal_offset_;
    focal_offset_ = 1;  // whatever looks along the normal meets a map somewhere; what that is behind is lost
  }
  if (focal_offset_ == 0) return;  // the eye is in the focal plane: no line of sight meets it at t > 0
  const Vec3 in_front = focal_offset_ > 0 ? focal_normal_ : -focal_normal_;

  if (!view.blending.is_mesh()) {
    blend_ = make_blend_grid(rig, mesh, *this, parallel);
    for (CameraIndex i = 0; i < camera_rects_.size(); i++) camera_rects_[i] = blend_->camera_rect(i);
    faces_.push_back(whole_view(in_front, {0, 0, view.width, view.height}));
    return;
  }

  const CamerasInView cameras(rig, view.pose);
  const RegionBounds bounds(rays_, view.lens, view.width, view.height, parallel);
  for (uint32_t i = 0; i < mesh.faces.size(); i++) {
    FacePlan face = plan_face(cameras, mesh.faces[i], i);
    if (face.edge[0] + face.edge[1] + face.edge[2] == Vec3(0)) continue;  // without area: never contains anything
    for (const double sign : {1.0, -1.0}) {
      const Vec3 half_planes[5] = {sign * face.edge[0], sign * face.edge[1], sign * face.edge[2], face.facing,
                                   in_front};
      face.rect = unite(face.rect, bounds.bound(half_planes));
    }
    if (face.rect.empty()) continue;
    bound_corners(face);
    faces_.push_back(face);
  }
}

ViewPlan::ViewPlan(const ViewWarp& warp, size_t num_cameras, const ParallelFor& parallel)
    : rays_(warp.lens, warp.width, warp.height, parallel),
      faces_(warp.faces),
      camera_rects_(num_cameras),
      focal_normal_(warp.in_front),
      focal_offset_(1) {
  view_.width = warp.width;
  view_.height = warp.height;
  view_.lens = warp.lens;
  for (const ViewWarp::Projection& camera : warp.cameras) {
    if (camera.camera >= num_cameras)
      throw Error("camera " + std::to_string(camera.camera) + " is not one of the " + std::to_string(num_cameras) +
                  " of the rig");
    told_.emplace_back(camera.camera, camera.camera_from_ray);
  }
  for (const FacePlan& face : faces_) bound_corners(face);
}

void ViewPlan::bound_corners(const FacePlan& face) {
  for (const CameraIndex camera : face.camera)
    if (camera != MeshFace::kNone) camera_rects_[camera] = unite(camera_rects_[camera], face.rect);
}

const Mat3* ViewPlan::told_matrix(CameraIndex camera) const {
  const auto found = std::ranges::lower_bound(told_, camera, {}, &std::pair<CameraIndex, Mat3>::first);
  return found != told_.end() && found->first == camera ? &found->second : nullptr;
}

std::vector<CameraIndex> ViewPlan::contributors() const {
  std::vector<CameraIndex> cameras;
  for (CameraIndex i = 0; i < camera_rects_.size(); i++)
    if (!camera_rects_[i].empty()) cameras.push_back(i);
  return cameras;
}

Rect chroma_aligned(const Rect& rect, const View& view) {
  return {rect.x0 & ~1, rect.y0 & ~1, std::min((rect.x1 + 1) & ~1, view.width),
          std::min((rect.y1 + 1) & ~1, view.height)};
}

}  // namespace lf
