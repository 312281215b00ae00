// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/rtp_link.h"

#include <gio/gio.h>

#include <cstring>
#include <fstream>

#include "base/text.h"
#include "common/gst_pointers.h"
#include "rtp/peers.h"
#include "wire/unit.h"

namespace lf {
namespace {

// A large buffer absorbs all packets of an answer. The default of Linux is 208 KiB, and the sysctl net.core.rmem_max is
// the upper limit.
constexpr int kReceiveBuffer = 8 << 20;

// Returns true if this machine supports IPv6. Receivers then listen on IPv6, because an IPv6 socket also receives IPv4
// packets.
bool has_ipv6() {
  std::ifstream interfaces("/proc/net/if_inet6");
  return interfaces.peek() != std::ifstream::traits_type::eof();
}

bool is_group(const std::string& host) {
  g_autoptr(GInetAddress) address = g_inet_address_new_from_string(host.c_str());
  return address && g_inet_address_get_is_multicast(address);
}

const char* text_or_null(const std::string& text) { return text.empty() ? nullptr : text.c_str(); }

// Returns the address to receive the answers of a node on. If the node is on a loopback address, this is the same
// address, so that other hosts cannot reach the port.
HostPort place_of_answers(const NodeAddress& node) {
  std::string address = node.answer_host;
  if (address.empty() && (node.host.starts_with("127.") || node.host == "::1")) address = node.host;
  return {address, node.answer_port};
}

}  // namespace

ScopedElements::~ScopedElements() {
  for (GstElement* element : elements_) {
    gst_element_set_state(element, GST_STATE_NULL);
    gst_bin_remove(bin_, element);
  }
}

GstElement* ScopedElements::add(const char* factory, const std::string& name) {
  GstElement* element = gst_element_factory_make(factory, name.c_str());
  if (!element)
    throw Error(std::string("element ") + factory +
                " is not installed (UDP elements are in gstreamer1.0-plugins-good)");
  return add(element);
}

GstElement* ScopedElements::add(GstElement* element) {
  elements_.push_back(element);
  gst_bin_add(bin_, element);
  return element;
}

// Requests and answers have the view id at the same offset (lib/wire/spec.md).
std::optional<uint32_t> view_of(GstBuffer* unit) {
  guint8 bytes[4];
  if (gst_buffer_extract(unit, wire::kUnitHeaderBytes, bytes, sizeof bytes) != sizeof bytes) return std::nullopt;
  return wire::Reader(bytes).get<uint32_t>();
}

RtpSecurity rtp_security_of(const RtpSecurity& settings, const std::vector<std::string>& addresses) {
  if (!settings.key_file.empty() || !settings.peers.empty()) return settings;
  std::string peers;
  for (const std::string& address : addresses) peers += address + ",";
  return {"", peers + "127.0.0.0/8,::1"};
}

void warn_without_key(GstElement* element, const RtpSecurity& security) {
  if (!security.key_file.empty()) return;
  const std::string from = security.peers.empty() ? "" : " (" + security.peers + ")";
  GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                      ("No key-file: anyone on this network can read packets and send requests. Packets are not "
                       "encrypted, and the allowed addresses%s can be forged.",
                       from.c_str()),
                      (nullptr));
}

GstElement* add_receiver(ScopedElements& to, const HostPort& from, const char* encoding, const RtpSecurity& security,
                         const std::string& name) {
  GstElement* udp = to.add("udpsrc", name + "_udp");
  // `reuse` lets two sockets bind one port. Each unicast packet still reaches only one of the two sockets.
  g_object_set(udp, "reuse", is_group(from.host), nullptr);
  if (!from.host.empty())
    g_object_set(udp, "address", from.host.c_str(), "auto-multicast", TRUE, nullptr);
  else if (has_ipv6())
    g_object_set(udp, "address", "::", nullptr);
  GstCaps* caps = gst_caps_new_simple(security.key_file.empty() ? "application/x-rtp" : "application/x-srtp", "media",
                                      G_TYPE_STRING, "application", "clock-rate", G_TYPE_INT, 90000, "encoding-name",
                                      G_TYPE_STRING, encoding, nullptr);
  g_object_set(udp, "port", from.port, "buffer-size", kReceiveBuffer, "caps", caps, nullptr);
  gst_caps_unref(caps);
  GstElement* gate = to.add("lfrtpgate", name + "_gate");
  g_object_set(gate, "key-file", text_or_null(security.key_file), "peers", text_or_null(security.peers), nullptr);
  // Packets may arrive more than once in this process: members of a multicast group get the same packet, and a viewer
  // encrypts each request only once for all hosts. Copies in different receivers must not count as replay attacks.
  const bool has_copies = is_group(from.host) || std::strcmp(encoding, "X-LIGHTFIELD-REQUEST") == 0;
  g_object_set(gate, "copies", has_copies, nullptr);
  GstElement* depay = to.add("rtplfdepay", name + "_depay");
  if (!gst_element_link_many(udp, gate, depay, nullptr)) throw Error("udpsrc can't be linked with rtplfdepay");
  return depay;
}

CameraHosts::CameraHosts(GstBin* bin, const std::vector<NodeAddress>& nodes, const std::string& key_file)
    : elements_(bin), requests_(elements_.add("rtplfpay", "request_pay")) {
  GstElement* seal = elements_.add("lfrtpseal", "request_seal");
  g_object_set(seal, "key-file", text_or_null(key_file), nullptr);
  GstElement* udp = elements_.add("multiudpsink", "request_udp");
  g_object_set(udp, "sync", FALSE, "async", FALSE, nullptr);
  if (!gst_element_link_many(requests_, seal, udp, nullptr)) throw Error("request elements can't be linked");
  for (const NodeAddress& node : nodes) {
    const std::vector<std::string> addresses = addresses_of(node.host);
    g_signal_emit_by_name(udp, "add", addresses.front().c_str(), node.request_port, nullptr);
    GstElement* answers =
        add_receiver(elements_, place_of_answers(node), "X-LIGHTFIELD-ANSWER",
                     rtp_security_of({key_file, ""}, addresses), "host" + std::to_string(hosts_.size()));
    hosts_.push_back({node.host + ":" + std::to_string(node.request_port), answers});
  }
}

void bind_limits(GstBin* bin, GstElement* element) {
  for (const char* factory : {"rtplfdepay", "lfcameranode"})
    for (const ElementPtr& follower : take_elements(gst_bin_iterate_all_by_element_factory_name(bin, factory)))
      if (follower.get() != element)
        g_object_bind_property(element, "limits", follower.get(), "limits", G_BINDING_SYNC_CREATE);
}

GstMessage* with_port(GstMessage* message) {
  if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR || !GST_IS_ELEMENT(GST_MESSAGE_SRC(message))) return message;
  GstElementFactory* factory = gst_element_get_factory(GST_ELEMENT(GST_MESSAGE_SRC(message)));
  if (!factory || g_strcmp0(GST_OBJECT_NAME(factory), "udpsrc") != 0) return message;
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  gint port = 0;
  g_object_get(GST_MESSAGE_SRC(message), "port", &port, nullptr);
  const gchar* reason = debug ? std::strrchr(debug, '\n') : nullptr;
  g_autoptr(GError) reported =
      g_error_new(error->domain, error->code, "UDP port %d: %s", port, reason ? reason + 1 : error->message);
  GstMessage* better = gst_message_new_error(GST_MESSAGE_SRC(message), reported, debug);
  gst_message_set_seqnum(better, gst_message_get_seqnum(message));
  gst_message_unref(message);
  return better;
}

}  // namespace lf
