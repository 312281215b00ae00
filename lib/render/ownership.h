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

// Pixels [x0, x1) of one row with the same owner.
struct OwnerRun {
  int x0, x1;
  int32_t face;  // index into plan.faces()
  bool operator==(const OwnerRun&) const = default;
};

// Tells which face owns each pixel of a part of a view, row by row. The owner is the lowest-numbered facing face that
// contains the pixel's line of sight; a pixel whose line of sight does not meet the focal surface at t > 0 has none.
// Where meshes fold, several faces contain a pixel and cameras far apart must agree on its owner: looking it up among
// all faces is both the exact rule and cheaper than testing each camera's ring per fragment.
//
// Along a row the edge functions are linear, so a face's pixels are one run (two where the triangle straddles the eye's
// plane), and finding them costs the number of rows, not of pixels. Ends are where evaluating the edge functions at the
// pixels says, to the last bit: the result for a pixel does not depend on the region.
class OwnerRuns {
 public:
  // `parallel`: looks at the pixels of distorted views, one by one.
  OwnerRuns(const ViewPlan& plan, const Rect& region, const ParallelFor& parallel = serial_for);

  const Rect& region() const { return region_; }
  // The runs of a row, ascending and disjoint; pixels between them have no owner. y inside region().
  std::span<const OwnerRun> row(int y) const {
    const Row& r = rows_[static_cast<size_t>(y - region_.y0)];
    return {runs_.data() + r.begin, r.count};
  }
  // The part of row(y) that meets [x0, x1); its first and last runs may reach beyond.
  std::span<const OwnerRun> row(int y, int x0, int x1) const;

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
  std::vector<OwnerRun> runs_;
};

// OwnerRuns spread out, for looking up one pixel after the other.
class OwnerMap {
 public:
  static constexpr int32_t kNone = -1;

  explicit OwnerMap(OwnerRuns runs);
  OwnerMap(const ViewPlan& plan, const Rect& region);

  const Rect& region() const { return region_; }
  const OwnerRuns& runs() const { return runs_; }
  // The pixel's owner as index into plan.faces(), or kNone. (x, y) inside region().
  int32_t at(int x, int y) const {
    return owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (x - region_.x0)];
  }
  const int32_t* row(int x, int y) const {
    return &owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (x - region_.x0)];
  }

 private:
  OwnerRuns runs_;
  Rect region_;
  std::vector<int32_t> owner_;
};

// The weight of corner 0, 1, 2 of a face for the line of sight (u, v, 1): in float, from edge functions in double in a
// fixed order of operations. All three are in [0, 1] for a pixel that the face owns.
struct FaceWeights {
  float w[3];
};
FaceWeights face_weights(const FacePlan& face, const Vec2& ray);

// The weights of one camera in a view: which corner of each face it is, or, in views that are not blended by the mesh,
// its weights of the grid.
class CameraCorners {
 public:
  CameraCorners(const ViewPlan& plan, CameraIndex camera);

  // The camera's weight in a pixel of owners.region(), however the view is blended.
  float weight_at(const ViewPlan& plan, const OwnerMap& owners, int x, int y) const {
    if (!plan.blend()) return weight(plan, owners.at(x, y), plan.rays().at(x, y));
    constexpr float kUnit = 1.f / BlendGrid::kOne;
    return owners.at(x, y) == OwnerMap::kNone ? 0 : kUnit * static_cast<float>(plan.blend()->weight(camera_, x, y));
  }
  // In a view that is blended by the mesh: the camera's weight for a ray whose owner is `owner`: 0 if that is
  // OwnerMap::kNone or a face of other cameras.
  float weight(const ViewPlan& plan, int32_t owner, const Vec2& ray) const {
    if (owner == OwnerMap::kNone || corner_[owner] < 0) return 0;
    return face_weights(plan.faces()[owner], ray).w[corner_[owner]];
  }

  // The corner of the face (index into plan.faces()) that the camera is; -1: none.
  int of_face(int32_t face) const { return corner_[face]; }

  // The smallest rectangle in `rect` (inside runs.region()) that holds all of its pixels with a face of this camera.
  // What is planned without looking at pixels is larger: tiles of distorted views, triangles without area, faces hidden
  // by lower-numbered ones.
  Rect owned(const OwnerRuns& runs, const Rect& rect) const;

 private:
  bool has(int32_t owner) const { return owner != OwnerMap::kNone && corner_[owner] >= 0; }

  CameraIndex camera_;
  std::vector<int8_t> corner_;  // per plan.faces(): the camera's corner, -1: none. Not blended by the mesh: 0
};

// The weight of `camera` in each pixel of `rect` (row-major, rect.width() * rect.height() values),
// 0 where its face does not own the pixel, or where there is nothing in focus. `rect` inside owners.region().
std::vector<float> pixel_weights(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera, const Rect& rect);

// What one node has to do for one view: the plan, and which of its own cameras contribute. Immutable; share between
// threads.
class RenderJob {
 public:
  // `own`: indices of the node's cameras, ascending. `mesh` must not hold cameras that the view counts as out of
  // service.
  RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own,
            const ParallelFor& parallel = serial_for);
  RenderJob(ViewPlan plan, std::span<const CameraIndex> own, const ParallelFor& parallel = serial_for);

  const ViewPlan& plan() const { return plan_; }
  // The owners of pixels, row by row; they cover the (chroma-aligned) rectangles of cameras().
  const OwnerRuns& runs() const { return runs_; }
  // The runs spread out, for looking up pixels; made when first asked for.
  const OwnerMap& owners() const;
  // The node's contributing cameras, ascending.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

 private:
  ViewPlan plan_;
  std::vector<CameraIndex> cameras_;
  OwnerRuns runs_;
  mutable std::once_flag owners_made_;
  mutable std::optional<OwnerMap> owners_;
};

}  // namespace lf
