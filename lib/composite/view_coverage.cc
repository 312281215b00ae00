// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/view_coverage.h"

#include "render/contribution_map.h"

namespace lf {

double ViewCoverage::share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact, int64_t now) {
  const bool known = share_ >= 0;
  const bool same = known && view_ == request.view && out_of_service_ == request.out_of_service && lost_ == lost;
  if (same || (known && !exact && now < known_at_ + kInterval)) return share_;
  const Mesh& mesh = mesh_.get(rig, request.out_of_service);
  share_ = mean_coverage(rig, ViewPlan(rig, mesh, request.view), kColumns, kRows, lost);
  view_ = request.view;
  out_of_service_ = request.out_of_service;
  lost_ = lost;
  known_at_ = now;
  return share_;
}

}  // namespace lf
