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

// What somebody flies: a pinhole camera with a focal plane facing it.
struct Viewpoint {
  Pose pose;                  // world_from_view
  double fov_y_deg = 45;      // vertical, kMinFovDeg..kMaxFovDeg
  double focus_distance = 2;  // metres along the optical axis, kMinFocus..kMaxFocus
  double aperture = 0;        // metres, 0..Blending::kMaxAperture; 0: blended by the mesh
  bool operator==(const Viewpoint&) const = default;
};

inline constexpr double kMinFovDeg = 1, kMaxFovDeg = 170;
inline constexpr double kMinFocus = 1e-6, kMaxFocus = 1e9;
inline constexpr double kMaxPosition = 1e9;  // metres, of each coordinate

// Everything put inside its limits and the quaternion to unit length. Requires finite numbers and a quaternion != 0.
Viewpoint clamped(const Viewpoint& viewpoint);
bool is_finite(const Viewpoint& viewpoint);
// The point in focus on the optical axis.
inline Vec3 pivot_of(const Viewpoint& v) { return v.pose.position + v.focus_distance * v.pose.forward(); }
View make_view(const Viewpoint& viewpoint, int width, int height);

// The viewpoint to begin with before an array: at the mean of its centres, along the mean of its axes, with the
// vertical field of view of its middle camera, focused at `focus_distance` or, where that is 0, at kFocusPerExtent
// times the diameter of the array (1 m for an array without extent). Requires at least one camera.
inline constexpr double kFocusPerExtent = 4;
Viewpoint default_viewpoint(const Rig& rig, double focus_distance = 0);
// An array is a window: from default_viewpoint() a drag over the height of the view moves the eye by its diameter.
inline constexpr double kOrbitPerHeight = 1 / kFocusPerExtent;

// From behind the array, along the mean of its axes: all cameras that look that way are inside of the view, with a
// tenth of its height and width around them, and what was in focus at `focus_distance` from the array still is. Other
// than that, default_viewpoint(). `aspect`: the view's width over its height.
Viewpoint viewpoint_behind(const Rig& rig, double aspect, double focus_distance = 0);
// The camera nearest to the mean of the centres; ties go to the lowest index.
CameraIndex middle_camera(const Rig& rig);

// Turns the movements of a mouse and keys into viewpoints. Mouse distances are in heights of the view, x to the right
// and y down, so that they mean the same at every size. The *pivot* is the point in focus on the optical axis. A plain
// value without locks.
class Navigator {
 public:
  explicit Navigator(const Viewpoint& home = {}) { set_home(home); }

  const Viewpoint& viewpoint() const { return now_; }
  const Viewpoint& home() const { return home_; }
  Vec3 pivot() const { return pivot_of(now_); }

  // How much there is to see from a viewpoint, 0..1. While there is such a function, no movement leaves less than
  // kEnough of what home shows, or less than before it where that was less already: the view turns back to where home
  // looks, as far as it takes, and the eye goes on; where that is of no use, it is drawn, around the pivot, towards the
  // line through home's position; and where that is of no use either, movements end.
  using Visible = std::function<double(const Viewpoint&)>;
  static constexpr double kEnough = 0.95;
  void set_visible(Visible visible) {
    visible_ = std::move(visible);
    enough_.reset();
  }

  void set(const Viewpoint& viewpoint) { now_ = clamped(viewpoint); }
  void set_home(const Viewpoint& viewpoint) {
    now_ = home_ = clamped(viewpoint);
    enough_.reset();
  }
  void reset() { now_ = home_; }

  // Turns around the pivot, kOrbitPerHeight radians per height: dx about home's vertical (so that the horizon stays),
  // dy about the view's right axis. The scene follows the mouse.
  void orbit(double dx, double dy);
  // Moves the eye sideways, so that what is in focus follows the mouse.
  void pan(double dx, double dy);
  // `steps` > 0: the focal plane moves away, by a tenth of its distance each.
  void focus(double steps);
  // `steps` > 0: a narrower field of view, by 5 % each. What is seen at `place`, from the middle of the view, stays
  // there.
  void zoom(double steps, const Vec2& place = {0, 0});
  // Moves the eye along the view's own axes, in hundredths of the focus distance, which stays as it is.
  void fly(const Vec3& steps_camera);

  // Moves as a key asks, named by its X keysym, letters in either case. Arrows orbit, w/s fly forward and back, a/d
  // left and right, q/e down and up, plus/minus zoom, bracketleft/bracketright focus nearer and farther, r goes home.
  // False if the key means nothing here.
  bool key(std::string_view name);

 private:
  template <typename Move>
  void go(Move move);
  Viewpoint turned_home(const Viewpoint& viewpoint, double share) const;
  Viewpoint drawn_home(const Viewpoint& viewpoint, double share) const;
  Quat turned_to(const Quat& orientation, const Vec3& forward) const;

  Viewpoint home_, now_;
  Visible visible_;
  std::optional<double> enough_;  // the least share that has to stay visible; computed at the first movement
};

}  // namespace lf
