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

// Weights of any number of cameras over a view: grid points every kStep pixels that carry the weights of several
// cameras, bilinear in between. Point (i, j) stands at pixel (i kStep, j kStep); the last ones are at or beyond the
// view's border.
//
// All in integers: a weight is a number of units of 1 / kOne, and those of all cameras in a pixel sum to kOne, to the
// bit, though each camera computes its own alone. What is rounded, at points and between them, are the running sums
// over the cameras in the order of their indices; a camera's weight is what its own share adds to that. Immutable once
// made; share between threads.
class BlendGrid {
 public:
  static constexpr int kOne = 32768;
  // Pixels from point to point; a multiple of a SIMD block of the renderer.
  static constexpr int kStep = 16, kStepBits = 4;
  static constexpr size_t kMaxShares = 64;  // cameras that have weight at a point

  struct Share {
    CameraIndex camera;
    double weight;  // not negative, finite, of any scale
  };

  BlendGrid(int width, int height, size_t num_cameras);
  static int points(int pixels) { return (pixels + kStep - 1) / kStep + 1; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  // Adds the next point, row after row. `shares`: ascending by camera, at most kMaxShares, at least one with a weight.
  void add_point(std::span<const Share> shares);

  // One camera in the cell of pixels between four points: running sums without and with it at points (i, j), (i + 1,
  // j), (i, j + 1), (i + 1, j + 1).
  struct Cell {
    std::array<int32_t, 4> before, with;

    // The camera's weight in pixel (x, y) of the cell, each 0..kStep - 1, in units of 1 / kOne.
    int weight(int x, int y) const { return level(with, x, y) - level(before, x, y); }

   private:
    static int level(const std::array<int32_t, 4>& at, int x, int y) {
      const int32_t left = at[0] * (kStep - y) + at[2] * y, right = at[1] * (kStep - y) + at[3] * y;
      return (left * kStep + (right - left) * x + (1 << (2 * kStepBits - 1))) >> (2 * kStepBits);
    }
  };
  // Finds the camera's cell; false where the camera has no weight at any of its four points. i < columns() - 1, j <
  // rows() - 1.
  bool find(CameraIndex camera, int i, int j, Cell& cell) const;
  // The camera's weight in a pixel of the view, in units of 1 / kOne.
  int weight(CameraIndex camera, int x, int y) const {
    Cell cell;
    return find(camera, x / kStep, y / kStep, cell) ? cell.weight(x % kStep, y % kStep) : 0;
  }
  // The sum of the squared weights at point (i, j), 0 to 1.
  double sum_of_squares(int i, int j) const;
  // Bounds the pixels in which the camera may have a weight; empty if there are none.
  Rect camera_rect(CameraIndex camera) const { return rects_[camera]; }

 private:
  struct Entry {
    CameraIndex camera;
    int32_t before, with;
  };
  Entry lookup(size_t point, CameraIndex camera) const;

  int width_, height_, columns_, rows_;
  std::vector<size_t> first_{0};  // for each point its first of entries_, and the end
  std::vector<Entry> entries_;
  std::vector<Rect> rects_;
};

// Computes what each camera should count for along one line of sight of a view, for Blending::kAperture and kAngle.
// Weights change continuously with the line, the view and the cameras, as long as no two cameras are at one place.
//
// kAperture: as if an open lens of that diameter stood in the array. With p_i the distance of camera i's centre from
// the line of sight and s_i = p_i^2 - min p^2, w_i = (1 - s_i / S)^2 where s_i < S = (diameter / 2)^2; never less than
// what lets the nearest four have a weight, or more than what leaves it to kMaxShares. Cameras that face away have
// none, those at nearly a right angle are counted as farther. Counting from the nearest camera makes it the same lens
// on the border of an array, and on a line of cameras that the eye is not in line with.
//
// kAngle: Buehler, Bosse, McMillan, Gortler and Cohen 2001, "Unstructured Lumigraph Rendering". With X the point in
// focus on the line, a_i = tan(angle at X between eye and camera / 2), f_i the size of a pixel of the camera at X over
// that of one of the view, and b_i the part (1/1024 to 1) that X is inside of the camera's image by of a margin of its
// size (behind the camera: 1/1024),
//   p_i = (a_i + a max(0, f_i - 1) / 10) / b_i,  w_i = 1 / p_i x (1 - (p_i - p) / (T - p)) where p_i < T,
// a the k-th smallest a_i, p the smallest p_i, T - p a sixteenth more than the (k + 1)-th smallest p_i - p (what is
// equally good must not vanish together); k = Blending::nearest. A camera in line with the eye gets all.
class CameraWeights {
 public:
  // Weighs the cameras of the mesh. Everything must outlive this.
  CameraWeights(const Rig& rig, const Mesh& mesh, const View& view);

  // The shares of cameras along the line of sight (u, v, 1) in view coordinates, which is in focus at `t` times it
  // (infinity is good, too). They ascend by camera and are at most BlendGrid::kMaxShares; empty only if there are no
  // cameras.
  void at(const Vec2& ray, double t, std::vector<BlendGrid::Share>& shares);

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

// The weights of a view that is not blended by its mesh, at the points of a grid over it. Cost: points x cameras.
std::shared_ptr<const BlendGrid> make_blend_grid(const Rig& rig, const Mesh& mesh, const ViewPlan& plan,
                                                 const ParallelFor& parallel = serial_for);

}  // namespace lf
