// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfviewsrc
 * @title: lfviewsrc
 * @short_description: a view of a light field as a source of video, with everything that it takes inside
 *
 * A bin of an #element-lfviewrequest ("view"), an #element-lfcompositor ("compositor") and the cameras: those of the
 * rig that are on this machine as one #element-lfcameranode ("node"), or, with `nodes`, those of other hosts, which are
 * reached by RTP and run #element-lfnodesink. Mouse and keys in a window behind it fly. Its properties are those of
 * view and compositor; other children's are set as those of any bin's (`lfviewsrc node::cameras=0-15 ...`).
 *
 * Each request pad `src_%u` is a further viewer of the same cameras, which has an lfviewrequest and an lfcompositor of
 * its own ("view_0", "compositor_0" of `src_0`). It begins with the settings of the bin, but with a view of its own
 * that stands in the middle of the array. Viewers come and go while everything runs, and none waits for another.
 * Pictures of a pad that is not linked are dropped.
 *
 * Cameras are live unless `is-live` is false, which makes pictures as fast as they are taken and ends with the views of
 * `location`. Films begin again at their end, but with `node::loop=false`.
 *
 * With `nodes` the pipeline runs by the machine's realtime clock, which those hosts have to share (chrony, PTP), unless
 * something else in it gives a clock.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json ! videoconvert ! autovideosink
 * ]| A window in which mouse and keys fly.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json location=views.json is-live=false ! videoconvert ! pngenc ! \
 *   multifilesink location=out_%02d.png
 * ]| Pictures of the views in a file.
 * |[
 * gst-launch-1.0 lfviewsrc name=v rig=rig.json width=640 height=480  v.src ! queue ! videoconvert ! autovideosink \
 *   v.src_0 ! queue ! videoconvert ! autovideosink
 * ]| Two viewers, each with a window.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json nodes=camhost0:6000:6100,camhost1:6000:6101 ! videoconvert ! autovideosink
 * ]| The cameras of two other hosts.
 */

#include "lfviewsrc.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "base/error.h"
#include "common.h"
#include "lfcompositor.h"
#include "lfviewrequest.h"
#include "property_copy.h"
#include "rtp_link.h"
#include "view_control.h"
#include "viewer_cameras.h"

GST_DEBUG_CATEGORY_STATIC(lf_view_src_debug);
#define GST_CAT_DEFAULT lf_view_src_debug

namespace {

enum { PROP_0, PROP_RIG, PROP_NODES, PROP_IS_LIVE, PROP_FIRST_COPY };

// Of one viewer and no other.
constexpr std::array kOwnProperties = {"location", "loop", "eye-offset", "num-buffers"};

bool is_own(const char* name) {
  return std::ranges::any_of(kOwnProperties, [name](const char* own) { return g_str_equal(own, name); }) ||
         std::ranges::any_of(lf::kViewFields, [name](const lf::ViewField& f) { return g_str_equal(f.name, name); });
}

struct Viewer {
  Viewer(GstBin* bin, guint view_id, const std::string& ending) : chain(bin, view_id, ending) {}
  lf::ViewerChain chain;
  std::unique_ptr<lf::RequestedPads> pads;  // that link it with the cameras
};

}  // namespace

struct _LfViewSrc {
  GstBin parent;
  // Under the object lock.
  gchar *rig, *nodes;
  gboolean is_live;

  GstElement *view, *compositor;  // of `src`: children; null where the elements are not installed
  // What is inside, under its own lock, which is taken before any other: bins tell applications of children.
  struct Inside {
    std::recursive_mutex mutex;
    std::map<std::string, std::shared_ptr<Viewer>> viewers;  // by the name of their pad
    guint next_view_id = 0;                                  // of a closed viewer there may still be answers
    std::unique_ptr<lf::ViewerCameras> cameras;
    std::string nodes;             // that `cameras` were made for
    GstClock* realtime = nullptr;  // made when it is asked for
  } * inside;
};

static void lf_view_src_uri_handler_init(gpointer iface, gpointer);

G_DEFINE_FINAL_TYPE_WITH_CODE(LfViewSrc, lf_view_src, GST_TYPE_BIN,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, lf_view_src_uri_handler_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewsrc, "lfviewsrc", GST_RANK_NONE, LF_TYPE_VIEW_SRC,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_src_debug, "lfviewsrc", 0,
                                                              "view of a light field"))

static std::string text_property(LfViewSrc* self, gchar* const* text) {
  GST_OBJECT_LOCK(self);
  const std::string copy = *text ? *text : "";
  GST_OBJECT_UNLOCK(self);
  return copy;
}

static bool is_live(LfViewSrc* self) {
  GST_OBJECT_LOCK(self);
  const bool live = self->is_live;
  GST_OBJECT_UNLOCK(self);
  return live;
}

static GstElement* find_node(LfViewSrc* self) { return gst_bin_get_by_name(GST_BIN(self), "node"); }

// Of lfcameranode what is the bin's to say.
static void set_node(LfViewSrc* self) {
  GstElement* node = find_node(self);
  if (!node) return;
  const std::string rig = text_property(self, &self->rig);
  g_object_set(node, "is-live", is_live(self), "rig", rig.empty() ? nullptr : rig.c_str(), nullptr);
  gst_object_unref(node);
}

// Other cameras for all viewers. While nothing runs. Throws Error.
static void change_cameras(LfViewSrc* self, const std::string& nodes) {
  auto& inside = *self->inside;
  for (auto& [name, viewer] : inside.viewers) {
    viewer->pads.reset();
    viewer->chain.drop_answers();
  }
  inside.cameras.reset();
  const std::vector<lf::NodeAddress> addresses = lf::parse_nodes(nodes);
  inside.cameras = addresses.empty() ? lf::cameras_here(GST_BIN(self)) : lf::cameras_on_hosts(GST_BIN(self), addresses);
  inside.nodes = nodes;
  if (GstElement* node = find_node(self)) {
    g_object_set(node, "loop", TRUE, nullptr);
    gst_object_unref(node);
  }
  for (auto& [name, viewer] : inside.viewers) viewer->pads = inside.cameras->connect(viewer->chain);
  set_node(self);
}

// Before READY and before PAUSED. False after posting the reason.
static bool prepare(LfViewSrc* self) {
  const std::lock_guard lock(self->inside->mutex);
  const std::string rig = text_property(self, &self->rig), nodes = text_property(self, &self->nodes);
  try {
    if (rig.empty()) throw lf::Error("rig: not set");
    lf::shared_rig(rig);
    if (!nodes.empty() && !is_live(self))
      throw lf::Error("nodes: cameras of other hosts are live, is-live must be true");
    if (!self->view) throw lf::Error("elements lfviewrequest and lfcompositor are not installed");
    try {
      if (!self->inside->cameras || self->inside->nodes != nodes) change_cameras(self, nodes);
    } catch (const lf::Error& error) {
      throw lf::Error((nodes.empty() ? "" : "nodes: ") + std::string(error.what()));
    }
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
}

// While it runs a node may have other cameras, and not take the rig: then nobody does.
static void lf_view_src_set_rig(LfViewSrc* self, const gchar* path) {
  const std::lock_guard lock(self->inside->mutex);
  if (GstElement* node = find_node(self)) {
    g_object_set(node, "rig", path, nullptr);
    g_autofree gchar* taken = nullptr;
    g_object_get(node, "rig", &taken, nullptr);
    gst_object_unref(node);
    if (g_strcmp0(taken, path) != 0) return;
  }
  for (auto& [name, viewer] : self->inside->viewers) {
    g_object_set(viewer->chain.view(), "rig", path, nullptr);
    g_object_set(viewer->chain.compositor(), "rig", path, nullptr);
  }
  GST_OBJECT_LOCK(self);
  g_free(self->rig);
  self->rig = g_strdup(path);
  GST_OBJECT_UNLOCK(self);
}

static void lf_view_src_set_live(LfViewSrc* self, gboolean live) {
  const std::lock_guard lock(self->inside->mutex);
  GST_OBJECT_LOCK(self);
  self->is_live = live;
  GST_OBJECT_UNLOCK(self);
  for (auto& [name, viewer] : self->inside->viewers) viewer->chain.set_live(live);
  set_node(self);
}

static GstElement* owner_of(LfViewSrc* self, GParamSpec* copy) {
  return lf::is_copy(copy, LF_TYPE_VIEW_REQUEST) ? self->view : self->compositor;
}

static void lf_view_src_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  switch (id) {
    case PROP_RIG: return lf_view_src_set_rig(self, g_value_get_string(value));
    case PROP_IS_LIVE: return lf_view_src_set_live(self, g_value_get_boolean(value));
    case PROP_NODES:
      GST_OBJECT_LOCK(self);
      g_free(self->nodes);
      self->nodes = g_value_dup_string(value);
      GST_OBJECT_UNLOCK(self);
      return;
    default:
      if (GstElement* owner = owner_of(self, pspec)) g_object_set_property(G_OBJECT(owner), pspec->name, value);
  }
}

static void lf_view_src_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  if (id >= PROP_FIRST_COPY) {
    if (GstElement* owner = owner_of(self, pspec)) g_object_get_property(G_OBJECT(owner), pspec->name, value);
    return;
  }
  GST_OBJECT_LOCK(self);
  switch (id) {
    case PROP_RIG: g_value_set_string(value, self->rig); break;
    case PROP_NODES: g_value_set_string(value, self->nodes); break;
    case PROP_IS_LIVE: g_value_set_boolean(value, self->is_live); break;
    default: G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, pspec);
  }
  GST_OBJECT_UNLOCK(self);
}

// What the viewers of a bin have in common goes over to one more.
static void copy_settings(LfViewSrc* self, const lf::ViewerChain& to) {
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(self), &count);
  for (guint i = 0; i < count; i++) {
    GParamSpec* spec = specs[i];
    if (!lf::is_copy(spec) || !(spec->flags & G_PARAM_WRITABLE) || is_own(spec->name)) continue;
    const bool of_view = lf::is_copy(spec, LF_TYPE_VIEW_REQUEST);
    GValue value = G_VALUE_INIT;
    g_object_get_property(G_OBJECT(self), spec->name, &value);
    g_object_set_property(G_OBJECT(of_view ? to.view() : to.compositor()), spec->name, &value);
    g_value_unset(&value);
  }
}

// The viewer whose pictures leave by the pad `name`. Throws Error.
static std::shared_ptr<Viewer> add_viewer(LfViewSrc* self, const std::string& name) {
  auto& inside = *self->inside;
  const std::string ending = name.substr(sizeof("src") - 1);
  const auto viewer = std::make_shared<Viewer>(GST_BIN(self), inside.next_view_id++, ending);
  inside.viewers[name] = viewer;
  const std::string rig = text_property(self, &self->rig);
  if (!rig.empty()) {
    g_object_set(viewer->chain.view(), "rig", rig.c_str(), nullptr);
    g_object_set(viewer->chain.compositor(), "rig", rig.c_str(), nullptr);
  }
  viewer->chain.set_live(is_live(self));
  return viewer;
}

static GstPad* add_ghost_pad(LfViewSrc* self, const Viewer& viewer, const char* name, const char* template_name) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), template_name);
  GstPad* target = viewer.chain.pictures();
  GstPad* pad = gst_ghost_pad_new_from_template(name, target, templ);
  gst_object_unref(target);
  if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  return pad;
}

static GstPad* lf_view_src_new_pad(GstElement* element, GstPadTemplate*, const gchar* wanted, const GstCaps*) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  auto& inside = *self->inside;
  std::string name = wanted ? wanted : "";
  for (guint number = 0; name.empty() || (!wanted && inside.viewers.contains(name)); number++)
    name = "src_" + std::to_string(number);
  if (!self->view || inside.viewers.contains(name)) return nullptr;
  try {
    const std::shared_ptr<Viewer> viewer = add_viewer(self, name);
    copy_settings(self, viewer->chain);
    if (inside.cameras) viewer->pads = inside.cameras->connect(viewer->chain);
    GstPad* pad = add_ghost_pad(self, *viewer, name.c_str(), "src_%u");
    viewer->chain.sync_state();
    return pad;
  } catch (const lf::Error& error) {
    GST_ERROR_OBJECT(self, "no pad %s: %s", name.c_str(), error.what());
    return nullptr;
  }
}

namespace {

struct Closing {
  std::shared_ptr<Viewer> viewer;
  GstPad* pad;
};

void close_viewer(GstElement*, gpointer data) {
  auto& [viewer, pad] = *static_cast<Closing*>(data);
  viewer->chain.close([&] { viewer->pads.reset(); });
  gst_pad_set_active(pad, FALSE);
}

void free_closing(gpointer data) {
  Closing* closing = static_cast<Closing*>(data);
  gst_object_unref(closing->pad);
  delete closing;
}

}  // namespace

// The viewer stops in another thread: this may be one of its own, in a probe, or somebody may hold its last picture.
static void lf_view_src_release_pad(GstElement* element, GstPad* pad) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  const auto found = self->inside->viewers.find(GST_PAD_NAME(pad));
  if (found == self->inside->viewers.end()) {  // the element itself goes, see dispose
    gst_element_remove_pad(element, pad);
    return;
  }
  Closing* closing = new Closing{found->second, GST_PAD(gst_object_ref(pad))};
  self->inside->viewers.erase(found);
  gst_ghost_pad_set_target(GST_GHOST_PAD(pad), nullptr);
  gst_element_remove_pad(element, pad);
  closing->viewer->chain.take_out();
  gst_element_call_async(element, close_viewer, closing, free_closing);
}

// Hosts name capture times by the time of day. Null where the cameras are here.
static GstClock* hosts_clock(LfViewSrc* self) {
  const std::lock_guard lock(self->inside->mutex);
  if (self->inside->nodes.empty()) return nullptr;
  if (!self->inside->realtime) self->inside->realtime = lf::new_realtime_clock();
  return GST_CLOCK(gst_object_ref(self->inside->realtime));
}

static GstClock* lf_view_src_provide_clock(GstElement* element) {
  GstClock* clock = GST_ELEMENT_CLASS(lf_view_src_parent_class)->provide_clock(element);
  return clock ? clock : hosts_clock(LF_VIEW_SRC(element));
}

static GstStateChangeReturn lf_view_src_change_state(GstElement* element, GstStateChange transition) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const bool starts = transition == GST_STATE_CHANGE_NULL_TO_READY || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts && !prepare(self)) return GST_STATE_CHANGE_FAILURE;
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_view_src_parent_class)->change_state(element, transition);
  // A pipeline asks once, unless it is told that there is something new; other runs may have other cameras.
  const bool begun = transition == GST_STATE_CHANGE_READY_TO_PAUSED && result != GST_STATE_CHANGE_FAILURE;
  if (!begun && transition != GST_STATE_CHANGE_PAUSED_TO_READY) return result;
  if (GstClock* clock = hosts_clock(self)) {
    gst_element_post_message(element, begun ? gst_message_new_clock_provide(GST_OBJECT(element), clock, TRUE)
                                            : gst_message_new_clock_lost(GST_OBJECT(element), clock));
    gst_object_unref(clock);
  }
  return result;
}

// What goes upstream, such as a key that an application presses, comes in behind the pictures of `src`.
static gboolean lf_view_src_send_event(GstElement* element, GstEvent* event) {
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_DOWNSTREAM)
    return GST_ELEMENT_CLASS(lf_view_src_parent_class)->send_event(element, event);
  GstPad* pad = gst_element_get_static_pad(element, "src");
  const gboolean done = gst_pad_send_event(pad, event);
  gst_object_unref(pad);
  return done;
}

static gboolean lf_view_src_set_view(LfViewSrc* self, const GstStructure* structure) {
  gboolean done = FALSE;
  if (self->view) g_signal_emit_by_name(self->view, "set-view", structure, &done);
  return done;
}

static gboolean lf_view_src_focus_at(LfViewSrc* self, gdouble x, gdouble y) {
  gboolean done = FALSE;
  if (self->view) g_signal_emit_by_name(self->view, "focus-at", x, y, &done);
  return done;
}

static void lf_view_src_dispose(GObject* object) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  for (auto& [name, viewer] : self->inside->viewers) viewer->pads.reset();
  self->inside->cameras.reset();
  self->inside->viewers.clear();
  self->view = self->compositor = nullptr;
  G_OBJECT_CLASS(lf_view_src_parent_class)->dispose(object);
}

static void lf_view_src_finalize(GObject* object) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  gst_clear_object(&self->inside->realtime);
  delete self->inside;
  g_free(self->rig);
  g_free(self->nodes);
  G_OBJECT_CLASS(lf_view_src_parent_class)->finalize(object);
}

static GstURIType lf_view_src_uri_type(GType) { return GST_URI_SRC; }

static const gchar* const* lf_view_src_protocols(GType) {
  static const gchar* const protocols[] = {"lf", nullptr};
  return protocols;
}

static gchar* lf_view_src_uri(GstURIHandler* handler) {
  const std::string rig = text_property(LF_VIEW_SRC(handler), &LF_VIEW_SRC(handler)->rig);
  if (rig.empty()) return nullptr;
  g_autofree gchar* whole = g_canonicalize_filename(rig.c_str(), nullptr);
  g_autofree gchar* escaped = g_uri_escape_string(whole, G_URI_RESERVED_CHARS_ALLOWED_IN_PATH, FALSE);
  return g_strconcat("lf://", escaped, nullptr);
}

static gboolean lf_view_src_set_uri(GstURIHandler* handler, const gchar* uri, GError** error) {
  g_autofree gchar* path = gst_uri_get_location(uri);
  if (!path || path[0] != '/') {
    g_set_error(error, GST_URI_ERROR, GST_URI_ERROR_BAD_URI, "%s: must be lf:///path/of/rig.json", uri);
    return FALSE;
  }
  g_object_set(handler, "rig", path, nullptr);
  return TRUE;
}

static void lf_view_src_uri_handler_init(gpointer iface, gpointer) {
  GstURIHandlerInterface* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = lf_view_src_uri_type;
  handler->get_protocols = lf_view_src_protocols;
  handler->get_uri = lf_view_src_uri;
  handler->set_uri = lf_view_src_set_uri;
}

static void lf_view_src_install_properties(GObjectClass* klass) {
  constexpr int kBoth = G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS;
  constexpr auto kReady = GParamFlags(kBoth | GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      klass, PROP_RIG,
      g_param_spec_string("rig", "Rig",
                          "Rig file (rig.json) of the array; required. Set while running, it is read again and serves "
                          "from the next request on, if it has the same cameras with the same sources",
                          nullptr, GParamFlags(kBoth | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property(
      klass, PROP_NODES,
      g_param_spec_string(
          "nodes", "Nodes",
          "Hosts that the cameras are on (lfnodesink): HOST:PORT-THERE:PORT-HERE,..., with the ports "
          "for requests there and for answers here. They are live (empty: all cameras are on this machine)",
          nullptr, kReady));
  g_object_class_install_property(klass, PROP_IS_LIVE,
                                  g_param_spec_boolean("is-live", "Is live",
                                                       "Pictures come in time with the clock, of frames that live "
                                                       "cameras make, in place of as fast as they are taken",
                                                       TRUE, kReady));
  const guint next = lf::install_copies(klass, PROP_FIRST_COPY, LF_TYPE_VIEW_REQUEST,
                                        {"rig", "view-id", "is-live", "navigation-from", "access"}, {"num-buffers"});
  lf::install_copies(klass, next, LF_TYPE_COMPOSITOR, {"rig", "view-id", "partial", "node", "codec"}, {"latency"});
}

// Of what lfcompositor puts out the pictures.
static void lf_view_src_install_pads(GstElementClass* klass) {
  GstElementClass* compositor = GST_ELEMENT_CLASS(g_type_class_ref(LF_TYPE_COMPOSITOR));
  GstCaps* all = gst_pad_template_get_caps(gst_element_class_get_pad_template(compositor, "src"));
  GstCaps* video = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(all); i++) {
    const GstStructure* structure = gst_caps_get_structure(all, i);
    if (gst_structure_has_name(structure, "video/x-raw"))
      gst_caps_append_structure(video, gst_structure_copy(structure));
  }
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, video));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src_%u", GST_PAD_SRC, GST_PAD_REQUEST, video));
  gst_caps_unref(video);
  gst_caps_unref(all);
  g_type_class_unref(compositor);
}

static void lf_view_src_class_init(LfViewSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = lf_view_src_set_property;
  object_class->get_property = lf_view_src_get_property;
  object_class->dispose = lf_view_src_dispose;
  object_class->finalize = lf_view_src_finalize;
  lf_view_src_install_properties(object_class);

  /**
   * LfViewSrc::set-view:
   * @src: the element
   * @view: as of lfviewrequest
   *
   * Moves the view of `src`, as the same action of lfviewrequest does. That of `src_0` is moved by its child "view_0".
   *
   * Returns: %FALSE if nothing of @view is known.
   */
  g_signal_new_class_handler("set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf_view_src_set_view), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN, 1,
                             GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);
  /**
   * LfViewSrc::focus-at:
   * @src: the element
   * @x: pixels of the view, from the middle of its first one
   * @y: the same
   *
   * Focuses the view of `src` at a pixel, as the same action of lfviewrequest does.
   *
   * Returns: %FALSE if that can't be.
   */
  g_signal_new_class_handler("focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf_view_src_focus_at), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN, 2,
                             G_TYPE_DOUBLE, G_TYPE_DOUBLE);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf_view_src_change_state;
  element_class->provide_clock = lf_view_src_provide_clock;
  element_class->request_new_pad = lf_view_src_new_pad;
  element_class->release_pad = lf_view_src_release_pad;
  element_class->send_event = lf_view_src_send_event;
  lf_view_src_install_pads(element_class);
  gst_element_class_set_static_metadata(
      element_class, "Light field view source", "Source/Video",
      "A view of a light field, flown with mouse and keys: lfviewrequest, the cameras of a rig and lfcompositor in one",
      "gst-lightfield");
}

static void lf_view_src_init(LfViewSrc* self) {
  self->is_live = TRUE;
  self->inside = new _LfViewSrc::Inside;
  // Requests to hosts leave by a sink, which is none of the pipeline's.
  gst_bin_set_suppressed_flags(GST_BIN(self), GST_ELEMENT_FLAG_SINK);
  try {
    const std::shared_ptr<Viewer> viewer = add_viewer(self, "src");
    self->view = viewer->chain.view();
    self->compositor = viewer->chain.compositor();
    lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->view));
    lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->compositor));
    add_ghost_pad(self, *viewer, "src", "src");
    change_cameras(self, "");
  } catch (const lf::Error& error) {
    GST_WARNING_OBJECT(self, "%s", error.what());
  }
}
