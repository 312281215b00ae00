// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lffragment
 * @title: lffragment
 * @short_description: the random access camera: answers view requests with its cameras' fragments
 *
 * Takes the video of one or more cameras of a rig on its `sink_%u` pads and view requests on `request`. Each request is
 * answered with one buffer on `src`: every camera's own weighted contribution to the requested view, warped through the
 * requested focal plane, in a tight rectangle. `lfcompositor` adds the fragments up. Further requesters use the pads
 * `request_%u`, each paired with a `src_%u`.
 *
 * With `access` the cameras are those of the paper's section 4.2 that know less: they take their part from warp or
 * pixel commands, which `lfviewrequest access=` sends behind its requests, and leave the requests themselves alone. Of
 * `rig` only their lenses count then, or only the sizes of their images.
 *
 * JPEG video is kept as it comes and decoded only where a request looks. Damaged frames are dropped and counted; the
 * one before serves in their place.
 *
 * Live cameras are never waited for: the frame nearest to the requested capture time is used, if it is not farther
 * than `max-skew`. A warning tells when a camera comes to be off by more than a frame. Frames of other cameras
 * (files) are waited for, so that files in give the same files out on every machine, and are read no faster than
 * requests move on. Where requests are sought, they are too.
 *
 * Requests whose pictures would come too late to be shown, as QoS events say that lfcompositor passes on, are answered
 * without fragments.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lffragment name=n rig=rig.json ! c.sink_0  lfcamsrc rig=rig.json camera=0 ! n.sink_0 \
 *   lfcamsrc rig=rig.json camera=1 ! n.sink_1  lfcamsrc rig=rig.json camera=8 ! n.sink_2 \
 *   r. ! queue ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]|
 *
 * ## Element messages
 * With `post-messages` an element message "lightfield-answer" per answer: view-id, sequence (uint), pts (uint64),
 * fragments (uint), bytes, and what it took: wait-ns (for frames of the time asked for), decode-ns, render-ns,
 * encode-ns (uint64).
 */

#include "fragment/lffragment.h"

#include <cstring>

#include "base/error.h"
#include "common/common.h"
#include "fragment/lffragment_private.h"

GST_DEBUG_CATEGORY(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

namespace {

using Settings = lf::FragmentSettings;

GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST,
                            GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_CAMERA_FORMATS " }") "; image/jpeg"));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate more_request_template =
    GST_STATIC_PAD_TEMPLATE("request_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_CAPS));
GstStaticPadTemplate more_src_template =
    GST_STATIC_PAD_TEMPLATE("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(LF_ANSWER_CAPS));
}  // namespace

bool lf_fragment_upstream_is_live(GstPad* sink, GstClockTime* latency) {
  GstQuery* query = gst_query_new_latency();
  gboolean live = FALSE;
  if (gst_pad_peer_query(sink, query)) gst_query_parse_latency(query, &live, latency, nullptr);
  gst_query_unref(query);
  return live;
}

void lf_fragment_set_mode(LfFragment* self, lf::CameraFrames::Mode mode) {
  lf::ObjectLock lock(self);
  self->mode = mode;
  for (GList* item = GST_ELEMENT(self)->sinkpads; item; item = item->next) {
    if (!LF_IS_FRAGMENT_PAD(item->data)) continue;
    auto& input = *LF_FRAGMENT_PAD(item->data)->input;
    input.frames->set_mode(mode);
    if (mode == lf::CameraFrames::Mode::kRunning) self->node->inputs().add(input.frames);
  }
  lock.unlock();
  self->node->inputs().set_running(mode == lf::CameraFrames::Mode::kRunning);
}

// The camera pads' properties, for gst-launch's `sink_0::camera=5`.
static GObject* lf_fragment_child_by_index(GstChildProxy* proxy, guint index) {
  GObject* child = nullptr;
  GST_OBJECT_LOCK(proxy);
  for (GList* item = GST_ELEMENT(proxy)->sinkpads; item && !child; item = item->next)
    if (LF_IS_FRAGMENT_PAD(item->data) && index-- == 0) child = G_OBJECT(gst_object_ref(item->data));
  GST_OBJECT_UNLOCK(proxy);
  return child;
}

static guint lf_fragment_children_count(GstChildProxy* proxy) {
  guint count = 0;
  GST_OBJECT_LOCK(proxy);
  for (GList* item = GST_ELEMENT(proxy)->sinkpads; item; item = item->next) count += LF_IS_FRAGMENT_PAD(item->data);
  GST_OBJECT_UNLOCK(proxy);
  return count;
}

static void lf_fragment_child_proxy_init(gpointer iface, gpointer) {
  GstChildProxyInterface* proxy = static_cast<GstChildProxyInterface*>(iface);
  proxy->get_child_by_index = lf::callback<lf_fragment_child_by_index>;
  proxy->get_children_count = lf::callback<lf_fragment_children_count>;
}

G_DEFINE_FINAL_TYPE_WITH_CODE(LfFragment, lf_fragment, GST_TYPE_ELEMENT,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_CHILD_PROXY, lf_fragment_child_proxy_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lffragment, "lffragment", GST_RANK_NONE, LF_TYPE_FRAGMENT,
                                      GST_DEBUG_CATEGORY_INIT(lf_fragment_debug, "lffragment", 0,
                                                              "random access camera"))

enum { PROP_0, PROP_STATS, PROP_FIRST_LIMIT, PROP_FIRST_SETTING = PROP_FIRST_LIMIT + lf::RequestGuard::kNumProperties };

lf::FragmentSettings lf_fragment_settings(LfFragment* self) {
  const lf::ObjectLock lock(self);
  return *self->settings;
}

// While the element runs the file is read at once, and serves from the next request on. False if it can't be.
static bool lf_fragment_reload_rig(LfFragment* self, const gchar* path) {
  const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
  if (!rig) return false;
  const std::string problem = self->node->inputs().set_rig(rig);
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s: %s, of which this node has the video: it is left out.", path, problem.c_str()),
                        (nullptr));
  return true;
}

static bool is_limit(guint id) { return id >= PROP_FIRST_LIMIT && id < PROP_FIRST_SETTING; }
static lf::RequestGuard::Property limit_of(guint id) {
  return static_cast<lf::RequestGuard::Property>(id - PROP_FIRST_LIMIT);
}

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  if (is_limit(id)) return self->guard->set(limit_of(id), value);
  if (lf::is_named(pspec, "rig") && lf::is_running(GST_ELEMENT(self)) &&
      !lf_fragment_reload_rig(self, g_value_get_string(value)))
    return;
  lf::ObjectLock lock(self);
  Settings::properties().set(*self->settings, id, value);
  lock.unlock();
}

static void lf_fragment_get_property(GObject* object, guint id, GValue* value, GParamSpec*) {
  LfFragment* self = LF_FRAGMENT(object);
  if (is_limit(id)) return self->guard->get(limit_of(id), value);
  if (id != PROP_STATS) return Settings::properties().get(lf_fragment_settings(self), id, value);
  GstStructure* stats = self->node->stats().structure();
  self->guard->add_stats(stats);
  g_value_take_boxed(value, stats);
}

static guint number_of(const gchar* name, const gchar* prefix, guint* next) {
  guint number = *next;
  if (name && g_str_has_prefix(name, prefix))
    number = static_cast<guint>(g_ascii_strtoull(name + strlen(prefix), nullptr, 10));
  *next = MAX(*next, number + 1);
  return number;
}

static GstPad* lf_fragment_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar* name,
                                           const GstCaps*) {
  LfFragment* self = LF_FRAGMENT(element);
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(element);
  if (templ == gst_element_class_get_pad_template(klass, "request_%u")) {
    const guint number = number_of(name, "request_", &self->next_pair);
    g_autofree gchar* request_name = g_strdup_printf("request_%u", number);
    g_autofree gchar* src_name = g_strdup_printf("src_%u", number);
    return lf_fragment_pair_new(self, templ, request_name, gst_element_class_get_pad_template(klass, "src_%u"),
                                src_name);
  }
  g_autofree gchar* pad_name = g_strdup_printf("sink_%u", number_of(name, "sink_", &self->next_camera_pad));
  GST_OBJECT_LOCK(self);
  const lf::CameraFrames::Mode mode = self->mode;
  GST_OBJECT_UNLOCK(self);
  GstPad* pad = lf_fragment_camera_pad_new(templ, pad_name, mode);
  if (mode == lf::CameraFrames::Mode::kRunning) self->node->inputs().add(LF_FRAGMENT_PAD(pad)->input->frames);
  if (lf::is_running(element)) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(element, pad);
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), pad_name);
  return pad;
}

static void lf_fragment_release_pad(GstElement* element, GstPad* pad) {
  LfFragment* self = LF_FRAGMENT(element);
  if (LF_IS_FRAGMENT_PAD(pad)) {
    // Only when its streaming thread is out nothing of it comes back.
    auto& input = *LF_FRAGMENT_PAD(pad)->input;
    input.frames->set_mode(lf::CameraFrames::Mode::kStopped);
    gst_pad_set_active(pad, FALSE);
    self->node->inputs().remove(input.frames);
    gst_child_proxy_child_removed(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_PAD_NAME(pad));
    gst_element_remove_pad(element, pad);
    return;
  }
  lf_fragment_pair_release(self, pad);
}

// A camera that the application names counts from the start on: its weight is lost in a sum until it has a frame.
static gboolean lf_fragment_assign_named_camera(GstElement* element, GstPad* pad, gpointer) {
  if (!LF_IS_FRAGMENT_PAD(pad) || LF_FRAGMENT_PAD(pad)->camera < 0) return TRUE;
  return lf_fragment_assign_camera(LF_FRAGMENT(element), LF_FRAGMENT_PAD(pad));
}

static bool lf_fragment_start(LfFragment* self) {
  const Settings settings = lf_fragment_settings(self);
  if (settings.rig.empty()) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("No rig file given: set the property \"rig\"."), (nullptr));
    return false;
  }
  try {
    self->node->inputs().set_rig(lf::shared_rig(settings.rig));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
  self->node->set_node_id(settings.node);
  self->node->inputs().forget_family();
  self->guard->clear();
  GST_OBJECT_LOCK(self);
  for (PadPair* pair : *self->pairs) {
    pair->ended = pair->flushed = false;
    pair->last_time = pair->told_delay = pair->told_at = pair->looked_at = 0;
    pair->segment = {};
    pair->qos.clear();
    pair->requester.rig.reset();
    *pair->requester.cancelled = false;
  }
  GST_OBJECT_UNLOCK(self);
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  if (gst_element_foreach_sink_pad(GST_ELEMENT(self), lf_fragment_assign_named_camera, nullptr)) return true;
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  return false;
}

static gboolean lf_fragment_reset_camera_pad(GstElement* element, GstPad* pad, gpointer) {
  if (LF_IS_FRAGMENT_PAD(pad)) lf_fragment_camera_pad_reset(LF_FRAGMENT(element), LF_FRAGMENT_PAD(pad));
  return TRUE;
}

static GstStateChangeReturn lf_fragment_change_state(GstElement* element, GstStateChange transition) {
  LfFragment* self = LF_FRAGMENT(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !lf_fragment_start(self)) return GST_STATE_CHANGE_FAILURE;
  // Pads are deactivated by the parent class, which waits for their streaming threads: wake these first.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_fragment_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    gst_element_foreach_sink_pad(element, lf_fragment_reset_camera_pad, nullptr);
  return result;
}

static void lf_fragment_finalize(GObject* object) {
  LfFragment* self = LF_FRAGMENT(object);
  g_mutex_clear(&self->seek_lock);
  delete self->pairs;
  delete self->node;
  delete self->guard;
  delete self->card;
  delete self->workers;
  delete self->settings;
  G_OBJECT_CLASS(lf_fragment_parent_class)->finalize(object);
}

static void lf_fragment_class_init(LfFragmentClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  object_class->set_property = lf::callback<lf_fragment_set_property>;
  object_class->get_property = lf::callback<lf_fragment_get_property>;
  object_class->finalize = lf_fragment_finalize;
  element_class->change_state = lf::callback<lf_fragment_change_state>;
  element_class->request_new_pad = lf::callback<lf_fragment_request_new_pad>;
  element_class->release_pad = lf::callback<lf_fragment_release_pad>;

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

  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, LF_TYPE_FRAGMENT_PAD);
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(
      element_class, "Light field random access camera", "Filter/Video",
      "Answers view requests with the fragments that its cameras contribute to the requested view",
      "gst-lightfield developers");
  for (const GType type : {LF_TYPE_FRAGMENT_PAD, LF_TYPE_FRAGMENT_RENDERER, LF_TYPE_FRAGMENT_RESAMPLING,
                           LF_TYPE_FRAGMENT_CODEC, LF_TYPE_ACCESS})
    gst_type_mark_as_plugin_api(type, GstPluginAPIFlags(0));
}

static void lf_fragment_init(LfFragment* self) {
  g_mutex_init(&self->seek_lock);
  self->node = new lf::FragmentNode;
  self->guard = new lf::RequestGuard;
  self->settings = new Settings;
  self->card = new lf::Card();
  self->pairs = new std::set<PadPair*>;
  self->workers = new std::shared_ptr<lf::WorkerPool>(lf::WorkerPool::shared());
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(self);
  lf_fragment_pair_new(self, gst_element_class_get_pad_template(klass, "request"), "request",
                       gst_element_class_get_pad_template(klass, "src"), "src");
}
