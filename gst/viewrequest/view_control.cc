// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/view_control.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include <gst/video/navigation.h>

#include "common/gst_pointers.h"
#include "common/guard.h"
#include "geometry/pose.h"
#include "viewrequest/lfviewrequest.h"
#include "viewrequest/view_request_settings.h"

namespace lf {
namespace {

GstElement* find_in_pipeline(GstElement* element, const std::string& name) {
  ObjectPtr<GstObject> top(GST_OBJECT(gst_object_ref(element)));
  while (GstObject* parent = gst_object_get_parent(top.get())) top.reset(parent);
  return GST_IS_BIN(top.get()) ? gst_bin_get_by_name(GST_BIN(top.get()), name.c_str()) : nullptr;
}

Viewpoint viewpoint_of(const ViewValues& v) {
  Viewpoint viewpoint;
  viewpoint.pose.position = {v[kFieldX], v[kFieldY], v[kFieldZ]};
  viewpoint.pose.orientation = quat_from_euler({v[kFieldYaw], v[kFieldPitch], v[kFieldRoll]});
  viewpoint.fov_y_deg = v[kFieldFov];
  viewpoint.focus_distance = v[kFieldFocus];
  viewpoint.aperture = v[kFieldAperture];
  return viewpoint;
}

ViewValues values_of(const Viewpoint& v) {
  const EulerAngles angles = euler_from_quat(v.pose.orientation);
  return {v.pose.position.x, v.pose.position.y, v.pose.position.z, angles.yaw, angles.pitch,
          angles.roll,       v.fov_y_deg,       v.focus_distance,  v.aperture, 0};
}

std::optional<double> number(const GValue* value) {
  GValue as_double = G_VALUE_INIT;
  g_value_init(&as_double, G_TYPE_DOUBLE);
  const bool ok = !G_VALUE_HOLDS_BOOLEAN(value) && g_value_transform(value, &as_double);
  const double result = g_value_get_double(&as_double);
  g_value_unset(&as_double);
  return ok && std::isfinite(result) ? std::optional(result) : std::nullopt;
}

}  // namespace

bool NavigationTap::attach(GstElement* element, const std::string& name, void (*navigated)(GstElement*, GstEvent*)) {
  detach();
  g_autoptr(GstElement) source = find_in_pipeline(element, name);
  if (!source) return false;
  lf::ObjectLock lock(source);
  for (GList* item = source->srcpads; item; item = item->next)
    probes_.emplace_back(GST_PAD(gst_object_ref(item->data)), 0);
  lock.unlock();
  // The reference is weak, because GStreamer does not wait for active probes when it removes a probe.
  const auto on_event = [weak = WeakRef(element), navigated](GstPad*, GstPadProbeInfo* info) {
    if (const ElementPtr alive = weak.get())
      guarded(alive.get(), 0, [&] { return navigated(alive.get(), GST_PAD_PROBE_INFO_EVENT(info)), 0; });
    return GST_PAD_PROBE_OK;
  };
  for (auto& [pad, id] : probes_) id = add_probe(pad, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, on_event);
  return !probes_.empty();
}

void NavigationTap::detach() {
  for (const auto& [pad, id] : probes_) {
    gst_pad_remove_probe(pad, id);
    gst_object_unref(pad);
  }
  probes_.clear();
}

const std::array<ViewField, kNumViewFields> kViewFields = {{
    {"x", "X",
     "Position of the viewpoint along the x axis of the rig, in metres. Larger values move the viewpoint to "
     "the right",
     -kMaxPosition, kMaxPosition, 0},
    {"y", "Y",
     "Position of the viewpoint along the y axis of the rig, in metres. "
     "Larger values move the viewpoint down",
     -kMaxPosition, kMaxPosition, 0},
    {"z", "Z",
     "Position of the viewpoint along the z axis of the rig, in metres. Larger values move the viewpoint "
     "forward, towards the scene",
     -kMaxPosition, kMaxPosition, 0},
    {"yaw", "Yaw", "Rotation of the view to the right, in degrees. It is applied before pitch and roll", -360, 360, 0},
    {"pitch", "Pitch", "Rotation of the view upwards, in degrees. It is applied after yaw and before roll", -360, 360,
     0},
    {"roll", "Roll",
     "Rotation of the view clockwise about its optical axis, in degrees. It is applied after yaw and pitch", -360, 360,
     0},
    {"fov", "Field of view", "Vertical field of view, in degrees. A smaller angle magnifies the scene", kMinFovDeg,
     kMaxFovDeg, 45},
    {"focus-distance", "Focus distance",
     "Distance of the focal plane from the viewpoint along the optical axis, in metres. Objects at this distance are "
     "sharp. Nearer and farther objects appear double or blurred, unless the lfcompositor uses a focal surface (its "
     "`focus` property)",
     kMinFocus, kMaxFocus, 2},
    {"aperture", "Aperture",
     "Diameter of the synthetic aperture, in metres. All cameras within this diameter contribute to a pixel. If the "
     "lfcompositor uses a focal plane (focus=plane), objects out of focus blur as with a large lens. Otherwise "
     "objects at all depths stay sharp (0: each pixel is blended from three cameras)",
     0, Blending::kMaxAperture, 0},
    {"margin", "Margin",
     "Width of the margin around the view, relative to the view. The picture shows 1 + margin times the width and the "
     "height of the view, in the same number of pixels. Use this if the client crops pictures, for example because it "
     "redraws them for a later viewpoint (0: no margin)",
     0, 1, 0},
}};

ViewControl::ViewControl() {
  for (int i = 0; i < kNumViewFields; i++) values_[i] = kViewFields[i].initial;
  navigator_.set_home(viewpoint_of(values_));
}

void ViewControl::read_values() {
  const double margin = values_[kFieldMargin];
  values_ = values_of(navigator_.viewpoint());
  values_[kFieldMargin] = margin;
}

Viewpoint ViewControl::widened(double margin) const {
  Viewpoint viewpoint = navigator_.viewpoint();
  if (margin > 0) {
    const double half = std::tan(glm::radians(viewpoint.fov_y_deg) / 2) * (1 + margin);
    viewpoint.fov_y_deg = std::min(glm::degrees(2 * std::atan(half)), kMaxFovDeg);
  }
  return viewpoint;
}

// Returns the largest of a few margins that shows little more black than the view itself. A black margin would only
// take pixels from the view.
double ViewControl::visible_margin(double margin, double aspect) const {
  constexpr double kLeastMargin = 0.05, kLeastVisible = 0.97;
  if (!share_ || aspect <= 0 || margin <= 0) return margin;
  const double least = kLeastVisible * (*share_)(viewpoint(), aspect);
  while (margin >= kLeastMargin && (*share_)(widened(margin), aspect) < least) margin /= 2;
  return margin >= kLeastMargin ? margin : 0;
}

void ViewControl::set(int field, double value) {
  set_fields_[field] = values_[field] = value;
  navigator_.set(viewpoint_of(values_));
}

// Unknown fields are errors, because a misspelt name would otherwise be ignored silently.
static bool has_unknown_field(const GstStructure* structure) {
  for (gint i = 0; i < gst_structure_n_fields(structure); i++) {
    const std::string_view name = gst_structure_nth_field_name(structure, static_cast<guint>(i));
    const bool known = name == LF_VIEW_ID_FIELD || name == kFocusContinuous ||
                       std::ranges::any_of(kViewFields, [&](const ViewField& field) { return name == field.name; });
    if (!known) return true;
  }
  return false;
}

std::optional<double> ViewControl::focus_continuous(const GstStructure* structure) {
  const GValue* value = gst_structure_get_value(structure, kFocusContinuous);
  if (!value) return std::nullopt;
  return G_VALUE_HOLDS_BOOLEAN(value) ? static_cast<double>(g_value_get_boolean(value)) : number(value);
}

bool ViewControl::set_view(const GstStructure* structure, double aspect) {
  if (has_unknown_field(structure)) return false;
  std::array<std::optional<double>, kNumViewFields> fields;
  bool any = gst_structure_has_field(structure, kFocusContinuous);
  if (any && !focus_continuous(structure)) return false;
  for (int i = 0; i < kNumViewFields; i++) {
    const GValue* value = gst_structure_get_value(structure, kViewFields[i].name);
    if (!value) continue;
    fields[i] = number(value);
    if (!fields[i]) return false;
    fields[i] = std::clamp(*fields[i], kViewFields[i].min, kViewFields[i].max);
    any = true;
  }
  for (int i = 0; i < kNumViewFields; i++)
    if (fields[i]) set(i, *fields[i]);
  if (fields[kFieldMargin]) set(kFieldMargin, visible_margin(*fields[kFieldMargin], aspect));
  return any;
}

void ViewControl::begin(const Viewpoint& defaults) {
  values_ = values_of(defaults);
  for (int i = 0; i < kNumViewFields; i++)
    if (set_fields_[i]) values_[i] = *set_fields_[i];
  navigator_.set_home(viewpoint_of(values_));
  drag_.reset();
}

bool ViewControl::drag_to(double x, double y, bool shift, int view_height) {
  const double dx = (x - drag_->x) / view_height, dy = (y - drag_->y) / view_height;
  drag_->x = x;
  drag_->y = y;
  if (drag_->pan || shift)
    navigator_.pan(dx, dy);
  else
    navigator_.orbit(dx, dy);
  read_values();
  return true;
}

bool ViewControl::wheel(double steps, bool control, const Vec2& place) {
  if (control)
    navigator_.focus(steps);
  else
    navigator_.zoom(steps, place);
  read_values();
  return true;
}

void ViewControl::constrain_view(std::shared_ptr<const VisibleFraction> share) {
  share_ = std::move(share);
  aspect_ = 0;
  navigator_.set_visibility(nullptr);
}

bool ViewControl::navigate(GstEvent* event, int view_width, int view_height, int columns, int rows) {
  if (const double aspect = static_cast<double>(view_width) / view_height; share_ && aspect != aspect_) {
    aspect_ = aspect;
    navigator_.set_visibility([share = share_, aspect](const Viewpoint& v) { return (*share)(v, aspect); });
  }
  GstNavigationModifierType state = GST_NAVIGATION_MODIFIER_NONE;
  gst_navigation_event_parse_modifier_state(event, &state);
  const bool shift = state & GST_NAVIGATION_MODIFIER_SHIFT_MASK, control = state & GST_NAVIGATION_MODIFIER_CONTROL_MASK;
  double x = 0, y = 0, delta_x = 0, delta_y = 0;
  int button = 0;
  const gchar* key = nullptr;
  const auto in_view = [](double at, int side, int views) {
    return at >= 0 && at < static_cast<double>(side) * views ? std::fmod(at, side) : at;
  };
  // Returns the pointer position relative to the centre of the view, in view heights. Invalid positions become the
  // centre.
  const auto place = [&] {
    const Vec2 at((in_view(x + 0.5, view_width, columns) - view_width / 2.0) / view_height,
                  (in_view(y + 0.5, view_height, rows) - view_height / 2.0) / view_height);
    const double widest = static_cast<double>(view_width) / view_height / 2;
    return std::abs(at.x) <= widest && std::abs(at.y) <= 0.5 ? at : Vec2(0, 0);
  };
  switch (gst_navigation_event_get_type(event)) {
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS:
      if (!gst_navigation_event_parse_mouse_button_event(event, &button, &x, &y)) return false;
      if (button == 4 || button == 5) return wheel(button == 4 ? 1 : -1, control, place());
      if (button < 1 || button > 3 || !std::isfinite(x) || !std::isfinite(y)) return false;
      drag_ = Drag{x, y, button != 1, {x, y}};
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE: {
      const bool dragging = drag_.has_value();
      constexpr double kStill = 3;  // maximum movement of a click, in pixels
      if (dragging && !drag_->pan && glm::distance(drag_->begun, Vec2(drag_->x, drag_->y)) <= kStill)
        click_ = drag_->begun;
      drag_.reset();
      return dragging;
    }
    case GST_NAVIGATION_EVENT_MOUSE_MOVE:
      if (!drag_ || !gst_navigation_event_parse_mouse_move_event(event, &x, &y)) return false;
      return std::isfinite(x) && std::isfinite(y) && drag_to(x, y, shift, view_height);
    case GST_NAVIGATION_EVENT_MOUSE_SCROLL:
      if (!gst_navigation_event_parse_mouse_scroll_event(event, &x, &y, &delta_x, &delta_y)) return false;
      return std::isfinite(delta_y) && delta_y != 0 && wheel(delta_y, control, place());
    case GST_NAVIGATION_EVENT_KEY_PRESS:
      if (!gst_navigation_event_parse_key_event(event, &key) || !key || !navigator_.key(key)) return false;
      read_values();
      return true;
    default: return false;
  }
}

}  // namespace lf

lf::View lf_view_request_view(LfViewRequest* self) {
  const lf::PictureFormat& form = self->state->form;
  return lf::make_view(self->state->control.requested(), form.width, form.height);
}

gboolean lf_view_request_change_view(LfViewRequest* self, const std::function<gboolean(lf::ViewControl&)>& change) {
  lf::ObjectLock lock(self);
  const lf::ViewValues before = self->state->control.values();
  const gboolean done = change(self->state->control);
  const lf::ViewValues after = self->state->control.values();
  if (before != after) self->state->turn.note_change();
  lock.unlock();
  for (int i = 0; i < lf::kNumViewFields; i++)
    if (before[i] != after[i]) g_object_notify(G_OBJECT(self), lf::kViewFields[i].name);
  return done;
}

lf::ViewRequestSettings lf_view_request_settings(LfViewRequest* self) {
  const lf::ObjectLock lock(self);
  return self->state->settings;
}

guint lf_view_request_view_id(LfViewRequest* self) { return lf_view_request_settings(self).view_id; }

void lf_view_request_set_focus_distance(LfViewRequest* self, double distance) {
  lf_view_request_change_view(self, [distance](lf::ViewControl& control) {
    control.set(lf::kFieldFocus, distance);
    return TRUE;
  });
}

static gboolean lf_view_request_focus_at(LfViewRequest* self, gdouble x, gdouble y) {
  if (!std::isfinite(x) || !std::isfinite(y)) return FALSE;
  lf::ObjectLock lock(self);
  // Cameras with other access kinds cannot test depths.
  const bool can = self->state->stream && !self->state->stream->from_file() && !self->state->stream->access();
  const lf::View middle = can ? lf_view_request_view(self) : lf::View();
  const lf::ViewSet set = self->state->settings;
  const double wider = 1 + self->state->control.values()[lf::kFieldMargin];
  lock.unlock();
  if (!can) return FALSE;
  const lf::Vec2 place((x + 0.5) / middle.width, (y + 0.5) / middle.height);
  const std::optional<lf::ViewSetPosition> shown = set.place_at(place);
  if (!shown) return FALSE;
  const lf::View seen = set.view(middle, *shown);
  // The depths are those of the requested picture, which is wider than the view.
  const lf::Vec2 in_view = 0.5 + (place - lf::Vec2(shown->column(), shown->row()) - 0.5) / wider;
  if (const auto distance = self->state->focus.focus_at(in_view, shown->count() > 1 ? &seen : nullptr))
    lf_view_request_set_focus_distance(self, *distance);
  return TRUE;
}

static bool is_for_view(GstEvent* event, guint view_id) {
  const GstStructure* structure = gst_event_get_structure(event);
  guint id = 0;
  return !structure || !gst_structure_has_field(structure, LF_VIEW_ID_FIELD) ||
         (gst_structure_get_uint(structure, LF_VIEW_ID_FIELD, &id) && id == view_id);
}

static bool is_navigation(GstEvent* event) { return GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION; }
static bool is_view(GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, LF_VIEW_EVENT);
}

static gboolean follow(LfViewRequest* self, const GstStructure* structure) {
  const std::optional<double> follows = lf::ViewControl::focus_continuous(structure);
  if (follows) g_object_set(self, lf::kFocusContinuous, *follows != 0, nullptr);
  return follows.has_value();
}

static gboolean lf_view_request_set_view(LfViewRequest* self, const GstStructure* structure) {
  if (!structure) return FALSE;
  bool from_file = false;
  const gboolean valid = lf_view_request_change_view(self, [&](lf::ViewControl& control) -> gboolean {
    from_file = self->state->stream && self->state->stream->from_file();
    const lf::PictureFormat& form = self->state->form;
    const double aspect = form.height > 0 ? static_cast<double>(form.width) / form.height : 0;
    return from_file ? lf::ViewControl().set_view(structure) : control.set_view(structure, aspect);
  });
  if (!valid) return FALSE;
  return follow(self, structure) || !from_file;
}

bool lf_view_request_is_navigation(GstEvent* event) { return is_navigation(event) || is_view(event); }

gboolean lf_view_request_navigate(LfViewRequest* self, GstEvent* event) {
  if (is_view(event))
    return is_for_view(event, lf_view_request_view_id(self)) &&
           lf_view_request_set_view(self, gst_event_get_structure(event));
  std::optional<lf::Vec2> click;
  const gboolean done = lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    if (!self->state->stream || self->state->stream->from_file()) return FALSE;
    if (!is_for_view(event, self->state->settings.view_id)) return FALSE;
    const lf::View view = lf_view_request_view(self);
    const lf::ViewSetPosition place = self->state->settings.place(0);
    const bool changed =
        self->state->settings.navigation && control.navigate(event, view.width, view.height, place.columns, place.rows);
    click = control.take_click();
    return gboolean(changed);
  });
  if (click) lf_view_request_focus_at(self, click->x, click->y);
  return done;
}

void lf_view_request_install_signals(GObjectClass* klass) {
  /**
   * LfViewRequest::set-view:
   * @request: the element
   * @view: a structure with any name and any of the fields x, y, z, yaw, pitch, roll, fov, focus-distance, aperture,
   * margin as numbers, and focus-continuous (0 or 1)
   *
   * Moves the view, starting with the next request. Values are clamped to the ranges of the properties. With
   * `constrain-view`, the margin is reduced to the part that cameras see. Views from a file do not move.
   *
   * Returns: %FALSE, without changes, if @view has none of these fields, has unknown fields, or has a value that is not
   * a finite number.
   */
  g_signal_new_class_handler("set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_request_set_view>), nullptr, nullptr, nullptr,
                             G_TYPE_BOOLEAN, 1, GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);

  /**
   * LfViewRequest::focus-at:
   * @request: the element
   * @x: column in pixels; for a set of views, a column of the whole picture
   * @y: row in pixels; for a set of views, a row of the whole picture
   *
   * Sets the focal plane to the depth at a pixel, like a click on the picture. If the lfcompositor has a focal surface,
   * the change is immediate. Otherwise the element first requests two additional small views, which sweep all depths.
   * If `focus-continuous` is set, the point then stays in focus.
   *
   * Returns: %FALSE if the pixel is outside the view, the view comes from a file, the element is not running, or
   * `access` is not self.
   */
  g_signal_new_class_handler("focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_request_focus_at>), nullptr, nullptr, nullptr,
                             G_TYPE_BOOLEAN, 2, G_TYPE_DOUBLE, G_TYPE_DOUBLE);

  /**
   * LfViewRequest::skip-request:
   * @request: the element
   * @time: the running time of the picture
   *
   * Emitted before each request of a live element, on the streaming thread. Use this signal to limit the rate of
   * requests. A request that is dropped later loses its depth hypotheses, and the focal surface gets no better.
   *
   * Returns: %TRUE to send no request for this time.
   */
  g_signal_new("skip-request", G_TYPE_FROM_CLASS(klass), G_SIGNAL_RUN_LAST, 0, g_signal_accumulator_true_handled,
               nullptr, nullptr, G_TYPE_BOOLEAN, 1, G_TYPE_UINT64);
}
