// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "geometry/focal_surface.h"
#include "view/view.h"

namespace lf {

// The focal map of `from` as another view of the same scene has it: what each node is in focus at moves to where the
// other view sees it. Where several meet the nearest wins, where none does the farther of the neighbours along the row:
// what comes into sight behind an edge is the background. The map itself if the view is the same. `from` has a map.
std::shared_ptr<const FocalMap> carry_over(const View& from, const View& to);

}  // namespace lf
