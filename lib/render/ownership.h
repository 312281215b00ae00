// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "render/camera_weights.h"
#include "render/view_plan.h"

namespace lf {

// True if a face of the mesh contains a line of sight: all quotients e_k / (e_0 + e_1 + e_2) are >= 0. False for NaN
// rays, which do not exist.
bool contains(const FacePlan& face, const Vec2& ray);

// Pixels [x0, x1) of one row that belong to the same face.
struct FaceRun {
  int x0, x1;
  int32_t face;  // index into plan.faces()
  bool operator==(const FaceRun&) const = default;
};

// Finds the face of the camera mesh that owns each pixel of a region, row by row. The owner is the lowest-numbered
// facing face that contains the pixel's line of sight. A pixel has no owner if its line of sight does not meet the
// focal surface at t > 0. Several faces can contain a pixel if the mesh folds, and all hosts must then choose the same
// owner. The search among all faces is exact, and cheaper than a test of each camera's neighbouring faces for each
// fragment.
//
// Edge functions are linear along a row, so the pixels of a face form one run, or two if the triangle straddles the
// eye's plane. The cost therefore grows with the number of rows and not with the number of pixels. The ends of runs
// equal an exact evaluation of the edge functions at the pixels, so the result for a pixel does not depend on the
// region.
class FaceRuns {
 public:
  // `parallel` is used for views with lens distortion, which are scanned pixel by pixel.
  FaceRuns(const ViewPlan& plan, const Rect& region, const ParallelFor& parallel = serial_for);

  const Rect& region() const { return region_; }
  // Returns the runs of row y of region(), ascending and disjoint. Pixels between runs have no owner.
  std::span<const FaceRun> row(int y) const {
    const Row& r = rows_[static_cast<size_t>(y - region_.y0)];
    return {runs_.data() + r.begin, r.count};
  }
  // Returns the runs of row y that intersect [x0, x1). The first and last run may extend beyond this interval.
  std::span<const FaceRun> row(int y, int x0, int x1) const;

 private:
  struct Row {
    uint32_t begin = 0, count = 0;
  };
  struct Found {
    int y, x0, x1;
    int32_t face;
  };
  std::vector<Found> find(const ViewPlan& plan, const Rect& band) const;
  void insert(Row& row, int x0, int x1, int32_t face);

  Rect region_;
  std::vector<Row> rows_;
  std::vector<FaceRun> runs_;
};

// Holds the owners of FaceRuns as one value per pixel, for random access.
class FaceIdMap {
 public:
  static constexpr int32_t kNone = -1;

  explicit FaceIdMap(FaceRuns runs);
  FaceIdMap(const ViewPlan& plan, const Rect& region);

  const Rect& region() const { return region_; }
  const FaceRuns& runs() const { return runs_; }
  // Returns the pixel's owner as an index into plan.faces(), or kNone. (x, y) must be inside region().
  int32_t at(int x, int y) const {
    return owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (x - region_.x0)];
  }
  const int32_t* row(int x, int y) const {
    return &owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (x - region_.x0)];
  }

 private:
  FaceRuns runs_;
  Rect region_;
  std::vector<int32_t> owner_;
};

// The weights of the three corners of a face for the line of sight (u, v, 1). They are computed from edge functions in
// double, in a fixed order of operations. Each weight is in [0, 1] for a pixel that the face owns.
struct FaceWeights {
  float w[3];
};
FaceWeights face_weights(const FacePlan& face, const Vec2& ray);

// Weights of one camera in a view: its corner in each face of the mesh, and its weights in the WeightGrid of the face
// without corners.
class CameraCorners {
 public:
  CameraCorners(const ViewPlan& plan, CameraIndex camera);

  // Returns the camera's weight in a pixel of owners.region(), for any blending.
  float weight_at(const ViewPlan& plan, const FaceIdMap& owners, int x, int y) const {
    const int32_t owner = owners.at(x, y);
    if (owner == FaceIdMap::kNone) return 0;
    if (plan.faces()[owner].has_corners()) return weight(plan, owner, plan.rays().at(x, y));
    constexpr float kUnit = 1.f / WeightGrid::kOne;
    return kUnit * static_cast<float>(plan.blend()->weight(camera_, x, y));
  }
  // Returns the camera's weight for a ray that belongs to the face `owner` of the mesh. 0 if `owner` is
  // FaceIdMap::kNone or the camera is not a corner of the face.
  float weight(const ViewPlan& plan, int32_t owner, const Vec2& ray) const {
    if (owner == FaceIdMap::kNone || corner_[owner] < 0) return 0;
    return face_weights(plan.faces()[owner], ray).w[corner_[owner]];
  }

  // Returns the camera's corner in the face with this index in plan.faces(), or -1.
  int of_face(int32_t face) const { return corner_[face]; }

  // Returns the bounds of all pixels in `rect` that belong to a face of this camera. `rect` must be inside
  // runs.region(). ViewPlan::camera_rect() can be larger, because it has whole tiles of distorted views, triangles
  // without area, and faces that lower-numbered faces hide.
  Rect owned(const FaceRuns& runs, const Rect& rect) const;

 private:
  bool has(int32_t owner) const { return owner != FaceIdMap::kNone && corner_[owner] >= 0; }

  CameraIndex camera_;
  std::vector<int8_t> corner_;  // per plan.faces(): the camera's corner, -1: none; 0 in the face without corners
};

// Returns the weight of `camera` in each pixel of `rect`, row by row. The weight is 0 in pixels of other faces, and
// where nothing is in focus. `rect` must be inside owners.region().
std::vector<float> pixel_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera, const Rect& rect);

// The work of one node (a process with some of the cameras) for one view: the plan, and the node's cameras that
// contribute. Immutable; safe to share between threads.
class RenderJob {
 public:
  // `own` are the indices of the node's cameras, ascending. `mesh` must not contain cameras that the view marks as out
  // of service.
  RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own,
            const ParallelFor& parallel = serial_for);
  RenderJob(ViewPlan plan, std::span<const CameraIndex> own, const ParallelFor& parallel = serial_for);

  const ViewPlan& plan() const { return plan_; }
  // Returns runs that cover the chroma-aligned rectangles of cameras().
  const FaceRuns& runs() const { return runs_; }
  // Returns the owners of single pixels, which are computed on first use.
  const FaceIdMap& owners() const;
  // Returns the contributing cameras of the node, ascending.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

 private:
  ViewPlan plan_;
  std::vector<CameraIndex> cameras_;
  FaceRuns runs_;
  mutable std::once_flag owners_made_;
  mutable std::optional<FaceIdMap> owners_;
};

}  // namespace lf
