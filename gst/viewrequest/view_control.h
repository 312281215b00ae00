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

// Listens to what a window says to another branch of the pipeline: pictures that come off a network end at a source
// that knows nothing of views.
class NavigationTap {
 public:
  ~NavigationTap() { detach(); }

  // Calls `navigated` with `element` for every upstream event at a source pad of the element `name` in its pipeline, in
  // the thread that sends it. Such a call may still be under way, or begin, when detach() has returned; the element
  // lives as long. False if there is no such element, or it has no source pad.
  bool attach(GstElement* element, const std::string& name, void (*navigated)(GstElement*, GstEvent*));
  void detach();

 private:
  std::vector<std::pair<GstPad*, gulong>> probes_;
};

// One number of a view: the property of lfviewrequest, and the field of set-view structures, that it is.
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
  kNumViewFields
};
extern const std::array<ViewField, kNumViewFields> kViewFields;
using ViewValues = std::array<double, kNumViewFields>;

// Upstream events name the view they are for in this field (uint); without it they are for every view.
inline constexpr char kViewIdField[] = "lightfield-view-id";
// Custom upstream event that sets the view: any of the fields of kViewFields, as numbers.
inline constexpr char kViewEvent[] = "lightfield-view-request";

bool is_for_view(GstEvent* event, guint view_id);

// Properties, events and signals of one view, made into a viewpoint. Without locks.
class ViewControl {
 public:
  ViewControl();

  const Viewpoint& viewpoint() const { return navigator_.viewpoint(); }
  // Angles as they were set, until something else turns the view.
  const ViewValues& values() const { return values_; }

  void set(int field, double value);  // finite
  // Sets all numbers of a view that the structure has, or none of them: false if the structure has neither these nor
  // focus-continuous, or a value that is not a finite number, or an unknown field.
  bool set_view(const GstStructure* structure);
  // The field focus-continuous of such a structure; nothing where it is missing or not a finite number.
  static std::optional<double> focus_continuous(const GstStructure* structure);
  // What was set by set() or set_view() stays, everything else is as in `defaults`; "home" is here.
  void begin(const Viewpoint& defaults);
  // Mouse and keys go as far as something is visible of this array; null: anywhere.
  void keep_visible(std::shared_ptr<const VisibleShare> share);
  const std::shared_ptr<const VisibleShare>& visible_share() const { return share_; }
  // A GstNavigation event of a picture of columns x rows views of this size in pixels. False if it means nothing here.
  bool navigate(GstEvent* event, int view_width, int view_height, int columns = 1, int rows = 1);
  // Where the picture was clicked since the last call, pixels: the first button was pressed and let go without a drag.
  std::optional<Vec2> take_click() { return std::exchange(click_, std::nullopt); }

 private:
  struct Drag {
    double x, y;
    bool pan;  // whatever the modifiers
    Vec2 begun;
  };

  bool drag_to(double x, double y, bool shift, int view_height);
  bool wheel(double steps, bool control, const Vec2& place);
  void read_values();

  Navigator navigator_;
  ViewValues values_;
  std::array<std::optional<double>, kNumViewFields> given_;
  std::optional<Drag> drag_;
  std::optional<Vec2> click_;
  std::shared_ptr<const VisibleShare> share_;
  double aspect_ = 0;  // width / height of the view that the navigator knows
};

}  // namespace lf
