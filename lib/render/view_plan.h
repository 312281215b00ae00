// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "base/rect.h"
#include "render/rays.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

class BlendGrid;
struct ViewWarp;

// One mesh face as a view sees it. For the line of sight d = (u, v, 1) in view coordinates the three edge functions are
// e_k(d) = edge[k] . d (k = the corner opposite the edge), and corner k has weight e_k / (e_0 + e_1 + e_2) where all
// three quotients are >= 0 (docs/design.md: w_i = e_jk / (e_ij + e_jk + e_ki)).
struct FacePlan {
  uint32_t face = 0;  // number of the face in the mesh
  std::array<CameraIndex, 3> camera{};
  Vec3 edge[3];  // neighbours' shared edges are equal up to sign, to the last bit; 0 for unused corners
  Vec3 facing;   // faces d where facing . d > 0: the sum of the corners' forward axes in view coordinates
  Rect rect;     // contains every pixel of the view that the face owns

  // The value of an edge function, always with this order of operations: every machine gets the same bits.
  static double evaluate(const Vec3& edge, const Vec2& ray) { return edge.x * ray.x + (edge.y * ray.y + edge.z); }
  bool operator==(const FacePlan&) const = default;
};

// Everything geometric about one view that no pixel of a camera is needed for. Immutable once made; share between
// threads. Cost: O(faces of the mesh) in place of O(pixels); not blended by the mesh: see make_blend_grid().
class ViewPlan {
 public:
  // `rig`, `mesh`: only read during the call. The view must be valid (see validate()). `parallel`: does what takes
  // long, the rays of distorted lenses and the weights of views that are not blended by the mesh.
  ViewPlan(const Rig& rig, const Mesh& mesh, const View& view, const ParallelFor& parallel = serial_for);
  // The plan that somebody else has made, who knows the rig of `num_cameras` cameras: the same to the last bit. Throws
  // Error for cameras beyond that. `warp` must be valid (see validate()); the view has no pose then, and no focal
  // plane.
  ViewPlan(const ViewWarp& warp, size_t num_cameras, const ParallelFor& parallel = serial_for);

  const View& view() const { return view_; }
  const Rays& rays() const { return rays_; }
  // The faces that may own pixels of the view, ascending by number: the lowest-numbered one that contains a pixel owns
  // it.
  const std::vector<FacePlan>& faces() const { return faces_; }
  // The weights of the cameras where the view is not blended by its mesh; else null. Then there is one face without
  // corners: what has a focus at all.
  const BlendGrid* blend() const { return blend_.get(); }
  // The number of cameras in the rig.
  size_t num_cameras() const { return camera_rects_.size(); }
  // Bounds the pixels in which the camera may have a weight; empty if there are none.
  Rect camera_rect(CameraIndex camera) const { return camera_rects_[camera]; }
  // Cameras with a rectangle that is not empty, ascending.
  std::vector<CameraIndex> contributors() const;

  // Line of sight t > 0 to the focal plane in view coordinates: (focal_normal . d) t = focal_offset. With a focal map:
  // (focal_normal . d) t = 1 / inverse distance - eye_distance, and focal_offset is 1 for its sign.
  const Vec3& focal_normal() const { return focal_normal_; }
  double focal_offset() const { return focal_offset_; }
  double eye_distance() const { return eye_distance_; }  // metres of the eye from the plane that distances count from
  // The inverse distance at which pixel (x, y), or a place between pixels, is in focus; 0 without a map.
  double inverse_at(double x, double y) const { return view_.focus.map ? view_.focus.map->inverse_at(x, y) : 0; }
  // The homography into a camera, where the plan was told; else null: it follows from the poses.
  const Mat3* told_matrix(CameraIndex camera) const;

 private:
  View view_;
  Rays rays_;
  std::vector<FacePlan> faces_;
  std::vector<Rect> camera_rects_;
  Vec3 focal_normal_;
  double focal_offset_ = 0, eye_distance_ = 0;
  std::shared_ptr<const BlendGrid> blend_;
  std::vector<std::pair<CameraIndex, Mat3>> told_;  // ascending by camera; empty: the plan was not told
  void bound_corners(const FacePlan& face);
};

// The smallest rectangle of whole 2x2 chroma blocks around `rect`, inside the view.
Rect chroma_aligned(const Rect& rect, const View& view);

}  // namespace lf
