// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/visible_share.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/contribution_map.h"

namespace lf {
namespace {

constexpr int kRows = 12, kMaxColumns = 4 * kRows;
// Of a view of which nothing may be dark, and how much of a pixel's weight makes it bright.
constexpr int kFineRows = 97, kMaxFineColumns = 4 * kFineRows;
constexpr float kBright = 0.25f;
constexpr int kHalvings = 12;

// The same eye, with everything far away and no synthetic aperture.
Viewpoint far_from(const Viewpoint& viewpoint) {
  Viewpoint far = viewpoint;
  far.focus_distance = kMaxFocus;
  far.aperture = 0;
  return far;
}

// The middle of the triangle nearest to `position`; of cameras that make none, `position`.
Vec3 inside_of_a_face(const Rig& rig, const Mesh& mesh, const Vec3& position) {
  Vec3 nearest = position;
  double least = std::numeric_limits<double>::infinity();
  for (const MeshFace& face : mesh.faces) {
    if (face.corners() < 3) continue;
    Vec3 middle(0);
    for (const CameraIndex camera : face.camera) middle += rig.cameras[camera].pose.position / 3.0;
    if (const double distance = glm::length(middle - position); distance < least) {
      least = distance;
      nearest = middle;
    }
  }
  return nearest;
}

}  // namespace

VisibleShare::VisibleShare(const Rig& rig) : rig_(rig), mesh_(build_mesh(rig)) {}

double VisibleShare::operator()(const Viewpoint& viewpoint, double aspect) const {
  const int columns = std::clamp(static_cast<int>(std::lround(kRows * aspect)), 1, kMaxColumns);
  return mean_coverage(rig_, ViewPlan(rig_, mesh_, make_view(far_from(viewpoint), columns, kRows)), kRows);
}

// The middles of the outermost pixels of the raster lie a pixel of it outside of the view, so that no corner between
// them is dark.
bool VisibleShare::sees_all(const Viewpoint& viewpoint, double aspect) const {
  const int columns = std::clamp(static_cast<int>(std::lround((kFineRows - 1) * aspect)) + 1, 2, kMaxFineColumns);
  // What is near is farther aside for cameras beside the eye.
  for (Viewpoint v : {far_from(viewpoint), viewpoint}) {
    const double edge = std::tan(v.fov_y_deg * (M_PI / 360)) * kFineRows / (kFineRows - 3);
    v.fov_y_deg = std::atan(edge) * (360 / M_PI);
    const ViewPlan plan(rig_, mesh_, make_view(clamped(v), columns, kFineRows));
    const std::vector<float> seen = view_coverage(rig_, plan, OwnerMap(plan, {0, 0, columns, kFineRows}));
    if (std::ranges::any_of(seen, [](float share) { return share < kBright; })) return false;
  }
  return true;
}

Viewpoint VisibleShare::home(double aspect, double focus_distance) const {
  Viewpoint v = default_viewpoint(rig_, focus_distance);
  v.pose.position = inside_of_a_face(rig_, mesh_, v.pose.position);
  const auto with_fov = [&v](double fov_y_deg) {
    Viewpoint other = v;
    other.fov_y_deg = fov_y_deg;
    return other;
  };
  if (sees_all(v, aspect)) return v;
  double seen = kMinFovDeg, dark = v.fov_y_deg;
  if (!sees_all(with_fov(seen), aspect)) return v;  // a ring of cameras, and the like
  for (int i = 0; i < kHalvings; i++) {
    const double middle = (seen + dark) / 2;
    (sees_all(with_fov(middle), aspect) ? seen : dark) = middle;
  }
  return with_fov(seen);
}

}  // namespace lf
