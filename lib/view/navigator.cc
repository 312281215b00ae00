// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/navigator.h"

#include <algorithm>
#include <cctype>
#include <string>

namespace lf {
namespace {

constexpr double kFocusStep = 0.1;      // relative to the focus distance, per wheel notch
constexpr double kFlyStep = 0.01;       // relative to the focus distance, per key press
constexpr double kKeyOrbit = 1.0 / 20;  // view heights per key press
constexpr double kZoomStep = 1.05;
constexpr double kLevel = 0.01;  // sine of the smallest angle to the vertical with a horizon
constexpr int kHalvings = 6;     // bisection steps of a limited movement

Vec3 centre_of(const Rig& rig) {
  Vec3 sum(0);
  for (const Camera& camera : rig.cameras) sum += camera.pose.position;
  return sum / static_cast<double>(rig.cameras.size());
}

// Averages axes instead of quaternions, which have an ambiguous sign. If the axes cancel out, as in a ring of cameras
// that look in all directions, the middle camera is used.
Quat mean_orientation(const Rig& rig) {
  Vec3 forward(0), down(0);
  for (const Camera& camera : rig.cameras) {
    forward += camera.pose.forward();
    down += camera.pose.down();
  }
  const double tiny = 1e-3 * static_cast<double>(rig.cameras.size());
  if (glm::length(forward) < tiny || glm::length(glm::cross(down, glm::normalize(forward))) < tiny)
    return glm::normalize(rig.cameras[middle_camera(rig)].pose.orientation);
  return look_at(Vec3(0), forward, down).orientation;
}

// Returns the largest share in 0..1 with fits(share), or 0.
template <typename Fits>
double largest_share(Fits fits) {
  if (fits(1)) return 1;
  double inside = 0, outside = 1;
  for (int i = 0; i < kHalvings; i++) {
    const double middle = (inside + outside) / 2;
    (fits(middle) ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace

Viewpoint clamped(const Viewpoint& viewpoint) {
  Viewpoint v = viewpoint;
  v.pose.position = glm::clamp(v.pose.position, Vec3(-kMaxPosition), Vec3(kMaxPosition));
  v.pose.orientation = glm::normalize(v.pose.orientation);
  v.fov_y_deg = std::clamp(v.fov_y_deg, kMinFovDeg, kMaxFovDeg);
  v.focus_distance = std::clamp(v.focus_distance, kMinFocus, kMaxFocus);
  v.aperture = std::clamp(v.aperture, 0.0, Blending::kMaxAperture);
  return v;
}

bool is_finite(const Viewpoint& v) {
  return is_finite(v.pose.position) && is_finite(v.pose.orientation) && is_finite(v.fov_y_deg) &&
         is_finite(v.focus_distance) && is_finite(v.aperture);
}

View make_view(const Viewpoint& v, int width, int height) {
  return {width,
          height,
          Lens::from_fov_y(v.fov_y_deg, width, height),
          v.pose,
          {focal_plane_at(v.pose, v.focus_distance)},
          make_blending(v.aperture, 0)};
}

CameraIndex middle_camera(const Rig& rig) {
  const Vec3 centre = centre_of(rig);
  const auto nearer = [&](const Camera& a, const Camera& b) {
    return glm::length(a.pose.position - centre) < glm::length(b.pose.position - centre);
  };
  return static_cast<CameraIndex>(std::min_element(rig.cameras.begin(), rig.cameras.end(), nearer) -
                                  rig.cameras.begin());
}

Viewpoint default_viewpoint(const Rig& rig, double focus_distance) {
  const Vec3 centre = centre_of(rig);
  const Camera& middle = rig.cameras[middle_camera(rig)];
  Viewpoint v;
  v.pose = {centre, mean_orientation(rig)};
  v.fov_y_deg = 2 * std::atan(middle.height / 2.0 / middle.lens.fy()) * (180 / M_PI);
  v.focus_distance = focus_distance > 0 ? focus_distance : rig.focus_distance;
  if (v.focus_distance <= 0) {
    double radius = 0;
    for (const Camera& camera : rig.cameras) radius = std::max(radius, glm::length(camera.pose.position - centre));
    v.focus_distance = radius > 0 ? kFocusPerExtent * 2 * radius : 1;
  }
  return clamped(v);
}

Viewpoint viewpoint_behind(const Rig& rig, double aspect, double focus_distance) {
  constexpr double kBorder = 0.8;  // part of half the view's width and height that contains all cameras
  Viewpoint v = default_viewpoint(rig, focus_distance);
  const double half_y = kBorder * std::tan(v.fov_y_deg * (M_PI / 360)), half_x = half_y * aspect;
  double back = 0;
  for (const Camera& camera : rig.cameras) {
    const Vec3 at = v.pose.camera_from_world(camera.pose.position);
    if (glm::dot(camera.pose.forward(), v.pose.forward()) <= 0) continue;
    back = std::max(back, std::max(std::abs(at.x) / half_x, std::abs(at.y) / half_y) - at.z);
  }
  v.pose.position -= back * v.pose.forward();
  v.focus_distance += back;
  return clamped(v);
}

// Returns the orientation turned to look along `forward`, with the same horizon. Unchanged if there is no horizon.
Quat Navigator::turned_to(const Quat& orientation, const Vec3& forward) const {
  const Vec3 before = glm::mat3_cast(orientation)[2], down = home_.pose.down();
  if (glm::length(glm::cross(before, down)) < kLevel || glm::length(glm::cross(forward, down)) < kLevel)
    return orientation;
  const auto level = [&down](const Vec3& axis) { return look_at(Vec3(0), axis, down).orientation; };
  return glm::normalize(level(forward) * glm::conjugate(level(before)) * orientation);
}

Viewpoint Navigator::turned_towards_home(const Viewpoint& viewpoint, double share) const {
  Viewpoint v = viewpoint;
  v.pose.orientation = glm::normalize(glm::slerp(v.pose.orientation, home_.pose.orientation, share));
  return v;
}

// Rotates the view about its pivot by a share of the rotation that would bring its optical axis onto home's position.
// The horizon stays level.
Viewpoint Navigator::moved_towards_home(const Viewpoint& viewpoint, double share) const {
  Viewpoint v = viewpoint;
  const Vec3 centre = pivot_point(v), forward = v.pose.forward();
  Vec3 axis = centre - home_.pose.position;
  if (glm::dot(axis, forward) < 0) axis = -axis;
  if (glm::length(axis) < kMinFocus) return v;
  v.pose.orientation = turned_to(v.pose.orientation, glm::normalize(glm::mix(forward, glm::normalize(axis), share)));
  v.pose.position = centre - v.focus_distance * v.pose.forward();
  return v;
}

// `move(share)` must return the viewpoint after a share of the movement.
template <typename Move>
void Navigator::go(Move move) {
  const Viewpoint target = clamped(move(1));
  if (!visible_) return set(target);
  if (!min_visible_) min_visible_ = kMinVisible * visible_(home_);
  const double seen = visible_(target);
  if (seen >= *min_visible_) return set(target);
  const double least = std::min(*min_visible_, visible_(now_));
  if (seen >= least) return set(target);
  const auto shows = [&](const Viewpoint& v) { return visible_(clamped(v)) >= least; };
  if (shows(turned_towards_home(target, 1)))
    return set(turned_towards_home(
        target, 1 - largest_share([&](double kept) { return shows(turned_towards_home(target, 1 - kept)); })));
  const double far = largest_share([&](double share) { return shows(moved_towards_home(move(share), 1)); });
  const Viewpoint there = move(far);
  const double kept = largest_share([&](double share) { return shows(moved_towards_home(there, 1 - share)); });
  if (far > 0) set(moved_towards_home(there, 1 - kept));
}

void Navigator::orbit(double dx, double dy) {
  const Vec3 centre = pivot();
  go([&](double share) {
    Viewpoint v = now_;
    // The camera moves against the mouse: when the mouse goes right, the eye goes left (about "down", forward turns
    // right).
    const Quat about_vertical = glm::angleAxis(share * dx * kOrbitPerHeight, home_.pose.down());
    const Quat about_right = glm::angleAxis(-share * dy * kOrbitPerHeight, now_.pose.right());
    v.pose.orientation = glm::normalize(about_vertical * about_right * now_.pose.orientation);
    v.pose.position = centre - v.focus_distance * v.pose.forward();
    return v;
  });
}

void Navigator::pan(double dx, double dy) {
  const double scale = 2 * now_.focus_distance * std::tan(now_.fov_y_deg * (M_PI / 180) / 2);
  go([&](double share) {
    Viewpoint v = now_;
    v.pose.position -= share * scale * (dx * v.pose.right() + dy * v.pose.down());
    return v;
  });
}

void Navigator::focus(double steps) {
  Viewpoint v = now_;
  v.focus_distance *= std::pow(1 + kFocusStep, steps);
  set(v);
}

void Navigator::zoom(double steps, const Vec2& place) {
  const auto towards = [&place](double fov_y_deg) {
    return glm::normalize(Vec3(2 * std::tan(fov_y_deg * (M_PI / 360)) * place, 1));
  };
  go([&](double share) {
    Viewpoint v = now_;
    v.fov_y_deg = std::clamp(v.fov_y_deg * std::pow(kZoomStep, -share * steps), kMinFovDeg, kMaxFovDeg);
    const Vec3 before = towards(now_.fov_y_deg), after = towards(v.fov_y_deg);
    const Quat turn = glm::normalize(Quat(1 + glm::dot(after, before), glm::cross(after, before)));
    v.pose.orientation = turned_to(now_.pose.orientation, now_.pose.rotation() * (turn * Vec3(0, 0, 1)));
    return v;
  });
}

void Navigator::fly(const Vec3& steps_camera) {
  go([&](double share) {
    Viewpoint v = now_;
    v.pose.position += v.pose.rotation() * (share * kFlyStep * v.focus_distance * steps_camera);
    return v;
  });
}

bool Navigator::key(std::string_view name) {
  std::string k(name);
  if (k.size() == 1) k[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(k[0])));
  if (k == "Left") {
    orbit(-kKeyOrbit, 0);
  } else if (k == "Right") {
    orbit(kKeyOrbit, 0);
  } else if (k == "Up") {
    orbit(0, -kKeyOrbit);
  } else if (k == "Down") {
    orbit(0, kKeyOrbit);
  } else if (k == "w") {
    fly({0, 0, 1});
  } else if (k == "s") {
    fly({0, 0, -1});
  } else if (k == "a") {
    fly({-1, 0, 0});
  } else if (k == "d") {
    fly({1, 0, 0});
  } else if (k == "q") {
    fly({0, 1, 0});
  } else if (k == "e") {
    fly({0, -1, 0});
  } else if (k == "plus" || k == "equal" || k == "KP_Add" || k == "+" || k == "=") {
    zoom(1);
  } else if (k == "minus" || k == "KP_Subtract" || k == "-") {
    zoom(-1);
  } else if (k == "bracketleft" || k == "[") {
    focus(-1);
  } else if (k == "bracketright" || k == "]") {
    focus(1);
  } else if (k == "r") {
    reset();
  } else {
    return false;
  }
  return true;
}

}  // namespace lf
