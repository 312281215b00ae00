// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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

// Weights of any number of cameras over a view, on a grid with a point every kStep pixels, and bilinear in between.
// Point (i, j) is at pixel (i kStep, j kStep). The last points are at or beyond the view's border.
//
// All weights are integers in units of 1 / kOne. The weights of all cameras in a pixel sum to exactly kOne, although
// each camera's weight is computed independently. The running sums over the cameras, by ascending index, are rounded
// and interpolated. A camera's weight is the difference of two running sums. Immutable after construction; safe to
// share between threads.
class WeightGrid {
 public:
  static constexpr int kOne = 32768;
  // Pixels from point to point; a multiple of the renderer's SIMD block.
  static constexpr int kStep = 16, kStepBits = 4;
  static constexpr size_t kMaxShares = 64;  // cameras with weight at a point

  struct Share {
    CameraIndex camera;
    double weight;  // non-negative, finite, arbitrary scale
  };

  WeightGrid(int width, int height, size_t num_cameras);
  static int points(int pixels) { return (pixels + kStep - 1) / kStep + 1; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // Adds the next point in row-major order. `shares`: ascending by camera, at most kMaxShares, at least one with a
  // positive weight.
  void add_point(std::span<const Share> shares);

  // One camera's running sums, excluding (`before`) and including (`with`) the camera, at the corners of a cell: points
  // (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1).
  struct Cell {
    std::array<int32_t, 4> before, with;

    // Returns the weight in pixel (x, y) of the cell, each 0 to kStep - 1, in units of 1 / kOne.
    int weight(int x, int y) const { return level(with, x, y) - level(before, x, y); }

   private:
    static int level(const std::array<int32_t, 4>& at, int x, int y) {
      const int32_t left = at[0] * (kStep - y) + at[2] * y, right = at[1] * (kStep - y) + at[3] * y;
      return (left * kStep + (right - left) * x + (1 << (2 * kStepBits - 1))) >> (2 * kStepBits);
    }
  };
  // Finds the camera's cell (i, j). Returns false if the camera has no weight at any of its four points. i < columns()
  // - 1, j < rows() - 1.
  bool find(CameraIndex camera, int i, int j, Cell& cell) const;
  // Returns the camera's weight in a pixel of the view, in units of 1 / kOne.
  int weight(CameraIndex camera, int x, int y) const {
    Cell cell;
    return find(camera, x / kStep, y / kStep, cell) ? cell.weight(x % kStep, y % kStep) : 0;
  }
  // Returns the sum of the squared weights at point (i, j), 0 to 1.
  double sum_of_squares(int i, int j) const;
  // Bounds the pixels with a weight of the camera; may be empty.
  Rect camera_rect(CameraIndex camera) const { return rects_[camera]; }

 private:
  struct Entry {
    CameraIndex camera;
    int32_t before, with;
  };
  Entry lookup(size_t point, CameraIndex camera) const;

  int width_, height_, columns_, rows_;
  std::vector<size_t> first_{0};  // for each point the index of its first entry, and the end
  std::vector<Entry> entries_;
  std::vector<Rect> rects_;
};

// Computes the weight of each camera along one line of sight, for Blending::kAperture and kAngle. Weights change
// continuously with the line, the view and the cameras, unless two cameras have the same position.
//
// kAperture simulates an open lens of that diameter in the array. p_i is the distance of camera i's centre from the
// line of sight, and s_i = p_i^2 - min p^2. w_i = (1 - s_i / S)^2 where s_i < S = (diameter / 2)^2. S is limited so
// that at least the nearest four and at most kMaxShares cameras have a weight. Cameras that face away have no weight;
// cameras at nearly a right angle count as more distant. Measuring from the nearest camera gives the same lens at the
// border of an array, and for an eye beside a line of cameras.
//
// kAngle: Buehler, Bosse, McMillan, Gortler and Cohen 2001, "Unstructured Lumigraph Rendering". X is the point in focus
// on the line of sight, and a_i = tan(angle at X between eye and camera / 2). f_i is the size of a camera pixel at X,
// relative to a pixel of the view. b_i (1/1024 to 1) is the distance of X from the edge of the camera's image, relative
// to a margin; 1/1024 outside the image or behind the camera.
//   p_i = (a_i + a max(0, f_i - 1) / 10) / b_i,  w_i = 1 / p_i x (1 - (p_i - p) / (T - p)) where p_i < T,
// with k = Blending::nearest, a the k-th smallest a_i, and p the smallest p_i. T - p is 17/16 of the (k + 1)-th
// smallest p_i - p, so that equally good cameras do not all vanish. A camera in line with the eye gets the whole
// weight.
class CameraWeights {
 public:
  // Weighs the cameras of the mesh. All arguments must outlive this object.
  CameraWeights(const Rig& rig, const Mesh& mesh, const View& view);

  // Computes the shares of cameras along the line of sight (u, v, 1) in view coordinates, with the focus at `t` times
  // this vector (may be infinite). `shares` are ascending by camera, at most WeightGrid::kMaxShares, and empty only
  // without cameras.
  void at(const Vec2& ray, double t, std::vector<WeightGrid::Share>& shares);

 private:
  struct Candidate {
    double penalty;
    size_t i;  // index into cameras_
    auto operator<=>(const Candidate&) const = default;
  };
  struct Seen {
    CameraIndex camera;
    Vec3 centre, forward;  // in view coordinates, relative to the eye
    Mat3 camera_from_view;
    double focal;  // pixels
  };

  void within_aperture(const Vec3& d);
  void by_angle(const Vec3& d, const Vec3& in_focus);
  double inside(const Seen& seen, const Vec3& in_focus) const;

  const Rig& rig_;
  const Blending blending_;
  const double view_focal_;
  std::vector<Seen> cameras_;
  std::vector<Candidate> by_angle_, candidates_;
  std::vector<double> weights_;  // weights of candidates_
};

// Computes the WeightGrid of a view that is not blended by the mesh. Cost: points x cameras.
std::shared_ptr<const WeightGrid> make_weight_grid(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                   const ParallelFor& parallel = serial_for);

}  // namespace lf
