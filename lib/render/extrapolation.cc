// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/extrapolation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

namespace lf {
namespace {

constexpr int kStep = WeightGrid::kStep;

// The weights change from the mesh's to the nearest cameras' over a part of the border's edges. LLFF's fern, three
// views through the surface: 19.3 dB over a whole edge, 19.6 over a half, 20.0 over a quarter. If this is less than two
// steps of the grid, the change takes two steps, because the grid cannot show a faster one.
constexpr double kFadingPixels = 2 * kStep;
constexpr double kFadingPart = 0.25;

// The border of a mesh, in view coordinates relative to the eye.
class MeshBorder {
 public:
  MeshBorder(const Rig& rig, const Mesh& mesh, const Pose& view_pose) {
    std::map<std::pair<CameraIndex, CameraIndex>, int> faces_of_edge;
    std::map<CameraIndex, std::pair<int, Vec3>> strips_of_camera;
    for (const MeshFace& face : mesh.faces) {
      const auto& [a, b, c] = face.camera;
      if (face.corners() == 3)
        for (const auto& edge : {std::minmax(a, b), std::minmax(b, c), std::minmax(c, a)}) faces_of_edge[edge]++;
      if (face.corners() == 2)
        for (const CameraIndex camera : {a, b}) {
          strips_of_camera[camera].first++;
          strips_of_camera[camera].second = face.extent;
        }
    }
    const Mat3 view_from_world = glm::transpose(view_pose.rotation());
    const auto place = [&](CameraIndex i) {
      return view_from_world * (rig.cameras[i].pose.position - view_pose.position);
    };
    const auto forward = [&](CameraIndex i) { return view_from_world * rig.cameras[i].pose.forward(); };
    std::vector<double> lengths;
    for (const auto& [edge, faces] : faces_of_edge) {
      if (faces != 1) continue;
      const auto [a, b] = edge;
      parts_.push_back({a, b, place(a), place(b) - place(a), forward(a) + forward(b), false});
      lengths.push_back(glm::length(parts_.back().along));
    }
    for (const auto& [camera, strips] : strips_of_camera)
      if (strips.first == 1)
        parts_.push_back({camera, camera, place(camera), view_from_world * strips.second, forward(camera), true});
    // The ends of a line of cameras have no length: its strips have.
    if (lengths.empty())
      for (const MeshFace& face : mesh.faces)
        if (face.corners() == 2) lengths.push_back(glm::length(place(face.camera[1]) - place(face.camera[0])));
    if (!lengths.empty()) length_ = median(std::move(lengths));
  }

  // A place on the border: `part` of the way from camera a to camera b.
  struct Place {
    CameraIndex a, b;
    double part;
    double distance;  // between the place and the line of sight, metres
    double depth;     // distance from the eye along the line of sight, metres
  };
  double length() const { return length_; }  // median length of the border edges, metres
  // Returns the place nearest to the line of sight along the unit vector d. Ignores cameras that face away
  // from d.
  std::optional<Place> nearest(const Vec3& d) const {
    std::optional<Place> found;
    for (const Part& part : parts_) {
      if (!(glm::dot(part.facing, d) > 0)) continue;
      const Vec3 from = across(part.from, d), along = across(part.along, d);
      const double squared = glm::dot(along, along);
      double at = squared > 0 ? -glm::dot(from, along) / squared : 0;
      if (!part.is_line) at = std::clamp(at, 0.0, 1.0);
      const double distance = glm::length(from + at * along);
      const double depth = std::abs(glm::dot(part.from + at * part.along, d));
      if (!found || distance < found->distance) found = {part.a, part.b, part.is_line ? 0 : at, distance, depth};
    }
    return found;
  }

 private:
  // A border edge between two cameras, or a line through the last camera of a row.
  struct Part {
    CameraIndex a, b;
    Vec3 from, along, facing;
    bool is_line;
  };
  static Vec3 across(const Vec3& v, const Vec3& d) { return v - glm::dot(v, d) * d; }

  std::vector<Part> parts_;
  double length_ = std::numeric_limits<double>::infinity();  // metres
};

using Shares = std::vector<WeightGrid::Share>;

void add_share(Shares& shares, CameraIndex camera, double weight) {
  if (!(weight > 0)) return;
  const auto at = std::ranges::lower_bound(shares, camera, {}, &WeightGrid::Share::camera);
  if (at != shares.end() && at->camera == camera)
    at->weight += weight;
  else
    shares.insert(at, {camera, weight});
}

// Returns the weights of the face of the mesh that contains the line of sight; empty: none does.
Shares mesh_weights(const ViewPlan& plan, const Vec2& ray) {
  Shares shares;
  for (const FacePlan& face : plan.faces()) {
    if (!contains(face, ray) || !(glm::dot(face.facing, Vec3(ray, 1)) > 0)) continue;
    const FaceWeights weights = face_weights(face, ray);
    for (int k = 0; k < 3; k++)
      if (face.camera[k] != MeshFace::kNone) add_share(shares, face.camera[k], weights.w[k]);
    break;
  }
  return shares;
}

double smoothstep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

class Extrapolation {
 public:
  Extrapolation(const Rig& rig, const Mesh& mesh, const ViewPlan& plan)
      : plan_(plan), border_(rig, mesh, plan.view().pose), by_angle_(rig, mesh, nearest_cameras(plan.view())) {}

  // Computes the shares for a pixel. Returns true if the pixel is beside the mesh and a camera sees the point in focus.
  bool at(const Vec2& pixel, Shares& shares) {
    const LineOfSight line = line_of_sight(plan_, pixel);
    shares = mesh_weights(plan_, line.ray);
    if (!shares.empty()) return false;
    const std::optional<MeshBorder::Place> place = border_.nearest(glm::normalize(Vec3(line.ray, 1)));
    const double fade = place ? smoothstep(place->distance / fading_length(place->depth)) : 1;
    bool seen = false;
    if (fade > 0) {
      seen = by_angle_.at(line.ray, line.focus, shares) && std::isfinite(line.focus);
      const double sum = std::accumulate(shares.begin(), shares.end(), 0.0,
                                         [](double so_far, const auto& share) { return so_far + share.weight; });
      for (WeightGrid::Share& share : shares) share.weight *= fade / sum;
    }
    if (!(fade < 1)) return seen;
    add_share(shares, place->a, (1 - fade) * (1 - place->part));
    add_share(shares, place->b, (1 - fade) * place->part);
    return seen;
  }

 private:
  double fading_length(double depth) const {
    return std::max(kFadingPart * border_.length(), kFadingPixels * depth / plan_.view().lens.fx());
  }
  static View nearest_cameras(View view) {
    view.blending = {.kind = Blending::Kind::kAngle, .nearest = kExtrapolationCameras};
    return view;
  }

  const ViewPlan& plan_;
  MeshBorder border_;
  CameraWeights by_angle_;
};

}  // namespace

std::vector<uint8_t> cells_beside_mesh(const FaceRuns& runs) {
  const Rect& view = runs.region();
  const int columns = WeightGrid::points(view.x1) - 1, rows = WeightGrid::points(view.y1) - 1;
  std::vector<uint8_t> cells(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  bool any = false;
  for (int y = 0; y < view.y1; y++) {
    uint8_t* const row = &cells[static_cast<size_t>(y / kStep) * static_cast<size_t>(columns)];
    const auto mark = [&](int x0, int x1) {
      if (x0 >= x1) return;
      std::fill(row + x0 / kStep, row + (x1 - 1) / kStep + 1, uint8_t{1});
      any = true;
    };
    int x = 0;
    for (const FaceRun& run : runs.row(y)) {
      mark(x, run.x0);
      x = run.x1;
    }
    mark(x, view.x1);
  }
  if (!any) cells.clear();
  return cells;
}

std::shared_ptr<const WeightGrid> extrapolated_weights(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                       std::vector<uint8_t> cells, const ParallelFor& parallel) {
  const View& view = plan.view();
  const int columns = WeightGrid::points(view.width), rows = WeightGrid::points(view.height);
  // Only the points around cells with pixels are needed.
  std::vector<uint8_t> needed(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  for (int j = 0; j + 1 < rows; j++)
    for (int i = 0; i + 1 < columns; i++) {
      if (!cells[static_cast<size_t>(j) * static_cast<size_t>(columns - 1) + static_cast<size_t>(i)]) continue;
      uint8_t* const point = &needed[static_cast<size_t>(j) * static_cast<size_t>(columns) + static_cast<size_t>(i)];
      for (uint8_t* const corner : {point, point + 1, point + columns, point + columns + 1}) *corner = 1;
    }
  auto grid = std::make_shared<WeightGrid>(view.width, view.height, rig.cameras.size(), std::move(cells));
  const Extrapolation extrapolation(rig, mesh, plan);
  std::vector<Shares> shares(needed.size());
  std::atomic<bool> any_seen = false;
  parallel(static_cast<size_t>(rows), [&](size_t j) {
    Extrapolation own = extrapolation;
    for (int i = 0; i < columns; i++) {
      const size_t point = j * static_cast<size_t>(columns) + static_cast<size_t>(i);
      if (!needed[point]) continue;
      // The last points are beyond the view, where the plan has no faces.
      if (own.at({std::min(i * kStep, view.width - 1), std::min(static_cast<int>(j) * kStep, view.height - 1)},
                 shares[point]))
        any_seen = true;
    }
  });
  if (!any_seen) return nullptr;
  for (const Shares& of_point : shares) grid->add_point(of_point);
  return grid;
}

}  // namespace lf
