// SPDX-License-Identifier: LGPL-2.1-or-later
#include <memory>
#include <string>
#include <utility>

#include "base/error.h"
#include "viewrequest/lfviewrequest_private.h"

enum {
  PROP_0,
  PROP_IS_LIVE,
  PROP_NUM_BUFFERS,
  PROP_FIRST_FIELD,  // one for each of kViewFields, then one for each of the settings
  PROP_FIRST_SETTING = PROP_FIRST_FIELD + lf::kNumViewFields,
};

std::shared_ptr<const lf::VisibleShare> lf_view_request_visible_share(const lf::ViewRequestSettings& settings,
                                                                      const std::shared_ptr<const lf::Rig>& rig) {
  if (!rig || !settings.keep_visible) return nullptr;
  return std::make_shared<lf::VisibleShare>(*rig);
}

// While the element runs a rig is read at once. Cameras that were announced as out of service are those of the rig
// before: whoever notices that one is missing says so again.
static void set_rig(LfViewRequest* self, const lf::ViewRequestSettings& changed, std::shared_ptr<const lf::Rig> rig) {
  const uint64_t before = self->state->stream->rig_hash();
  self->state->stream->set_rig(std::move(rig), changed.out_of_service);
  if (self->state->stream->rig_hash() != before) self->state->out_of_service.clear();
}

static std::string without_effect(LfViewRequest* self) {
  const bool live = gst_base_src_is_live(GST_BASE_SRC(self));
  const lf::ObjectLock lock(self);
  return self->state->settings.without_effect(live);
}

static void set_setting(LfViewRequest* self, guint id, const GValue* value, const GParamSpec* pspec) {
  const bool is_rig = lf::is_named(pspec, "rig");
  const gchar* path = is_rig ? g_value_get_string(value) : nullptr;
  std::shared_ptr<const lf::Rig> rig;
  if (path && lf::is_running(GST_ELEMENT(self)) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return;
  std::string problem;
  lf::ObjectLock lock(self);
  lf::ViewRequestSettings changed = self->state->settings;
  lf::ViewRequestSettings::properties().set(changed, id, value);
  try {
    if (self->state->stream && is_rig && (rig || !path)) set_rig(self, changed, rig);
    if (self->state->stream && lf::is_named(pspec, "out-of-service"))
      self->state->stream->set_out_of_service(changed.out_of_service);
    if (self->state->stream && (is_rig || lf::is_named(pspec, "keep-visible")))
      self->state->control.keep_visible(lf_view_request_visible_share(changed, self->state->stream->rig()));
    self->state->settings = changed;
    lf_view_request_choose_form(self);
    self->state->focus.follow(changed.focus_continuous);
  } catch (const lf::Error& error) {
    problem = error.what();
  }
  lock.unlock();
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s; %s as %s", problem.c_str(), is_rig ? "the rig stays" : "the cameras out of service stay",
                         is_rig ? "it was" : "they were"),
                        (nullptr));
}

void lf_view_request_warn_without_effect(LfViewRequest* self, const std::string& before) {
  const std::string text = without_effect(self);
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_view_request_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) {
    gst_base_src_set_live(GST_BASE_SRC(self), g_value_get_boolean(value));
  } else if (id == PROP_NUM_BUFFERS) {
    GST_OBJECT_LOCK(self);
    self->state->settings.num_buffers = g_value_get_int(value);
    GST_OBJECT_UNLOCK(self);
  } else if (id >= PROP_FIRST_SETTING) {
    const std::string before = without_effect(self);
    set_setting(self, id, value, pspec);
    if (lf::is_running(GST_ELEMENT(self))) lf_view_request_warn_without_effect(self, before);
  } else if (id >= PROP_FIRST_FIELD) {
    lf::ObjectLock lock(self);
    self->state->control.set(static_cast<int>(id) - PROP_FIRST_FIELD, g_value_get_double(value));
    self->state->turn.note_change();
    lock.unlock();
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
}

static void lf_view_request_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfViewRequest* self = LF_VIEW_REQUEST(object);
  if (id == PROP_IS_LIVE) return g_value_set_boolean(value, gst_base_src_is_live(GST_BASE_SRC(self)));
  lf::ObjectLock lock(self);
  if (id == PROP_NUM_BUFFERS)
    g_value_set_int(value, self->state->settings.num_buffers);
  else if (id >= PROP_FIRST_SETTING)
    lf::ViewRequestSettings::properties().get(self->state->settings, id, value);
  else if (id >= PROP_FIRST_FIELD)
    g_value_set_double(value, self->state->control.values()[id - PROP_FIRST_FIELD]);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  lock.unlock();
}

void lf_view_request_install_properties(GObjectClass* klass) {
  klass->set_property = lf::callback<lf_view_request_set_property>;
  klass->get_property = lf::callback<lf_view_request_get_property>;
  for (int i = 0; i < lf::kNumViewFields; i++) {
    const lf::ViewField& f = lf::kViewFields[i];
    GParamSpec* spec = g_param_spec_double(
        f.name, f.nick, f.blurb, f.min, f.max, f.initial,
        GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE));
    g_object_class_install_property(klass, PROP_FIRST_FIELD + i, spec);
  }
  lf::ViewRequestSettings::properties().install(klass, PROP_FIRST_SETTING);
  g_object_class_override_property(klass, PROP_NUM_BUFFERS, "num-buffers");
  g_object_class_install_property(
      klass, PROP_IS_LIVE,
      g_param_spec_boolean("is-live", "Is live",
                           "Make requests in time with the clock, for frames that live cameras make", FALSE,
                           GParamFlags(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
}
