// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "geometry/lens.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Gives the line of sight (u, v, 1) of each pixel of a view, in view coordinates. Lines of sight are computed for
// pinhole lenses and looked up in a table for distorted lenses. u and v are NaN for pixels that the lens does not map
// to any direction.
class Rays {
 public:
  // Prepares the lines of sight of a lens. `parallel` computes the table of a distorted lens, which takes
  // lens.mean_iterations() iterations per pixel.
  Rays(const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  bool separable() const { return !table_; }  // u depends only on x, and v only on y
  Vec2 at(int x, int y) const {
    if (separable()) return {(x - cx_) * inv_fx_, (y - cy_) * inv_fy_};
    return table_[static_cast<size_t>(y) * width_ + x];
  }
  // Returns the line of sight at (x + 0.5, y + 0.5), where a chroma sample lies. The result is exact for pinhole
  // lenses. Otherwise it is the mean of the four pixels, clamped to the view.
  Vec2 at_centre_of_four(int x, int y) const;

 private:
  int width_, height_;
  double cx_, cy_, inv_fx_, inv_fy_;
  std::shared_ptr<const Vec2[]> table_;  // row-major; null for a pinhole lens
};

// Computes the bounding rectangle, in pixels of a view, of a region such as a mesh face, so that the renderer only
// visits pixels that can show the region. Planes through the eye bound the region: a pixel with the line of sight d =
// (u, v, 1) is inside if h . d >= 0 for the normal h of each plane.
class RegionBounds {
 public:
  // Prepares the search for a view with these lines of sight, lens and size. For a distorted lens, the constructor
  // computes the bounds of the lines of sight in tiles of the view; `parallel` divides this work among threads. The
  // arguments are read only during the call.
  RegionBounds(const Rays& rays, const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  // Returns a rectangle that contains every pixel inside all half-spaces, even after rounding. `half_planes` are the
  // normals h. The rectangle is tight for pinhole lenses. For distorted lenses, it consists of whole tiles. It may be
  // empty.
  Rect bound(std::span<const Vec3> half_planes) const;

 private:
  struct Tile {
    Rect rect;
    Vec2 low, high;  // bounds of the rays; low > high if there are no rays
    bool may_contain(std::span<const Vec3> half_planes) const;
    void add(const Tile& other);
  };
  // A square of 8x8 tiles. If the square as a whole is outside a half-space, its tiles need no tests.
  struct Block {
    Tile whole;
    size_t first, past;
    bool may_contain(std::span<const Vec3> half_planes) const;
  };
  Rect bound_polygon(std::span<const Vec3> half_planes) const;
  Rect bound_tiles(std::span<const Vec3> half_planes) const;

  int width_, height_;
  double fx_, fy_, cx_, cy_;
  std::vector<Tile> tiles_;  // tiles of distorted lenses, ordered by block
  std::vector<Block> blocks_;
};

class WeightGrid;
struct ViewWarp;

// One face of the camera mesh (usually a triangle of three cameras) as seen by a view. It gives the weight of each of
// its cameras for a line of sight d = (u, v, 1) in view coordinates. The edge functions are e_k(d) = edge[k] . d, where
// k is the corner opposite the edge. Corner k has the weight e_k / (e_0 + e_1 + e_2) if all three quotients are >= 0
// (docs/architecture.md: w_i = e_jk / (e_ij + e_jk + e_ki)).
//
// A face without corners is the area of the view that takes its weights from a WeightGrid.
struct FacePlan {
  uint32_t face = 0;  // number of the face in the mesh
  std::array<CameraIndex, 3> camera{};
  Vec3 edge[3];  // bit-identical in both faces of a shared edge, except for the sign; 0 for unused corners
  Vec3 facing;   // the face faces d if facing . d > 0; sum of the corners' forward axes in view coordinates
  Rect rect;     // contains every pixel that the face owns

  bool has_corners() const { return camera[0] != MeshFace::kNone; }
  // Evaluates an edge function. The order of operations is fixed, so that all machines get the same bits.
  static double evaluate(const Vec3& edge, const Vec2& ray) { return edge.x * ray.x + (edge.y * ray.y + edge.z); }
  bool operator==(const FacePlan&) const = default;
};

// Everything about rendering a view that does not depend on images: the faces that own its pixels, the weights of the
// cameras, and the homographies into their images. It is immutable, so threads can share a plan. The cost grows with
// the number of faces and not with the number of pixels, except for views that are blended by a WeightGrid (see
// make_weight_grid()).
class ViewPlan {
 public:
  // Plans a view. `rig` and `mesh` are read only during the call. The view must be valid (see validate()). `parallel`
  // computes the lines of sight of distorted lenses and the WeightGrid.
  ViewPlan(const Rig& rig, const Mesh& mesh, const View& view, const ParallelFor& parallel = serial_for);
  // Plans a view for a camera without the rig, from homographies that a process with the rig has sent. The
  // result is bit-identical to the plan of that process, except that the view has neither a pose nor a focal plane.
  // `warp` must be valid (see validate()). Throws Error for camera indices beyond `num_cameras`.
  ViewPlan(const ViewWarp& warp, size_t num_cameras, const ParallelFor& parallel = serial_for);

  const View& view() const { return view_; }
  const Rays& rays() const { return rays_; }
  // Returns the faces that may own pixels of the view, in ascending order of their numbers. If several faces contain a
  // pixel, the lowest-numbered face owns the pixel.
  const std::vector<FacePlan>& faces() const { return faces_; }
  // Returns the camera weights in the pixels of the last face, which then has no corners. If the view is not blended by
  // the mesh, this face covers everything that can be in focus. Otherwise it covers the pixels that are extrapolated
  // (see render/extrapolation.h). Null if there are none.
  const WeightGrid* blend() const { return blend_.get(); }
  size_t num_cameras() const { return camera_rects_.size(); }
  // Returns bounds of the pixels that the camera contributes to; may be empty.
  Rect camera_rect(CameraIndex camera) const { return camera_rects_[camera]; }
  // Returns the cameras that contribute to the view (with a non-empty camera_rect()), in ascending order.
  std::vector<CameraIndex> contributors() const;

  // The following functions describe the focal surface, the surface that the view shows in focus. A line of sight d in
  // view coordinates meets a focal plane at the point t d with t > 0 and (focal_normal . d) t = focal_offset. A focal
  // map gives an inverse distance for each part of the view. Then t follows from (focal_normal . d) t = 1 / inverse
  // distance - eye_distance, and focal_offset is 1.
  const Vec3& focal_normal() const { return focal_normal_; }
  double focal_offset() const { return focal_offset_; }
  double eye_distance() const { return eye_distance_; }  // metres from the eye to the origin of distances
  // Returns the inverse distance at which (x, y) is in focus, or 0 without a map. Positions may be fractional.
  double inverse_at(double x, double y) const { return view_.focus.map ? view_.focus.map->inverse_at(x, y) : 0; }
  // Returns the homography into a camera if the plan was made from a ViewWarp. Otherwise returns null.
  const Mat3* explicit_homography(CameraIndex camera) const;

 private:
  View view_;
  Rays rays_;
  std::vector<FacePlan> faces_;
  std::vector<Rect> camera_rects_;
  Vec3 focal_normal_;
  double focal_offset_ = 0, eye_distance_ = 0;
  std::shared_ptr<const WeightGrid> blend_;
  // ascending by camera; empty unless the plan was made from a ViewWarp
  std::vector<std::pair<CameraIndex, Mat3>> homographies_;
  void bound_corners(const FacePlan& face);
  void add_grid(std::shared_ptr<const WeightGrid> grid, const Rect& rect);
};

// Returns the smallest rectangle of whole 2x2 chroma blocks that contains `rect`, clipped to the view.
Rect chroma_aligned(const Rect& rect, const View& view);

// The plan of a view in a form that cameras without the rig can use: the triangles and the homographies into their
// images. All coordinates are relative to the view's eye.
struct ViewWarp {
  int width = 0, height = 0;
  Lens lens;
  Vec3 in_front{0};             // lines of sight d with in_front . d > 0 meet the focal plane
  std::vector<FacePlan> faces;  // as in ViewPlan, with consecutive numbers

  struct Projection {
    CameraIndex camera = 0;
    Mat3 camera_from_ray{1};
    bool operator==(const Projection&) const = default;
  };
  std::vector<Projection> cameras;  // ascending; exactly the corners of the faces

  bool operator==(const ViewWarp&) const = default;
};

// Exports a plan for cameras without the rig. The view of the plan must have a focal plane instead of a map, because a
// map has no single homography per camera. `rig` must be the rig of the plan.
ViewWarp view_warp(const Rig& rig, const ViewPlan& plan);

// Checks a warp from an untrusted source. Throws Error with the invalid field for bad sizes, for numbers that are not
// finite, for rectangles that are empty or outside the view, and for cameras other than the corners of the faces.
void validate(const ViewWarp& warp);

}  // namespace lf
