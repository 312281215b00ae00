// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "bench/surface/picture.h"
#include "focus/surface_choice.h"
#include "rig/mesh.h"
#include "view/view.h"

namespace lf::focus {

// Single planes parallel to an array, judged by the truth: what surfaces are compared with. Distances are metres from
// the plane through the array, `from`; none needs to be known before.

using Draw = std::function<Picture(const View&)>;

View on_plane(const View& view, const Plane& from, double distance);

// Where a view's scene is, as inverse distances.
struct Depths {
  DepthRange range;   // that all but little of it is in
  double middle = 0;  // half of it is nearer
  double best = 0;    // of the plane whose picture is nearest to the truth
};
// Looks at every plane that the array tells apart, from infinity (a quarter of a pixel between neighbouring cameras) to
// where fewer and fewer pixels are seen by their cameras: at every nth pixel of the view, an eighth of the disparity
// apart (1/8 to 1/2 pixel), and around the best one finer. Nothing if no camera sees what the view shows. Throws Error
// if all cameras are at one place.
std::optional<Depths> find_depths(const Rig& rig, const Mesh& mesh, const View& view, const Image& truth,
                                  const Plane& from, const Draw& draw);

struct JudgedPlanes {
  Picture best;  // of the planes that cover half of what any covers, the one with the highest PSNR
  double best_distance = 0;
  Picture bound;  // each pixel's best of the planes through which any camera sees it
};
// If no plane covers anything the figures are NaN.
JudgedPlanes judge_planes(const View& view, const Image& truth, const Plane& from, std::span<const double> distances,
                          const Draw& draw);

}  // namespace lf::focus
