// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/camera_weights.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lf {

WeightGrid::WeightGrid(int width, int height, size_t num_cameras, std::vector<uint8_t> cells)
    : width_(width),
      height_(height),
      columns_(points(width)),
      rows_(points(height)),
      cells_(std::move(cells)),
      has_whole_cells_(std::ranges::find(cells_, kWhole) != cells_.end()),
      rects_(num_cameras) {
  first_.reserve(static_cast<size_t>(columns_) * rows_ + 1);
}

void WeightGrid::add_point(std::span<const Share> shares) {
  const auto point = static_cast<int>(first_.size() - 1);
  const int i = point % columns_, j = point / columns_;
  Rect reach;  // cells with weights around the point
  for (int y = std::max(j - 1, 0); y < std::min(j + 1, rows_ - 1); y++)
    for (int x = std::max(i - 1, 0); x < std::min(i + 1, columns_ - 1); x++)
      if (has_weights(x, y)) reach = unite(reach, {x * kStep, y * kStep, (x + 1) * kStep, (y + 1) * kStep});
  reach = intersect(reach, {i * kStep - kStep + 1, j * kStep - kStep + 1, i * kStep + kStep, j * kStep + kStep});
  double total = 0;
  for (const Share& share : shares) total += share.weight;
  double sum = 0;
  int32_t before = 0;
  for (const Share& share : shares) {
    sum += share.weight;
    const auto with = static_cast<int32_t>(std::lround(sum / total * kOne));
    if (with == before) continue;
    entries_.push_back({share.camera, before, with});
    before = with;
    rects_[share.camera] = unite(rects_[share.camera], intersect(reach, {0, 0, width_, height_}));
  }
  first_.push_back(entries_.size());
}

double WeightGrid::sum_of_squares(int i, int j) const {
  const size_t point = static_cast<size_t>(j) * columns_ + i;
  double sum = 0;
  for (size_t k = first_[point]; k < first_[point + 1]; k++) {
    const double weight = static_cast<double>(entries_[k].with - entries_[k].before) / kOne;
    sum += weight * weight;
  }
  return sum;
}

// Returns the sum of the preceding cameras for a camera without weight at the point.
WeightGrid::Entry WeightGrid::lookup(size_t point, CameraIndex camera) const {
  const auto begin = entries_.begin() + static_cast<ptrdiff_t>(first_[point]),
             end = entries_.begin() + static_cast<ptrdiff_t>(first_[point + 1]);
  const auto found = std::ranges::lower_bound(begin, end, camera, {}, &Entry::camera);
  if (found != end && found->camera == camera) return *found;
  const int32_t sum = found == begin ? 0 : (found - 1)->with;
  return {camera, sum, sum};
}

bool WeightGrid::find(CameraIndex camera, int i, int j, Cell& cell) const {
  if (!has_weights(i, j)) return false;
  const size_t point = static_cast<size_t>(j) * columns_ + i;
  const size_t at[4] = {point, point + 1, point + columns_, point + columns_ + 1};
  bool any = false;
  for (size_t k = 0; k < 4; k++) {
    const Entry entry = lookup(at[k], camera);
    cell.before[k] = entry.before;
    cell.with[k] = entry.with;
    any = any || entry.with != entry.before;
  }
  return any;
}

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Requests may contain any numbers. Therefore overflow and NaN become `largest`, so that they sort last.
double at_most(double largest, double value) { return value < largest ? value : largest; }
constexpr double kFarthest = 1e300;

constexpr size_t kLeast = 4;          // minimum number of cameras with a weight
constexpr double kMinReach = 1.25;    // relative to the squared distance of the last of these cameras
constexpr double kFacing = 0.25;      // below this cosine a camera fades, because its axis is nearly at a right angle

constexpr double kLargest = 1e12;       // angle for cameras beyond the focus
constexpr double kReach = 1 + 1. / 16;  // relative to the (k + 1)-th penalty
// Penalty of camera pixels that are larger than the view's pixels, because they blur. It is relative to the angles.
constexpr double kBlur = 0.1;
constexpr double kMargin = 0.05;  // relative to an image's smaller side; a camera fades within this margin
// The weight outside the image is not 0, for an eye at the camera and for pixels that no other camera sees.
constexpr double kOutside = 1. / 1024;

Vec2 ray_at(const Lens& lens, const Vec2& pixel) {
  constexpr int kTries = 32;
  const Vec2 middle(lens.cx(), lens.cy());
  for (int i = 0; i < kTries; i++)
    if (const auto ray = lens.unproject(middle + (pixel - middle) * (static_cast<double>(kTries - i) / kTries)))
      return *ray;
  return {0, 0};
}

}  // namespace

LineOfSight line_of_sight(const ViewPlan& plan, const Vec2& pixel) {
  const Vec2 ray = ray_at(plan.view().lens, pixel);
  double distance = plan.focal_offset();
  if (plan.view().focus.map) distance = 1 / plan.inverse_at(pixel.x, pixel.y) - plan.eye_distance();
  const double t = distance / glm::dot(plan.focal_normal(), Vec3(ray, 1));
  return {ray, t > 0 ? t : kInf};
}

CameraWeights::CameraWeights(const Rig& rig, const Mesh& mesh, const View& view)
    : rig_(rig), blending_(view.blending), view_focal_((view.lens.fx() + view.lens.fy()) / 2) {
  std::vector<char> in_mesh(rig.cameras.size());
  for (const MeshFace& face : mesh.faces)
    for (int k = 0; k < face.corners(); k++) in_mesh[face.camera[k]] = 1;
  const Mat3 world_from_view = view.pose.rotation(), view_from_world = glm::transpose(world_from_view);
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
    if (!in_mesh[i]) continue;
    const Camera& camera = rig.cameras[i];
    const Mat3 world_from_camera = camera.pose.rotation();
    cameras_.push_back({i, view_from_world * (camera.pose.position - view.pose.position),
                        view_from_world * world_from_camera[2], glm::transpose(world_from_camera) * world_from_view,
                        (camera.lens.fx() + camera.lens.fy()) / 2});
  }
  double far = 1;
  for (const Seen& seen : cameras_) far = std::max(far, glm::length(seen.centre));
  farthest_ = 1e6 * far;
}

Vec3 CameraWeights::in_focus(const Vec2& ray, double t) const { return Vec3(ray, 1) * std::min(t, farthest_); }

double CameraWeights::visibility(CameraIndex camera, const Vec2& ray, double t) const {
  const auto found = std::ranges::lower_bound(cameras_, camera, {}, &Seen::camera);
  if (found == cameras_.end() || found->camera != camera) return 0;
  const double part = inside(*found, in_focus(ray, t));
  return part > kOutside ? part : 0;
}

bool CameraWeights::at(const Vec2& ray, double t, std::vector<WeightGrid::Share>& shares) {
  candidates_.clear();
  weights_.clear();
  shares.clear();
  const Vec3 d = glm::normalize(Vec3(ray, 1));
  if (cameras_.empty()) return false;
  bool seen = false;
  if (blending_.kind == Blending::Kind::kAperture)
    within_aperture(d);
  else
    seen = by_angle(d, in_focus(ray, t));
  for (size_t i = 0; i < weights_.size(); i++)
    if (weights_[i] > 0) shares.push_back({cameras_[candidates_[i].i].camera, weights_[i]});
  std::ranges::sort(shares, {}, &WeightGrid::Share::camera);
  return seen;
}

void CameraWeights::within_aperture(const Vec3& d) {
  double least = kInf;
  const auto find = [&](bool also_those_that_face_away) {
    for (size_t i = 0; i < cameras_.size(); i++) {
      const double facing = also_those_that_face_away ? 1 : std::min(glm::dot(cameras_[i].forward, d) / kFacing, 1.0);
      if (!(facing > 0)) continue;
      const Vec3& c = cameras_[i].centre;
      const Vec3 beside = (c - glm::dot(c, d) * d) / facing;
      candidates_.push_back({at_most(kFarthest, glm::dot(beside, beside)), i});
      least = std::min(least, candidates_.back().penalty);
    }
  };
  find(false);
  if (candidates_.empty()) find(true);
  const auto nth = [this](size_t n) {
    std::nth_element(candidates_.begin(), candidates_.begin() + static_cast<ptrdiff_t>(n), candidates_.end());
    return candidates_[n].penalty;
  };
  double reach = blending_.aperture / 2 * (blending_.aperture / 2);
  const size_t wanted = std::min(kLeast, candidates_.size());
  const auto is_near = [&](const Candidate& candidate) { return candidate.penalty - least <= reach / kMinReach; };
  if (static_cast<size_t>(std::ranges::count_if(candidates_, is_near)) < wanted)
    reach = kMinReach * (nth(wanted - 1) - least);
  if (candidates_.size() > WeightGrid::kMaxShares) {
    reach = std::min(reach, nth(WeightGrid::kMaxShares) - least);
    candidates_.resize(WeightGrid::kMaxShares);
  }
  for (const Candidate& candidate : candidates_) {
    const double part = candidate.penalty <= least ? 0 : (candidate.penalty - least) / reach;
    weights_.push_back(part < 1 ? (1 - part) * (1 - part) : 0);
  }
}

double CameraWeights::inside(const Seen& seen, const Vec3& in_focus) const {
  const Camera& camera = rig_.cameras[seen.camera];
  const auto pixel = camera.lens.project(seen.camera_from_view * (in_focus - seen.centre));
  if (!pixel) return kOutside;
  const double across = std::min(pixel->x + 0.5, camera.width - 0.5 - pixel->x),
               down = std::min(pixel->y + 0.5, camera.height - 0.5 - pixel->y);
  const double part = std::min(across, down) / (kMargin * std::min(camera.width, camera.height));
  return part > kOutside ? std::min(part, 1.0) : kOutside;
}

bool CameraWeights::by_angle(const Vec3& d, const Vec3& in_focus) {
  by_angle_.clear();
  for (size_t i = 0; i < cameras_.size(); i++) {
    const Vec3& c = cameras_[i].centre;
    const Vec3 from_focus = c - in_focus;
    const double beside = glm::length(c - glm::dot(c, d) * d);
    const double range = glm::length(from_focus) - glm::dot(from_focus, d);
    by_angle_.push_back({range > 0 ? at_most(kLargest, beside / range) : kLargest, i});
  }
  // Usually only a few are needed.
  const auto past_sorted = [this](size_t n) {
    std::partial_sort(by_angle_.begin(), by_angle_.begin() + static_cast<ptrdiff_t>(n), by_angle_.end());
    return n;
  };
  const size_t k = static_cast<size_t>(blending_.nearest), all = by_angle_.size();
  size_t sorted = past_sorted(std::min(2 * k + 2, all));
  double unit = by_angle_[std::min(k, all) - 1].penalty;
  if (!(unit > 0)) unit = 1;
  const double view_pixel = glm::length(in_focus) / view_focal_;

  // Penalties only increase angles, so the loop stops as soon as no further camera can be among the nearest.
  double bound = kInf;  // T of the formula
  bool seen = false;
  const auto smallest_first = [this](size_t n) {
    std::partial_sort(candidates_.begin(), candidates_.begin() + static_cast<ptrdiff_t>(n), candidates_.end());
  };
  for (size_t n = 0; n < all; n++) {
    if (n == sorted) sorted = past_sorted(all);
    const auto [angle, i] = by_angle_[n];
    if (angle >= bound) break;
    const Seen& camera = cameras_[i];
    const double part = inside(camera, in_focus);
    seen = seen || part > kOutside;
    const double blur = glm::length(camera.centre - in_focus) / camera.focal / view_pixel - 1;
    candidates_.push_back({(angle + unit * kBlur * (blur > 0 ? at_most(kLargest, blur) : 0)) / part, i});
    if (candidates_.size() <= k) continue;
    smallest_first(k + 1);
    const double best = candidates_[0].penalty;
    bound = best + kReach * (candidates_[k].penalty - best);
  }
  std::ranges::sort(candidates_);
  candidates_.resize(std::min(candidates_.size(), WeightGrid::kMaxShares));
  const double best = candidates_[0].penalty, floor = 1e-12 * unit;
  for (const Candidate& candidate : candidates_) {
    const double over = candidate.penalty - best, part = over <= 0 ? 0 : over / (bound - best);
    weights_.push_back(part < 1 ? (1 - part) * (floor / std::max(candidate.penalty, floor)) : 0);
  }
  return seen;
}

std::shared_ptr<const WeightGrid> make_weight_grid(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                   const ParallelFor& parallel) {
  const View& view = plan.view();
  auto grid = std::make_shared<WeightGrid>(view.width, view.height, rig.cameras.size());
  const CameraWeights weights(rig, mesh, view);
  // Processing a few rows at a time limits the memory for their shares.
  constexpr int kRowsAtOnce = 16;
  std::vector<std::vector<WeightGrid::Share>> shares(static_cast<size_t>(grid->columns()) * kRowsAtOnce);
  for (int top = 0; top < grid->rows(); top += kRowsAtOnce) {
    const int rows = std::min(grid->rows() - top, kRowsAtOnce);
    parallel(static_cast<size_t>(rows), [&](size_t row) {
      CameraWeights own = weights;
      for (int i = 0; i < grid->columns(); i++) {
        const Vec2 pixel = Vec2(i, top + static_cast<int>(row)) * double{WeightGrid::kStep};
        const LineOfSight line = line_of_sight(plan, pixel);
        own.at(line.ray, line.focus, shares[row * static_cast<size_t>(grid->columns()) + static_cast<size_t>(i)]);
      }
    });
    for (size_t i = 0; i < static_cast<size_t>(rows * grid->columns()); i++) grid->add_point(shares[i]);
  }
  return grid;
}

}  // namespace lf
