// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_path.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/error.h"
#include "base/number_text.h"
#include "view/navigator.h"

namespace lf {

namespace {

using Vec4 = glm::dvec4;

// The Hermite segment between keys i and i + 1 and how far along it we are.
struct Segment {
  const std::vector<NamedView>& keys;
  size_t i;
  double s, length;  // 0..1, seconds

  // value(k) of key k, interpolated.
  template <typename Value>
  auto mix(Value value) const {
    using T = decltype(value(i));
    const size_t n = keys.size();
    const auto velocity = [&](size_t k) -> T {  // per second; one-sided at the ends
      const size_t before = k > 0 ? k - 1 : k, after = k + 1 < n ? k + 1 : k;
      return (value(after) - value(before)) / (keys[after].time - keys[before].time);
    };
    const double s2 = s * s, s3 = s2 * s;
    return value(i) * (2 * s3 - 3 * s2 + 1) + value(i + 1) * (3 * s2 - 2 * s3) +
           velocity(i) * ((s3 - 2 * s2 + s) * length) + velocity(i + 1) * ((s3 - s2) * length);
  }
};

Vec4 as_vec(const Quat& q) { return {q.w, q.x, q.y, q.z}; }
Vec4 as_vec(const Plane& p) { return {p.normal, p.d}; }

// The plane's distance along the optical axis if it faces the view, else 0.
double facing_distance(const View& view) {
  const Vec3 axis = view.pose.forward();
  const double distance =
      -view.focus.plane.signed_distance(view.pose.position) / glm::dot(view.focus.plane.normal, axis);
  const bool faces = glm::length(glm::cross(view.focus.plane.normal, axis)) < 1e-6;
  return faces && distance > 0 ? distance : 0;
}

std::string numbered(size_t i) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%06zu", i);
  return name;
}

void require_range(const FocusRange& focus) {
  if (!(focus.near > 0 && focus.near <= focus.far && std::isfinite(focus.far)))
    throw Error("focus: must be 0 < near <= far, is " + number_text(focus.near) + " and " + number_text(focus.far));
}

}  // namespace

ViewPath::ViewPath(std::vector<NamedView> keys) : keys_(std::move(keys)) {
  if (keys_.empty()) throw Error("views: a path needs at least one view");
  for (size_t i = 0; i < keys_.size(); i++) {
    View& view = keys_[i].view;
    planes_face_ = planes_face_ && facing_distance(view) > 0;
    if (i == 0) continue;
    View& before = keys_[i - 1].view;
    const std::string place = "views[" + std::to_string(i) + "].";
    if (!(keys_[i].time > keys_[i - 1].time)) throw Error(place + "time: must be later than that of the view before");
    if (view.width != before.width || view.height != before.height)
      throw Error(place + "width, height: must be those of the first view");
    if (view.lens.model() != before.lens.model()) throw Error(place + "model: must be that of the first view");
    // q and -q are one orientation, a plane and its negative one plane: take the nearer.
    if (glm::dot(view.pose.orientation, before.pose.orientation) < 0) view.pose.orientation = -view.pose.orientation;
  }
  for (size_t i = 1; i < keys_.size() && !planes_face_; i++) {
    Plane& plane = keys_[i].view.focus.plane;
    if (glm::dot(plane.normal, keys_[i - 1].view.focus.plane.normal) < 0) plane = {-plane.normal, -plane.d};
  }
}

View ViewPath::at(double time) const {
  const auto later = [](double t, const NamedView& key) { return t < key.time; };
  const size_t next = std::upper_bound(keys_.begin(), keys_.end(), time, later) - keys_.begin();
  if (next == 0) return keys_.front().view;
  const NamedView& key = keys_[next - 1];
  if (next == keys_.size() || time == key.time) return key.view;

  const double length = keys_[next].time - key.time;
  const Segment segment{keys_, next - 1, (time - key.time) / length, length};
  View view = key.view;
  view.pose.position = segment.mix([&](size_t k) { return keys_[k].view.pose.position; });
  const Vec4 q = glm::normalize(segment.mix([&](size_t k) { return as_vec(keys_[k].view.pose.orientation); }));
  view.pose.orientation = Quat(q.x, q.y, q.z, q.w);
  std::array<double, Lens::kMaxParams> params{};
  for (int p = 0; p < view.lens.num_params(); p++)
    params[p] = segment.mix([&](size_t k) { return keys_[k].view.lens.params()[p]; });
  view.lens = Lens(view.lens.model(), params);
  if (planes_face_) {
    const double log_distance = segment.mix([&](size_t k) { return std::log(facing_distance(keys_[k].view)); });
    view.focus.plane = focal_plane_at(view.pose, std::exp(log_distance));
  } else {
    const Vec4 plane = segment.mix([&](size_t k) { return as_vec(keys_[k].view.focus.plane); });
    const double norm = glm::length(Vec3(plane));
    view.focus.plane = {Vec3(plane) / norm, plane.w / norm};
  }
  return view;
}

std::vector<NamedView> ViewPath::sample(double rate_hz) const {
  if (!(rate_hz > 0)) throw Error("rate: must be positive");
  const size_t count = static_cast<size_t>(std::floor((end() - begin()) * rate_hz + 1e-3)) + 1;
  std::vector<NamedView> views(count);
  for (size_t i = 0; i < count; i++) {
    views[i].name = numbered(i);
    views[i].time = begin() + static_cast<double>(i) / rate_hz;
    views[i].view = at(views[i].time);
  }
  return views;
}

std::vector<NamedView> make_focus_sweep(const View& view, const FocusRange& range, int planes) {
  require_range(range);
  if (planes < 1) throw Error("planes: must be at least 1");
  std::vector<NamedView> views;
  for (int i = 0; i < planes; i++) {
    const double share = planes > 1 ? static_cast<double>(i) / (planes - 1) : 0;
    NamedView named{numbered(static_cast<size_t>(i)), 0, view};
    const double inverse = (1 - share) / range.near + share / range.far;
    named.view.focus = {focal_plane_at(view.pose, 1 / inverse), nullptr};
    views.push_back(named);
  }
  return views;
}

namespace {

// Of a camera's field of view: what is left shows no border when the eye is between cameras.
constexpr double kFieldOfView = 0.85;

// A key of the tour. x, y: in halves of the array's extent; z: in distances at which the view, from the middle, just
// spans the array; focus: from near (0) to far (1), in the logarithm. |x| + |z| <= 1 keeps all lines of sight inside.
struct Key {
  double x, y, z, focus;
};
constexpr Key kKeys[] = {{0, 0, 0, 0},         {-0.6, -0.4, 0, 0}, {-0.35, 0.35, 0.35, 0.4}, {0.35, 0.35, 0.5, 1},
                         {0.55, -0.3, 0.2, 1}, {0, 0, -0.5, 1},    {-0.3, -0.2, -0.3, 0.4},  {0, 0, 0, 0}};
constexpr int kNumKeys = std::size(kKeys);
constexpr double kFarthest = 0.85;  // of |x| + |z|

}  // namespace

std::vector<NamedView> make_tour(const Rig& rig, const FocusRange& focus, const TourOptions& options) {
  require_range(focus);
  if (options.frames < 1) throw Error("frames: must be at least 1");
  if (!(options.rate_hz > 0)) throw Error("rate: must be positive");

  const Viewpoint home = default_viewpoint(rig);
  const Camera& middle = rig.cameras[middle_camera(rig)];
  const int width = options.width > 0 ? options.width : middle.width;
  const int height = options.height > 0 ? options.height : middle.height;
  // The tangent of half the angle decides what is seen: no wider than the camera in either direction.
  const double half_y = kFieldOfView * std::min(middle.height / 2.0 / middle.lens.fy(),
                                                middle.width / 2.0 / middle.lens.fx() * height / width);
  const double half_x = half_y * width / height;

  double extent_x = 0, extent_y = 0;
  for (const Camera& camera : rig.cameras) {
    const Vec3 from_middle = camera.pose.position - home.pose.position;
    extent_x = std::max(extent_x, std::abs(glm::dot(from_middle, home.pose.right())));
    extent_y = std::max(extent_y, std::abs(glm::dot(from_middle, home.pose.down())));
  }
  // Cameras on a line cover all of the other direction.
  const double tiny = 1e-3 * std::max(extent_x, extent_y);
  double reach = std::numeric_limits<double>::infinity();
  if (extent_x > tiny) reach = std::min(reach, extent_x / half_x);
  if (extent_y > tiny) reach = std::min(reach, extent_y / half_y);
  if (!std::isfinite(reach)) reach = 0;  // a single camera

  if (!(options.room >= 0)) throw Error("room: must not be negative");
  const double aside = extent_x > tiny ? std::min(options.room / 2 / extent_x, 1.0) : 0;
  const double part = std::max(1 - aside / kFarthest, 0.0);  // of the way

  const double seconds = (options.frames - 1) / options.rate_hz;
  std::vector<NamedView> keys;
  for (int i = 0; i < (options.frames > 1 ? kNumKeys : 1); i++) {
    const Key& key = kKeys[i];
    Viewpoint v = home;
    // Never more than half-way to what is in focus, however large the array.
    const double forward = std::min(part * key.z * reach, focus.near / 2);
    v.pose.position += part * key.x * extent_x * home.pose.right() + part * key.y * extent_y * home.pose.down() +
                       forward * home.pose.forward();
    v.fov_y_deg = 2 * std::atan(half_y) * (180 / M_PI);
    v.focus_distance = focus.near * std::pow(focus.far / focus.near, key.focus) - forward;
    keys.push_back({"", seconds * i / (kNumKeys - 1), make_view(clamped(v), width, height)});
  }
  std::vector<NamedView> views = ViewPath(std::move(keys)).sample(options.rate_hz);
  if (options.still)
    for (NamedView& view : views) view.time = 0;
  return views;
}

}  // namespace lf
