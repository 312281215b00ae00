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

// The widest floating-point type (80-bit on x86), so that errors of the reference are negligible.
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

// Converts any type with x, y, z members.
template <typename Vector>
V3 to_v3(const Vector& v) {
  return {v.x, v.y, v.z};
}

// Rodrigues' form of q v q*, with q normalised; `inverse` rotates by q* instead.
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

// The lens models of docs/architecture.md, from a Lens's model and parameters alone. Equations are solved by bisection
// or by Newton's method on differences: slow but simple.
class ReferenceLens {
 public:
  explicit ReferenceLens(const lf::Lens& lens);

  // Projects camera coordinates to a pixel; nullopt outside the field.
  std::optional<P2> project(const V3& x_camera) const;
  // Returns a pixel's line of sight (u, v, 1); nullopt if no ray with Z > 0 projects to the pixel.
  std::optional<P2> line_of_sight(const P2& pixel) const;
  // Returns how far a point is inside the field: positive inside, negative outside, 0 at the end of the field.
  Real inside_field(const V3& x_camera) const;
  // Returns the length of (a, b) where the field ends; infinity if it does not end.
  Real longest() const { return longest_; }

 private:
  Real grown(Real length) const;  // radial distortion of a length of (a, b); see geometry/lens.h
  Real find_fold() const;         // as such a length
  P2 bend(const P2& ab) const;

  Real fx_, fy_, cx_, cy_;
  bool fisheye_ = false;
  std::array<Real, 5> numerator_ = {1}, denominator_ = {1};  // coefficients for powers of r^2
  Real p1_ = 0, p2_ = 0, s1_ = 0, s2_ = 0;
  Real longest_;
};

// The weights of a view blended by aperture or angle, as stated in render/camera_weights.h, in 80-bit floating point
// without rounding; shares no code with the library.
class ReferenceBlending {
 public:
  // Nodes are `step` pixels apart. All arguments must outlive the object.
  ReferenceBlending(const Rig& rig, const Mesh& mesh, const View& view, int step);
  // Returns the weights of all cameras of the rig in pixel (x, y), as if every line of sight had a focus; they add up
  // to 1.
  std::vector<Real> at(int x, int y) const;

 private:
  std::vector<Real> at_node(int x, int y) const;
  std::vector<Real> within_aperture(const V3& d) const;
  std::vector<Real> by_angle(const V3& d, const V3& in_focus) const;

  const Rig& rig_;
  const View& view_;
  const int step_, columns_;
  std::vector<CameraIndex> cameras_;
  std::vector<V3> centre_, forward_;  // centres and axes of these cameras; relative to the viewpoint, in world axes
  std::vector<std::vector<Real>> nodes_;
};

// The rendering rule of the light field, pixel by pixel, sharing no code with the library. For a pixel's line of sight
// E + t d:
// - The weights of a triangle are w_i = e_jk / (e_ij + e_jk + e_ki), e_ij = d . ((C_i - E) x (C_j - E)), from the
//   edge's smaller camera index to the larger. The line is inside if all are >= 0; without weight if the sum is 0.
// - The owner is the face with the lowest index of ALL faces that face d and contain the line.
// - X is the intersection with the focal plane at t > 0 (otherwise there is no weight). Each corner of the owner
//   samples its image at the projection of X. The corner's weight is lost if X is behind the camera, beyond the lens's
//   fold or outside the image.
// - The picture is the sum of valid weight x colour, divided by 1 - missing weight.
struct Pixel {
  static constexpr int kNone = -1;

  int owner = kNone;  // face index in the mesh
  int corners = 0;    // number of corners of the owner, and of valid elements below
  std::array<CameraIndex, 3> camera{};
  std::array<double, 3> weight{};  // weights of these cameras; all other cameras have none
  std::array<double, 3> valid{};   // weight, or 0 if the sample is lost
  double coverage = 0;             // sum of valid weights
  double lost = 0;                 // sum of missing weights
  std::array<double, 3> colour{};  // 0..255 after the division; black without valid weight
  // Distance (relative to the terms of the deciding sums) from another owner, and from another decision on the samples.
  // At margins as small as rounding, double arithmetic may decide differently.
  double owner_margin = 0;
  double sample_margin = 0;
};

struct Picture {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;  // row-major
  const Pixel& at(int x, int y) const { return pixels[static_cast<size_t>(y) * width + x]; }
  // Returns the weight of `camera` in a pixel; 0 if the camera is not a corner of the owner.
  double weight_of(int x, int y, CameraIndex camera) const;
  // Returns the picture rounded to 8 bits, and the coverage per pixel in the format of quality.h.
  Image image() const;
  std::vector<float> coverage() const;
};

// `images`: one kRgb image per camera of the rig; or empty: colours stay black.
Picture render(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images);

// Returns a map's value for a pixel: bilinear between the nodes, which are at the centres of step x step pixels;
// constant beyond the outer nodes.
Real inverse_distance(const FocalMap& map, int x, int y);

struct Sighting {
  bool faces = false;  // (sum of the corners' axes) . d > 0
  bool contains = false;
  std::array<Real, 3> weight{};  // weights of the face's corners; 0 unless the face contains the line
  Real margin = 0;               // see Pixel::owner_margin
};
// The faces seen from one viewpoint; precomputes everything that is independent of the line of sight.
class Sight {
 public:
  Sight(const Rig& rig, const Mesh& mesh, const V3& eye);
  // `d` in world axes, any length > 0.
  Sighting look(size_t face, const V3& d) const;

 private:
  struct Face {
    int corners;
    std::array<V3, 3> edge;     // triangle: opposite each corner; strip: (C_k - E) x extent
    std::array<Real, 3> scale;  // scale of the terms of edge . d, for a unit d
    V3 axes;                    // sum of the corners' forward axes
  };
  std::vector<Face> faces_;
};

// Computes the same weights by another method: barycentric coordinates, by areas, of the intersection with the
// triangle's plane. Returns nullopt if the line is (almost) parallel to the plane or the triangle has (almost) no area.
std::optional<std::array<Real, 3>> weights_at_meeting_point(const Rig& rig, const MeshFace& face, const V3& eye,
                                                            const V3& d);

}  // namespace lf::reference
