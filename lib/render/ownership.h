// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/camera_weights.h"
#include "render/view_plan.h"

namespace lf {

// Returns true if a face (triangle of the camera mesh) contains a line of sight, which means that no corner has a
// negative weight e_k / (e_0 + e_1 + e_2). Returns false for NaN, the value of pixels without a line of sight.
bool contains(const FacePlan& face, const Vec2& ray);

// Pixels [x0, x1) of one row that belong to the same face of the camera mesh.
struct FaceRun {
  int x0, x1;
  int32_t face;  // index into plan.faces()
  bool operator==(const FaceRun&) const = default;
};

// Finds for each pixel of a region the face (triangle of the camera mesh) that owns the pixel. The pixel is blended
// from the cameras at the corners of this face. The owner is the lowest-numbered face that contains the pixel's line of
// sight and has cameras that look in its direction. Cells of the WeightGrid ViewPlan::blend() that are used as a whole
// are an exception: their pixels belong to the face without corners. A pixel has no owner if its line of sight does not
// meet the focal surface in front of the eye.
//
// Several faces can contain a pixel if the mesh folds. All hosts must then choose the same owner, so the search among
// all faces is exact. It also takes less time than testing the faces around each camera.
//
// Edge functions are linear along a row, so the pixels of a face form one run, or two if the triangle straddles the
// eye's plane. The cost therefore grows with the number of rows and not with the number of pixels. The ends of the runs
// agree with an evaluation of the edge functions at each pixel, so the owner of a pixel does not depend on the region.
class FaceRuns {
 public:
  // Finds the owners of the pixels in `region`. `parallel` speeds up views with lens distortion, which are scanned
  // pixel by pixel.
  FaceRuns(const ViewPlan& plan, const Rect& region, const ParallelFor& parallel = serial_for);

  const Rect& region() const { return region_; }
  // Returns the runs of row y of region(), from left to right without overlap. Pixels between runs have no owner.
  std::span<const FaceRun> row(int y) const {
    const Row& r = rows_[static_cast<size_t>(y - region_.y0)];
    return {runs_.data() + r.begin, r.count};
  }
  // Returns the runs of row y that intersect [x0, x1). The first and the last run may extend beyond this interval.
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

// Stores the owner of each pixel, for random access. FaceRuns stores the same owners as runs.
class FaceIdMap {
 public:
  static constexpr int32_t kNone = -1;

  explicit FaceIdMap(FaceRuns runs);
  FaceIdMap(const ViewPlan& plan, const Rect& region);

  const Rect& region() const { return region_; }
  const FaceRuns& runs() const { return runs_; }
  // Returns the pixel's owner as an index into plan.faces(), or kNone if no face owns the pixel. (x, y) must be inside
  // region().
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

// The blending weights of the three cameras of a face for the line of sight (u, v, 1). They are computed from edge
// functions in double precision, in a fixed order of operations, so that all machines get the same weights. Each weight
// is in [0, 1] for a pixel that the face owns.
struct FaceWeights {
  float w[3];
};
FaceWeights face_weights(const FacePlan& face, const Vec2& ray);

// Computes the blending weights of one camera in a view. They come from the faces that the camera is a corner of and,
// for other pixels, from the WeightGrid of the face without corners.
class CameraCorners {
 public:
  CameraCorners(const ViewPlan& plan, CameraIndex camera);

  // Returns the camera's weight in a pixel of owners.region(), whatever the kind of blending.
  float weight_at(const ViewPlan& plan, const FaceIdMap& owners, int x, int y) const {
    const int32_t owner = owners.at(x, y);
    if (owner == FaceIdMap::kNone) return 0;
    if (plan.faces()[owner].has_corners()) return weight(plan, owner, plan.rays().at(x, y));
    constexpr float kUnit = 1.f / WeightGrid::kOne;
    return kUnit * static_cast<float>(plan.blend()->weight(camera_, x, y));
  }
  // Returns the camera's weight for a line of sight that the face `owner` contains. The weight is 0 if `owner` is
  // FaceIdMap::kNone or if the camera is not a corner of this face.
  float weight(const ViewPlan& plan, int32_t owner, const Vec2& ray) const {
    if (owner == FaceIdMap::kNone || corner_[owner] < 0) return 0;
    return face_weights(plan.faces()[owner], ray).w[corner_[owner]];
  }

  // Returns which corner (0 to 2) of the face with this index in plan.faces() the camera is, or -1 if it is not a
  // corner.
  int of_face(int32_t face) const { return corner_[face]; }

  // Returns bounds of the pixels in `rect` that belong to a face of this camera. `rect` must be inside runs.region().
  Rect owned(const FaceRuns& runs, const Rect& rect) const;

 private:
  bool has(int32_t owner) const { return owner != FaceIdMap::kNone && corner_[owner] >= 0; }

  CameraIndex camera_;
  std::vector<int8_t> corner_;  // per plan.faces(): the camera's corner, -1: none; 0 in the face without corners
};

// Returns the weight of `camera` in each pixel of `rect`, row by row. The weight is 0 in pixels of other faces, and
// where nothing is in focus. `rect` must be inside owners.region().
std::vector<float> pixel_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera, const Rect& rect);

// The work of one node (a process with some of the cameras) for one view. It consists of the plan of the view and the
// node's cameras that contribute. Immutable; safe to share between threads.
class RenderJob {
 public:
  // Plans the view for the cameras `own`, which are the indices of the node's cameras in ascending order. `mesh` must
  // not contain cameras that the view marks as out of service.
  RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own,
            const ParallelFor& parallel = serial_for);
  RenderJob(ViewPlan plan, std::span<const CameraIndex> own, const ParallelFor& parallel = serial_for);

  const ViewPlan& plan() const { return plan_; }
  // Returns the owners of all pixels that cameras() contribute to. The region consists of whole chroma samples.
  const FaceRuns& runs() const { return runs_; }
  // Returns the contributing cameras of the node, in ascending order.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

 private:
  ViewPlan plan_;
  std::vector<CameraIndex> cameras_;
  FaceRuns runs_;
};

}  // namespace lf
