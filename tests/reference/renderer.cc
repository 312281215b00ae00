// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/camera_weights.h"

namespace lf::reference {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr Real kFarAway = 1e12L;  // metres: infinity, for points

// Bisects [low, high] to the limit of precision; `beyond(x)` is false below the result and true above.
template <typename Predicate>
Real bisect(Real low, Real high, const Predicate& beyond) {
  for (;;) {
    const Real middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return middle;
    (beyond(middle) ? high : low) = middle;
  }
}

constexpr Real kMaxSlope = 1e6L;  // Lens::kMaxSlope
constexpr Real kFisheyeField = 95 * 3.14159265358979323846L / 180;

Real polynomial(const std::array<Real, 5>& terms, Real x) {
  Real sum = 0, power = 1;
  for (const Real term : terms) {
    sum += term * power;
    power *= x;
  }
  return sum;
}

}  // namespace

ReferenceLens::ReferenceLens(const lf::Lens& lens) {
  const auto& p = lens.params();
  const bool one_focal = lens.model() == LensModel::kSimplePinhole || lens.model() == LensModel::kSimpleRadial ||
                         lens.model() == LensModel::kRadial || lens.model() == LensModel::kSimpleRadialFisheye ||
                         lens.model() == LensModel::kRadialFisheye;
  fx_ = p[0];
  fy_ = p[one_focal ? 0 : 1];
  cx_ = p[one_focal ? 1 : 2];
  cy_ = p[one_focal ? 2 : 3];
  switch (lens.model()) {
    case LensModel::kSimplePinhole:
    case LensModel::kPinhole: break;
    case LensModel::kSimpleRadial:
    case LensModel::kSimpleRadialFisheye: numerator_ = {1, p[3]}; break;
    case LensModel::kRadial:
    case LensModel::kRadialFisheye: numerator_ = {1, p[3], p[4]}; break;
    case LensModel::kOpenCvFisheye: numerator_ = {1, p[4], p[5], p[6], p[7]}; break;
    case LensModel::kOpenCv:
    case LensModel::kFullOpenCv:
      numerator_ = {1, p[4], p[5], p[8]};
      denominator_ = {1, p[9], p[10], p[11]};
      break;
    case LensModel::kThinPrismFisheye:
      numerator_ = {1, p[4], p[5], p[8], p[9]};
      s1_ = p[10];
      s2_ = p[11];
  }
  if (lens.model() == LensModel::kOpenCv || lens.model() == LensModel::kFullOpenCv ||
      lens.model() == LensModel::kThinPrismFisheye) {
    p1_ = p[6];
    p2_ = p[7];
  }
  fisheye_ = lens.model() == LensModel::kOpenCvFisheye || lens.model() == LensModel::kSimpleRadialFisheye ||
             lens.model() == LensModel::kRadialFisheye || lens.model() == LensModel::kThinPrismFisheye;
  longest_ = find_fold();
  if (fisheye_) longest_ = std::min(longest_, kFisheyeField);
}

Real ReferenceLens::grown(Real length) const {
  return length * polynomial(numerator_, length * length) / polynomial(denominator_, length * length);
}

// Looks for the fold in steps of 1 / 2000 and of 2 %.
Real ReferenceLens::find_fold() const {
  constexpr Real kLargest = 1e9L;
  if (numerator_ == std::array<Real, 5>{1} && denominator_ == numerator_) return kInfinity;
  const auto stops = [&](Real r) {
    const Real q = r * r, d = polynomial(denominator_, q);
    Real up = 0, down = 0, power = 1;  // derivatives by q
    for (size_t i = 1; i < numerator_.size(); i++, power *= q) {
      up += static_cast<Real>(i) * numerator_[i] * power;
      down += static_cast<Real>(i) * denominator_[i] * power;
    }
    const Real n = polynomial(numerator_, q);
    return !(d > 0) || !(n * d + 2 * q * (up * d - n * down) > 0);
  };
  for (Real r = 0; r < kLargest;) {
    const Real next = std::max(r + Real{1} / 2000, r * Real{1.02L});
    if (stops(next)) return bisect(r, next, stops);
    r = next;
  }
  return kInfinity;
}

P2 ReferenceLens::bend(const P2& u) const {
  const Real r2 = u.x * u.x + u.y * u.y;
  const Real radial = polynomial(numerator_, r2) / polynomial(denominator_, r2);
  return {u.x * radial + 2 * p1_ * u.x * u.y + p2_ * (r2 + 2 * u.x * u.x) + s1_ * r2,
          u.y * radial + 2 * p2_ * u.x * u.y + p1_ * (r2 + 2 * u.y * u.y) + s2_ * r2};
}

std::optional<P2> ReferenceLens::project(const V3& x) const {
  if (!(inside_field(x) > 0)) return std::nullopt;
  const Real beside = std::hypot(x.x, x.y), angle = std::atan2(beside, x.z);
  const Real scale = !fisheye_ ? 1 / x.z : beside > 0 ? angle / beside : 0;
  const P2 d = bend({x.x * scale, x.y * scale});
  return P2{fx_ * d.x + cx_, fy_ * d.y + cy_};
}

Real ReferenceLens::inside_field(const V3& x) const {
  if (fisheye_) return norm(x) > 0 ? longest_ - std::atan2(std::hypot(x.x, x.y), x.z) : 0;
  const Real depth = x.z / norm(x);
  if (!(depth > 0) || std::isinf(longest_)) return depth;
  return std::min(depth, 1 - std::hypot(x.x, x.y) / x.z / longest_);
}

std::optional<P2> ReferenceLens::line_of_sight(const P2& pixel) const {
  const P2 target{(pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_};
  const bool radial_only = p1_ == 0 && p2_ == 0 && s1_ == 0 && s2_ == 0;
  if (radial_only && !fisheye_ && std::isinf(longest_) && grown(1) == 1) return target;

  const Real length = std::hypot(target.x, target.y);
  Real end = longest_;
  if (std::isinf(end))
    for (end = 1; grown(end) < length;) end *= 2;
  if (radial_only && grown(end) < length) return std::nullopt;
  const Real r = length > 0 ? bisect(0, end, [&](Real x) { return grown(x) >= length; }) : 0;
  P2 u = length > 0 ? P2{target.x * r / length, target.y * r / length} : P2{};

  for (int i = 0; i < 60 && !radial_only; i++) {
    constexpr Real kStep = 1e-6L;
    const P2 at = bend(u);
    const P2 right = bend({u.x + kStep, u.y}), left = bend({u.x - kStep, u.y});
    const P2 down = bend({u.x, u.y + kStep}), up = bend({u.x, u.y - kStep});
    const Real xx = (right.x - left.x) / (2 * kStep), xy = (down.x - up.x) / (2 * kStep);
    const Real yx = (right.y - left.y) / (2 * kStep), yy = (down.y - up.y) / (2 * kStep);
    const Real det = xx * yy - xy * yx;
    const P2 miss{target.x - at.x, target.y - at.y};
    const P2 before = u;
    u.x += (yy * miss.x - xy * miss.y) / det;
    u.y += (xx * miss.y - yx * miss.x) / det;
    if (u.x == before.x && u.y == before.y) break;
  }
  const P2 check = bend(u);
  if (!radial_only && !(std::hypot(check.x - target.x, check.y - target.y) < 1e-15L * (1 + length)))
    return std::nullopt;
  const Real found = std::hypot(u.x, u.y);
  if (found > longest_ || (fisheye_ && found > std::atan(kMaxSlope))) return std::nullopt;
  if (fisheye_ && found > 0) return P2{u.x * std::tan(found) / found, u.y * std::tan(found) / found};
  return u;
}

namespace {

// Returns the n-th smallest, from 0.
Real nth(std::vector<Real> values, size_t n) {
  std::sort(values.begin(), values.end());
  return values[n];
}

Real focal_length(const Lens& lens) { return (Real{lens.fx()} + lens.fy()) / 2; }

}  // namespace

ReferenceBlending::ReferenceBlending(const Rig& rig, const Mesh& mesh, const View& view, int step)
    : rig_(rig), view_(view), step_(step), columns_((view.width + step - 1) / step + 1) {
  for (CameraIndex i = 0; i < rig.cameras.size(); i++) {
    const auto has = [i](const MeshFace& face) { return std::ranges::find(face.camera, i) != face.camera.end(); };
    if (!std::ranges::any_of(mesh.faces, has)) continue;
    const Pose& pose = rig.cameras[i].pose;
    cameras_.push_back(i);
    centre_.push_back(to_v3(pose.position) - to_v3(view.pose.position));
    forward_.push_back(rotate(pose.orientation, {0, 0, 1}));
  }
  for (int y = 0; y < (view.height + step - 1) / step + 1; y++)
    for (int x = 0; x < columns_; x++) nodes_.push_back(at_node(x * step, y * step));
}

std::vector<Real> ReferenceBlending::at(int x, int y) const {
  const size_t first = static_cast<size_t>(y / step_) * columns_ + x / step_;
  const Real right = Real(x % step_) / step_, down = Real(y % step_) / step_;
  std::vector<Real> out(rig_.cameras.size());
  for (size_t i = 0; i < cameras_.size(); i++)
    out[cameras_[i]] = (1 - down) * ((1 - right) * nodes_[first][i] + right * nodes_[first + 1][i]) +
                       down * ((1 - right) * nodes_[first + columns_][i] + right * nodes_[first + columns_ + 1][i]);
  return out;
}

std::vector<Real> ReferenceBlending::at_node(int x, int y) const {
  const ReferenceLens lens(view_.lens);
  const P2 middle{view_.lens.cx(), view_.lens.cy()};
  P2 ray{0, 0};
  for (int i = 32; i > 0; i--) {
    const auto found = lens.line_of_sight({middle.x + (x - middle.x) * i / 32, middle.y + (y - middle.y) * i / 32});
    if (!found) continue;
    ray = *found;
    break;
  }
  const V3 line = rotate(view_.pose.orientation, {ray.x, ray.y, 1}), d = (1 / norm(line)) * line;
  std::vector<Real> weights;
  if (view_.blending.kind == Blending::Kind::kAperture) {
    weights = within_aperture(d);
  } else {
    const FocalMap* const map = view_.focus.map.get();
    const Plane& plane = map ? map->from : view_.focus.plane;
    const V3 normal = to_v3(plane.normal);
    const Real from_plane = dot(normal, to_v3(view_.pose.position)) + plane.d;
    Real t = ((map ? 1 / inverse_distance(*map, x, y) : 0) - from_plane) / dot(normal, line), far = 1;
    for (const V3& c : centre_) far = std::max(far, norm(c));
    if (!(t > 0)) t = kInfinity;
    weights = by_angle(d, std::min(t, 1e6L * far) * line);
  }
  Real sum = 0;
  for (const Real w : weights) sum += w;
  for (Real& w : weights) w /= sum;
  return weights;
}

std::vector<Real> ReferenceBlending::within_aperture(const V3& d) const {
  const bool any_faces = std::ranges::any_of(forward_, [&](const V3& f) { return dot(f, d) > 0; });
  std::vector<Real> squared, all;
  for (size_t i = 0; i < cameras_.size(); i++) {
    const Real facing = any_faces ? std::min<Real>(dot(forward_[i], d) / 0.25L, 1) : 1;
    const V3 beside = centre_[i] - dot(centre_[i], d) * d;
    squared.push_back(facing > 0 ? dot(beside, beside) / (facing * facing) : kInfinity);
    if (facing > 0) all.push_back(squared.back());
  }
  const Real least = nth(all, 0), radius = Real{view_.blending.aperture} / 2;
  Real reach = std::max(radius * radius, 1.25L * (nth(all, std::min<size_t>(4, all.size()) - 1) - least));
  if (all.size() > WeightGrid::kMaxShares) reach = std::min(reach, nth(all, WeightGrid::kMaxShares) - least);
  for (Real& s : squared) {
    const Real part = s <= least ? 0 : (s - least) / reach;
    s = part < 1 ? (1 - part) * (1 - part) : 0;
  }
  return squared;
}

std::vector<Real> ReferenceBlending::by_angle(const V3& d, const V3& in_focus) const {
  const size_t k = static_cast<size_t>(view_.blending.nearest);
  std::vector<Real> angle, penalty;
  for (const V3& c : centre_) {
    const V3 to_camera = c - in_focus, to_eye = Real{-1} * d;
    const Real cosine = dot(to_camera, to_eye) / norm(to_camera), sine = norm(cross(c, d)) / norm(to_camera);
    angle.push_back(sine / (1 + cosine));
  }
  Real unit = nth(angle, std::min(k, angle.size()) - 1);
  if (unit == 0) unit = 1;
  for (size_t i = 0; i < cameras_.size(); i++) {
    const Camera& camera = rig_.cameras[cameras_[i]];
    const V3 from_camera = in_focus - centre_[i];
    const auto at = ReferenceLens(camera.lens).project(rotate(camera.pose.orientation, from_camera, true));
    Real inside = Real{1} / 1024;
    if (at) {
      const Real to_border = std::min(std::min(at->x + 0.5L, camera.width - 0.5L - at->x),
                                      std::min(at->y + 0.5L, camera.height - 0.5L - at->y));
      inside = std::clamp<Real>(to_border / (Real{0.05} * std::min(camera.width, camera.height)), Real{1} / 1024, 1);
    }
    const Real size = norm(from_camera) / focal_length(camera.lens) / (norm(in_focus) / focal_length(view_.lens));
    penalty.push_back((angle[i] + unit * std::max<Real>(size - 1, 0) / 10) / inside);
  }
  const Real best = nth(penalty, 0);
  const Real bound = penalty.size() > k ? best + (1 + Real{1} / 16) * (nth(penalty, k) - best) : kInfinity;
  for (Real& p : penalty) {
    const Real part = p <= best ? 0 : (p - best) / (bound - best);
    p = part < 1 && p < kInfinity ? (1 - part) / std::max(p, 1e-12L * unit) : 0;
  }
  return penalty;
}

namespace {

V3 centre(const Rig& rig, CameraIndex camera) { return to_v3(rig.cameras[camera].pose.position); }
V3 axis(const Rig& rig, CameraIndex camera) { return rotate(rig.cameras[camera].pose.orientation, V3{0, 0, 1}); }

// The scale of rounding errors of d . (a x b) in good double arithmetic, a x b = a x (b - a), with a lower limit for
// 80-bit arithmetic: 2^-11 is its gain in precision.
Real edge_scale(const V3& a, const V3& b) {
  return std::max(std::min(norm(a), norm(b)) * norm(b - a), std::ldexp(norm(a) * norm(b), -11));
}

// Returns how far the decision "all of `e` have one sign" is from changing; a `scale` of 0 means exactly zero.
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

// Bilinear; coordinates are clamped to the outer pixel centres.
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

struct Viewpoint {
  const Camera* camera;
  ReferenceLens lens;

  // Returns the position of X in the image; nullopt if the sample is lost. `margin`: distance from the opposite
  // decision.
  std::optional<P2> find(const V3& x_world, Real& margin) const {
    const V3 x = rotate(camera->pose.orientation, x_world - to_v3(camera->pose.position), true);
    const Real fold = std::abs(lens.inside_field(x));
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
  // Distance of the viewpoint from the focal plane; with a map, from the reference plane of its distances.
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
        // Every line of sight along the normal has an owner; a surface behind the viewpoint loses its samples.
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
