// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/focus_array.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/maths.h"
#include "focus/hypothesis_levels.h"
#include "render/ownership.h"

namespace lf {

Plane array_plane(const Rig& rig) {
  // Averages differences from the first camera, which are precise even if the array is far from the origin.
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

double median_edge(const Rig& rig, const Mesh& mesh) {
  std::vector<double> edges;
  for (const MeshFace& face : mesh.faces)
    for (int k = 0, n = face.corners(); n > 1 && k < n; k++)
      edges.push_back(glm::distance(rig.cameras[face.camera[k]].pose.position,
                                    rig.cameras[face.camera[(k + 1) % n]].pose.position));
  return edges.empty() ? 0 : median(std::move(edges));
}

namespace {

// Returns the median distance from a camera to its nearest neighbour, in metres. Returns 0 if all cameras are at one
// place.
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

struct SparseEvidence {
  int apart, columns;
  std::vector<float> at;

  // Interpolates the evidence bilinearly at all nodes. The last points are at or beyond the last column and row.
  std::vector<float> spread(const FocalMap& map) const {
    std::vector<float> evidence(map.levels.size());
    std::vector<float> row(static_cast<size_t>(columns));
    const auto part = [this](int i) { return static_cast<float>(i % apart) / static_cast<float>(apart); };
    for (int j = 0; j < map.rows; j++) {
      const float* const upper = &at[static_cast<size_t>(j / apart) * columns];
      const float down = part(j);
      for (int i = 0; i < columns; i++) row[i] = upper[i] + down * (upper[i + columns] - upper[i]);
      float* const out = &evidence[static_cast<size_t>(j) * map.columns];
      for (int i = 0; i < map.columns; i++) {
        const float* const beside = &row[static_cast<size_t>(i / apart)];
        out[i] = beside[0] + part(i) * (beside[1] - beside[0]);
      }
    }
    return evidence;
  }
};

// Returns the sum of the squared weights of the cameras of a face, along a line of sight.
double sum_of_squares(const FacePlan& face, const Vec2& ray) {
  double squares = 0;
  for (const double w : face_weights(face, ray).w) squares += w * w;
  return squares;
}

// Returns the evidence for a sum of squared weights; see FocusArray::evidence().
float evidence_of(double sum_of_squares) {
  constexpr double kThreeEqual = 2. / 3;
  const double scale = 1 / std::sqrt(kThreeEqual);
  return static_cast<float>(scale * std::sqrt(std::max(1 - sum_of_squares, 0.0)));
}

}  // namespace

FocusArray::FocusArray(const Rig& rig, const Mesh* mesh) : from_(array_plane(rig)), rig_(&rig), given_mesh_(mesh) {
  std::vector<double> focals, widths;
  for (const Camera& camera : rig.cameras) {
    focals.push_back(camera.lens.fx());
    widths.push_back(camera.width / camera.lens.fx());
  }
  const double spacing = spacing_of(rig);
  if (!(spacing > 0)) return;
  spacing_ = spacing;
  // In a grid of cameras, cameras one spacing apart contribute to the same pixel. In other arrays, triangles are larger
  // than the distance to the nearest camera.
  edge_ = spacing;
  if (rig.topology.type != Topology::Type::kGrid)
    edge_ = std::max(edge_, median_edge(rig, mesh ? *mesh : mesh_.get(rig, {})));
  focal_ = median(std::move(focals));
  disparity_ = edge_ * focal_;
  nearest_ = median(std::move(widths)) / 4 / spacing;
}

// Returns the hypothesis view with one pixel for every kApart-th node, at the node's position.
View FocusArray::sparse_view(const View& view) {
  View sparse = hypothesis_view(view);
  sparse.width = (view.focus.map->columns - 1) / kApart + 2;
  sparse.height = (view.focus.map->rows - 1) / kApart + 2;
  std::array<double, Lens::kMaxParams> params = sparse.lens.params();
  const int focal = lens_model_num_focal(sparse.lens.model());
  for (int i = 0; i < focal + 2; i++) params[static_cast<size_t>(i)] /= kApart;
  sparse.lens = Lens(sparse.lens.model(), params);
  sparse.blending.fills_gaps = false;  // cells of this view's WeightGrid are too large to show gaps
  sparse.focus.map = nullptr;
  sparse.focus.plane = focal_plane_at(view.pose, 1);
  return sparse;
}

const Mesh& FocusArray::mesh_without(const CameraSet& out_of_service) const {
  return given_mesh_ ? *given_mesh_ : mesh_.get(*rig_, out_of_service);
}

double FocusArray::width_of(const View& view, const CameraSet& out_of_service) const {
  if (view.blending.kind == Blending::Kind::kAngle && rig_) {
    std::vector<double> beside;
    for (const Camera& camera : rig_->cameras) {
      const Vec3 apart = camera.pose.position - view.pose.position;
      beside.push_back(glm::length(apart - glm::dot(apart, from_.normal) * from_.normal));
    }
    const auto last = beside.begin() +
                      std::min<ptrdiff_t>(std::min(view.blending.nearest, kHypothesisCameras),
                                          static_cast<ptrdiff_t>(beside.size())) -
                      1;
    std::ranges::nth_element(beside, last);
    return std::max(edge_, 2 * *last);
  }
  return rig_ && edge_ > 0 ? width_beside_mesh(view, out_of_service) : edge_;
}

// Returns the width for width_of() in a view with lines of sight beside the mesh. All cameras are on one side of such a
// line of sight, so a wrong depth displaces an object, whereas inside the mesh a wrong depth blurs the object. The
// result is the root mean square over the view.
double FocusArray::width_beside_mesh(const View& view, const CameraSet& out_of_service) const {
  const View sparse = sparse_view(view);
  const ViewPlan plan(*rig_, mesh_without(out_of_service), sparse);
  if (!plan.blend()) return edge_;
  constexpr int kSamples = 24;  // per row and column, at most
  // A displacement causes the same squared error as a blur that is sqrt(12) times as wide. The mean position of the
  // cameras of a line of sight is half an edge farther away than the nearest camera.
  const double kOfDisplacement = std::sqrt(12);
  const int step = std::max({sparse.width / kSamples, sparse.height / kSamples, 1});
  const FaceIdMap owners(plan, {0, 0, sparse.width, sparse.height});
  double sum = 0;
  int count = 0;
  for (int y = 0; y < sparse.height; y += step)
    for (int x = 0; x < sparse.width; x += step) {
      const int32_t owner = owners.at(x, y);
      if (owner == FaceIdMap::kNone) continue;
      double width = edge_;
      if (!plan.faces()[owner].has_corners()) {
        const Vec3 d = view.pose.rotation() * glm::normalize(Vec3(plan.rays().at(x, y), 1));
        double least = std::numeric_limits<double>::infinity();
        for (const Camera& camera : rig_->cameras) {
          const Vec3 to = camera.pose.position - view.pose.position, across = to - glm::dot(to, d) * d;
          least = std::min(least, glm::dot(across, across));
        }
        width += kOfDisplacement * (std::sqrt(least) + edge_ / 2);
      }
      sum += width * width;
      count++;
    }
  return count > 0 ? std::sqrt(sum / count) : edge_;
}

std::vector<uint8_t> FocusArray::inside_mesh(const View& view, const CameraSet& out_of_service) const {
  if (!rig_ || !view.blending.is_mesh()) return {};
  const View sparse = sparse_view(view);
  const ViewPlan plan(*rig_, mesh_without(out_of_service), sparse);
  if (!plan.blend()) return {};
  const FaceIdMap owners(plan, {0, 0, sparse.width, sparse.height});
  const FocalMap& map = *view.focus.map;
  std::vector<uint8_t> inside;
  inside.reserve(map.levels.size());
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const int32_t owner = owners.at((i + kApart / 2) / kApart, (j + kApart / 2) / kApart);
      inside.push_back(owner != FaceIdMap::kNone && plan.faces()[owner].has_corners());
    }
  return inside;
}

std::vector<float> FocusArray::evidence(const View& view, const CameraSet& out_of_service) const {
  const FocalMap& map = *view.focus.map;
  if (!rig_) return std::vector<float>(map.levels.size(), 1);
  View sparse = hypothesis_view(view);
  const bool is_mesh = sparse.blending.is_mesh();
  if (is_mesh) sparse = sparse_view(view);
  const ViewPlan plan(*rig_, mesh_without(out_of_service), sparse);
  const WeightGrid* const grid = plan.blend();
  std::vector<float> evidence;
  if (!is_mesh) {
    if (!grid) return std::vector<float>(map.levels.size(), 0);  // nothing is in focus
    for (int j = 0; j < grid->rows(); j++)
      for (int i = 0; i < grid->columns(); i++) evidence.push_back(evidence_of(grid->sum_of_squares(i, j)));
    return SparseEvidence{WeightGrid::kStep, grid->columns(), std::move(evidence)}.spread(map);
  }
  const FaceIdMap owners(plan, {0, 0, sparse.width, sparse.height});
  for (int y = 0; y < sparse.height; y++)
    for (int x = 0; x < sparse.width; x++) {
      constexpr int kStep = WeightGrid::kStep;
      const int32_t owner = owners.at(x, y);
      if (owner == FaceIdMap::kNone)
        evidence.push_back(0);
      else if (const FacePlan& face = plan.faces()[owner]; face.has_corners())
        evidence.push_back(evidence_of(sum_of_squares(face, plan.rays().at(x, y))));
      else
        evidence.push_back(evidence_of(grid->sum_of_squares((x + kStep / 2) / kStep, (y + kStep / 2) / kStep)));
    }
  return SparseEvidence{kApart, sparse.width, std::move(evidence)}.spread(map);
}

}  // namespace lf
