// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gst/gst.h>

#include "render/contribution_map.h"
#include "view/navigator.h"

namespace lf {

// Intercepts navigation events (mouse, keys) at another element of the pipeline. A window sends these events upstream.
// If the pictures come from a network source, the events end there and never reach lfviewrequest, so this class watches
// the pads of that element.
class NavigationTap {
 public:
  ~NavigationTap() { detach(); }

  // Calls `navigated` with `element` for every upstream event at a source pad of the element `name` in the same
  // pipeline, in the thread of the sender. Calls may still start or run after detach() has returned; they keep
  // `element` alive. Returns false if there is no such element or it has no source pad.
  bool attach(GstElement* element, const std::string& name, void (*navigated)(GstElement*, GstEvent*));
  void detach();

 private:
  std::vector<std::pair<GstPad*, gulong>> probes_;
};

// A number that is part of a view, such as the x coordinate. It is both a property of lfviewrequest and a field of the
// structures for the signal set-view.
struct ViewField {
  const char *name, *nick, *blurb;
  double min, max, initial;
};
enum ViewFieldIndex {
  kFieldX,
  kFieldY,
  kFieldZ,
  kFieldYaw,
  kFieldPitch,
  kFieldRoll,
  kFieldFov,
  kFieldFocus,
  kFieldAperture,
  kFieldMargin,
  kNumViewFields
};
extern const std::array<ViewField, kNumViewFields> kViewFields;
using ViewValues = std::array<double, kNumViewFields>;

// Moves the viewpoint of one view by properties, events and signals, and stores its position. Not thread-safe.
class ViewControl {
 public:
  ViewControl();

  const Viewpoint& viewpoint() const { return navigator_.viewpoint(); }
  // Returns the viewpoint to request: the field of view is wider by the margin.
  Viewpoint requested() const { return widened(values_[kFieldMargin]); }
  // Returns the numbers of the present view. Angles are returned as they were set (for example a yaw of 360) until
  // navigation turns the view.
  const ViewValues& values() const { return values_; }

  void set(int field, double value);  // `value` must be finite
  // Sets all numbers of the view in the structure, or none. Returns false for unknown fields, for values that are not
  // finite numbers, and if there are neither numbers nor focus-continuous. If the view is constrained, the margin is
  // reduced to the part that cameras see. `aspect` is width over height of the view; 0: unknown.
  bool set_view(const GstStructure* structure, double aspect = 0);
  // Returns the field focus-continuous of the structure as a number, or nothing if the field is missing or not a finite
  // number.
  static std::optional<double> focus_continuous(const GstStructure* structure);
  // Moves the view to its start position. Numbers that set() or set_view() have set keep their values, and all other
  // numbers are taken from `defaults`. The navigation command "home" returns to this position.
  void begin(const Viewpoint& defaults);
  // Limits navigation by mouse and keys, so that cameras see at least a part of the view. `share` computes this part;
  // null removes the limit.
  void constrain_view(std::shared_ptr<const VisibleFraction> share);
  const std::shared_ptr<const VisibleFraction>& visible_share() const { return share_; }
  // Moves the view according to a GstNavigation event. The event's coordinates are pixels of a picture with columns x
  // rows views (1 x 1: a single view), and each view has this size in pixels. Returns false if the event has no effect.
  bool navigate(GstEvent* event, int view_width, int view_height, int columns = 1, int rows = 1);
  // Returns the position of the last click in pixels of the picture, once for each click. A click is a press and a
  // release of the first button without a movement in between.
  std::optional<Vec2> take_click() { return std::exchange(click_, std::nullopt); }

 private:
  Viewpoint widened(double margin) const;
  struct Drag {
    double x, y;
    bool pan;  // pans regardless of the modifiers
    Vec2 begun;
  };

  bool drag_to(double x, double y, bool shift, int view_height);
  bool wheel(double steps, bool control, const Vec2& place);
  void read_values();
  double visible_margin(double margin, double aspect) const;

  Navigator navigator_;
  ViewValues values_;
  std::array<std::optional<double>, kNumViewFields> set_fields_;
  std::optional<Drag> drag_;
  std::optional<Vec2> click_;
  std::shared_ptr<const VisibleFraction> share_;
  double aspect_ = 0;
};

}  // namespace lf
