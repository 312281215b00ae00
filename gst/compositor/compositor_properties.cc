// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/error.h"
#include "compositor/lfcompositor_private.h"
#include "fragment/lffragment.h"

GST_DEBUG_CATEGORY_EXTERN(lf_compositor_debug);
#define GST_CAT_DEFAULT lf_compositor_debug

namespace {

constexpr double kMaxFocus = 1e9;       // metres
constexpr guint kDefaultMaxMissed = 5;  // a sixth of a second at 30 pictures a second

enum {
  PROP_0,
  PROP_VIEW_ID,
  PROP_RIG,
  PROP_BACKGROUND,
  PROP_POST_MESSAGES,
  PROP_INCOMPLETE,
  PROP_MAX_MISSED,
  PROP_PARTIAL,
  PROP_NODE,
  PROP_CODEC,
  PROP_FOCUS,
  PROP_FOCUS_NEAR,
  PROP_FOCUS_FAR,
  PROP_MONITOR_INTERVAL,
  PROP_TRIAL_INTERVAL,
  PROP_GAINS,
  PROP_FIRST_LIMIT,
  PROP_STATS = PROP_FIRST_LIMIT + lf::RequestGuard::kMaxViews  // it has one view
};

}  // namespace

GType lf_compositor_incomplete_get_type(void) {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {LF_COMPOSITOR_INCOMPLETE_CONCEAL,
         "Show what there is; with `rig`, the other cameras make up for what is missing, and the picture before where "
         "nothing is left",
         "conceal"},
        {LF_COMPOSITOR_INCOMPLETE_REPEAT, "Show the picture before again; conceal before the first", "repeat"},
        {LF_COMPOSITOR_INCOMPLETE_DROP, "Show nothing", "drop"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("LfCompositorIncomplete", values);
  }();
  return type;
}

bool lf_compositor_load_rig(LfCompositor* self, std::shared_ptr<const lf::Rig>* rig) {
  GST_OBJECT_LOCK(self);
  g_autofree gchar* path = g_strdup(self->rig_path);
  GST_OBJECT_UNLOCK(self);
  rig->reset();
  if (!path) return true;
  try {
    *rig = lf::shared_rig(path);
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
}

// Before the element runs the path is noted; while it runs the file is read at once, and serves from the next request
// on.
static void lf_compositor_set_rig(LfCompositor* self, const GValue* value) {
  const gchar* path = g_value_get_string(value);
  const bool running = lf::is_running(GST_ELEMENT(self));
  std::shared_ptr<const lf::Rig> rig;
  if (running && (path || self->partial) && !(rig = lf::reload_rig(GST_ELEMENT(self), path))) return;
  lf::ObjectLock lock(self);
  g_free(self->rig_path);
  self->rig_path = g_strdup(path);
  if (running) {
    delete self->new_rig;
    self->new_rig = new std::shared_ptr<const lf::Rig>(std::move(rig));
  }
  lock.unlock();
}

// What comes out has the caps that it began with: while the element runs it stays what it is.
static void lf_compositor_set_partial(LfCompositor* self, gboolean partial) {
  const bool refused = lf::is_running(GST_ELEMENT(self)) && partial != self->partial;
  if (!refused) self->partial = partial;
  if (refused)
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("partial: can't be changed while the element runs; it stays %s", partial ? "false" : "true"),
                        (nullptr));
}

static bool is_limit(guint id) { return id >= PROP_FIRST_LIMIT && id < PROP_STATS; }
static lf::RequestGuard::Property limit_of(guint id) {
  return static_cast<lf::RequestGuard::Property>(id - PROP_FIRST_LIMIT);
}

static void lf_compositor_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  if (is_limit(id)) return self->guard->set(limit_of(id), value);
  if (id == PROP_RIG) return lf_compositor_set_rig(self, value);
  if (id == PROP_PARTIAL) return lf_compositor_set_partial(self, g_value_get_boolean(value));
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_VIEW_ID: self->view_id = g_value_get_uint(value); break;
    case PROP_BACKGROUND: self->background = g_value_get_uint(value); break;
    case PROP_POST_MESSAGES: self->post_messages = g_value_get_boolean(value); break;
    case PROP_INCOMPLETE: self->incomplete = static_cast<LfCompositorIncomplete>(g_value_get_enum(value)); break;
    case PROP_MAX_MISSED: self->max_missed = g_value_get_uint(value); break;
    case PROP_NODE: self->node = g_value_get_uint(value); break;
    case PROP_CODEC: self->codec = static_cast<lf::CodecChoice>(g_value_get_enum(value)); break;
    case PROP_FOCUS: self->focus.mode = static_cast<lf::FocusMode>(g_value_get_enum(value)); break;
    case PROP_FOCUS_NEAR: self->focus.near = g_value_get_double(value); break;
    case PROP_FOCUS_FAR: self->focus.far = g_value_get_double(value); break;
    case PROP_MONITOR_INTERVAL: self->monitor_interval = g_value_get_uint(value); break;
    case PROP_TRIAL_INTERVAL: self->trial_interval = g_value_get_uint(value); break;
    case PROP_GAINS: self->gains = g_value_get_boolean(value); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

static void lf_compositor_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfCompositor* self = LF_COMPOSITOR(object);
  if (is_limit(id)) return self->guard->get(limit_of(id), value);
  lf::ObjectLock lock(self);
  switch (id) {
    case PROP_VIEW_ID: g_value_set_uint(value, self->view_id); break;
    case PROP_RIG: g_value_set_string(value, self->rig_path); break;
    case PROP_BACKGROUND: g_value_set_uint(value, self->background); break;
    case PROP_POST_MESSAGES: g_value_set_boolean(value, self->post_messages); break;
    case PROP_INCOMPLETE: g_value_set_enum(value, self->incomplete); break;
    case PROP_MAX_MISSED: g_value_set_uint(value, self->max_missed); break;
    case PROP_PARTIAL: g_value_set_boolean(value, self->partial); break;
    case PROP_NODE: g_value_set_uint(value, self->node); break;
    case PROP_CODEC: g_value_set_enum(value, static_cast<gint>(self->codec)); break;
    case PROP_FOCUS: g_value_set_enum(value, static_cast<gint>(self->focus.mode)); break;
    case PROP_FOCUS_NEAR: g_value_set_double(value, self->focus.near); break;
    case PROP_FOCUS_FAR: g_value_set_double(value, self->focus.far); break;
    case PROP_MONITOR_INTERVAL: g_value_set_uint(value, self->monitor_interval); break;
    case PROP_TRIAL_INTERVAL: g_value_set_uint(value, self->trial_interval); break;
    case PROP_GAINS: g_value_set_boolean(value, self->gains); break;
    case PROP_STATS: {
      GstStructure* stats = self->state->stats.structure();
      self->guard->add_stats(stats);
      g_value_take_boxed(value, stats);
      break;
    }
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  lock.unlock();
}

void lf_compositor_install_properties(GObjectClass* klass) {
  klass->set_property = lf::callback<lf_compositor_set_property>;
  klass->get_property = lf::callback<lf_compositor_get_property>;
  const auto flags = [](int more) {
    return GParamFlags(G_PARAM_READWRITE | G_PARAM_CONSTRUCT | G_PARAM_STATIC_STRINGS | more);
  };
  const auto install = [klass](guint id, GParamSpec* spec) { g_object_class_install_property(klass, id, spec); };
  install(PROP_VIEW_ID,
          g_param_spec_uint("view-id", "View id", "The view to compose: requests and answers of others are ignored", 0,
                            G_MAXUINT, 0, flags(GST_PARAM_MUTABLE_READY)));
  install(PROP_RIG, g_param_spec_string(
                        "rig", "Rig",
                        "Rig file (rig.json); optional: with it the weight of fragments that never came is known and "
                        "made up for, `background` shows outside the array's mesh, and cameras that never answered at "
                        "all are noticed. Set while running, it is read again and serves from the next request on",
                        nullptr, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_BACKGROUND, g_param_spec_uint("background", "Background",
                                             "Colour where nothing contributes, 0xAARRGGBB (alpha is ignored)", 0,
                                             G_MAXUINT32, 0xff000000, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_POST_MESSAGES, g_param_spec_boolean("post-messages", "Post messages",
                                                   "Post an element message \"lightfield-view\" for every picture",
                                                   FALSE, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_INCOMPLETE,
          g_param_spec_enum(
              "incomplete", "Incomplete", "What is put out for a request of which something is missing at its deadline",
              LF_TYPE_COMPOSITOR_INCOMPLETE, LF_COMPOSITOR_INCOMPLETE_CONCEAL, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(
      PROP_MAX_MISSED,
      g_param_spec_uint("max-missed", "Max missed",
                        "Live, a camera that is missing from more pictures in a row is announced upstream as out of "
                        "service, and a node that is is not waited for, until they answer in time again (0: never)",
                        0, G_MAXUINT, kDefaultMaxMissed, flags(GST_PARAM_MUTABLE_READY)));
  install(PROP_PARTIAL,
          g_param_spec_boolean("partial", "Partial",
                               "Put out the sum of the answers as one answer for the next compositor of a tree, in "
                               "place of a picture; needs `rig`",
                               FALSE, flags(GST_PARAM_MUTABLE_READY)));
  install(PROP_NODE, g_param_spec_uint("node", "Node", "Number carried in partial answers, as that of a node", 0,
                                       G_MAXUINT, 0, flags(GST_PARAM_MUTABLE_READY)));
  install(PROP_CODEC,
          g_param_spec_enum("codec", "Codec", "How pixels travel in partial answers", LF_TYPE_FRAGMENT_CODEC,
                            static_cast<gint>(lf::CodecChoice::kAuto), flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_FOCUS,
          g_param_spec_enum("focus", "Focus",
                            "What pictures are focused on. Other than on a plane, the focal surface is found from what "
                            "the cameras have in common on trial surfaces, and the view's lfviewrequest is told of it. "
                            "Without `rig` auto is plane",
                            LF_TYPE_COMPOSITOR_FOCUS, static_cast<gint>(lf::FocusMode::kAuto),
                            flags(GST_PARAM_MUTABLE_PLAYING)));
  const auto install_distance = [&](guint id, const char* name, const char* nick, const char* blurb) {
    install(id, g_param_spec_double(name, nick, blurb, 0, kMaxFocus, 0, flags(GST_PARAM_MUTABLE_PLAYING)));
  };
  install_distance(PROP_FOCUS_NEAR, "focus-near", "Focus near",
                   "Nearest that a focal surface can be, metres from the array (0: at first 0.4 times the distance "
                   "of the viewer's focal plane, then as the scene asks)");
  install_distance(PROP_FOCUS_FAR, "focus-far", "Focus far",
                   "Farthest that a focal surface can be, metres from the array (0: at first 4 times the distance "
                   "of the viewer's focal plane, then as the scene asks)");
  install(PROP_MONITOR_INTERVAL,
          g_param_spec_uint("monitor-interval", "Monitor interval",
                            "Beside one of so many requests a camera, each in turn, is left out and predicted from the "
                            "others, in a small view: `stats` tell how well, and which cameras stand out (0: never). "
                            "Needs `rig`",
                            0, G_MAXUINT16, 0, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_TRIAL_INTERVAL,
          g_param_spec_uint("trial-interval", "Trial interval",
                            "At most one of so many requests has trials, by which a focal surface is found: more where "
                            "time is short and the surface may follow the scene more slowly",
                            1, G_MAXUINT16, 1, flags(GST_PARAM_MUTABLE_PLAYING)));
  install(PROP_GAINS, g_param_spec_boolean(
                          "gains", "Gains",
                          "Let cameras match their brightness to that of the others; with focus surface or auto. The "
                          "lffragments' stats have each camera's gain",
                          TRUE, flags(GST_PARAM_MUTABLE_PLAYING)));
  lf::RequestGuard::install(klass, PROP_FIRST_LIMIT, false);
  install(
      PROP_STATS,
      g_param_spec_boxed(
          "stats", "Statistics",
          "Counts of pictures (complete, incomplete, unseen: no camera sees anything of the view, repeated, dropped), "
          "requests skipped (too late to be shown, as QoS events say), requests refused for one of the limits "
          "(refused, "
          "and of these refused-pixels, -aperture, -trials, -rate, -views), "
          "coverage (share of the latest view that cameras can see; with `rig`), fragments (missing, damaged), late, "
          "repeated, stray (to requests that nobody has asked) and bad answers, pictures that failed (no memory), "
          "bytes, cameras out of service; the largest skew; of a focal surface: rounds of "
          "trials, their bytes, how far cameras disagree (residual, 255ths) and by how much the last round lessened "
          "it (gained), requests from one with trials to the next (interval), whether one plane is enough (flat); of "
          "the monitor: "
          "turns of cameras, their bytes, for each camera the PSNR, gain and shift (pixels of the small view) of its "
          "prediction, and suspects with their fault (colour, direction, picture); "
          "latency per stage (p50, p95, "
          "p99 over the latest 1024 pictures, nanoseconds)",
          GST_TYPE_STRUCTURE, GParamFlags(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_INCOMPLETE, GstPluginAPIFlags(0));
  gst_type_mark_as_plugin_api(LF_TYPE_COMPOSITOR_FOCUS, GstPluginAPIFlags(0));
}
