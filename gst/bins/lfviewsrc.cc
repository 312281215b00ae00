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
 * that stands in the middle of the array; `location`, `loop` and `num-buffers` are of `src` alone. Viewers come and go
 * while everything runs, and none waits for another. Pictures of a pad that is not linked are dropped.
 *
 * `width`, `height` and `framerate` that are not set follow downstream caps, also when these change while playing; what
 * is set counts, and views of `location` have sizes of their own. Where downstream accepts no such pictures an error
 * says why. Formats are those of the cameras: `videoconvert` makes others. Each picture has a meta that says which view
 * it shows (#element-lfcompositor).
 *
 * Live, whoever takes pictures more slowly than they come gets the newest: the oldest are dropped behind the
 * compositor, and the search for the focal surface goes on at its own pace. No queue is needed between the pads and
 * their sinks.
 *
 * With `views` there are several eyes, side by side around the view, whose pictures of one moment make one: a stereo
 * pair, a row, a quilt (#element-lfviewrequest).
 *
 * Cameras are live unless `is-live` is false, which makes pictures as fast as they are taken and ends with the views of
 * `location`. Films begin again at their end, but with `node::loop=false`.
 *
 * With `record` the cameras are on disk, too, for other views of the same (#element-lfcameranode).
 *
 * With `listen` views are those that viewers on other hosts ask for at this port by RTP (`lfviewrequest ! rtplfpay !
 * lfrtpseal ! udpsink`): `src` shows view 0, `src_0` view 1, and so on. That is a host of compositors, for viewers that
 * take pictures. With `partial` it is one of a rack, whose `src` is the sum of the rack's cameras, for the next one.
 *
 * With `key-file`, the same file as on those hosts, nobody else can see or steer what goes between
 * (#element-lfrtpseal); without, answers are taken from the addresses of `nodes` and requests from those of
 * `peers`, and whoever is on the network in between can do both.
 *
 * As a URI, lf:///path/of/rig.json, cameras whose sources describe elements are refused: a player may be given any URI.
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
 * gst-launch-1.0 lfviewsrc name=v rig=rig.json width=640 height=480  v.src ! videoconvert ! autovideosink \
 *   v.src_0 ! videoconvert ! autovideosink
 * ]| Two viewers, each with a window.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json views=stereo ! videoconvert ! autovideosink
 * ]| A stereo pair, side by side.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json nodes=CAMHOST0:6000:6100,CAMHOST1:6000:6101 ! videoconvert ! autovideosink
 * ]| The cameras of two other hosts.
 * |[
 * gst-launch-1.0 lfviewsrc rig=rig.json record=seen ! videoconvert ! autovideosink
 * ]| Seen and recorded; lfviewsrc rig=seen/rig.json shows it again.
 */

#include <memory>
#include <string>

#include "base/error.h"
#include "bins/lfviewsrc_private.h"
#include "bins/rtp_link.h"
#include "common/common.h"
#include "common/day_clock.h"
#include "common/guard.h"
#include "rig/bin_description.h"

GST_DEBUG_CATEGORY(lf_view_src_debug);
#define GST_CAT_DEFAULT lf_view_src_debug

G_DEFINE_FINAL_TYPE_WITH_CODE(LfViewSrc, lf_view_src, GST_TYPE_BIN,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, lf_view_src_uri_handler_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfviewsrc, "lfviewsrc", GST_RANK_NONE, LF_TYPE_VIEW_SRC,
                                      GST_DEBUG_CATEGORY_INIT(lf_view_src_debug, "lfviewsrc", 0,
                                                              "view of a light field"))

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

static lf::Admission admission_of_requests(const LfViewSrcHosts& hosts) { return {hosts.key_file, hosts.peers}; }

// What f() makes of a property; an Error of it begins with the property's name.
template <typename F>
static auto of_property(const char* name, F f) {
  try {
    return f();
  } catch (const lf::Error& error) {
    throw lf::Error(std::string(name) + ": " + error.what());
  }
}

static std::unique_ptr<lf::ViewerCameras> cameras_of(LfViewSrc* self, const LfViewSrcHosts& hosts) {
  if (hosts.nodes.empty()) return lf::cameras_here(GST_BIN(self));
  return of_property("nodes",
                     [&] { return lf::cameras_on_hosts(GST_BIN(self), lf::parse_nodes(hosts.nodes), hosts.key_file); });
}

static std::unique_ptr<lf::ViewerRequests> requests_of(LfViewSrc* self, const LfViewSrcHosts& hosts) {
  if (hosts.listen.empty()) return nullptr;
  return of_property("listen", [&] {
    const std::vector<lf::HostPort> places = lf::parse_host_ports(hosts.listen);
    if (places.size() != 1) throw lf::Error("must be one port");
    return std::make_unique<lf::ViewerRequests>(GST_BIN(self), places[0], admission_of_requests(hosts));
  });
}

// Other cameras, and other requests, for all viewers. While nothing runs. Throws Error.
static void change_hosts(LfViewSrc* self, const LfViewSrcHosts& hosts) {
  auto& inside = *self->inside;
  drop_hosts(self);
  inside.hosts = hosts;
  try {
    inside.cameras = cameras_of(self, hosts);
    inside.requests = requests_of(self, hosts);
    for (auto& [name, viewer] : inside.viewers) lf_view_src_connect(self, *viewer);
  } catch (...) {
    drop_hosts(self);
    throw;
  }
  lf::follow_limits(GST_BIN(self), self->compositor);
  if (GstElement* node = gst_bin_get_by_name(GST_BIN(self), "node")) {
    g_object_set(node, "loop", TRUE, nullptr);
    gst_object_unref(node);
  }
  lf_view_src_set_node(self);
}

// Players open URIs from anywhere, and elements may run any program.
static void refuse_described_sources(const lf::Rig& rig, const std::string& path) {
  for (const lf::Camera& camera : rig.cameras)
    if (lf::is_bin_description(camera.source))
      throw lf::Error(path + ": camera " + std::to_string(camera.id) +
                      ": its source describes elements, which no URI opens: set the property rig in place of a URI");
}

static bool is_by_uri(LfViewSrc* self) {
  const lf::ObjectLock lock(self);
  return self->by_uri;
}

// Before READY and before PAUSED. False after posting the reason.
static bool prepare(LfViewSrc* self) {
  const std::lock_guard lock(self->inside->mutex);
  const std::string rig = lf_view_src_rig(self);
  const LfViewSrcHosts hosts = lf_view_src_hosts(self);
  try {
    if (rig.empty()) throw lf::Error("rig: not set (rig=RIG.json names the array's rig file)");
    const std::shared_ptr<const lf::Rig> read = lf::shared_rig(rig);
    if (is_by_uri(self) && hosts.nodes.empty()) refuse_described_sources(*read, rig);
    if (hosts.any() && !lf_view_src_is_live(self))
      throw lf::Error("nodes, listen: what is on other hosts is live, is-live must be true");
    if (!hosts.any() && !hosts.key_file.empty())
      throw lf::Error("key-file: nothing goes over the network without nodes or listen");
    if (hosts.listen.empty() && !hosts.peers.empty()) throw lf::Error("peers: nobody sends requests without listen");
    if (!hosts.nodes.empty() && !lf_view_src_record(self).empty())
      throw lf::Error("record: the cameras are on other hosts, which record their own (lfnodesink record=FOLDER)");
    if (!self->view) throw lf::Error("elements lfviewrequest and lfcompositor are not installed");
    if (!self->inside->cameras || self->inside->hosts != hosts) change_hosts(self, hosts);
    for (auto& [name, viewer] : self->inside->viewers) lf_view_src_follow_access(self, viewer->chain);
    return true;
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
}

// Hosts name capture times by the time of day. Null where everything is here.
static GstClock* hosts_clock(LfViewSrc* self) {
  const std::lock_guard lock(self->inside->mutex);
  if (!self->inside->hosts.any()) return nullptr;
  if (!self->inside->realtime) self->inside->realtime = lf::new_day_clock();
  return GST_CLOCK(gst_object_ref(self->inside->realtime));
}

static void warn_without_key(LfViewSrc* self) {
  const LfViewSrcHosts hosts = lf_view_src_hosts(self);
  if (!hosts.listen.empty()) lf::warn_without_key(GST_ELEMENT(self), admission_of_requests(hosts));
}

static GstClock* lf_view_src_provide_clock(GstElement* element) {
  GstClock* clock = GST_ELEMENT_CLASS(lf_view_src_parent_class)->provide_clock(element);
  return clock ? clock : hosts_clock(LF_VIEW_SRC(element));
}

static GstStateChangeReturn lf_view_src_change_state(GstElement* element, GstStateChange transition) {
  LfViewSrc* self = LF_VIEW_SRC(element);
  const bool starts = transition == GST_STATE_CHANGE_NULL_TO_READY || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts && !prepare(self)) return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) warn_without_key(self);
  g_atomic_int_set(&self->failed, 0);
  GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_view_src_parent_class)->change_state(element, transition);
  // An error that comes while the state still changes fails that change: gst-launch-1.0 waits for ever after an error
  // that is posted before its loop runs.
  if (starts && g_atomic_int_get(&self->failed)) result = GST_STATE_CHANGE_FAILURE;
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
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) g_atomic_int_set(&LF_VIEW_SRC(bin)->failed, 1);
  GST_BIN_CLASS(lf_view_src_parent_class)->handle_message(bin, lf::with_port(message));
}

static void lf_view_src_class_init(LfViewSrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->dispose = lf_view_src_dispose;
  object_class->finalize = lf_view_src_finalize;
  lf_view_src_install_properties(object_class);
  lf_view_src_install_actions(object_class);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_view_src_change_state>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_view_src_handle_message>;
  element_class->provide_clock = lf::callback<lf_view_src_provide_clock>;
  element_class->send_event = lf::callback<lf_view_src_send_event>;
  lf_view_src_install_pads(element_class);
  gst_element_class_set_static_metadata(
      element_class, "Light field view source", "Source/Video",
      "A view of a light field, flown with mouse and keys: lfviewrequest, the cameras of a rig and lfcompositor in one",
      "gst-lightfield");
}

static void lf_view_src_init(LfViewSrc* self) {
  self->inside = new _LfViewSrc::Inside;
  self->settings = new LfViewSrcSettings;
  // Requests to hosts leave by a sink, which is none of the pipeline's.
  gst_bin_set_suppressed_flags(GST_BIN(self), GST_ELEMENT_FLAG_SINK);
  try {
    lf_view_src_add_main_viewer(self);
    change_hosts(self, {});
  } catch (const std::exception& error) {
    GST_WARNING_OBJECT(self, "%s", error.what());
  }
}
