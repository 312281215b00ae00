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

// The viewpoint of a user: a pinhole camera, and a focal plane perpendicular to its optical axis.
struct Viewpoint {
  Pose pose;                  // world_from_view
  double fov_y_deg = 45;      // vertical, kMinFovDeg to kMaxFovDeg
  double focus_distance = 2;  // metres along the optical axis, kMinFocus to kMaxFocus
  double aperture = 0;        // metres, 0 to Blending::kMaxAperture; 0 selects mesh blending
  bool operator==(const Viewpoint&) const = default;
};

inline constexpr double kMinFovDeg = 1, kMaxFovDeg = 170;
inline constexpr double kMinFocus = 1e-6, kMaxFocus = 1e9;
inline constexpr double kMaxPosition = 1e9;  // metres, limit of each coordinate

// Returns the viewpoint clamped to its limits, with a unit quaternion. All numbers must be finite, and the quaternion
// must not be 0.
Viewpoint clamped(const Viewpoint& viewpoint);
bool is_finite(const Viewpoint& viewpoint);
inline Vec3 pivot_point(const Viewpoint& v) { return v.pose.position + v.focus_distance * v.pose.forward(); }
View make_view(const Viewpoint& viewpoint, int width, int height);

// Returns a viewpoint to start with. It is at the mean position of the cameras, looks along their mean axis, and has
// the vertical field of view of the middle camera. If `focus_distance` is 0, the focus distance is that of the rig or,
// if it is unknown, kFocusPerExtent times the diameter of the array (1 m if the diameter is 0). The rig must have at
// least one camera.
inline constexpr double kFocusPerExtent = 4;
Viewpoint default_viewpoint(const Rig& rig, double focus_distance = 0);
// Radians of orbit if the mouse moves by the height of the view. This value moves the eye from default_viewpoint() by
// the diameter of the array.
inline constexpr double kOrbitPerHeight = 1 / kFocusPerExtent;

// Returns a viewpoint behind the array with the direction of default_viewpoint(), so that the user sees the cameras.
// All cameras that look forward are inside the view, with a margin of a tenth of its width and height. The focal plane
// stays `focus_distance` from the array. `aspect` is width over height.
Viewpoint viewpoint_behind(const Rig& rig, double aspect, double focus_distance = 0);
// Returns the camera nearest to the mean position, or the lowest index if several are equally near.
CameraIndex middle_camera(const Rig& rig);

// Moves a viewpoint with the mouse and the keyboard. The *pivot* is the point on the optical axis that is in focus;
// orbiting rotates the eye about the pivot. Mouse distances are in view heights (x right, y down), so that the movement
// does not depend on the size of the window. Not thread-safe.
class Navigator {
 public:
  explicit Navigator(const Viewpoint& home = {}) { set_home(home); }

  const Viewpoint& viewpoint() const { return now_; }
  const Viewpoint& home() const { return home_; }
  Vec3 pivot() const { return pivot_point(now_); }

  // Limits all movements to viewpoints with enough visible scene. `visible` returns the visible share of the view, 0 to
  // 1. No movement reduces this share below kMinVisible times its value at home (or its current value, if that is
  // lower).
  //
  // A movement that would show too little is corrected step by step. First, the view turns towards the direction of the
  // home view while the eye moves. If that is not enough, the eye rotates about the pivot towards the line from the
  // pivot to the home position. If even that is not enough, the movement stops early.
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

  // Rotates the eye about the pivot by kOrbitPerHeight radians per view height, so that the scene follows the mouse. dx
  // rotates about the vertical axis of the home view, which keeps the horizon level. dy rotates about the right axis of
  // the view.
  void orbit(double dx, double dy);
  // Moves the eye sideways so that points in focus follow the mouse.
  void pan(double dx, double dy);
  // Moves the focal plane away by a tenth of its distance per step, or closer if `steps` is negative.
  void focus(double steps);
  // Narrows the field of view by 5 % per step, or widens it if `steps` is negative. The part of the scene at `place`
  // (relative to the middle of the view) stays where it is.
  void zoom(double steps, const Vec2& place = {0, 0});
  // Moves the eye along the axes of the view, in hundredths of the focus distance. The focus distance stays the same.
  void fly(const Vec3& steps_camera);

  // Handles a key, named by its X keysym; upper and lower case are equal. Arrows orbit, w/s fly forward and back, a/d
  // left and right, q/e down and up, plus/minus zoom, bracketleft/bracketright focus nearer and farther, and r goes
  // home. Returns false for other keys.
  bool key(std::string_view name);

 private:
  template <typename Move>
  void go(Move move);
  Viewpoint turned_towards_home(const Viewpoint& viewpoint, double share) const;
  Viewpoint moved_towards_home(const Viewpoint& viewpoint, double share) const;
  Quat turned_to(const Quat& orientation, const Vec3& forward) const;

  Viewpoint home_, now_;
  Visible visible_;
  std::optional<double> min_visible_;  // lower limit of the visible share; computed at the first movement
};

}  // namespace lf
