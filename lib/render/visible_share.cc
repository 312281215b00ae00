// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/visible_share.h"

#include <algorithm>
#include <cmath>

#include "render/contribution_map.h"

namespace lf {
namespace {

constexpr int kRows = 12, kMaxColumns = 4 * kRows;

}  // namespace

VisibleShare::VisibleShare(const Rig& rig) : rig_(rig), mesh_(build_mesh(rig)) {}

double VisibleShare::operator()(const Viewpoint& viewpoint, double aspect) const {
  Viewpoint far = viewpoint;
  far.focus_distance = kMaxFocus;
  far.aperture = 0;
  const int columns = std::clamp(static_cast<int>(std::lround(kRows * aspect)), 1, kMaxColumns);
  return mean_coverage(rig_, ViewPlan(rig_, mesh_, make_view(far, columns, kRows)), kRows);
}

}  // namespace lf
