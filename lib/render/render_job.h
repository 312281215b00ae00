// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "render/ownership.h"
#include "render/view_plan.h"

namespace lf {

// What one node has to do for one view: the plan, and which of its own cameras contribute. Immutable; share between
// threads.
class RenderJob {
 public:
  // `own`: indices of the node's cameras, ascending. `mesh` must not hold cameras that the view counts as out of
  // service.
  RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own);
  RenderJob(ViewPlan plan, std::span<const CameraIndex> own);

  const ViewPlan& plan() const { return plan_; }
  // Cover the (chroma-aligned) rectangles of cameras().
  const OwnerRuns& runs() const { return runs_; }
  // The same for looking up pixels; made when first asked for.
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

// The mesh of a rig for the out-of-service set asked for last: sets change rarely. Not thread-safe.
class MeshCache {
 public:
  // Throws Error for cameras that the rig does not have.
  const Mesh& get(const Rig& rig, const CameraSet& out_of_service);
  void clear() { mesh_.reset(); }

 private:
  CameraSet out_of_service_;
  std::optional<Mesh> mesh_;
};

}  // namespace lf
