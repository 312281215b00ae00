// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/blending.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "reference/reference_lens.h"
#include "reference/renderer.h"
#include "render/camera_weights.h"

namespace lf::reference {
namespace {

constexpr Real kNever = std::numeric_limits<Real>::infinity();

// The n-th smallest, from 0.
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
    if (!(t > 0)) t = kNever;
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
    squared.push_back(facing > 0 ? dot(beside, beside) / (facing * facing) : kNever);
    if (facing > 0) all.push_back(squared.back());
  }
  const Real least = nth(all, 0), radius = Real{view_.blending.aperture} / 2;
  Real reach = std::max(radius * radius, 1.25L * (nth(all, std::min<size_t>(4, all.size()) - 1) - least));
  if (all.size() > BlendGrid::kMaxShares) reach = std::min(reach, nth(all, BlendGrid::kMaxShares) - least);
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
  const Real bound = penalty.size() > k ? best + (1 + Real{1} / 16) * (nth(penalty, k) - best) : kNever;
  for (Real& p : penalty) {
    const Real part = p <= best ? 0 : (p - best) / (bound - best);
    p = part < 1 && p < kNever ? (1 - part) / std::max(p, 1e-12L * unit) : 0;
  }
  return penalty;
}

}  // namespace lf::reference
