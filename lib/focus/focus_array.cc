// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_array.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/percentiles.h"
#include "focus/trial_levels.h"
#include "render/ownership.h"

namespace lf {

Plane array_plane(const Rig& rig) {
  // Means of differences: an array far from the origin keeps its precision.
  const Vec3 first = rig.cameras[0].pose.position;
  Vec3 offset(0), axis(0);
  for (const Camera& camera : rig.cameras) {
    offset += camera.pose.position - first;
    axis += camera.pose.forward();
  }
  constexpr double kNoDirection = 1e-6;
  const auto count = static_cast<double>(rig.cameras.size());
  const Vec3 normal = glm::length(axis) > kNoDirection * count ? glm::normalize(axis) : rig.cameras[0].pose.forward();
  return plane_through(first + offset / count, normal);
}

namespace {

// Metres from a camera to the one next to it, the median; 0 if no two stand at different places.
double spacing_of(const Rig& rig) {
  std::vector<double> spacings;
  for (const Camera& camera : rig.cameras) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Camera& other : rig.cameras) {
      const double apart = glm::length(other.pose.position - camera.pose.position);
      if (apart > 0) nearest = std::min(nearest, apart);
    }
    if (std::isfinite(nearest)) spacings.push_back(nearest);
  }
  return spacings.empty() ? 0 : median(std::move(spacings));
}

// Square root of 1 - sum w^2 of the owner's corners, times `scale`, at the places of a grid of nodes.
std::vector<float> sparse_evidence(const RenderJob& job, double scale) {
  const View& view = job.plan().view();
  std::vector<float> evidence(static_cast<size_t>(view.width) * static_cast<size_t>(view.height));
  for (int y = 0; y < view.height; y++) {
    if (y < job.runs().region().y0 || y >= job.runs().region().y1) continue;
    for (const OwnerRun& run : job.runs().row(y)) {
      const FacePlan& face = job.plan().faces()[run.face];
      for (int x = std::max(run.x0, 0); x < std::min(run.x1, view.width); x++) {
        const FaceWeights weights = face_weights(face, job.plan().rays().at(x, y));
        double squares = 0;
        for (const double w : weights.w) squares += w * w;
        evidence[static_cast<size_t>(y) * view.width + x] =
            static_cast<float>(scale * std::sqrt(std::max(1 - squares, 0.0)));
      }
    }
  }
  return evidence;
}

}  // namespace

FocusArray::FocusArray(const Rig& rig) : from_(array_plane(rig)), rig_(&rig) {
  std::vector<double> focals, widths;
  for (const Camera& camera : rig.cameras) {
    focals.push_back(camera.lens.fx());
    widths.push_back(camera.width / camera.lens.fx());
  }
  const double spacing = spacing_of(rig);
  if (!(spacing > 0)) return;
  spacing_ = spacing;
  focal_ = median(std::move(focals));
  disparity_ = spacing * focal_;
  nearest_ = median(std::move(widths)) / 4 / spacing;
}

std::vector<float> FocusArray::evidence(const View& view, const CameraSet& out_of_service) const {
  const FocalMap& map = *view.focus.map;
  const size_t nodes = static_cast<size_t>(map.columns) * static_cast<size_t>(map.rows);
  if (!rig_) return std::vector<float>(nodes, 1);
  // A pixel for every kApart-th node, where that stands.
  View sparse = trial_view(view);
  sparse.width = (map.columns - 1) / kApart + 2;
  sparse.height = (map.rows - 1) / kApart + 2;
  std::array<double, Lens::kMaxParams> params = sparse.lens.params();
  const int focal = lens_model_num_focal(sparse.lens.model());
  for (int i = 0; i < focal + 2; i++) params[static_cast<size_t>(i)] /= kApart;
  sparse.lens = Lens(sparse.lens.model(), params);
  sparse.focus.map = nullptr;
  sparse.focus.plane = focal_plane_at(view.pose, 1);
  std::vector<CameraIndex> all(rig_->cameras.size());
  std::iota(all.begin(), all.end(), 0);
  const RenderJob job(*rig_, given_mesh_ ? *given_mesh_ : mesh_.get(*rig_, out_of_service), sparse, all);
  constexpr double kThreeEqual = 2. / 3;
  const std::vector<float> known = sparse_evidence(job, 1 / std::sqrt(kThreeEqual));

  std::vector<float> evidence(nodes);
  std::vector<float> row(static_cast<size_t>(sparse.width));
  for (int j = 0; j < map.rows; j++) {
    const float* const upper = &known[static_cast<size_t>(j / kApart) * sparse.width];
    const float down = static_cast<float>(j % kApart) / kApart;
    for (int i = 0; i < sparse.width; i++) row[i] = upper[i] + down * (upper[i + sparse.width] - upper[i]);
    float* const out = &evidence[static_cast<size_t>(j) * map.columns];
    for (int i = 0; i < map.columns; i++) {
      const float* const at = &row[static_cast<size_t>(i / kApart)];
      out[i] = at[0] + static_cast<float>(i % kApart) / kApart * (at[1] - at[0]);
    }
  }
  return evidence;
}

}  // namespace lf
