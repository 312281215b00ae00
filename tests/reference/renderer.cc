// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/renderer.h"

#include <algorithm>
#include <limits>

namespace lf::reference {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

V3 centre(const Rig& rig, CameraIndex camera) { return to_v3(rig.cameras[camera].pose.position); }
V3 axis(const Rig& rig, CameraIndex camera) { return rotate(rig.cameras[camera].pose.orientation, V3{0, 0, 1}); }

// What rounding errors of d . (a x b) are proportional to in good double arithmetic, a x b = a x (b - a), and at least
// in this one: 2^-11 is how much finer an 80-bit real is.
Real edge_scale(const V3& a, const V3& b) {
  return std::max(std::min(norm(a), norm(b)) * norm(b - a), std::ldexp(norm(a) * norm(b), -11));
}

// How far from a change of mind a verdict "all of `e` have one sign" is; `scale` 0 means exactly zero.
Real sign_margin(const std::array<Real, 3>& e, const std::array<Real, 3>& scale, int n, bool contains) {
  Real inside = kInfinity, most_positive = 0, most_negative = 0;
  for (int k = 0; k < n; k++) {
    if (scale[k] == 0) continue;
    const Real relative = e[k] / scale[k];
    inside = std::min(inside, std::abs(relative));
    most_positive = std::max(most_positive, relative);
    most_negative = std::max(most_negative, -relative);
  }
  return contains ? inside : std::min(most_positive, most_negative);
}

// Bilinear; coordinates clamped to the outer pixel centres.
std::array<Real, 3> sample(const Image& image, const P2& at) {
  const auto split = [](Real x, int size, int& low, int& high) {
    x = std::clamp<Real>(x, 0, size - 1);
    low = std::min(static_cast<int>(std::floor(x)), size - 1);
    high = std::min(low + 1, size - 1);
    return x - low;
  };
  int x0, x1, y0, y1;
  const Real fx = split(at.x, image.width(), x0, x1), fy = split(at.y, image.height(), y0, y1);
  std::array<Real, 3> colour;
  for (int c = 0; c < 3; c++)
    colour[c] = (1 - fy) * ((1 - fx) * image.pixel(x0, y0)[c] + fx * image.pixel(x1, y0)[c]) +
                fy * ((1 - fx) * image.pixel(x0, y1)[c] + fx * image.pixel(x1, y1)[c]);
  return colour;
}

// A camera with what its samples need.
struct Viewpoint {
  const Camera* camera;
  ReferenceLens lens;

  // Where X falls in the image; nothing if it is lost. `margin`: distance from the other verdict.
  std::optional<P2> find(const V3& x_world, Real& margin) const {
    const V3 x = rotate(camera->pose.orientation, x_world - to_v3(camera->pose.position), true);
    const Real behind = x.z / norm(x);
    if (!(behind > 0)) {
      margin = std::abs(behind);
      return std::nullopt;
    }
    const Real r = std::hypot(x.x, x.y) / x.z;
    const Real fold = std::isinf(lens.fold_radius()) ? behind : std::min(behind, std::abs(1 - r / lens.fold_radius()));
    const std::optional<P2> pixel = lens.project(x);
    if (!pixel) {
      margin = fold;
      return std::nullopt;
    }
    const Real w = camera->width, h = camera->height;
    const Real inside = std::min({pixel->x + 0.5L, w - 0.5L - pixel->x, pixel->y + 0.5L, h - 0.5L - pixel->y});
    margin = std::min(fold, std::abs(inside) / std::max(w, h));
    if (inside < 0) return std::nullopt;
    return pixel;
  }
};

}  // namespace

Sight::Sight(const Rig& rig, const Mesh& mesh, const V3& eye) {
  for (const MeshFace& mesh_face : mesh.faces) {
    Face face{mesh_face.corners(), {}, {}, {}};
    for (int k = 0; k < face.corners; k++) face.axes = face.axes + axis(rig, mesh_face.camera[k]);
    if (face.corners == 3) {
      for (int k = 0; k < 3; k++) {
        const CameraIndex from = mesh_face.camera[(k + 1) % 3], to = mesh_face.camera[(k + 2) % 3];
        const V3 a = centre(rig, std::min(from, to)) - eye, b = centre(rig, std::max(from, to)) - eye;
        face.edge[k] = (from < to ? Real{1} : Real{-1}) * cross(a, b);
        face.scale[k] = edge_scale(a, b);
      }
    } else if (face.corners == 2) {
      for (int k = 0; k < 2; k++) {
        const V3 a = centre(rig, mesh_face.camera[k]) - eye;
        face.edge[k] = cross(a, to_v3(mesh_face.extent));
        face.scale[k] = norm(a);
      }
    }
    faces_.push_back(face);
  }
}

Sighting Sight::look(size_t index, const V3& d) const {
  const Face& face = faces_[index];
  const Real length = norm(d);
  Sighting seen;
  const Real towards = dot(face.axes, d);
  seen.faces = towards > 0;
  std::array<Real, 3> e{}, scale{};
  for (int k = 0; k < face.corners; k++) {
    e[k] = dot(face.edge[k], d);
    scale[k] = face.scale[k] * length;
  }
  Real sign = kInfinity;
  if (face.corners == 3) {
    const Real sum = e[0] + e[1] + e[2];
    if (sum != 0) seen.weight = {e[0] / sum, e[1] / sum, e[2] / sum};
    seen.contains = sum != 0 && seen.weight[0] >= 0 && seen.weight[1] >= 0 && seen.weight[2] >= 0;
    sign = sign_margin(e, scale, 3, seen.contains);
  } else if (face.corners == 2) {
    const Real difference = e[0] - e[1];
    if (difference != 0) seen.weight = {1 - e[0] / difference, e[0] / difference, 0};
    seen.contains = difference != 0 && seen.weight[0] >= 0 && seen.weight[1] >= 0;
    sign = sign_margin({e[0], -e[1], 0}, scale, 2, seen.contains);
  } else {
    seen.weight = {1, 0, 0};
    seen.contains = true;
  }
  if (!seen.contains) seen.weight = {};
  const Real facing = std::abs(towards) / length;
  if (seen.faces && seen.contains) {
    seen.margin = std::min(facing, sign);
  } else {
    seen.margin = std::max(seen.faces ? 0 : facing, seen.contains ? 0 : sign);
  }
  return seen;
}

namespace {

constexpr Real kFarAway = 1e12L;  // metres: infinity, for points

}  // namespace

Real inverse_distance(const FocalMap& map, int x, int y) {
  const auto at = [&](int i, int j) {
    i = std::clamp(i, 0, map.columns - 1);
    j = std::clamp(j, 0, map.rows - 1);
    return map.farthest + (map.nearest - map.farthest) * static_cast<Real>(map.levels[j * map.columns + i]) / 255;
  };
  const Real column = (x + Real{0.5}) / map.step - Real{0.5}, row = (y + Real{0.5}) / map.step - Real{0.5};
  const int i = static_cast<int>(std::floor(column)), j = static_cast<int>(std::floor(row));
  const Real a = column - i, b = row - j;
  return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) + b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
}

Picture render(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images) {
  const V3 eye = to_v3(view.pose.position);
  const ReferenceLens view_lens(view.lens);
  const Sight sight(rig, mesh, eye);
  std::vector<Viewpoint> viewpoints;
  for (const Camera& camera : rig.cameras) viewpoints.push_back({&camera, ReferenceLens(camera.lens)});
  const Plane& plane = view.focus.map ? view.focus.map->from : view.focus.plane;
  const V3 normal = to_v3(plane.normal);
  // Of the eye from the focal plane; with a map, from the plane that its distances count from.
  const Real from_plane = dot(normal, eye) + plane.d;

  Picture picture{view.width, view.height, std::vector<Pixel>(static_cast<size_t>(view.width) * view.height)};
  for (int y = 0; y < view.height; y++) {
    for (int x = 0; x < view.width; x++) {
      Pixel& pixel = picture.pixels[static_cast<size_t>(y) * view.width + x];
      const std::optional<P2> ray = view_lens.line_of_sight({static_cast<Real>(x), static_cast<Real>(y)});
      if (!ray) {
        pixel.owner_margin = pixel.sample_margin = 1;
        continue;
      }
      const V3 d = rotate(view.pose.orientation, V3{ray->x, ray->y, 1});
      const Real approach = dot(normal, d);
      Real distance = from_plane, t = -distance / approach;
      bool in_front = t > 0;
      if (view.focus.map) {
        // Whatever looks along the normal has an owner; a surface behind the eye loses its samples.
        const Real inverse = inverse_distance(*view.focus.map, x, y);
        distance = -1;
        t = inverse > 0 ? (1 / inverse - from_plane) / approach : kFarAway;
        in_front = approach > 0;
      }
      Real margin = distance == 0 ? Real{1} : std::abs(approach) / norm(d);
      Sighting seen;
      for (size_t face = 0; face < mesh.faces.size() && distance != 0 && approach != 0 && in_front; face++) {
        seen = sight.look(face, d);
        margin = std::min(margin, seen.margin);
        if (seen.faces && seen.contains) {
          pixel.owner = static_cast<int>(face);
          break;
        }
      }
      pixel.owner_margin = static_cast<double>(margin);
      pixel.sample_margin = 1;
      if (pixel.owner == Pixel::kNone) continue;

      const MeshFace& owner = mesh.faces[pixel.owner];
      const V3 x_focus = eye + t * d;
      std::array<Real, 3> sum{};
      Real lost = 0, coverage = 0;
      pixel.corners = owner.corners();
      for (int k = 0; k < pixel.corners; k++) {
        pixel.camera[k] = owner.camera[k];
        pixel.weight[k] = static_cast<double>(seen.weight[k]);
        Real sample_margin = 1;
        std::optional<P2> at = viewpoints[owner.camera[k]].find(x_focus, sample_margin);
        if (view.focus.map) {
          const Real before_eye = 1 - inverse_distance(*view.focus.map, x, y) * from_plane;
          sample_margin = std::min(sample_margin, std::abs(before_eye));
          if (before_eye <= 0) at.reset();
        }
        if (seen.weight[k] > 0) pixel.sample_margin = std::min(pixel.sample_margin, static_cast<double>(sample_margin));
        if (!at) {
          lost += seen.weight[k];
          continue;
        }
        pixel.valid[k] = pixel.weight[k];
        coverage += seen.weight[k];
        if (images.empty()) continue;
        const Image& image = images[owner.camera[k]];
        const std::array<Real, 3> colour = sample(image, *at);
        for (int c = 0; c < 3; c++) sum[c] += seen.weight[k] * colour[c];
      }
      pixel.lost = static_cast<double>(lost);
      pixel.coverage = static_cast<double>(coverage);
      if (coverage > 0)
        for (int c = 0; c < 3; c++) pixel.colour[c] = static_cast<double>(sum[c] / (1 - lost));
    }
  }
  return picture;
}

double Picture::weight_of(int x, int y, CameraIndex camera) const {
  const Pixel& pixel = at(x, y);
  for (int k = 0; k < pixel.corners; k++)
    if (pixel.camera[k] == camera) return pixel.weight[k];
  return 0;
}

Image Picture::image() const {
  Image out(PixelFamily::kRgb, width, height);
  for (size_t i = 0; i < pixels.size(); i++)
    for (int c = 0; c < 3; c++)
      out.data()[i * 3 + c] = static_cast<uint8_t>(std::clamp(std::lround(pixels[i].colour[c]), 0L, 255L));
  return out;
}

std::vector<float> Picture::coverage() const {
  std::vector<float> out;
  for (const Pixel& pixel : pixels) out.push_back(static_cast<float>(pixel.coverage));
  return out;
}

std::optional<std::array<Real, 3>> weights_at_meeting_point(const Rig& rig, const MeshFace& face, const V3& eye,
                                                            const V3& d) {
  const V3 a = centre(rig, face.camera[0]), b = centre(rig, face.camera[1]), c = centre(rig, face.camera[2]);
  const V3 n = cross(b - a, c - a);
  const Real area = norm(n), longest = std::max({norm(b - a), norm(c - a), norm(c - b)});
  if (!(area > 1e-3L * longest * longest) || !(std::abs(dot(n, d)) > 1e-3L * area * norm(d))) return std::nullopt;
  const V3 p = eye + (dot(n, a - eye) / dot(n, d)) * d;
  const auto part = [&](const V3& from, const V3& to) { return dot(n, cross(from - p, to - p)) / (area * area); };
  return std::array<Real, 3>{part(b, c), part(c, a), part(a, b)};
}

}  // namespace lf::reference
