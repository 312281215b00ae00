// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/view_warp.h"

#include <algorithm>
#include <string>

#include "base/error.h"
#include "render/camera_projection.h"

namespace lf {
namespace {

bool is_finite(const Mat3& m) { return lf::is_finite(m[0]) && lf::is_finite(m[1]) && lf::is_finite(m[2]); }

void validate_face(const FacePlan& face, const Rect& view) {
  const auto& [a, b, c] = face.camera;
  const bool two = b != MeshFace::kNone, three = c != MeshFace::kNone;
  if (a == MeshFace::kNone || (three && !two) || (two && a == b) || (three && (a == c || b == c)))
    throw Error("corners: must be one, two or three different cameras");
  if (face.rect.empty() || intersect(face.rect, view) != face.rect) throw Error("rectangle: is not inside the view");
  if (!std::ranges::all_of(face.edge, [](const Vec3& edge) { return lf::is_finite(edge); }))
    throw Error("edges: must be finite numbers");
  if (!lf::is_finite(face.facing)) throw Error("facing: must be finite numbers");
}

}  // namespace

ViewWarp view_warp(const Rig& rig, const ViewPlan& plan) {
  const View& view = plan.view();
  ViewWarp warp{.width = view.width, .height = view.height, .lens = view.lens, .faces = plan.faces()};
  warp.in_front = plan.focal_offset() > 0 ? plan.focal_normal() : -plan.focal_normal();
  for (size_t i = 0; i < warp.faces.size(); i++) warp.faces[i].face = static_cast<uint32_t>(i);
  for (const CameraIndex camera : plan.contributors())
    warp.cameras.push_back({camera, CameraProjection(plan, camera, rig.cameras[camera]).camera_from_ray()});
  return warp;
}

void validate(const ViewWarp& warp) {
  validate_size("width", warp.width);
  validate_size("height", warp.height);
  if (!lf::is_finite(warp.in_front)) throw Error("in_front: must be finite numbers");
  std::vector<CameraIndex> corners;
  for (size_t i = 0; i < warp.faces.size(); i++) {
    try {
      validate_face(warp.faces[i], {0, 0, warp.width, warp.height});
    } catch (const Error& error) {
      throw Error("triangles[" + std::to_string(i) + "]." + error.what());
    }
    for (const CameraIndex camera : warp.faces[i].camera)
      if (camera != MeshFace::kNone) corners.push_back(camera);
  }
  std::ranges::sort(corners);
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  if (!std::ranges::equal(corners, warp.cameras, {}, {}, &ViewWarp::Projection::camera))
    throw Error("cameras: must be the triangles' corners, ascending");
  for (size_t i = 0; i < warp.cameras.size(); i++)
    if (!is_finite(warp.cameras[i].camera_from_ray))
      throw Error("cameras[" + std::to_string(i) + "].matrix: must be finite numbers");
}

}  // namespace lf
