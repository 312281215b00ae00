// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/ownership.h"

#include <algorithm>
#include <cmath>

namespace lf {
namespace {

bool meets_focal_surface(const ViewPlan& plan, const Vec2& ray) {
  const double along = glm::dot(plan.focal_normal(), Vec3(ray, 1));
  return plan.focal_offset() > 0 ? along > 0 : along < 0;
}

}  // namespace

bool contains(const FacePlan& face, const Vec2& ray) {
  const double e0 = FacePlan::evaluate(face.edge[0], ray), e1 = FacePlan::evaluate(face.edge[1], ray),
               e2 = FacePlan::evaluate(face.edge[2], ray), sum = e0 + e1 + e2;
  return (e0 >= 0 && e1 >= 0 && e2 >= 0 && sum > 0) || (e0 <= 0 && e1 <= 0 && e2 <= 0 && sum < 0);
}

namespace {

bool may_own(const ViewPlan& plan, const FacePlan& face, const Vec2& ray) {
  return contains(face, ray) && glm::dot(face.facing, Vec3(ray, 1)) > 0 && meets_focal_surface(plan, ray);
}

// Returns true if h . d > 0 over all of `rect` by more than rounding. The function is linear, so it is enough to test
// the corners.
bool positive_over(const Vec3& h, const Rays& rays, const Rect& rect) {
  for (const int x : {rect.x0, rect.x1 - 1})
    for (const int y : {rect.y0, rect.y1 - 1}) {
      const Vec2 ray = rays.at(x, y);
      const double scale = std::abs(h.x * ray.x) + std::abs(h.y * ray.y) + std::abs(h.z);
      if (!(glm::dot(h, Vec3(ray, 1)) > 1e-12 * scale)) return false;
    }
  return true;
}

// The place where an edge function changes its sign, for finding the pixels of a face row by row. Along row v, the sign
// changes at x = offset + slope * v.
class EdgeCrossing {
 public:
  EdgeCrossing(const Vec3& edge, const Rays& rays) : edge_(edge), rays_(&rays) {
    const Vec2 origin = rays.at(0, 0);
    const double step = rays.at(1, 0).x - origin.x;
    const double scale = -1 / (edge.x * step);
    offset_ = edge.z * scale - origin.x / step;
    slope_ = edge.y * scale;
  }

  // Clips the intervals [x0, x1) of many rows to the pixels with sign * e >= 0. `v` are the rows. If rounding could
  // change the result of a row, the row is marked in `undecided`, and find() must evaluate the edge function.
  void clip_rows(int sign, std::span<const double> v, int* x0, int* x1, uint8_t* undecided) const {
    if (edge_.x == 0) {
      for (size_t i = 0; i < v.size(); i++)
        if (sign * FacePlan::evaluate(edge_, {0, v[i]}) < 0) x1[i] = x0[i];
      return;
    }
    const bool at_least = (edge_.x > 0) == (sign > 0);
    for (size_t i = 0; i < v.size(); i++) {
      const double x = offset_ + slope_ * v[i], error_bound = error_bound_at(v[i]);
      const double limited = x > -kFar ? (x < kFar ? x : kFar) : -kFar;  // maps NaN to -kFar
      constexpr double kWhole = 0x1.8p52;                                // adding this rounds to an integer
      const double nearest = (limited + kWhole) - kWhole;
      const int end = static_cast<int>(nearest) + (limited > nearest ? 1 : 0);
      undecided[i] |= !(error_bound < kMaxErrorBound) | !(std::abs(limited - nearest) > error_bound);
      if (at_least)
        x0[i] = std::max(x0[i], end);
      else
        x1[i] = std::min(x1[i], end);
    }
  }

  // The ends of the intervals of row y at v, on either side of the sign change. `first` and `past` differ by one if the
  // function is 0 at a pixel. find() returns false if rounding is too large to decide.
  struct Ends {
    int first = 0;  // smallest x not before the change
    int past = 0;   // one past the largest x not after the change
    bool rising = true;
    bool constant = false;  // the whole row has sign `value`
    double value = 0;
  };
  bool find(int y, double v, Ends& ends) const {
    if (edge_.x == 0) {
      ends.constant = true;
      ends.value = FacePlan::evaluate(edge_, {0, v});
      return true;
    }
    const double x = offset_ + slope_ * v, error_bound = error_bound_at(v);
    if (!(error_bound < kMaxErrorBound)) return false;
    ends.rising = edge_.x > 0;
    const double limited = std::clamp(x, -kFar, kFar), nearest = std::nearbyint(limited);
    if (std::abs(limited - nearest) > error_bound) {
      ends.first = ends.past = static_cast<int>(std::ceil(limited));
      return true;
    }
    const int n = static_cast<int>(nearest);
    const double value = FacePlan::evaluate(edge_, rays_->at(n, y));
    if (value == 0) {
      ends.first = n;
      ends.past = n + 1;
    } else {
      ends.first = ends.past = (value > 0) == ends.rising ? n : n + 1;
    }
    return true;
  }

 private:
  static constexpr double kRounding = 1e-13;  // relative to the terms of the sums; far above rounding
  static constexpr double kMaxErrorBound = 1e-3, kFar = 1e6;
  double error_bound_at(double v) const {
    return kRounding * (std::abs(offset_) + std::abs(slope_ * v) + kMaxImageSize);
  }

  Vec3 edge_;
  const Rays* rays_;
  double offset_, slope_;
};

struct Interval {
  int x0, x1;
  bool empty() const { return x1 <= x0; }
  void at_least(int x) { x0 = std::max(x0, x); }
  void less_than(int x) { x1 = std::min(x1, x); }
  void clear() { x1 = x0; }
};

void clip(const EdgeCrossing::Ends& ends, int sign, Interval& interval) {
  if (ends.constant) {
    if (sign * ends.value < 0) interval.clear();
  } else if (ends.rising == (sign > 0)) {
    interval.at_least(ends.first);
  } else {
    interval.less_than(ends.past);
  }
}

template <class Fn>
void scan(const ViewPlan& plan, const FacePlan& face, int y, Interval range, const Fn& fn) {
  for (int x = range.x0; x < range.x1; x++) {
    if (!may_own(plan, face, plan.rays().at(x, y))) continue;
    const int begin = x;
    while (x + 1 < range.x1 && may_own(plan, face, plan.rays().at(x + 1, y))) x++;
    fn(begin, x + 1);
  }
}

struct LinearFace {
  LinearFace(const ViewPlan& plan, const FacePlan& face)
      : plan(plan),
        face(face),
        crossing{{face.edge[0], plan.rays()}, {face.edge[1], plan.rays()}, {face.edge[2], plan.rays()}},
        sum(face.edge[0] + face.edge[1] + face.edge[2]) {}
  const ViewPlan& plan;
  const FacePlan& face;
  const EdgeCrossing crossing[3];
  const Vec3 sum;  // pixels with sum 0 are outside, because all three functions are 0
};

template <class Fn>
void find_in_row(const LinearFace& linear, int y, const Interval& range, const Fn& fn) {
  const auto scan_row = [&](const Interval& part) {
    scan(linear.plan, linear.face, y, part, [&](int x0, int x1) { fn(y, x0, x1); });
  };
  const Rays& rays = linear.plan.rays();
  const Vec2 begin = rays.at(0, y);
  EdgeCrossing::Ends ends[3];
  bool clear = true;
  for (int k = 0; k < 3; k++) clear = linear.crossing[k].find(y, begin.y, ends[k]) && clear;
  if (!clear) return scan_row(range);
  Interval found[2];
  for (int i = 0; i < 2; i++) {
    found[i] = range;
    for (int k = 0; k < 3; k++) clip(ends[k], i == 0 ? 1 : -1, found[i]);
  }
  // The sum is linear and keeps its sign within an interval, so it is enough to test both ends against 0.
  const Vec3& sum = linear.sum;
  const double u_step = rays.at(1, y).x - begin.x, row_sum = sum.y * begin.y + sum.z;
  for (const Interval& interval : found) {
    if (interval.empty()) continue;
    const double first = sum.x * (begin.x + interval.x0 * u_step) + row_sum;
    const double last = sum.x * (begin.x + (interval.x1 - 1) * u_step) + row_sum;
    const double rounding = 1e-12 * (std::abs(sum.x) + std::abs(row_sum));
    if (std::min(std::abs(first), std::abs(last)) > rounding)
      fn(y, interval.x0, interval.x1);
    else
      scan_row(interval);
  }
}

template <class Fn>
void find_runs(const ViewPlan& plan, const FacePlan& face, const Rect& rect, const Fn& fn) {
  const Rays& rays = plan.rays();
  const Vec3 towards_focus = plan.focal_offset() > 0 ? plan.focal_normal() : -plan.focal_normal();
  if (!rays.separable() || !positive_over(face.facing, rays, rect) || !positive_over(towards_focus, rays, rect)) {
    for (int y = rect.y0; y < rect.y1; y++)
      scan(plan, face, y, {rect.x0, rect.x1}, [&](int x0, int x1) { fn(y, x0, x1); });
    return;
  }
  const LinearFace linear(plan, face);
  const int sign = positive_over(linear.sum, rays, rect) ? 1 : positive_over(-linear.sum, rays, rect) ? -1 : 0;
  if (sign == 0) {  // the triangle straddles the eye's plane
    for (int y = rect.y0; y < rect.y1; y++) find_in_row(linear, y, {rect.x0, rect.x1}, fn);
    return;
  }
  constexpr int kRows = 64;
  double v[kRows];
  int x0[kRows], x1[kRows];
  uint8_t undecided[kRows];
  for (int y = rect.y0; y < rect.y1; y += kRows) {
    const int rows = std::min(rect.y1 - y, kRows);
    for (int i = 0; i < rows; i++) v[i] = rays.at(0, y + i).y;
    std::fill_n(x0, rows, rect.x0);
    std::fill_n(x1, rows, rect.x1);
    std::fill_n(undecided, rows, 0);
    for (const EdgeCrossing& crossing : linear.crossing)
      crossing.clip_rows(sign, {v, static_cast<size_t>(rows)}, x0, x1, undecided);
    for (int i = 0; i < rows; i++)
      if (undecided[i])
        find_in_row(linear, y + i, {rect.x0, rect.x1}, fn);
      else if (x0[i] < x1[i])
        fn(y + i, x0[i], x1[i]);
  }
}

}  // namespace

std::vector<FaceRuns::Found> FaceRuns::find(const ViewPlan& plan, const Rect& band) const {
  std::vector<Found> found;
  found.reserve(4 * static_cast<size_t>(band.height()) * 8);
  // Runs that are inserted first win, so the whole cells of the grid come first. They belong to the last face.
  if (const WeightGrid* const grid = plan.blend(); grid && grid->has_whole_cells()) {
    const size_t last = plan.faces().size() - 1;
    find_runs(plan, plan.faces()[last], intersect(plan.faces()[last].rect, band), [&](int y, int x0, int x1) {
      grid->visit_whole_cells(y, x0, x1, [&](int a, int b) {
        found.push_back({y, a, b, static_cast<int32_t>(last)});
      });
    });
  }
  for (size_t i = 0; i < plan.faces().size(); i++) {
    const Rect rect = intersect(plan.faces()[i].rect, band);
    if (rect.empty()) continue;
    find_runs(plan, plan.faces()[i], rect, [&](int y, int x0, int x1) {
      found.push_back({y, x0, x1, static_cast<int32_t>(i)});
    });
  }
  return found;
}

FaceRuns::FaceRuns(const ViewPlan& plan, const Rect& region, const ParallelFor& parallel)
    : region_(intersect(region, {0, 0, plan.view().width, plan.view().height})) {
  if (region_.empty()) region_ = {};
  // Pixel-by-pixel scans run in parallel in small bands. Otherwise all rows of a face are found together.
  constexpr int kBandRows = 32;
  constexpr size_t kManyPixels = size_t{1} << 22;
  size_t pixels = 0;
  for (const FacePlan& face : plan.faces()) {
    const Rect rect = intersect(face.rect, region_);
    if (!rect.empty()) pixels += static_cast<size_t>(rect.width()) * static_cast<size_t>(rect.height());
  }
  const bool in_bands = !plan.rays().separable() || pixels > kManyPixels;
  const int height = in_bands ? kBandRows : std::max(region_.height(), 1);
  std::vector<std::vector<Found>> bands(static_cast<size_t>((region_.height() + height - 1) / height));
  parallel(bands.size(), [&](size_t i) {
    const int top = region_.y0 + static_cast<int>(i) * height;
    bands[i] = find(plan, {region_.x0, top, region_.x1, std::min(top + height, region_.y1)});
  });
  rows_.resize(static_cast<size_t>(region_.height()));
  for (const std::vector<Found>& band : bands)
    for (const Found& f : band) rows_[static_cast<size_t>(f.y - region_.y0)].count++;
  // n overlapping runs have 2 n ends, which split a row into fewer than 2 n pieces.
  uint32_t begin = 0;
  for (Row& row : rows_) {
    row.begin = begin;
    begin += 2 * row.count;
    row.count = 0;
  }
  runs_.resize(begin);
  for (const std::vector<Found>& band : bands)
    for (const Found& f : band) {
      Row& row = rows_[static_cast<size_t>(f.y - region_.y0)];
      FaceRun* const end = runs_.data() + row.begin + row.count;
      if (row.count == 0 || (end - 1)->x1 <= f.x0) {
        *end = {f.x0, f.x1, f.face};
        row.count++;
      } else {
        insert(row, f.x0, f.x1, f.face);
      }
    }
}

// Faces come in ascending order, so existing runs win.
void FaceRuns::insert(Row& row, int x0, int x1, int32_t face) {
  FaceRun* const begin = runs_.data() + row.begin;
  FaceRun* at = begin + row.count;
  while (at > begin && (at - 1)->x1 > x0) at--;  // first run that ends after x0
  const auto put = [&](int from, int to) {
    std::move_backward(at, begin + row.count, begin + row.count + 1);
    *at = {from, to, face};
    row.count++;
  };
  while (x0 < x1) {
    const int next = at < begin + row.count ? at->x0 : x1;
    if (next >= x1) {
      put(x0, x1);
      return;
    }
    if (x0 < next) {
      put(x0, next);
      at++;
    }
    x0 = at->x1;
    at++;
  }
}

std::span<const FaceRun> FaceRuns::row(int y, int x0, int x1) const {
  const std::span<const FaceRun> all = row(y);
  const auto first = std::partition_point(all.begin(), all.end(), [x0](const FaceRun& r) { return r.x1 <= x0; });
  const auto past = std::partition_point(first, all.end(), [x1](const FaceRun& r) { return r.x0 < x1; });
  return {first, past};
}

FaceIdMap::FaceIdMap(const ViewPlan& plan, const Rect& region) : FaceIdMap(FaceRuns(plan, region)) {}

FaceIdMap::FaceIdMap(FaceRuns runs) : runs_(std::move(runs)), region_(runs_.region()) {
  owner_.assign(static_cast<size_t>(region_.width()) * region_.height(), kNone);
  for (int y = region_.y0; y < region_.y1; y++)
    for (const FaceRun& run : runs_.row(y))
      std::fill_n(&owner_[static_cast<size_t>(y - region_.y0) * region_.width() + (run.x0 - region_.x0)],
                  run.x1 - run.x0, run.face);
}

FaceWeights face_weights(const FacePlan& face, const Vec2& ray) {
  const double e0 = FacePlan::evaluate(face.edge[0], ray), e1 = FacePlan::evaluate(face.edge[1], ray),
               e2 = FacePlan::evaluate(face.edge[2], ray), sum = e0 + e1 + e2;
  return {{static_cast<float>(e0 / sum), static_cast<float>(e1 / sum), static_cast<float>(e2 / sum)}};
}

CameraCorners::CameraCorners(const ViewPlan& plan, CameraIndex camera)
    : camera_(camera), corner_(plan.faces().size(), -1) {
  for (size_t i = 0; i < corner_.size(); i++) {
    if (!plan.faces()[i].has_corners()) corner_[i] = 0;
    for (int8_t k = 0; k < 3; k++)
      if (plan.faces()[i].camera[k] == camera) corner_[i] = k;
  }
}

Rect CameraCorners::owned(const FaceRuns& runs, const Rect& rect) const {
  Rect bounds;
  for (int y = rect.y0; y < rect.y1; y++)
    for (const FaceRun& run : runs.row(y, rect.x0, rect.x1))
      if (has(run.face)) bounds = unite(bounds, {std::max(run.x0, rect.x0), y, std::min(run.x1, rect.x1), y + 1});
  return bounds;
}

std::vector<float> pixel_weights(const ViewPlan& plan, const FaceIdMap& owners, CameraIndex camera, const Rect& rect) {
  const CameraCorners corners(plan, camera);
  std::vector<float> weights;
  weights.reserve(static_cast<size_t>(rect.width()) * rect.height());
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) weights.push_back(corners.weight_at(plan, owners, x, y));
  return weights;
}

namespace {

std::vector<CameraIndex> contributing(const ViewPlan& plan, std::span<const CameraIndex> own) {
  std::vector<CameraIndex> cameras;
  for (const CameraIndex camera : own)
    if (!plan.camera_rect(camera).empty()) cameras.push_back(camera);
  return cameras;
}

Rect region(const ViewPlan& plan, const std::vector<CameraIndex>& cameras) {
  Rect all;
  for (const CameraIndex camera : cameras) all = unite(all, chroma_aligned(plan.camera_rect(camera), plan.view()));
  return all;
}

}  // namespace

RenderJob::RenderJob(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own,
                     const ParallelFor& parallel)
    : RenderJob(ViewPlan(rig, mesh, view, parallel), own, parallel) {}

RenderJob::RenderJob(ViewPlan plan, std::span<const CameraIndex> own, const ParallelFor& parallel)
    : plan_(std::move(plan)), cameras_(contributing(plan_, own)), runs_(plan_, region(plan_, cameras_), parallel) {}

}  // namespace lf
