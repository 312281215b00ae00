// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lfnodesink
 * @title: lfnodesink
 * @short_description: the cameras of this machine for viewers on other hosts
 *
 * lfnodesink serves the cameras of this machine to viewers on other hosts, which run `lfviewsrc nodes=...`. It contains
 * an #element-lfcameranode ("node") with live cameras, and has the properties of that element. View requests arrive by
 * RTP at the port in the property `listen`, and the answers are sent to the address in the property `answers`. If there
 * are several clients, both properties are lists, with one item for each client in the same order. File sources loop
 * unless `loop=false`.
 *
 * If `key-file` names the same file on all hosts, packets are encrypted, and only hosts with this file can send
 * requests and read answers (#element-lfrtpseal, #element-lfrtpgate). Without a key file, requests are accepted from
 * the hosts in `peers`, by default the hosts of `answers` and this machine. Sender addresses can be forged, so the
 * element posts a warning at start. `stats` counts dropped packets.
 *
 * The bin has no pads. It provides the realtime clock of the machine, unless another element in the bin provides a
 * clock. Synchronise the clocks of all hosts with chrony or PTP, because requests name capture times as time of day.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfnodesink rig=rig.json cameras=0-31 node=0 listen=6000 answers=VIEWER:6100
 * ]| Serves cameras 0 to 31 to the host VIEWER.
 * |[
 * gst-launch-1.0 lfnodesink rig=rig.json cameras=0-31 listen=6000 answers=VIEWER:6100 key-file=lightfield.key
 * ]| Does the same with encryption.
 */

#include <gst/gst.h>

#include <string>
#include <vector>

#include "base/text.h"
#include "bins/lfcameranode.h"
#include "bins/property_proxy.h"
#include "bins/rtp_link.h"
#include "common/gst_pointers.h"
#include "common/guard.h"
#include "common/properties.h"
#include "common/wall_clock.h"
#include "rtp/peers.h"
#include "rtp/rtplfpay.h"

GST_DEBUG_CATEGORY_STATIC(lf_node_sink_debug);
#define GST_CAT_DEFAULT lf_node_sink_debug

namespace {

struct Settings : lf::RtpSecurity {
  std::string listen, answers;
  bool operator==(const Settings&) const = default;

  static lf::PropertyTable<Settings>& properties() {
    using S = Settings;
    static lf::PropertyTable<S> table = {
        lf::property<&S::listen>(lf::kWhileReady, "listen", "Listen",
                                 "Comma-separated list of the addresses that receive view requests, with one item for "
                                 "each client (viewer or compositor host). An item is a local UDP port such as 6000, "
                                 "ADDRESS:PORT, or a multicast GROUP:PORT. This property is required"),
        lf::property<&S::answers>(lf::kWhileReady, "answers", "Answers",
                                  "Comma-separated list of the addresses that receive the answers, each as HOST:PORT. "
                                  "The first item belongs to the client of the first item in `listen`, and so on, so "
                                  "both lists have the same length. This property is required"),
        lf::inherited_property<S, &S::key_file>(
            lf::kWhileReady, "key-file", "Key file",
            "Path of the file with the secret that all hosts share (32 or more random characters). Packets are then "
            "encrypted, and only hosts with the same secret can send requests (empty: no encryption)"),
        lf::inherited_property<S, &S::peers>(
            lf::kWhileReady, "peers", "Peers",
            "Comma-separated list of the hosts that may send requests, as names, addresses or networks such as "
            "10.0.0.0/24. If the list is empty, every host with the secret in `key-file` may send requests. Without a "
            "key file, only this machine and the hosts in `answers` may send requests"),
    };
    return table;
  }
};

// A strip of 320 x 16 pixels fills about one packet, so a lost packet costs only one strip.
constexpr lf::ProxyDefault kNodeDefaults[] = {{"is-live", TRUE}, {"loop", TRUE}, {"strip-pixels", 5120}};

struct Links {
  Settings settings;
  std::unique_ptr<lf::ScopedElements> elements;
  std::unique_ptr<lf::RequestedPads> pads;
};

}  // namespace

#define LF_TYPE_NODE_SINK (lf_node_sink_get_type())
G_DECLARE_FINAL_TYPE(LfNodeSink, lf_node_sink, LF, NODE_SINK, GstBin)

struct _LfNodeSink {
  GstBin parent;
  Settings* settings;  // guarded by the object lock
  GstElement* node;    // borrowed; null if lfcameranode is not installed
  GstElement* pay;
  GstClock* realtime;
  Links* links;
};

G_DEFINE_FINAL_TYPE(LfNodeSink, lf_node_sink, GST_TYPE_BIN)
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lfnodesink, "lfnodesink", GST_RANK_NONE, LF_TYPE_NODE_SINK,
                                      GST_DEBUG_CATEGORY_INIT(lf_node_sink_debug, "lfnodesink", 0,
                                                              "cameras for viewers on other machines"))

static void remove_links(LfNodeSink* self) { *self->links = {}; }

static void add_requester(LfNodeSink* self, size_t index, const lf::HostPort& from, const lf::HostPort& to,
                          const lf::RtpSecurity& security) {
  const std::string number = std::to_string(index);
  const std::vector<std::string> addresses = lf::addresses_of(to.host);
  lf::ScopedElements& elements = *self->links->elements;
  GstElement* received = lf::add_receiver(elements, from, "X-LIGHTFIELD-REQUEST",
                                          lf::rtp_security_of(security, addresses), "requests" + number);
  GstElement* queue = elements.add("queue", "requests" + number);
  gst_util_set_object_arg(G_OBJECT(queue), "leaky", "downstream");
  g_object_set(queue, "max-size-buffers", 4, "max-size-time", guint64{0}, "max-size-bytes", 0, nullptr);
  // The node renders the next answer while the network sends the previous answer.
  GstElement* made = elements.add("queue", "made" + number);
  g_object_set(made, "max-size-buffers", 16, "max-size-time", guint64{0}, "max-size-bytes", 0, nullptr);
  GstElement* pay = elements.add("rtplfpay", "answers" + number + "_pay");
  for (const char* name : {"mtu", "max-bitrate"})
    g_object_bind_property(self->pay, name, pay, name, G_BINDING_SYNC_CREATE);
  GstElement* seal = elements.add("lfrtpseal", "answers" + number + "_seal");
  if (!security.key_file.empty()) g_object_set(seal, "key-file", security.key_file.c_str(), nullptr);
  GstElement* udp = elements.add("udpsink", "answers" + number + "_udp");
  g_object_set(udp, "host", addresses.front().c_str(), "port", to.port, "sync", FALSE, "async", FALSE, nullptr);

  std::string ending;
  if (index > 0) {
    GstPad* request = gst_element_request_pad_simple(self->node, "request_%u");
    ending = std::string(GST_PAD_NAME(request)).substr(sizeof("request") - 1);
    self->links->pads->add(self->node, request);
  }
  const bool linked = gst_element_link_pads(received, "src", queue, "sink") &&
                      gst_element_link_pads(queue, "src", self->node, ("request" + ending).c_str()) &&
                      gst_element_link_pads(self->node, ("src" + ending).c_str(), made, "sink") &&
                      gst_element_link_many(made, pay, seal, udp, nullptr);
  if (!linked) throw lf::Error("the cameras can't be linked with the network");
}

// Called before READY and before PAUSED. Returns false after posting an error.
static bool prepare(LfNodeSink* self) {
  lf::ObjectLock lock(self);
  const Settings settings = *self->settings;
  lock.unlock();
  Links& links = *self->links;
  if (links.pads && links.settings == settings) return true;
  remove_links(self);
  try {
    if (!self->node || !self->pay)
      throw lf::Error(
          "elements lfcameranode and rtplfpay are not installed (set "
          "GST_PLUGIN_PATH to the folder of the gst-lightfield plugin)");
    const std::vector<lf::HostPort> from = lf::parse_host_ports(settings.listen),
                                    to = lf::parse_host_ports(settings.answers);
    if (from.empty())
      throw lf::Error(
          "listen: not set (for example, listen=6000 receives view requests at UDP port "
          "6000)");
    if (from.size() != to.size())
      throw lf::Error(
          "listen and answers: must have the same number of items, one per client. For example, "
          "listen=6000,6001 needs answers=HOST1:6100,HOST2:6100");
    for (const lf::HostPort& place : to)
      if (place.host.empty()) throw lf::Error("answers: " + std::to_string(place.port) + ": must be HOST:PORT");
    links.elements = std::make_unique<lf::ScopedElements>(GST_BIN(self));
    links.pads = std::make_unique<lf::RequestedPads>();
    for (size_t i = 0; i < from.size(); i++) add_requester(self, i, from[i], to[i], settings);
    lf::bind_limits(GST_BIN(self), self->node);
    links.settings = settings;
    return true;
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
  }
  remove_links(self);
  return false;
}

static GstStateChangeReturn lf_node_sink_change_state(GstElement* element, GstStateChange transition) {
  const bool starts = transition == GST_STATE_CHANGE_NULL_TO_READY || transition == GST_STATE_CHANGE_READY_TO_PAUSED;
  if (starts && !prepare(LF_NODE_SINK(element))) return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED)
    lf::warn_without_key(element, LF_NODE_SINK(element)->links->settings);
  return GST_ELEMENT_CLASS(lf_node_sink_parent_class)->change_state(element, transition);
}

static GstClock* lf_node_sink_provide_clock(GstElement* element) {
  if (GstClock* clock = GST_ELEMENT_CLASS(lf_node_sink_parent_class)->provide_clock(element)) return clock;
  return GST_CLOCK(gst_object_ref(LF_NODE_SINK(element)->realtime));
}

static GstElement* owner_of(LfNodeSink* self, GParamSpec* copy) {
  return lf::is_proxy(copy, LF_TYPE_CAMERA_NODE) ? self->node : self->pay;
}

static void add_stats_of(LfNodeSink* self, const std::string& child, GstStructure* to) {
  g_autoptr(GstElement) element = gst_bin_get_by_name(GST_BIN(self), child.c_str());
  g_autoptr(GstStructure) stats = nullptr;
  if (element) g_object_get(element, "stats", &stats, nullptr);
  if (!stats) return;
  gst_structure_foreach(
      stats,
      [](GQuark field, const GValue* value, gpointer all) -> gboolean {
        gst_structure_id_set_value(static_cast<GstStructure*>(all), field, value);
        return TRUE;
      },
      to);
}

static GstStructure* make_stats(LfNodeSink* self) {
  GstStructure* stats = nullptr;
  if (self->node) g_object_get(self->node, "stats", &stats, nullptr);
  if (!stats) stats = gst_structure_new_empty("lightfield-fragment-stats");
  g_autoptr(GstStructure) all = gst_structure_new_empty("lightfield-requests");
  for (int i = 0;; i++) {
    const std::string name = "requests" + std::to_string(i);
    g_autoptr(GstElement) queue = gst_bin_get_by_name(GST_BIN(self), name.c_str());
    if (!queue) break;
    g_autoptr(GstStructure) one = gst_structure_new_empty("lightfield-requests-stats");
    for (const char* child : {"_gate", "_depay"}) add_stats_of(self, name + child, one);
    gst_structure_set(all, name.c_str(), GST_TYPE_STRUCTURE, one, nullptr);
  }
  gst_structure_set(stats, "requests", GST_TYPE_STRUCTURE, all, nullptr);
  return stats;
}

static Settings& settings_of(LfNodeSink* self) { return *self->settings; }
using Properties = lf::Properties<settings_of, make_stats>;

static void lf_node_sink_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  if (!lf::is_proxy(pspec)) return Properties::set(object, id, value, pspec);
  if (GstElement* owner = owner_of(LF_NODE_SINK(object), pspec))
    g_object_set_property(G_OBJECT(owner), pspec->name, value);
}

static void lf_node_sink_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!lf::is_proxy(pspec)) return Properties::get(object, id, value, pspec);
  if (GstElement* owner = owner_of(LF_NODE_SINK(object), pspec))
    g_object_get_property(G_OBJECT(owner), pspec->name, value);
}

static void lf_node_sink_dispose(GObject* object) {
  lf::guarded(object, false, [object] {
    remove_links(LF_NODE_SINK(object));
    return true;
  });
  gst_clear_object(&LF_NODE_SINK(object)->pay);
  LF_NODE_SINK(object)->node = nullptr;
  G_OBJECT_CLASS(lf_node_sink_parent_class)->dispose(object);
}

static void lf_node_sink_finalize(GObject* object) {
  LfNodeSink* self = LF_NODE_SINK(object);
  delete self->links;
  delete self->settings;
  gst_clear_object(&self->realtime);
  G_OBJECT_CLASS(lf_node_sink_parent_class)->finalize(object);
}

static void lf_node_sink_handle_message(GstBin* bin, GstMessage* message) {
  GST_BIN_CLASS(lf_node_sink_parent_class)->handle_message(bin, lf::with_port(message));
}

static void lf_node_sink_class_init(LfNodeSinkClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->dispose = lf_node_sink_dispose;
  object_class->finalize = lf_node_sink_finalize;
  const guint first_copy = Properties::install(
      object_class,
      "Counters of lfcameranode, and the structure requests, which contains one structure for each client (requests0, "
      "requests1, ...). The structure of a client counts the packets that passed, the packets that were dropped, by "
      "reason, and the requests that exceeded a limit. These are the counters of lfrtpgate and rtplfdepay");
  object_class->set_property = lf::callback<lf_node_sink_set_property>;
  object_class->get_property = lf::callback<lf_node_sink_get_property>;
  const guint next =
      lf::install_proxies(object_class, first_copy, LF_TYPE_CAMERA_NODE, {"is-live", "stats"}, {}, kNodeDefaults);
  lf::install_proxies(object_class, next, LF_TYPE_RTP_PAY, {"stats", "min-ptime", "max-ptime", "ptime-multiple"},
                      {"mtu"});

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = lf::callback<lf_node_sink_change_state>;
  GST_BIN_CLASS(klass)->handle_message = lf::callback<lf_node_sink_handle_message>;
  element_class->provide_clock = lf::callback<lf_node_sink_provide_clock>;
  gst_element_class_set_static_metadata(
      element_class, "Light field node sink", "Sink/Network/Video",
      "Serves the cameras of this machine to lfviewsrc on other hosts, and answers their view requests over RTP",
      "gst-lightfield");
}

static void lf_node_sink_init(LfNodeSink* self) {
  self->settings = new Settings;
  self->links = new Links;
  self->realtime = lf::new_wall_clock();
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_PROVIDE_CLOCK);
  self->pay = gst_element_factory_make("rtplfpay", nullptr);
  if (self->pay) gst_object_ref_sink(self->pay);
  self->node = gst_element_factory_make("lfcameranode", "node");
  if (!self->node) return;
  lf::set_defaults(self->node, kNodeDefaults);
  gst_bin_add(GST_BIN(self), self->node);
  lf::forward_notifications(G_OBJECT(self), G_OBJECT(self->node));
}
