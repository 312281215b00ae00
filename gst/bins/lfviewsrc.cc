// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfviewsrc
 * @title: lfviewsrc
 * @short_description: a light field view as a video source, with all required elements inside
 *
 * lfviewsrc renders a view of a camera array as video. Use it when one application needs cameras, renderer and viewer
 * in one element.
 *
 * The bin contains an #element-lfviewrequest ("view"), an #element-lfcompositor ("compositor") and the cameras. By
 * default the cameras belong to this machine and are one #element-lfcameranode ("node"). If `nodes` is set, the cameras
 * are on other hosts that run #element-lfnodesink, connected by RTP. A downstream window sends mouse and key events
 * that move the view.
 *
 * The bin has the properties of view and compositor. Set properties of other children as for any bin, for example
 * `lfviewsrc node::cameras=0-15`.
 *
 * Each request pad `src_%u` is another viewer of the same cameras. For example, the elements of the viewer at `src_0`
 * are called "view_0" and "compositor_0". A new viewer copies the settings of the bin and starts in the middle of the
 * array. `location`, `loop` and `num-buffers` apply to `src` only. Pads can be requested and released while the
 * pipeline runs, and a slow viewer does not delay another viewer. Pictures of unlinked pads are dropped.
 *
 * The request pads `depth_src` and `confidence_src` deliver the depths of the view at `src`, and how reliable they are
 * (#element-lfcompositor). Their pictures have the size, the pose and the time of the pictures at `src`, so the element
 * is a live source of colour and depth (RGB-D).
 *
 * If `width`, `height` or `framerate` is not set, it follows the downstream caps, even if these change while playing.
 * Views in `location` define their size in the file, and the element posts an error if downstream does not accept that
 * size. The pixel format is the format of the cameras; use `videoconvert` to convert. Each buffer has a meta that
 * describes its view (#element-lfcompositor).
 *
 * In live mode, a slow sink always receives the newest picture, because a leaky queue behind the compositor drops older
 * pictures. The search for depths therefore continues at full speed, and no further queue is needed in front of the
 * sinks.
 *
 * If `views` is set, each picture contains several views from neighbouring viewpoints: a stereo pair, a row, or a
 * quilt, which is a grid of views for light field displays (#element-lfviewrequest).
 *
 * Cameras are live by default. If `is-live=false`, the element renders as fast as downstream consumes, and the stream
 * ends after the last view of `location`. File sources loop unless `node::loop=false`.
 *
 * If `record` is set, the cameras are also recorded to disk, so that other views can be rendered later
 * (#element-lfcameranode).
 *
 * If `listen` is set, viewers on other hosts choose the views: their requests arrive by RTP, for example from
 * `lfviewrequest ! rtplfpay ! lfrtpseal ! udpsink`. `src` then shows view 0, `src_0` view 1, and so on. Use `listen` on
 * a host that renders pictures for remote viewers. If `partial` is also set, `src` delivers partial answers instead of
 * pictures: the weighted sum of the cameras, as the input of another compositor.
 *
 * If `key-file` names the same file on all hosts, packets are encrypted and authenticated (#element-lfrtpseal). Without
 * a key file, answers are accepted from the addresses of `nodes` and requests from the addresses of `peers`. Anyone on
 * the network path can then read and forge packets.
 *
 * The element handles URIs of the form lf:///path/of/rig.json. In a rig file, the source of a camera can be a launch
 * description, which can run any program. A URI can come from an untrusted page, so the element refuses URIs of rig
 * files with such sources.
 *
 * If `nodes` or `listen` is set, the bin provides the realtime clock of the machine, unless another element in the bin
 * provides a clock. Synchronise the clocks of all hosts with chrony or PTP, because requests name capture times as time
 * of day.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json ! videoconvert ! autovideosink
 * ]| Opens a window; mouse and keys move the view.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json location=views.json is-live=false ! videoconvert ! pngenc ! \
 *   multifilesink location=out_%02d.png
 * ]| Writes a PNG file for each view in a file.
 * |[
 * gst-launch-1.0 lfviewsrc name=v rig=rig.json width=640 height=480  v.src ! videoconvert ! autovideosink \
 *   v.src_0 ! videoconvert ! autovideosink
 * ]| Opens two windows with independent views.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json views=stereo ! videoconvert ! autovideosink
 * ]| Shows a stereo pair side by side.
 * |[
 * gst-launch-1.0 lfviewsrc name=v rig=rig.json focus-near=0.9 focus-far=8  v.src ! videoconvert ! autovideosink \
 *   v.depth_src ! videoconvert ! autovideosink
 * ]| Shows the view and its depths in two windows. Near objects are bright.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json nodes=CAMHOST0:6000:6100,CAMHOST1:6000:6101 ! videoconvert ! autovideosink
 * ]| Shows the cameras of two other hosts.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json record=seen ! videoconvert ! autovideosink
 * ]| Shows the view and records all cameras. Play the recording with rig=seen/rig.json.
 */

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include <gst/gst.h>

#include "base/text.h"
#include "bins/discovery.h"
#include "bins/property_proxy.h"
#include "bins/rtp_link.h"
#include "bins/viewer_chain.h"
#include "common/common.h"
#include "common/guard.h"
#include "common/properties.h"
#include "common/wall_clock.h"
#include "compositor/lfcompositor.h"
#include "fragment/lffragment.h"
#include "node/renderer_selector.h"
#include "rig/source_security.h"
#include "viewrequest/lfviewrequest.h"
#include "viewrequest/view_control.h"

GST_DEBUG_CATEGORY_STATIC(lf_view_src_debug);
#define GST_CAT_DEFAULT lf_view_src_debug

#define LF_TYPE_VIEW_SRC (lf_view_src_get_type())
G_DECLARE_FINAL_TYPE(LfViewSrc, lf_view_src, LF, VIEW_SRC, GstBin)

namespace {

struct Viewer {
  Viewer(GstBin* bin, guint view_id, const std::string& ending) : chain(bin, view_id, ending) {}
  lf::ViewerChain chain;
  std::unique_ptr<lf::RequestedPads> pads;
  std::unique_ptr<lf::RequestedPads> requests;
};

// The hosts with the cameras and the viewers, and the security of the requests from the viewers.
struct Hosts : lf::RtpSecurity {
  std::string nodes, listen;
  bool operator==(const Hosts&) const = default;
  bool any() const { return !nodes.empty() || !listen.empty(); }
};

struct Settings : Hosts {
  std::string rig;
  bool is_live = true;
  std::string record;
  bool trusted = false;
  lf::RendererChoice renderer = lf::RendererChoice::kCpu;

  static lf::PropertyTable<Settings>& properties();
};

constexpr std::array kOwnProperties = {"location", "loop", "num-buffers"};

bool is_own(const char* name) {
  return std::ranges::any_of(kOwnProperties, [name](const char* own) { return g_str_equal(own, name); }) ||
         std::ranges::any_of(lf::kViewFields, [name](const lf::ViewField& f) { return g_str_equal(f.name, name); });
}

}  // namespace

struct _LfViewSrc {
  GstBin parent;
  Settings* settings;        // guarded by the object lock
  std::atomic<bool> by_uri;  // the rig was set by a URI and is not trusted
  std::atomic<bool> failed;  // a child has posted an error during the current state change

  GstElement *view, *compositor;  // of the viewer of pad `src`, borrowed; null if the elements are not installed
  // Lock order: acquire `mutex` before all other locks, because bins emit signals to applications when children change.
  struct Inside {
    std::recursive_mutex mutex;
    std::map<std::string, std::shared_ptr<Viewer>> viewers;
    std::set<guint> view_ids;
    std::unique_ptr<lf::ViewerCameras> cameras;
    std::unique_ptr<lf::ViewerRequests> requests;  // null if viewers generate their own requests
    Hosts hosts;
    GstClock* realtime = nullptr;
  } * inside;
};

static void lf_view_src_uri_handler_init(gpointer iface, gpointer data);

G_DEFINE_FINAL_TYPE_WITH_CODE(LfViewSrc, lf_view_src, GST_TYPE_BIN,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, lf_view_src_uri_handler_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewsrc, "lfviewsrc", GST_RANK_NONE, LF_TYPE_VIEW_SRC,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_src_debug, "lfviewsrc", 0,
                                                              "view of a light field"))

lf::PropertyTable<Settings>& Settings::properties() {
  using S = Settings;
  static lf::PropertyTable<S> table = {
      lf::property<&S::rig>(lf::kWhilePlaying, "rig", "Rig",
                            "Path of the rig file (rig.json), which describes the cameras of the array. This property "
                            "is required. If it is set while the element runs, the element loads the file again and "
                            "uses it from the next request on. The new file must have the same cameras and sources"),
      lf::inherited_property<S, &S::nodes>(
          lf::kWhileReady, "nodes", "Nodes",
          "Comma-separated list of the hosts that run the cameras, each with an lfnodesink. An item is "
          "HOST:REQUEST-PORT:[LOCAL-ADDRESS:]ANSWER-PORT, for example camhost0:6000:6100. Requests are sent to "
          "REQUEST-PORT on HOST, and the answers of the host arrive at ANSWER-PORT of this machine. The value auto "
          "finds the hosts that announce cameras of this rig by DNS-SD. These cameras are always live (empty: all "
          "cameras are on this machine)"),
      lf::inherited_property<S, &S::listen>(
          lf::kWhileReady, "listen", "Listen",
          "Address that receives the view requests of viewers on other hosts: a local UDP port, ADDRESS:PORT or a "
          "multicast GROUP:PORT. The `src` pad then delivers the pictures of view 0, the `src_0` pad delivers view 1, "
          "and so on (empty: this element makes its own requests)"),
      lf::inherited_property<S, &S::key_file>(
          lf::kWhileReady, "key-file", "Key file",
          "Path of the file with the secret that all hosts share (32 or more random characters). If it is set, all "
          "packets to and from the hosts of `nodes` and `listen` are encrypted (empty: no encryption)"),
      lf::inherited_property<S, &S::peers>(
          lf::kWhileReady, "peers", "Peers",
          "Comma-separated list of the hosts that may send requests to the address in `listen`, as names, addresses or "
          "networks such as 10.0.0.0/24. If the list is empty, every host with the secret in `key-file` may send "
          "requests. Without a key file, only this machine may send requests, from the first loopback address (such as "
          "127.0.0.1) that sends one"),
      lf::property<&S::is_live>(lf::kWhileReady, "is-live", "Is live",
                                "If true, the element renders pictures in real time, synchronised to the pipeline "
                                "clock. If false, it renders pictures as fast as downstream consumes them, for example "
                                "to write a file. Cameras on other hosts (`nodes`) are always live and require true"),
      lf::property<&S::record>(
          lf::kWhileReady, "record", "Record",
          "Folder that receives a recording of the cameras of this machine. The recording consists of one file per "
          "camera and a rig.json for playback. The folder must not contain a rig.json yet. Remote cameras are recorded "
          "on their own host, by lfnodesink (empty: no recording)"),
      lf::property<&S::renderer>(
          lf::kWhilePlaying, "renderer", "Renderer",
          "Processor that renders the contribution of local cameras to each view: CPU or GPU. This property sets the "
          "`renderer` property of lfcameranode. Cameras on other hosts use the setting of their own lfnodesink",
          LF_TYPE_FRAGMENT_RENDERER),
      lf::property<&S::trusted>(
          lf::kWhileReady, "trusted", "Trusted",
          "If true, the rig file may run any GStreamer element. Set this only for rig files from people you trust. If "
          "false, launch descriptions in the rig may contain only sources, converters and decoders from a fixed list"),
  };
  return table;
}

static Settings& settings_of(LfViewSrc* self) { return *self->settings; }
using Properties = lf::Properties<settings_of>;

static lf::ElementPtr find_node(LfViewSrc* self) { return lf::ElementPtr(gst_bin_get_by_name(GST_BIN(self), "node")); }

static void set_node(LfViewSrc* self) {
  const lf::ElementPtr node = find_node(self);
  if (!node) return;
  const Settings settings = Properties::now(self);
  const auto text_or_null = [](const std::string& text) { return text.empty() ? nullptr : text.c_str(); };
  g_object_set(node.get(), "is-live", settings.is_live, "rig", text_or_null(settings.rig), "record",
               text_or_null(settings.record), "renderer", static_cast<gint>(settings.renderer), "trusted",
               settings.trusted, nullptr);
}

static void follow_access(LfViewSrc* self, const lf::ViewerChain& viewer) {
  const lf::ElementPtr node = find_node(self);
  if (!node) return;
  gint access = 0;
  g_object_get(node.get(), "access", &access, nullptr);
  if (access != static_cast<gint>(lf::Access::kSelf)) g_object_set(viewer.view(), "access", access, nullptr);
}

// Changes the rig of the running camera node. Returns false if the node rejects the rig, for example because its
// cameras differ. The viewers must then keep their current rig, too.
static bool set_rig_of_elements(LfViewSrc* self, const gchar* path) {
  if (const lf::ElementPtr node = find_node(self)) {
    g_object_set(node.get(), "rig", path, nullptr);
    g_autofree gchar* taken = nullptr;
    g_object_get(node.get(), "rig", &taken, nullptr);
    if (g_strcmp0(taken, path) != 0) return false;
  }
  for (auto& [name, viewer] : self->inside->viewers) {
    g_object_set(viewer->chain.view(), "rig", path, nullptr);
    g_object_set(viewer->chain.compositor(), "rig", path, nullptr);
  }
  return true;
}

static void set_live_of_elements(LfViewSrc* self, gboolean live) {
  for (auto& [name, viewer] : self->inside->viewers) viewer->chain.set_live(live);
  set_node(self);
}

static GstElement* owner_of(LfViewSrc* self, GParamSpec* copy) {
  return lf::is_proxy(copy, LF_TYPE_VIEW_REQUEST) ? self->view : self->compositor;
}

static void lf_view_src_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  if (lf::is_proxy(pspec)) {
    if (GstElement* owner = owner_of(self, pspec)) g_object_set_property(G_OBJECT(owner), pspec->name, value);
    return;
  }
  const std::lock_guard lock(self->inside->mutex);
  if (lf::is_named(pspec, "rig") && !set_rig_of_elements(self, g_value_get_string(value))) return;
  Properties::set(object, id, value, pspec);
  if (lf::is_named(pspec, "rig")) self->by_uri = false;
  if (lf::is_named(pspec, "is-live")) set_live_of_elements(self, g_value_get_boolean(value));
  if (lf::is_named(pspec, "record") || lf::is_named(pspec, "renderer") || lf::is_named(pspec, "trusted"))
    set_node(self);
}

static void lf_view_src_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!lf::is_proxy(pspec)) return Properties::get(object, id, value, pspec);
  if (GstElement* owner = owner_of(LF_VIEW_SRC(object), pspec))
    g_object_get_property(G_OBJECT(owner), pspec->name, value);
}

static void copy_settings(LfViewSrc* self, const lf::ViewerChain& to) {
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(self), &count);
  for (guint i = 0; i < count; i++) {
    GParamSpec* spec = specs[i];
    if (!lf::is_proxy(spec) || !(spec->flags & G_PARAM_WRITABLE) || is_own(spec->name)) continue;
    const bool of_view = lf::is_proxy(spec, LF_TYPE_VIEW_REQUEST);
    GValue value = G_VALUE_INIT;
    g_object_get_property(G_OBJECT(self), spec->name, &value);
    g_object_set_property(G_OBJECT(of_view ? to.view() : to.compositor()), spec->name, &value);
    g_value_unset(&value);
  }
  follow_access(self, to);
}

static GstURIType lf_view_src_uri_type(GType) { return GST_URI_SRC; }

static const gchar* const* lf_view_src_protocols(GType) {
  static const gchar* const protocols[] = {"lf", nullptr};
  return protocols;
}

static gchar* lf_view_src_uri(GstURIHandler* handler) {
  const std::string rig = Properties::now(LF_VIEW_SRC(handler)).rig;
  if (rig.empty()) return nullptr;
  g_autofree gchar* whole = g_canonicalize_filename(rig.c_str(), nullptr);
  g_autofree gchar* escaped = g_uri_escape_string(whole, G_URI_RESERVED_CHARS_ALLOWED_IN_PATH, FALSE);
  return g_strconcat("lf://", escaped, nullptr);
}

static gboolean lf_view_src_set_uri(GstURIHandler* handler, const gchar* uri, GError** error) {
  g_autofree gchar* path = gst_uri_get_location(uri);
  if (!path || path[0] != '/') {
    g_set_error(error, GST_URI_ERROR, GST_URI_ERROR_BAD_URI,
                "%s: must be lf:///path/of/rig.json, which is lf:// and the absolute path of a rig file", uri);
    return FALSE;
  }
  const std::lock_guard lock(LF_VIEW_SRC(handler)->inside->mutex);
  g_object_set(handler, "rig", path, nullptr);
  LF_VIEW_SRC(handler)->by_uri = true;
  return TRUE;
}

static void lf_view_src_uri_handler_init(gpointer iface, gpointer) {
  GstURIHandlerInterface* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = lf_view_src_uri_type;
  handler->get_protocols = lf_view_src_protocols;
  handler->get_uri = lf::callback<lf_view_src_uri>;
  handler->set_uri = lf::callback<lf_view_src_set_uri>;
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

static void install_actions(GObjectClass* klass) {
  /**
   * LfViewSrc::set-view:
   * @src: the element
   * @view: the view, as for lfviewrequest
   *
   * Moves the view of the `src` pad, like the `set-view` action of lfviewrequest. To move the view of `src_0`, emit
   * the action of the child "view_0".
   *
   * Returns: %FALSE if @view has no known field.
   */
  g_signal_new_class_handler("set-view", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_src_set_view>), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN,
                             1, GST_TYPE_STRUCTURE | G_SIGNAL_TYPE_STATIC_SCOPE);
  /**
   * LfViewSrc::focus-at:
   * @src: the element
   * @x: column in pixels; for a set of views, a column of the whole picture
   * @y: row in pixels; for a set of views, a row of the whole picture
   *
   * Focuses the view of the `src` pad at a pixel, like the `focus-at` action of lfviewrequest.
   *
   * Returns: %FALSE if the view cannot be focused there.
   */
  g_signal_new_class_handler("focus-at", G_TYPE_FROM_CLASS(klass), GSignalFlags(G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
                             G_CALLBACK(lf::callback<lf_view_src_focus_at>), nullptr, nullptr, nullptr, G_TYPE_BOOLEAN,
                             2, G_TYPE_DOUBLE, G_TYPE_DOUBLE);
}

static void install_properties(GObjectClass* klass) {
  const guint first_copy = Properties::install(klass);
  klass->set_property = lf::callback<lf_view_src_set_property>;
  klass->get_property = lf::callback<lf_view_src_get_property>;
  const guint next =
      lf::install_proxies(klass, first_copy, LF_TYPE_VIEW_REQUEST,
                          {"rig", "view-id", "is-live", "navigation-element", "access"}, {"num-buffers"});
  constexpr lf::ProxyDefault kLatency[] = {{"latency", LF_COMPOSITOR_LATENCY}};
  lf::install_proxies(klass, next, LF_TYPE_COMPOSITOR, {"rig", "view-id"}, {"latency"}, kLatency);
}

constexpr guint kFirstOfReopened = 1 << 20;

// Returns the view id of a pad: 0 for `src`, 1 for `src_0`, and so on. A reopened pad gets a new id, because answers to
// the closed viewer may still arrive. If `listen` is set, the id stays, because remote viewers define the ids.
static guint choose_view_id(LfViewSrc* self, const std::string& ending) {
  std::set<guint>& used = self->inside->view_ids;
  const guint id = ending.empty() ? 0 : static_cast<guint>(g_ascii_strtoull(ending.c_str() + 1, nullptr, 10)) + 1;
  if (used.insert(id).second || !Properties::now(self).listen.empty()) return id;
  guint next = kFirstOfReopened;
  if (*used.rbegin() >= next) next = *used.rbegin() + 1;
  used.insert(next);
  return next;
}

static void connect_viewer(LfViewSrc* self, Viewer& viewer) {
  auto& inside = *self->inside;
  if (inside.requests) viewer.requests = inside.requests->connect(viewer.chain);
  if (inside.cameras) viewer.pads = inside.cameras->connect(viewer.chain);
}

static std::shared_ptr<Viewer> add_viewer(LfViewSrc* self, const std::string& name) {
  auto& inside = *self->inside;
  const std::string ending = name.substr(sizeof("src") - 1);
  const auto viewer = std::make_shared<Viewer>(GST_BIN(self), choose_view_id(self, ending), ending);
  inside.viewers[name] = viewer;
  const Settings settings = Properties::now(self);
  if (!settings.rig.empty())
    for (GstElement* element : {viewer->chain.view(), viewer->chain.compositor()})
      g_object_set(element, "rig", settings.rig.c_str(), nullptr);
  viewer->chain.set_live(settings.is_live);
  return viewer;
}

static GstPad* add_ghost_pad(LfViewSrc* self, const Viewer& viewer, const char* name, const char* template_name) {
  GstPadTemplate* templ = gst_element_class_get_pad_template(GST_ELEMENT_GET_CLASS(self), template_name);
  GstPad* pad = gst_ghost_pad_new_from_template(name, viewer.chain.pictures().get(), templ);
  if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  return pad;
}

// Adds a pad with the depths of the view at `src`, or their confidences.
static GstPad* add_depth_pad(LfViewSrc* self, GstPadTemplate* templ) {
  const char* const name = GST_PAD_TEMPLATE_NAME_TEMPLATE(templ);
  const lf::PadPtr existing(gst_element_get_static_pad(GST_ELEMENT(self), name));
  if (existing || !self->view) return nullptr;
  const lf::PadPtr output = self->inside->viewers.at("src")->chain.add_output(name);
  GstPad* pad = gst_ghost_pad_new_from_template(name, output.get(), templ);
  if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(GST_ELEMENT(self), pad);
  return pad;
}

static GstPad* lf_view_src_new_pad(GstElement* element, GstPadTemplate* templ, const gchar* wanted, const GstCaps*) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  if (!g_str_has_prefix(GST_PAD_TEMPLATE_NAME_TEMPLATE(templ), "src")) return add_depth_pad(self, templ);
  auto& inside = *self->inside;
  std::string name = wanted ? wanted : "";
  for (guint number = 0; name.empty() || (!wanted && inside.viewers.contains(name)); number++)
    name = "src_" + std::to_string(number);
  if (!self->view || inside.viewers.contains(name)) return nullptr;
  try {
    const std::shared_ptr<Viewer> viewer = add_viewer(self, name);
    copy_settings(self, viewer->chain);
    connect_viewer(self, *viewer);
    GstPad* pad = add_ghost_pad(self, *viewer, name.c_str(), "src_%u");
    viewer->chain.follow_bin();
    return pad;
  } catch (const std::exception& error) {
    GST_ERROR_OBJECT(self, "no pad %s: %s", name.c_str(), error.what());
  }
  if (const auto half = inside.viewers.find(name); half != inside.viewers.end()) {
    half->second->chain.take_out();
    half->second->requests.reset();
    half->second->pads.reset();
    inside.viewers.erase(half);
  }
  return nullptr;
}

// Removes a pad of add_depth_pad(). Waits for the thread of its queue, which must not be the caller.
static void remove_depth_pad(LfViewSrc* self, GstPad* pad) {
  const lf::PadPtr output(gst_ghost_pad_get_target(GST_GHOST_PAD(pad)));
  gst_ghost_pad_set_target(GST_GHOST_PAD(pad), nullptr);
  gst_element_remove_pad(GST_ELEMENT(self), pad);
  if (output) self->inside->viewers.at("src")->chain.remove_output(output.get());
}

// Stops the viewer in another thread, because the caller may be a streaming thread of this viewer, or an application
// that holds its last picture.
static void lf_view_src_release_pad(GstElement* element, GstPad* pad) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const std::lock_guard lock(self->inside->mutex);
  const auto found = self->inside->viewers.find(GST_PAD_NAME(pad));
  if (found == self->inside->viewers.end()) return remove_depth_pad(self, pad);
  std::shared_ptr<Viewer> viewer = found->second;
  lf::PadPtr closed(GST_PAD(gst_object_ref(pad)));
  self->inside->viewers.erase(found);
  gst_ghost_pad_set_target(GST_GHOST_PAD(pad), nullptr);
  gst_element_remove_pad(element, pad);
  viewer->chain.take_out();
  lf::call_async(element, [viewer = std::move(viewer), closed = std::move(closed)] {
    viewer->chain.close([&] {
      viewer->requests.reset();
      viewer->pads.reset();
    });
    gst_pad_set_active(closed.get(), FALSE);
  });
}

static void add_main_viewer(LfViewSrc* self) {
  const std::shared_ptr<Viewer> viewer = add_viewer(self, "src");
  self->view = viewer->chain.view();
  self->compositor = viewer->chain.compositor();
  lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->view));
  lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->compositor));
  add_ghost_pad(self, *viewer, "src", "src");
  viewer->chain.follow_bin();
}

static void install_pads(GstElementClass* klass) {
  klass->request_new_pad = lf::callback<lf_view_src_new_pad>;
  klass->release_pad = lf::callback<lf_view_src_release_pad>;
  GstElementClass* compositor = GST_ELEMENT_CLASS(g_type_class_ref(LF_TYPE_COMPOSITOR));
  GstCaps* caps = gst_pad_template_get_caps(gst_element_class_get_pad_template(compositor, "src"));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, caps));
  gst_element_class_add_pad_template(klass, gst_pad_template_new("src_%u", GST_PAD_SRC, GST_PAD_REQUEST, caps));
  for (const char* name : {LF_DEPTH_PAD, LF_CONFIDENCE_PAD}) {
    GstCaps* of_depth = gst_pad_template_get_caps(gst_element_class_get_pad_template(compositor, name));
    gst_element_class_add_pad_template(klass, gst_pad_template_new(name, GST_PAD_SRC, GST_PAD_REQUEST, of_depth));
    gst_caps_unref(of_depth);
  }
  gst_caps_unref(caps);
  g_type_class_unref(compositor);
}

static void drop_hosts(LfViewSrc* self) {
  auto& inside = *self->inside;
  for (auto& [name, viewer] : inside.viewers) {
    viewer->requests.reset();
    viewer->pads.reset();
    viewer->chain.drop_answers();
  }
  inside.requests.reset();
  inside.cameras.reset();
}

// Returns f(), with the name of the property in front of the text of any Error.
template <typename F>
static auto of_property(const char* name, F f) {
  try {
    return f();
  } catch (const lf::Error& error) {
    throw lf::Error(std::string(name) + ": " + error.what());
  }
}

static std::unique_ptr<lf::ViewerCameras> cameras_of(LfViewSrc* self, const Settings& hosts) {
  if (hosts.nodes.empty()) return lf::make_local_cameras(GST_BIN(self));
  return of_property("nodes", [&] {
    const auto nodes = lf::find_nodes(hosts.nodes, *lf::shared_rig(hosts.rig), [self](const std::string& text) {
      GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("nodes: %s", text.c_str()), (nullptr));
    });
    return lf::make_remote_cameras(GST_BIN(self), nodes, hosts.key_file);
  });
}

static std::unique_ptr<lf::ViewerRequests> requests_of(LfViewSrc* self, const Hosts& hosts) {
  if (hosts.listen.empty()) return nullptr;
  return of_property("listen", [&] {
    const std::vector<lf::HostPort> places = lf::parse_host_ports(hosts.listen);
    if (places.size() != 1)
      throw lf::Error(
          "must be one port, because the requests of all viewers arrive at the "
          "same port");
    return std::make_unique<lf::ViewerRequests>(GST_BIN(self), places[0], hosts);
  });
}

// Replaces the cameras and requests of all viewers. Call while nothing runs. Throws Error.
static void change_hosts(LfViewSrc* self, const Settings& hosts) {
  auto& inside = *self->inside;
  drop_hosts(self);
  inside.hosts = hosts;
  try {
    inside.cameras = cameras_of(self, hosts);
    inside.requests = requests_of(self, hosts);
    for (auto& [name, viewer] : inside.viewers) connect_viewer(self, *viewer);
  } catch (...) {
    drop_hosts(self);
    throw;
  }
  lf::bind_limits(GST_BIN(self), self->compositor);
  if (const lf::ElementPtr node = find_node(self)) g_object_set(node.get(), "loop", TRUE, nullptr);
  set_node(self);
}

// Throws Error if a camera of the rig has a launch description as its source. The rig of a URI may come from an
// untrusted web page, and launch descriptions can run any program.
static void refuse_described_sources(const lf::Rig& rig, const std::string& path) {
  for (const lf::Camera& camera : rig.cameras)
    if (lf::is_launch_description(camera.source))
      throw lf::Error(path + ": camera " + std::to_string(camera.id) +
                      ": its source describes elements, which no URI opens: set the property rig instead of a URI");
}

// Called before READY and before PAUSED. Returns false after posting an error. Hosts are searched again before READY.
static bool prepare(LfViewSrc* self, bool to_ready) {
  const std::lock_guard lock(self->inside->mutex);
  const Settings hosts = Properties::now(self);
  try {
    if (hosts.rig.empty()) throw lf::Error("rig: not set (rig=RIG.json names the array's rig file)");
    const std::shared_ptr<const lf::Rig> read = lf::shared_rig(hosts.rig);
    if (self->by_uri && hosts.nodes.empty()) refuse_described_sources(*read, hosts.rig);
    if (hosts.any() && !hosts.is_live)
      throw lf::Error("nodes and listen: the cameras on other hosts are live, so is-live must be true");
    if (!hosts.any() && !hosts.key_file.empty())
      throw lf::Error(
          "key-file: has no effect without nodes or listen, because only packets between hosts are encrypted");
    if (hosts.listen.empty() && !hosts.peers.empty())
      throw lf::Error(
          "peers: has no effect without listen, because this element then receives no requests of other hosts");
    if (!hosts.nodes.empty() && !hosts.record.empty())
      throw lf::Error("record: the cameras are on other hosts, which record their own (lfnodesink record=FOLDER)");
    if (!self->view)
      throw lf::Error(
          "elements lfviewrequest and lfcompositor are not installed (set GST_PLUGIN_PATH "
          "to the folder of the gst-lightfield plugin)");
    const bool searches = to_ready && hosts.nodes == "auto";
    if (!self->inside->cameras || self->inside->hosts != hosts || searches) change_hosts(self, hosts);
    for (auto& [name, viewer] : self->inside->viewers) follow_access(self, viewer->chain);
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
}

// Returns a clock if another host is configured, because hosts exchange capture times as time of day; otherwise null.
// The caller owns the reference.
static GstClock* hosts_clock(LfViewSrc* self) {
  const std::lock_guard lock(self->inside->mutex);
  if (!self->inside->hosts.any()) return nullptr;
  if (!self->inside->realtime) self->inside->realtime = lf::new_wall_clock();
  return GST_CLOCK(gst_object_ref(self->inside->realtime));
}

static GstClock* lf_view_src_provide_clock(GstElement* element) {
  GstClock* clock = GST_ELEMENT_CLASS(lf_view_src_parent_class)->provide_clock(element);
  return clock ? clock : hosts_clock(LF_VIEW_SRC(element));
}

static GstStateChangeReturn lf_view_src_change_state(GstElement* element, GstStateChange transition) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const bool to_ready = transition == GST_STATE_CHANGE_NULL_TO_READY;
  const bool starts = to_ready || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts && !prepare(self, to_ready)) return GST_STATE_CHANGE_FAILURE;
  const Hosts hosts = Properties::now(self);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !hosts.listen.empty()) lf::warn_without_key(element, hosts);
  self->failed = false;
  GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_view_src_parent_class)->change_state(element, transition);
  // Fails the state change if an error arrives during it, because gst-launch-1.0 hangs after an error that is posted
  // before its main loop runs.
  if (starts && self->failed) result = GST_STATE_CHANGE_FAILURE;
  // Makes the pipeline select its clock again, because the next run may have other cameras.
  const bool begun = transition == GST_STATE_CHANGE_READY_TO_PAUSED && result != GST_STATE_CHANGE_FAILURE;
  if (!begun && transition != GST_STATE_CHANGE_PAUSED_TO_READY) return result;
  g_autoptr(GstClock) clock = hosts_clock(self);
  if (clock)
    gst_element_post_message(element, begun ? gst_message_new_clock_provide(GST_OBJECT(element), clock, TRUE)
                                            : gst_message_new_clock_lost(GST_OBJECT(element), clock));
  return result;
}

static gboolean lf_view_src_send_event(GstElement* element, GstEvent* event) {
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_DOWNSTREAM)
    return GST_ELEMENT_CLASS(lf_view_src_parent_class)->send_event(element, event);
  g_autoptr(GstPad) pad = gst_element_get_static_pad(element, "src");
  return gst_pad_send_event(pad, event);
}

static void lf_view_src_dispose(GObject* object) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  lf::guarded(self, false, [self] {
    drop_hosts(self);
    self->inside->viewers.clear();
    return true;
  });
  self->view = self->compositor = nullptr;
  G_OBJECT_CLASS(lf_view_src_parent_class)->dispose(object);
}

static void lf_view_src_finalize(GObject* object) {
  LfViewSrc* self = LF_VIEW_SRC(object);
  gst_clear_object(&self->inside->realtime);
  delete self->inside;
  delete self->settings;
  G_OBJECT_CLASS(lf_view_src_parent_class)->finalize(object);
}

static void lf_view_src_handle_message(GstBin* bin, GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) LF_VIEW_SRC(bin)->failed = true;
  GST_BIN_CLASS(lf_view_src_parent_class)->handle_message(bin, lf::with_port(message));
}

static void lf_view_src_class_init(LfViewSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->dispose = lf_view_src_dispose;
  object_class->finalize = lf_view_src_finalize;
  install_properties(object_class);
  install_actions(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_view_src_change_state>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_view_src_handle_message>;
  element_class->provide_clock = lf::callback<lf_view_src_provide_clock>;
  element_class->send_event = lf::callback<lf_view_src_send_event>;
  install_pads(element_class);
  gst_element_class_set_static_metadata(element_class, "Light field view source", "Source/Video",
                                        "Renders an interactive view of a light field. This bin combines "
                                        "lfviewrequest, the cameras of a rig and lfcompositor",
                                        "gst-lightfield");
}

static void lf_view_src_init(LfViewSrc* self) {
  self->inside = new _LfViewSrc::Inside;
  self->settings = new Settings;
  // The bin contains a udpsink for requests, which must not count as a sink of the pipeline.
  gst_bin_set_suppressed_flags(GST_BIN(self), GST_ELEMENT_FLAG_SINK);
  try {
    add_main_viewer(self);
    change_hosts(self, {});
  } catch (const std::exception& error) {
    GST_WARNING_OBJECT(self, "%s", error.what());
  }
}
