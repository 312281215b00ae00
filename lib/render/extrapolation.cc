// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/extrapolation.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace lf {
namespace {

constexpr int kStep = WeightGrid::kStep;

// The weights change gradually from the cameras of the mesh to the nearest cameras, over this fraction of the length of
// a border edge. The change takes at least two steps of the grid, because the grid cannot represent a faster change.
constexpr double kFadingPixels = 2 * kStep;
constexpr double kFadingPart = 0.25;

// Makes visibility fade much nearer to the edge of an image than for Blending::kAngle, within less than a pixel. Views
// are often as wide as the images of the cameras, and would otherwise have gaps at their borders.
constexpr double kSharper = 40;

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
    // The border of a line of cameras consists of points. Take the distances between its cameras instead.
    if (lengths.empty())
      for (const MeshFace& face : mesh.faces)
        if (face.corners() == 2) lengths.push_back(glm::length(place(face.camera[1]) - place(face.camera[0])));
    if (!lengths.empty()) length_ = median(std::move(lengths));
  }

  // A place on the border: `part` of the way from camera a to camera b.
  struct Place {
    CameraIndex a, b;
    double part;
    double distance;  // distance of the position from the line of sight, metres
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

double smoothstep(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

View nearest_cameras(View view) {
  view.blending = {.kind = Blending::Kind::kAngle, .nearest = kExtrapolationCameras};
  return view;
}

// Sets the weights of the face that the line of sight passes through. Sets no weights if there is no such face. `owner`
// is the pixel's face, or FaceIdMap::kNone.
void set_mesh_weights(const ViewPlan& plan, int32_t owner, const Vec2& ray, Shares& shares) {
  shares.clear();
  const auto add = [&](const FacePlan& face) {
    const FaceWeights weights = face_weights(face, ray);
    for (int k = 0; k < 3; k++)
      if (face.camera[k] != MeshFace::kNone) add_share(shares, face.camera[k], weights.w[k]);
  };
  if (owner != FaceIdMap::kNone) return add(plan.faces()[owner]);
  // Points beyond the focal surface have no owner, but may be inside a face.
  for (const FacePlan& face : plan.faces())
    if (contains(face, ray) && glm::dot(face.facing, Vec3(ray, 1)) > 0) return add(face);
}

// Returns the mean visibility of the point in focus, limited to kEnoughVisibility, for cameras with weights that add up
// to 1. Usually the first camera is enough.
double limited_visibility(const CameraWeights& cameras, const LineOfSight& line, const Shares& shares) {
  double seen = 0;
  for (const WeightGrid::Share& share : shares) {
    seen += share.weight * std::min(kSharper * cameras.visibility(share.camera, line.ray, line.focus), 1.0);
    if (seen >= kEnoughVisibility) return kEnoughVisibility;
  }
  return seen;
}

// Computes the weights of the cameras at one point of the WeightGrid; see extrapolation.h.
class Extrapolation {
 public:
  // `border` is only needed for pixels beside the mesh.
  Extrapolation(const ViewPlan& plan, const std::optional<MeshBorder>& border, const CameraWeights& by_angle)
      : plan_(plan), border_(border), by_angle_(by_angle) {}

  struct Result {
    bool is_extrapolated = false;  // the nearest cameras contribute
    bool is_seen = false;          // one of the nearest cameras contributes and sees the point in focus
  };
  Result at(const Vec2& pixel, int32_t owner, Shares& shares) {
    const LineOfSight line = line_of_sight(plan_, pixel);
    set_mesh_weights(plan_, owner, line.ray, shares);
    double stays = 1;  // share of the cameras of the mesh
    if (shares.empty()) {
      std::optional<MeshBorder::Place> place;
      if (border_) place = border_->nearest(glm::normalize(Vec3(line.ray, 1)));
      stays = place ? 1 - smoothstep(place->distance / fading_length(place->depth)) : 0;
      if (place) {
        add_share(shares, place->a, 1 - place->part);
        add_share(shares, place->b, place->part);
      }
    }
    if (plan_.view().blending.fills_gaps && stays > 0)
      stays *= smoothstep(limited_visibility(by_angle_, line, shares) / kEnoughVisibility);
    if (!(stays < 1)) return {};
    const Shares of_mesh = std::move(shares);
    const bool seen = set_nearest_cameras(line, 1 - stays, shares);
    for (const WeightGrid::Share& share : of_mesh) add_share(shares, share.camera, stays * share.weight);
    return {true, seen};
  }

 private:
  // Sets the weights of the nearest cameras, so that they add up to `sum`. Returns true if one of them sees the point
  // in focus.
  bool set_nearest_cameras(const LineOfSight& line, double sum, Shares& shares) {
    const bool seen = by_angle_.at(line.ray, line.focus, shares) && std::isfinite(line.focus);
    const double now = std::accumulate(shares.begin(), shares.end(), 0.0,
                                       [](double so_far, const auto& share) { return so_far + share.weight; });
    for (WeightGrid::Share& share : shares) share.weight *= sum / now;
    return seen;
  }

  double fading_length(double depth) const {
    return std::max(kFadingPart * border_->length(), kFadingPixels * depth / plan_.view().lens.fx());
  }

  const ViewPlan& plan_;
  const std::optional<MeshBorder>& border_;
  CameraWeights by_angle_;
};

// Builds the WeightGrid of extrapolated_weights(). First finds the cells that need it: cells beside the mesh, and cells
// with gaps. Then computes the weights at their corners.
class GridInProgress {
 public:
  GridInProgress(const ViewPlan& plan, const FaceRuns& runs)
      : plan_(plan),
        runs_(runs),
        columns_(WeightGrid::points(plan.view().width)),
        rows_(WeightGrid::points(plan.view().height)),
        cells_(static_cast<size_t>(columns_ - 1) * static_cast<size_t>(rows_ - 1)) {}

  bool mark_cells_beside_mesh() {
    const Rect& view = runs_.region();
    bool any = false;
    for (int y = 0; y < view.y1; y++) {
      uint8_t* const row = &cells_[static_cast<size_t>(y / kStep) * static_cast<size_t>(columns_ - 1)];
      const auto mark = [&](int x0, int x1) {
        if (x0 >= x1) return;
        std::fill(row + x0 / kStep, row + (x1 - 1) / kStep + 1, uint8_t{WeightGrid::kUnowned});
        any = true;
      };
      int x = 0;
      for (const FaceRun& run : runs_.row(y)) {
        mark(x, run.x0);
        x = run.x1;
      }
      mark(x, view.x1);
    }
    return any;
  }

  // Finds points in gaps among every kSparse-th point and row, which costs little. Gaps are at the border of camera
  // images, so they are usually wide. Gaps of a few pixels at the border of the view do not count, because views are
  // often as wide as the images of the cameras.
  void find_gaps(const CameraWeights& cameras) {
    Shares shares;
    const auto next = [](int i, int count) { return i < count - 1 ? std::min(i + kSparse, count - 1) : count; };
    for (int j = 0; j < rows_; j = next(j, rows_))
      for (int i = 0; i < columns_; i = next(i, columns_)) {
        constexpr int kBorder = kStep / 2;
        const View& view = plan_.view();
        const int x = std::clamp(i * kStep, std::min(kBorder, view.width - 1), std::max(view.width - 1 - kBorder, 0)),
                  y = std::clamp(j * kStep, std::min(kBorder, view.height - 1), std::max(view.height - 1 - kBorder, 0));
        const int32_t owner = owner_of(x, y);
        if (owner == FaceIdMap::kNone) continue;
        const LineOfSight line = line_of_sight(plan_, {x, y});
        set_mesh_weights(plan_, owner, line.ray, shares);
        if (limited_visibility(cameras, line, shares) < kEnoughVisibility) gaps_.emplace_back(i, j);
      }
  }

  // Looks more closely at cells that the border of the mesh crosses, because gaps beside the border are often narrow.
  void find_gaps_at_border(const CameraWeights& cameras, const ParallelFor& parallel) {
    constexpr int kStride = 4;
    parallel(static_cast<size_t>(rows_ - 1), [&](size_t row) {
      Shares shares;
      const auto is_gap = [&](int x, int y) {
        const int32_t owner = owner_of(x, y);
        if (owner == FaceIdMap::kNone) return false;
        const LineOfSight line = line_of_sight(plan_, {x, y});
        set_mesh_weights(plan_, owner, line.ray, shares);
        return limited_visibility(cameras, line, shares) < kEnoughVisibility;
      };
      const int j = static_cast<int>(row), bottom = std::min((j + 1) * kStep, plan_.view().height);
      for (int i = 0; i + 1 < columns_; i++) {
        uint8_t& use = cell(i, j);
        const int right = std::min((i + 1) * kStep, plan_.view().width);
        for (int y = j * kStep + kStride / 2; y < bottom && use == WeightGrid::kUnowned; y += kStride)
          for (int x = i * kStep + kStride / 2; x < right && use == WeightGrid::kUnowned; x += kStride)
            if (is_gap(x, y)) use = WeightGrid::kWhole;
      }
    });
    for (int j = 0; j + 1 < rows_; j++)
      for (int i = 0; i + 1 < columns_; i++)
        if (cell(i, j) == WeightGrid::kWhole) gaps_.emplace_back(i, j);
  }

  bool has_gaps() const { return !gaps_.empty(); }
  void mark_cells_with_gaps(const Extrapolation& extrapolation, const ParallelFor& parallel) {
    make_points();
    std::vector<uint8_t> near(points_.size());
    for (const auto& [x, y] : gaps_)
      for (int j = std::max(y - kSparse, 0); j <= std::min(y + kSparse, rows_ - 1); j++)
        std::fill_n(&near[number_of(std::max(x - kSparse, 0), j)],
                    std::min(x + kSparse, columns_ - 1) - std::max(x - kSparse, 0) + 1, uint8_t{1});
    parallel(static_cast<size_t>(rows_), [&](size_t j) {
      Extrapolation own = extrapolation;
      for (int i = 0, y = static_cast<int>(j); i < columns_; i++)
        if (near[number_of(i, y)] && owner_at(i, y) != FaceIdMap::kNone) compute(i, y, own);
    });
    for (int j = 0; j + 1 < rows_; j++)
      for (int i = 0; i + 1 < columns_; i++) {
        const auto is_gap = [](const Point* point) { return point->is_in_mesh && point->result.is_extrapolated; };
        const auto is_visible = [&](const Point* point) { return !is_gap(point) || point->result.is_seen; };
        const std::array<const Point*, 4> around = corners(i, j);
        if (std::ranges::any_of(around, is_gap) && std::ranges::any_of(around, is_visible))
          cell(i, j) = WeightGrid::kWhole;
      }
  }

  // Returns null if no camera sees any of the pixels.
  std::shared_ptr<const WeightGrid> finish(const Extrapolation& extrapolation, size_t num_cameras,
                                           const ParallelFor& parallel) {
    make_points();
    std::vector<uint8_t> needed(points_.size());
    for (int j = 0; j + 1 < rows_; j++)
      for (int i = 0; i + 1 < columns_; i++)
        if (cell(i, j) != WeightGrid::kUnused)
          for (const Point* const point : corners(i, j)) needed[static_cast<size_t>(point - points_.data())] = 1;
    std::atomic<bool> any_seen = false;
    parallel(static_cast<size_t>(rows_), [&](size_t j) {
      Extrapolation own = extrapolation;
      for (int i = 0; i < columns_; i++) {
        const size_t number = number_of(i, static_cast<int>(j));
        Point& point = points_[number];
        if (!needed[number]) point.shares.clear();
        if (needed[number] && !point.is_computed) compute(i, static_cast<int>(j), own);
        if (needed[number] && point.result.is_seen) any_seen = true;
      }
    });
    if (!any_seen) return nullptr;
    auto grid = std::make_shared<WeightGrid>(plan_.view().width, plan_.view().height, num_cameras, std::move(cells_));
    for (const Point& point : points_) grid->add_point(point.shares);
    return grid;
  }

 private:
  struct Point {
    Shares shares;
    bool is_computed = false;
    bool is_in_mesh = false;
    Extrapolation::Result result;
  };

  static constexpr int kSparse = 2;

  size_t number_of(int i, int j) const {
    return static_cast<size_t>(j) * static_cast<size_t>(columns_) + static_cast<size_t>(i);
  }
  void make_points() { points_.resize(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)); }
  // The last points are beyond the view, where the plan has no faces.
  Vec2 pixel_at(int i, int j) const {
    return {std::min(i * kStep, plan_.view().width - 1), std::min(j * kStep, plan_.view().height - 1)};
  }
  int32_t owner_at(int i, int j) const {
    return owner_of(std::min(i * kStep, plan_.view().width - 1), std::min(j * kStep, plan_.view().height - 1));
  }
  int32_t owner_of(int x, int y) const {
    const std::span<const FaceRun> runs = runs_.row(y, x, x + 1);
    return runs.empty() ? FaceIdMap::kNone : runs.front().face;
  }
  void compute(int i, int j, Extrapolation& own) {
    Point& point = points_[number_of(i, j)];
    const int32_t owner = owner_at(i, j);
    point.result = own.at(pixel_at(i, j), owner, point.shares);
    point.is_in_mesh = owner != FaceIdMap::kNone;
    point.is_computed = true;
  }
  uint8_t& cell(int i, int j) {
    return cells_[static_cast<size_t>(j) * static_cast<size_t>(columns_ - 1) + static_cast<size_t>(i)];
  }
  std::array<const Point*, 4> corners(int i, int j) const {
    const Point* const first = &points_[number_of(i, j)];
    return {first, first + 1, first + columns_, first + columns_ + 1};
  }

  const ViewPlan& plan_;
  const FaceRuns& runs_;
  const int columns_, rows_;
  std::vector<uint8_t> cells_;
  std::vector<Point> points_;  // empty until a point is needed
  std::vector<std::pair<int, int>> gaps_;
};

}  // namespace

std::shared_ptr<const WeightGrid> extrapolated_weights(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                       const FaceRuns& runs, const ParallelFor& parallel) {
  GridInProgress grid(plan, runs);
  const View by_angle = nearest_cameras(plan.view());
  const CameraWeights cameras(rig, mesh, by_angle);
  const bool is_beside = grid.mark_cells_beside_mesh();
  if (plan.view().blending.fills_gaps) {
    grid.find_gaps(cameras);
    if (is_beside) grid.find_gaps_at_border(cameras, parallel);
  }
  if (!is_beside && !grid.has_gaps()) return nullptr;
  std::optional<MeshBorder> border;
  if (is_beside) border.emplace(rig, mesh, plan.view().pose);
  const Extrapolation extrapolation(plan, border, cameras);
  if (grid.has_gaps()) grid.mark_cells_with_gaps(extrapolation, parallel);
  return grid.finish(extrapolation, rig.cameras.size(), parallel);
}

}  // namespace lf
