// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "image/image.h"
#include "reference/reference_lens.h"
#include "reference/small_vec.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf::reference {

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
