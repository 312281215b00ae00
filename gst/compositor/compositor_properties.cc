// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/lfcompositor_private.h"

using Settings = lf::CompositorSettings;

static constexpr guint kFirstLimit = 100;  // the id of the first property that is RequestGuard's

static Settings& settings_of(LfCompositor* self) { return *self->settings; }

static GstStructure* stats_of(LfCompositor* self) {
  GstStructure* stats = self->state->stats.structure();
  self->guard->add_stats(stats);
  return stats;
}

using Properties = lf::Properties<settings_of, stats_of>;

Settings lf_compositor_settings(LfCompositor* self) { return Properties::now(self); }

guint lf_compositor_view_id(LfCompositor* self) {
  const lf::ObjectLock lock(self);
  return self->settings->view_id;
}

// While it runs the file is read at once, and serves from the next request on. False if it can't be.
static bool lf_compositor_reload_rig(LfCompositor* self, const gchar* path) {
  std::shared_ptr<const lf::Rig> rig;
  if ((path || lf_compositor_settings(self).partial) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return false;
  const lf::ObjectLock lock(self);
  delete self->new_rig;
  self->new_rig = new std::shared_ptr<const lf::Rig>(std::move(rig));
  return true;
}

// What comes out has the caps that it began with: while the element runs it stays what it is.
static bool lf_compositor_may_be_partial(LfCompositor* self, gboolean partial) {
  if (partial == lf_compositor_settings(self).partial) return true;
  GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                      ("partial: can't be changed while the element runs; it stays %s", partial ? "false" : "true"),
                      (nullptr));
  return false;
}

void lf_compositor_warn_without_effect(LfCompositor* self, const std::string& before) {
  const std::string text = lf_compositor_settings(self).without_effect();
  if (!text.empty() && text != before) GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS, ("%s", text.c_str()), (nullptr));
}

static void lf_compositor_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  if (self->guard->set(id, value)) return;
  if (lf::is_running(GST_ELEMENT(self))) {
    if (lf::is_named(pspec, "rig") && !lf_compositor_reload_rig(self, g_value_get_string(value))) return;
    if (lf::is_named(pspec, "partial") && !lf_compositor_may_be_partial(self, g_value_get_boolean(value))) return;
  }
  const std::string before = lf_compositor_settings(self).without_effect();
  Properties::set(object, id, value, pspec);
  if (lf::is_running(GST_ELEMENT(self))) lf_compositor_warn_without_effect(self, before);
}

static void lf_compositor_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!LF_COMPOSITOR(object)->guard->get(id, value)) Properties::get(object, id, value, pspec);
}

lf::RequestGuard* lf_compositor_guard_new() { return new lf::RequestGuard(kFirstLimit); }

void lf_compositor_install_properties(GObjectClass* klass) {
  Properties::install(
      klass,
      "Counts of pictures (complete, incomplete, unseen: no camera sees anything of the view, repeated, dropped; "
      "card-pictures: made on a graphics card), "
      "requests skipped (too late to be shown, as QoS events say), requests refused for one of the limits "
      "(refused, "
      "and of these refused-pixels, -aperture, -trials, -rate, -views, -lens), "
      "coverage (share of the latest view that cameras can see; with `rig`), fragments (missing, damaged), late, "
      "repeated, stray (to requests that nobody has asked) and bad answers, pictures that failed (no memory), "
      "bytes, cameras out of service; the largest skew; of a focal surface: rounds of "
      "trials, their bytes, how far cameras disagree (residual, 255ths) and by how much the last round lessened "
      "it (gained), requests from one with trials to the next (interval), whether one plane is enough (flat); of "
      "the monitor: "
      "turns of cameras, their bytes, for each camera the PSNR, gain and shift (pixels of the small view) of its "
      "prediction, and suspects with their fault (colour, direction, picture); "
      "latency per stage (p50, p95, "
      "p99 over the latest 1024 pictures, nanoseconds)");
  lf::RequestGuard::install(klass, kFirstLimit, false);  // it has one view
  klass->set_property = lf::callback<lf_compositor_set_property>;
  klass->get_property = lf::callback<lf_compositor_get_property>;
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_INCOMPLETE, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_FOCUS, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_GAINS, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_SHOW, GstPluginAPIFlags(0));
}
