// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cmath>
#include <optional>

#include "viewrequest/lfviewrequest_private.h"

lf::View lf_view_request_view(LfViewRequest* self) {
  const lf::PictureForm& form = self->state->form;
  return lf::make_view(self->state->control.viewpoint(), form.width, form.height);
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

guint lf_view_request_view_id(LfViewRequest* self) {
  const lf::ObjectLock lock(self);
  return self->state->settings.view_id;
}

void lf_view_request_set_focus_distance(LfViewRequest* self, double distance) {
  lf_view_request_change_view(self, [distance](lf::ViewControl& control) {
    control.set(lf::kFieldFocus, distance);
    return TRUE;
  });
}

static gboolean lf_view_request_focus_at(LfViewRequest* self, gdouble x, gdouble y) {
  if (!std::isfinite(x) || !std::isfinite(y)) return FALSE;
  GST_OBJECT_LOCK(self);
  // Cameras that are told where to look (access) try nothing.
  const bool can = self->state->stream && !self->state->stream->from_file() && !self->state->stream->access();
  const lf::View middle = can ? lf_view_request_view(self) : lf::View();
  const lf::ViewSet set = self->state->settings;
  GST_OBJECT_UNLOCK(self);
  if (!can) return FALSE;
  const lf::Vec2 place((x + 0.5) / middle.width, (y + 0.5) / middle.height);
  const std::optional<lf::PlaceInSet> shown = set.place_at(place);
  if (!shown) return FALSE;
  const lf::View seen = set.view(middle, *shown);
  const lf::Vec2 in_view(place.x - shown->column(), place.y - shown->row());
  if (const auto distance = self->state->focus.focus_at(in_view, shown->count() > 1 ? &seen : nullptr))
    lf_view_request_set_focus_distance(self, *distance);
  return TRUE;
}

static bool is_navigation(GstEvent* event) { return GST_EVENT_TYPE(event) == GST_EVENT_NAVIGATION; }
static bool is_view(GstEvent* event) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM && gst_event_has_name(event, lf::kViewEvent);
}

// Sets focus-continuous, if the structure has that field. False if not.
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
    return from_file ? lf::ViewControl().set_view(structure) : control.set_view(structure);
  });
  if (!valid) return FALSE;
  return follow(self, structure) || !from_file;
}

bool lf_view_request_is_steering(GstEvent* event) { return is_navigation(event) || is_view(event); }

gboolean lf_view_request_steer(LfViewRequest* self, GstEvent* event) {
  if (is_view(event))
    return lf::is_for_view(event, lf_view_request_view_id(self)) &&
           lf_view_request_set_view(self, gst_event_get_structure(event));
  std::optional<lf::Vec2> click;
  const gboolean done = lf_view_request_change_view(self, [&](lf::ViewControl& control) {
    if (!self->state->stream || self->state->stream->from_file()) return FALSE;
    if (!lf::is_for_view(event, self->state->settings.view_id)) return FALSE;
    const lf::View view = lf_view_request_view(self);
    const lf::PlaceInSet place = self->state->settings.place(0);
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
   * @view: a structure of any name with any of the fields x, y, z, yaw, pitch, roll, fov, focus-distance, aperture, as
   * numbers, and focus-continuous (0 or 1)
   *
   * Moves the view; values beyond the properties' ranges are put inside them. The next request has it.
   *
   * Returns: %FALSE, and nothing is changed, if there is none of these fields, or one is not a finite number, or there
   * are others. Views of a file do not move.
   */
  g_signal_new_class_handler("set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_request_set_view>), nullptr, nullptr, nullptr,
                             G_TYPE_BOOLEAN, 1, GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);

  /**
   * LfViewRequest::focus-at:
   * @request: the element
   * @x: pixels of the view, of a set of the whole picture, from the middle of its first one
   * @y: the same
   *
   * Puts the focal plane where the view is in focus at a pixel, as a click on the picture does: at once if its
   * lfcompositor has a focal surface, else as soon as two small views have swept all depths. With `focus-continuous` it
   * is kept in focus from then on.
   *
   * Returns: %FALSE if the pixel is not in the view, or the view is a file's, or the element does not run, or its
   * cameras are told where to look (`access`).
   */
  g_signal_new_class_handler("focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_request_focus_at>), nullptr, nullptr, nullptr,
                             G_TYPE_BOOLEAN, 2, G_TYPE_DOUBLE, G_TYPE_DOUBLE);
}
