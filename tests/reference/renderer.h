// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/lens.h"
#include "image/image.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::reference {

// The widest real the machine has (80-bit on x86): errors of the reference itself then never matter.
using Real = long double;

struct V3 {
  Real x = 0, y = 0, z = 0;
};

inline V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(Real s, const V3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Real dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Real norm(const V3& a) { return std::sqrt(dot(a, a)); }
inline V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Anything with x, y, z (and w) members.
template <typename Vector>
V3 to_v3(const Vector& v) {
  return {v.x, v.y, v.z};
}

// Rodrigues' form of q v q*, with q brought to unit norm; `inverse` rotates by q* instead.
template <typename Quaternion>
V3 rotate(const Quaternion& q, const V3& v, bool inverse = false) {
  const Real sign = inverse ? -1 : 1;
  const Real w = q.w;
  const V3 axis{sign * q.x, sign * q.y, sign * q.z};
  const V3 twice = (2 / (w * w + dot(axis, axis))) * cross(axis, v);
  return v + w * twice + cross(axis, twice);
}

struct P2 {
  Real x = 0, y = 0;
};

// The lens models of docs/design.md, from a Lens's model and parameters alone. Everything that has to be solved is
// solved by bisection or by Newton's method on differences: slow, and nothing to get wrong.
class ReferenceLens {
 public:
  explicit ReferenceLens(const lf::Lens& lens);

  // Camera coordinates to a pixel position; nothing for Z <= 0 or beyond the fold.
  std::optional<P2> project(const V3& x_camera) const;
  // A pixel's line of sight (u, v, 1); nothing where no ray falls.
  std::optional<P2> line_of_sight(const P2& pixel) const;
  // The first undistorted radius at which r (1 + k1 r^2 + k2 r^4) stops growing; infinity if it never does.
  Real fold_radius() const { return fold_; }

 private:
  P2 distort(const P2& undistorted) const;

  Real fx_, fy_, cx_, cy_;
  Real k1_ = 0, k2_ = 0, p1_ = 0, p2_ = 0;
  Real fold_;
};

// The weights of a view that is not blended by its mesh, as render/camera_weights.h states them, in 80-bit reals and
// rounded nowhere; shared with nothing.
class ReferenceBlending {
 public:
  // Nodes are `step` pixels apart. Everything must outlive this.
  ReferenceBlending(const Rig& rig, const Mesh& mesh, const View& view, int step);
  // Of every camera of the rig, in pixel (x, y), as if all lines of sight had a focus; they sum to 1.
  std::vector<Real> at(int x, int y) const;

 private:
  std::vector<Real> at_node(int x, int y) const;
  std::vector<Real> within_aperture(const V3& d) const;
  std::vector<Real> by_angle(const V3& d, const V3& in_focus) const;

  const Rig& rig_;
  const View& view_;
  const int step_, columns_;
  std::vector<CameraIndex> cameras_;
  std::vector<V3> centre_, forward_;  // of these; relative to the eye, axes of the world
  std::vector<std::vector<Real>> nodes_;
};

// The rendering rule of the light field, written down pixel by pixel as it is stated and shared with nothing: for a
// pixel's line of sight E + t d,
//  - a triangle's weights are w_i = e_jk / (e_ij + e_jk + e_ki), e_ij = d . ((C_i - E) x (C_j - E)) from the edge's
//    smaller camera to its larger one; inside where all are >= 0, undefined (no weight) where the sum is 0;
//  - the owner is the lowest-numbered of ALL faces that faces d and contains it;
//  - X is where the line meets the focal plane at t > 0 (else: no weight at all); each corner of the owner samples its
//    image at X's projection, or loses its weight behind the camera, beyond the lens's fold or outside the image;
//  - the picture is the sum of valid weight x colour, divided by 1 - lost weight.
struct Pixel {
  static constexpr int kNone = -1;

  int owner = kNone;  // face of the mesh
  int corners = 0;    // of the owner: how many of the following count
  std::array<CameraIndex, 3> camera{};
  std::array<double, 3> weight{};  // the own_weights of these cameras; all others have none
  std::array<double, 3> valid{};   // weight, or 0 where the sample is lost
  double coverage = 0;             // sum of valid weights
  double lost = 0;                 // sum of lost weights
  std::array<double, 3> colour{};  // 0..255 after the division; black where nothing is left
  // How far (relative to the terms of the sums that decide) the line of sight is from another owner, and from another
  // verdict on its samples: where a margin is as small as rounding, doubles may rightly decide otherwise.
  double owner_margin = 0;
  double sample_margin = 0;
};

struct Picture {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;  // row-major
  const Pixel& at(int x, int y) const { return pixels[static_cast<size_t>(y) * width + x]; }
  // The own of `camera` in a pixel: 0 if it is no corner of the owner.
  double weight_of(int x, int y, CameraIndex camera) const;
  // Rounded to 8 bits, and coverage per pixel as quality.h takes it.
  Image image() const;
  std::vector<float> coverage() const;
};

// `images`: one kRgb image per camera of the rig; or none at all: colours stay black, all else is computed.
Picture render(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images);

// What a map has for a pixel: bilinear between the nodes, which stand in the middle of step x step pixels; the outer
// ones go on.
Real inverse_distance(const FocalMap& map, int x, int y);

// One face seen along one line of sight.
struct Sighting {
  bool faces = false;  // (sum of the corners' axes) . d > 0
  bool contains = false;
  std::array<Real, 3> weight{};  // of its corners; 0 unless it contains the line
  Real margin = 0;               // see Pixel::owner_margin
};
// Faces as one eye sees them: all that depends on no line of sight is made once.
class Sight {
 public:
  Sight(const Rig& rig, const Mesh& mesh, const V3& eye);
  // `d` in the world, any length > 0.
  Sighting look(size_t face, const V3& d) const;

 private:
  struct Face {
    int corners;
    std::array<V3, 3> edge;     // triangle: opposite each corner; strip: (C_k - E) x extent
    std::array<Real, 3> scale;  // of the terms that make up edge . d, for a unit d
    V3 axes;                    // sum of the corners' forward axes
  };
  std::vector<Face> faces_;
};

// The same weights by going there: the point where the line meets the triangle's plane and its barycentric coordinates
// by areas. Nothing where the line is (almost) parallel to the plane or the triangle has (almost) no area.
std::optional<std::array<Real, 3>> weights_at_meeting_point(const Rig& rig, const MeshFace& face, const V3& eye,
                                                            const V3& d);

}  // namespace lf::reference
