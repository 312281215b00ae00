// SPDX-License-Identifier: LGPL-2.1-or-later
#include <map>
#include <string>

#include "common/common.h"
#include "fragment/lffragment_private.h"

using Settings = lf::FragmentSettings;

static constexpr guint kFirstLimit = 100;  // the id of the first property that is RequestGuard's

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

static Settings& settings_of(LfFragment* self) { return self->state->settings; }

static GstStructure* stats_of(LfFragment* self) {
  const lf::NodeStats& node = self->state->node.stats();
  GstStructure* stats = gst_structure_new_empty("lightfield-fragment-stats");
  for (const auto& [name, value] : node.all()) gst_structure_set(stats, name.c_str(), G_TYPE_UINT64, value, nullptr);
  const std::map<uint32_t, float> gains = node.gains();
  GstStructure* of_cameras = gst_structure_new_empty("lightfield-gains");
  for (const auto& [id, gain] : gains)
    gst_structure_set(of_cameras, ("camera-" + std::to_string(id)).c_str(), G_TYPE_DOUBLE, static_cast<double>(gain),
                      nullptr);
  if (!gains.empty()) gst_structure_set(stats, "gains", GST_TYPE_STRUCTURE, of_cameras, nullptr);
  gst_structure_free(of_cameras);
  const std::string renderer = self->state->card.explain(lf_fragment_settings(self).renderer);
  gst_structure_set(stats, "renderer", G_TYPE_STRING, renderer.c_str(), nullptr);
  self->state->guard.add_stats(stats);
  return stats;
}

using Properties = lf::Properties<settings_of, stats_of>;

Settings lf_fragment_settings(LfFragment* self) { return Properties::now(self); }

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  if (self->state->guard.set(id, value)) return;
  if (lf::is_named(pspec, "rig") && lf::is_running(GST_ELEMENT(self)) &&
      !lf_fragment_reload_rig(self, g_value_get_string(value)))
    return;
  Properties::set(object, id, value, pspec);
}

static void lf_fragment_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!LF_FRAGMENT(object)->state->guard.get(id, value)) Properties::get(object, id, value, pspec);
}

_LfFragment::State* lf_fragment_state_new() { return new _LfFragment::State{.guard = lf::RequestGuard(kFirstLimit)}; }

void lf_fragment_install_properties(GObjectClass* object_class) {
  Properties::install(
      object_class,
      "Counts of requests, answers, of these skipped (too late to be shown), drawn by OpenGL and made together with "
      "others of their set of views (together), cameras' frames that were drawn from a card's memory without leaving "
      "it (card-frames), what renders and why (renderer), requests refused for one of the "
      "limits (refused, and of these refused-pixels, -aperture, -trials, -rate, -views, -lens), fragments, bytes, "
      "frames that were missing (of these stale: farther than max-skew) and frames that were damaged; the largest skew "
      "of a frame; what waiting for frames, decoding, rendering and encoding took: the latest answer's time and p50, "
      "p95, p99 over the latest 1024, and of all of them together (answer-ns; nanoseconds)");
  lf::RequestGuard::install(object_class, kFirstLimit);
  object_class->set_property = lf::callback<lf_fragment_set_property>;
  object_class->get_property = lf::callback<lf_fragment_get_property>;
  for (const GType type : {LF_TYPE_FRAGMENT_PAD, LF_TYPE_FRAGMENT_RENDERER, LF_TYPE_FRAGMENT_RESAMPLING,
                           LF_TYPE_FRAGMENT_CODEC, LF_TYPE_ACCESS})
    gst_type_mark_as_plugin_api(type, GstPluginAPIFlags(0));
}
