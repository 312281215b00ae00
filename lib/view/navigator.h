// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <optional>
#include <string_view>
#include <utility>

#include "geometry/pose.h"
#include "rig/rig.h"
#include "view/view.h"

namespace lf {

// Viewpoint of a user: a pinhole camera with a focal plane facing the view.
struct Viewpoint {
  Pose pose;                  // world_from_view
  double fov_y_deg = 45;      // vertical, kMinFovDeg..kMaxFovDeg
  double focus_distance = 2;  // metres along the optical axis, kMinFocus..kMaxFocus
  double aperture = 0;        // metres, 0..Blending::kMaxAperture; 0: mesh blending
  bool operator==(const Viewpoint&) const = default;
};

inline constexpr double kMinFovDeg = 1, kMaxFovDeg = 170;
inline constexpr double kMinFocus = 1e-6, kMaxFocus = 1e9;
inline constexpr double kMaxPosition = 1e9;  // metres, of each coordinate

// Returns the viewpoint clamped to its limits, with a unit quaternion. Requires finite numbers and a quaternion != 0.
Viewpoint clamped(const Viewpoint& viewpoint);
bool is_finite(const Viewpoint& viewpoint);
inline Vec3 pivot_point(const Viewpoint& v) { return v.pose.position + v.focus_distance * v.pose.forward(); }
View make_view(const Viewpoint& viewpoint, int width, int height);

// Initial viewpoint for an array: mean position and mean axis of the cameras, with the vertical field of view of the
// middle camera. The focus distance is `focus_distance`, or if 0, kFocusPerExtent times the diameter of the array (1 m
// if the array has no extent). Requires at least one camera.
inline constexpr double kFocusPerExtent = 4;
Viewpoint default_viewpoint(const Rig& rig, double focus_distance = 0);
// Radians of orbit per view height. From default_viewpoint(), a drag over the height of the view moves the eye by the
// diameter of the array.
inline constexpr double kOrbitPerHeight = 1 / kFocusPerExtent;

// Like default_viewpoint(), but from behind the array: all cameras that look forward are inside of the view, with a
// border of a tenth of its height and width. The focal plane stays at `focus_distance` from the array. `aspect`: width
// over height.
Viewpoint viewpoint_behind(const Rig& rig, double aspect, double focus_distance = 0);
// Returns the camera nearest to the mean position; the lowest index if there are several.
CameraIndex middle_camera(const Rig& rig);

// Converts mouse and key movements to viewpoints. Mouse distances are in view heights, x right and y down, so that they
// are independent of the size. The *pivot* is the point in focus on the optical axis. Not thread-safe.
class Navigator {
 public:
  explicit Navigator(const Viewpoint& home = {}) { set_home(home); }

  const Viewpoint& viewpoint() const { return now_; }
  const Viewpoint& home() const { return home_; }
  Vec3 pivot() const { return pivot_point(now_); }

  // Visible part of the scene from a viewpoint, 0..1. If set, no movement reduces the visible part below kMinVisible
  // times the visible part from home (or the current value, if less). The view turns towards home's direction while the
  // eye moves. If that is not enough, the eye rotates about the pivot towards the line through home's position. If that
  // is not enough either, the movement stops.
  using Visible = std::function<double(const Viewpoint&)>;
  static constexpr double kMinVisible = 0.95;
  void set_visibility(Visible visible) {
    visible_ = std::move(visible);
    min_visible_.reset();
  }

  void set(const Viewpoint& viewpoint) { now_ = clamped(viewpoint); }
  void set_home(const Viewpoint& viewpoint) {
    now_ = home_ = clamped(viewpoint);
    min_visible_.reset();
  }
  void reset() { now_ = home_; }

  // Orbits the pivot, kOrbitPerHeight radians per view height: dx about home's vertical, which keeps the horizon, dy
  // about the view's right axis. The scene follows the mouse.
  void orbit(double dx, double dy);
  // Moves the eye sideways, so that points in focus follow the mouse.
  void pan(double dx, double dy);
  // Moves the focal plane away by a tenth of its distance per step; negative: closer.
  void focus(double steps);
  // Narrows the field of view by 5 % per step; negative: widens. The scene at `place`, relative to the middle of the
  // view, stays there.
  void zoom(double steps, const Vec2& place = {0, 0});
  // Moves the eye along the view's axes, in hundredths of the focus distance. Keeps the focus distance.
  void fly(const Vec3& steps_camera);

  // Handles a key, named by its X keysym; letters in either case. Arrows orbit, w/s fly forward and back, a/d left and
  // right, q/e down and up, plus/minus zoom, bracketleft/bracketright focus nearer and farther, r goes home. Returns
  // false for other keys.
  bool key(std::string_view name);

 private:
  template <typename Move>
  void go(Move move);
  Viewpoint turned_towards_home(const Viewpoint& viewpoint, double share) const;
  Viewpoint moved_towards_home(const Viewpoint& viewpoint, double share) const;
  Quat turned_to(const Quat& orientation, const Vec3& forward) const;

  Viewpoint home_, now_;
  Visible visible_;
  std::optional<double> min_visible_;  // minimum visible part; computed at the first movement
};

}  // namespace lf
