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

// Lines of sight (u, v, 1) of a view's pixels: computed for pinhole lenses, looked up for distorted ones.
// A pixel that no ray falls on has NaN for u and v.
class Rays {
 public:
  // `parallel`: computes the table of a distorted lens, which takes lens.mean_steps() per pixel.
  Rays(const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  bool separable() const { return !table_; }  // u depends on x alone and v on y alone
  Vec2 at(int x, int y) const {
    if (separable()) return {(x - cx_) * inv_fx_, (y - cy_) * inv_fy_};
    return table_[static_cast<size_t>(y) * width_ + x];
  }
  // The line of sight between pixel centres, at (x + 0.5, y + 0.5), for chroma: exact for pinholes, the mean of the
  // four pixels otherwise (the pixels to the right and below are clamped to the view).
  Vec2 at_centre_of_four(int x, int y) const;

 private:
  int width_, height_;
  double cx_, cy_, inv_fx_, inv_fy_;
  std::shared_ptr<const Vec2[]> table_;  // row by row; null for a pinhole
};

// Bounds the pixels of a view whose line of sight d = (u, v, 1) has h . d >= 0 for each of several half-planes h.
class RegionBounds {
 public:
  // `rays`, `lens`: of the view; `rays` must outlive this. `parallel`: visits the pixels of a distorted view.
  RegionBounds(const Rays& rays, const Lens& lens, int width, int height, const ParallelFor& parallel = serial_for);

  // The bounds: tight for pinholes (the view's rectangle clipped by the half-planes), whole tiles for distorted lenses.
  // Never misses a pixel, rounding included.
  Rect bound(std::span<const Vec3> half_planes) const;

 private:
  struct Tile {
    Rect rect;
    Vec2 low, high;  // bounds of the tile's rays; low > high: there are none
    bool may_hold(std::span<const Vec3> half_planes) const;
    void add(const Tile& other);
  };
  // A square of tiles: one test tells that none of them holds anything.
  struct Block {
    Tile whole;
    size_t first, past;  // of tiles_
    bool may_hold(std::span<const Vec3> half_planes) const;
  };
  Rect bound_polygon(std::span<const Vec3> half_planes) const;
  Rect bound_tiles(std::span<const Vec3> half_planes) const;

  int width_, height_;
  double fx_, fy_, cx_, cy_;
  std::vector<Tile> tiles_;  // distorted lenses only; block by block
  std::vector<Block> blocks_;
};

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

// What cameras have to be told of a view to render their parts of it without knowing where they or any others stand:
// the plan of the view with the projections into the cameras. All is relative to the view's eye.
struct ViewWarp {
  int width = 0, height = 0;    // pixels of the view
  Lens lens;                    // the view's lens
  Vec3 in_front{0};             // lines of sight d with in_front . d > 0 meet the focal plane
  std::vector<FacePlan> faces;  // as in ViewPlan, numbered in their order

  struct Projection {
    CameraIndex camera = 0;
    Mat3 camera_from_ray{1};  // see CameraProjection
    bool operator==(const Projection&) const = default;
  };
  std::vector<Projection> cameras;  // ascending: the faces' corners, each once

  bool operator==(const ViewWarp&) const = default;
};

// The part of the plan that cameras receive. `rig`: the rig of the plan.
ViewWarp view_warp(const Rig& rig, const ViewPlan& plan);

// Throws Error naming the field where a ViewPlan can't be made of it: sizes, numbers that are not finite, rectangles
// that are empty or not inside the view, cameras that are not just the faces' corners.
void validate(const ViewWarp& warp);

}  // namespace lf
