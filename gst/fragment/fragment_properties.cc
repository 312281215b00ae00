// SPDX-License-Identifier: LGPL-2.1-or-later
#include <map>
#include <string>

#include "common/common.h"
#include "fragment/lffragment_private.h"

using Settings = lf::FragmentSettings;

enum { PROP_0, PROP_STATS, PROP_FIRST_LIMIT, PROP_FIRST_SETTING = PROP_FIRST_LIMIT + lf::RequestGuard::kNumProperties };

lf::FragmentSettings lf_fragment_settings(LfFragment* self) {
  const lf::ObjectLock lock(self);
  return self->state->settings;
}

// While the element runs the file is read at once, and serves from the next request on. False if it can't be.
static bool lf_fragment_reload_rig(LfFragment* self, const gchar* path) {
  const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
  if (!rig) return false;
  const std::string problem = self->state->node.inputs().set_rig(rig);
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s: %s, of which this node has the video: it is left out.", path, problem.c_str()),
                        (nullptr));
  return true;
}

static GstStructure* stats_structure(const lf::NodeStats& node) {
  GstStructure* stats = gst_structure_new_empty("application/x-lightfield-fragment-stats");
  for (const auto& [name, value] : node.all()) gst_structure_set(stats, name.c_str(), G_TYPE_UINT64, value, nullptr);
  const std::map<uint32_t, float> gains = node.gains();
  if (gains.empty()) return stats;
  GstStructure* of_cameras = gst_structure_new_empty("gains");
  for (const auto& [id, gain] : gains)
    gst_structure_set(of_cameras, ("camera-" + std::to_string(id)).c_str(), G_TYPE_DOUBLE, static_cast<double>(gain),
                      nullptr);
  gst_structure_set(stats, "gains", GST_TYPE_STRUCTURE, of_cameras, nullptr);
  gst_structure_free(of_cameras);
  return stats;
}

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  if (self->state->guard.set(id, value)) return;
  if (lf::is_named(pspec, "rig") && lf::is_running(GST_ELEMENT(self)) &&
      !lf_fragment_reload_rig(self, g_value_get_string(value)))
    return;
  lf::ObjectLock lock(self);
  Settings::properties().set(self->state->settings, id, value);
  lock.unlock();
}

static void lf_fragment_get_property(GObject* object, guint id, GValue* value, GParamSpec*) {
  LfFragment* self = LF_FRAGMENT(object);
  if (self->state->guard.get(id, value)) return;
  if (id != PROP_STATS) return Settings::properties().get(lf_fragment_settings(self), id, value);
  GstStructure* stats = stats_structure(self->state->node.stats());
  self->state->guard.add_stats(stats);
  g_value_take_boxed(value, stats);
}

_LfFragment::State* lf_fragment_state_new() {
  return new _LfFragment::State{.guard = lf::RequestGuard(PROP_FIRST_LIMIT)};
}

void lf_fragment_install_properties(GObjectClass* object_class) {
  object_class->set_property = lf::callback<lf_fragment_set_property>;
  object_class->get_property = lf::callback<lf_fragment_get_property>;
  Settings::properties().install(object_class, PROP_FIRST_SETTING);
  lf::RequestGuard::install(object_class, PROP_FIRST_LIMIT);
  g_object_class_install_property(
      object_class, PROP_STATS,
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts of requests, answers, of these skipped (too late to be shown) and drawn by OpenGL, requests refused "
          "for one of the limits (refused, and of these refused-pixels, -aperture, -trials, -rate, -views), fragments, "
          "bytes, frames that "
          "were missing (of these stale: farther than "
          "max-skew) and frames that were damaged; the largest skew of a frame; what waiting for frames, decoding, "
          "rendering and encoding took: the latest answer's time and p50, p95, p99 over the latest 1024, and of all of "
          "them together (answer-ns; nanoseconds)",
          GST_TYPE_STRUCTURE, GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
  for (const GType type : {LF_TYPE_FRAGMENT_PAD, LF_TYPE_FRAGMENT_RENDERER, LF_TYPE_FRAGMENT_RESAMPLING,
                           LF_TYPE_FRAGMENT_CODEC, LF_TYPE_ACCESS})
    gst_type_mark_as_plugin_api(type, GstPluginAPIFlags(0));
}
