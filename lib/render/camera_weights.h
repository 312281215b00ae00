// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/maths.h"
#include "render/view_plan.h"
#include "rig/rig.h"

namespace lf {

// Stores the weights (shares in each pixel) of any number of cameras over a view. Weights are exact at the points of a
// grid, kStep pixels apart, and bilinear in between. Point (i, j) is at pixel (i kStep, j kStep), and the last points
// are at or beyond the view's border.
//
// Several hosts may compute the weights of different cameras, and yet the weights of all cameras in a pixel must add up
// to exactly kOne. Therefore the grid does not store weights, but running sums over the cameras by ascending index, as
// integers in units of 1 / kOne. The running sums are interpolated and rounded, and the weight of a camera is the
// difference of two running sums. Immutable after construction; safe to share between threads.
class WeightGrid {
 public:
  static constexpr int kOne = 32768;
  // Distance between points in pixels. It is a multiple of the renderer's SIMD block.
  static constexpr int kStep = 16, kStepBits = 4;
  static constexpr size_t kMaxShares = 64;  // maximum number of cameras with weight at a point

  struct Share {
    CameraIndex camera;
    double weight;  // finite, at least 0; the scale does not matter
  };

  // The pixels of a cell that take their weights from the grid: no pixels, the pixels that no face of the mesh owns, or
  // all pixels.
  enum CellUse : uint8_t { kUnused = 0, kUnowned = 1, kWhole = 2 };

  // Creates an empty grid for a view of this size. `cells` contains the CellUse of (columns() - 1) x (rows() - 1)
  // cells, row by row. If `cells` is empty, all cells are kUnowned. Then call add_point() for each point.
  WeightGrid(int width, int height, size_t num_cameras, std::vector<uint8_t> cells = {});
  static int points(int pixels) { return (pixels + kStep - 1) / kStep + 1; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // Adds the weights at the next point, in row-major order. `shares` contains at most kMaxShares cameras, ascending,
  // and at least one positive weight. It is empty for a point that no cell with weights uses.
  void add_point(std::span<const Share> shares);

  // The weight of one camera in a row of a cell: the running sums at the ends of the row, times kStep, without the
  // camera and with it.
  struct CellRow {
    static constexpr int kHalf = 1 << (2 * kStepBits - 1);  // for rounding
    int32_t left_before, right_before, left, right;

    // Returns the weight in a pixel of the row, in units of 1 / kOne.
    int32_t weight(int x) const { return level(left, right, x) - level(left_before, right_before, x); }

   private:
    static int32_t level(int32_t left, int32_t right, int x) {
      return (left * kStep + (right - left) * x + kHalf) >> (2 * kStepBits);
    }
  };
  // The weight of one camera in a cell of the grid. It consists of the running sums at the four corners of the cell,
  // before the camera is added (`before`) and after (`with`). The corners are the points (i, j), (i + 1, j), (i, j + 1)
  // and (i + 1, j + 1).
  struct Cell {
    std::array<int32_t, 4> before, with;

    // Returns the weights in row y of the cell, and in pixel (x, y). x and y are 0 to kStep - 1.
    CellRow row(int y) const {
      const auto between = [y](int32_t upper, int32_t lower) { return upper * (kStep - y) + lower * y; };
      return {between(before[0], before[2]), between(before[1], before[3]), between(with[0], with[2]),
              between(with[1], with[3])};
    }
    int weight(int x, int y) const { return row(y).weight(x); }
  };
  // Finds the camera's weights at the corners of cell (i, j). Returns false if the camera has no weight at any of its
  // four corners, or if the cell has no weights. i < columns() - 1, j < rows() - 1.
  bool find(CameraIndex camera, int i, int j, Cell& cell) const;
  // Returns the camera's weight in pixel (x, y) of the view, in units of 1 / kOne.
  int weight(CameraIndex camera, int x, int y) const {
    Cell cell;
    return find(camera, x / kStep, y / kStep, cell) ? cell.weight(x % kStep, y % kStep) : 0;
  }
  // Returns the sum of the squared weights at point (i, j), 0 to 1. It is 1 if one camera has all the weight.
  double sum_of_squares(int i, int j) const;
  bool has_whole_cells() const { return has_whole_cells_; }
  // Calls visit(a, b) for each maximal part [a, b) of the pixels [x0, x1) of row y that is in cells of kWhole.
  template <typename Visit>
  void visit_whole_cells(int y, int x0, int x1, const Visit& visit) const {
    const uint8_t* const row = &cells_[static_cast<size_t>(y / kStep) * static_cast<size_t>(columns_ - 1)];
    for (int x = x0; x < x1;) {
      const int begin = x;
      while (x < x1 && row[x / kStep] == kWhole) x = std::min((x / kStep + 1) * kStep, x1);
      if (x > begin) visit(begin, x);
      while (x < x1 && row[x / kStep] != kWhole) x = std::min((x / kStep + 1) * kStep, x1);
    }
  }
  // Returns bounds of all pixels that the camera contributes to; may be empty.
  Rect camera_rect(CameraIndex camera) const { return rects_[camera]; }

 private:
  struct Entry {
    CameraIndex camera;
    int32_t before, with;
  };
  Entry lookup(size_t point, CameraIndex camera) const;
  bool has_weights(int i, int j) const {
    return cells_.empty() ||
           cells_[static_cast<size_t>(j) * static_cast<size_t>(columns_ - 1) + static_cast<size_t>(i)] != kUnused;
  }

  int width_, height_, columns_, rows_;
  std::vector<uint8_t> cells_;
  bool has_whole_cells_;
  std::vector<size_t> first_{0};  // for each point the index of its first entry, and the end
  std::vector<Entry> entries_;
  std::vector<Rect> rects_;
};

// Computes the weight of each camera along one line of sight, for views that are blended by Blending::kAperture or
// kAngle instead of the mesh. Weights change continuously with the line, the view and the cameras, unless two cameras
// have the same position.
//
// kAperture simulates a large lens of that diameter in the array. Let p_i be the distance of camera i's centre from the
// line of sight, and s_i = p_i^2 - min p^2. Then w_i = (1 - s_i / S)^2 for s_i < S, with S = (diameter / 2)^2. S is
// limited so that at least the nearest four and at most kMaxShares cameras have a weight. Cameras that face away have
// no weight, and cameras at nearly a right angle count as more distant. Distances are relative to the nearest camera,
// so the lens has the same size at the border of an array, and for an eye beside a line of cameras.
//
// kAngle prefers cameras that see the scene from nearly the same direction as the eye. Source: Buehler, Bosse,
// McMillan, Gortler and Cohen 2001, "Unstructured Lumigraph Rendering". Let X be the point in focus on the line of
// sight, and a_i = tan(angle at X between eye and camera / 2). f_i is the size of a camera pixel at X, relative to a
// pixel of the view. b_i (1/1024 to 1) is the distance of X from the edge of the camera's image, relative to a margin;
// it is 1/1024 outside the image or behind the camera.
//   p_i = (a_i + a max(0, f_i - 1) / 10) / b_i,  w_i = 1 / p_i x (1 - (p_i - p) / (T - p)) where p_i < T,
// with k = Blending::nearest, a the k-th smallest a_i, and p the smallest p_i. T - p is 17/16 of the (k + 1)-th
// smallest p_i - p, so that equally good cameras do not all vanish. A camera in line with the eye gets the whole
// weight.
class CameraWeights {
 public:
  // Prepares the weights of the cameras in the mesh. All arguments must outlive this object.
  CameraWeights(const Rig& rig, const Mesh& mesh, const View& view);

  // Computes the shares of the cameras along the line of sight (u, v, 1) in view coordinates. The focus is at `t` times
  // this vector; `t` may be infinite. `shares` become ascending by camera, at most WeightGrid::kMaxShares. They are
  // empty only if there are no cameras. Returns true if a camera with a share has the point in focus in its image; only
  // for kAngle.
  bool at(const Vec2& ray, double t, std::vector<WeightGrid::Share>& shares);
  // Returns how well a camera of the mesh sees the point in focus: b_i of the formula, but 0 outside the image.
  double visibility(CameraIndex camera, const Vec2& ray, double t) const;

 private:
  struct Candidate {
    double penalty;
    size_t i;
    auto operator<=>(const Candidate&) const = default;
  };
  struct Seen {
    CameraIndex camera;
    Vec3 centre, forward;  // in view coordinates, with the eye at the origin
    Mat3 camera_from_view;
    double focal;  // pixels
  };

  void within_aperture(const Vec3& d);
  bool by_angle(const Vec3& d, const Vec3& in_focus);
  double inside(const Seen& seen, const Vec3& in_focus) const;
  Vec3 in_focus(const Vec2& ray, double t) const;

  const Rig& rig_;
  const Blending blending_;
  const double view_focal_;
  std::vector<Seen> cameras_;  // ascending
  double farthest_ = 0;        // a finite distance for infinity, metres
  std::vector<Candidate> by_angle_, candidates_;
  std::vector<double> weights_;
};

// The line of sight (u, v, 1) of a pixel. The point in focus is at `focus` times this vector; may be infinite.
struct LineOfSight {
  Vec2 ray;
  double focus = 0;
};
// Returns the line of sight of a position in a view, in pixels. Positions outside the view are allowed. If the lens has
// no line of sight there, uses a position nearer to the middle.
LineOfSight line_of_sight(const ViewPlan& plan, const Vec2& pixel);

// Computes the WeightGrid of a view that is not blended by the mesh. Cost: points x cameras.
std::shared_ptr<const WeightGrid> make_weight_grid(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                   const ParallelFor& parallel = serial_for);

}  // namespace lf
