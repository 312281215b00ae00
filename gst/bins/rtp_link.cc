// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/rtp_link.h"

#include <gio/gio.h>

#include <cstring>
#include <fstream>

#include "base/error.h"
#include "common/request_guard.h"

namespace lf {
namespace {

// The system's default is 208 KiB. (Capped by the sysctl net.core.rmem_max.)
constexpr int kReceiveBuffer = 8 << 20;

// A socket of IPv6 takes what comes by either.
bool has_ipv6() {
  std::ifstream interfaces("/proc/net/if_inet6");
  return interfaces.peek() != std::ifstream::traits_type::eof();
}

bool is_group(const std::string& host) {
  g_autoptr(GInetAddress) address = g_inet_address_new_from_string(host.c_str());
  return address && g_inet_address_get_is_multicast(address);
}

const char* text_or_null(const std::string& text) { return text.empty() ? nullptr : text.c_str(); }

}  // namespace

GstElement* add_element(GstBin* bin, const char* factory, const std::string& name) {
  GstElement* element = gst_element_factory_make(factory, name.c_str());
  if (!element)
    throw Error(std::string("element ") + factory +
                " is not installed (those of UDP are in gstreamer1.0-plugins-good)");
  gst_bin_add(bin, element);
  return element;
}

Admission admission_of(const Admission& settings, const std::vector<std::string>& addresses) {
  if (!settings.key_file.empty() || !settings.peers.empty()) return settings;
  std::string peers;
  for (const std::string& address : addresses) peers += address + ",";
  return {"", peers + "127.0.0.0/8,::1"};
}

void warn_without_key(GstElement* element, const Admission& admission) {
  if (!admission.key_file.empty()) return;
  const std::string from = admission.peers.empty() ? "" : " (" + admission.peers + ")";
  GST_ELEMENT_WARNING(element, RESOURCE, SETTINGS,
                      ("Without a key-file anybody on this network can steer and see: packets are not sealed, and the "
                       "addresses that requests are taken from%s can be forged.",
                       from.c_str()),
                      (nullptr));
}

GstPad* add_receiver(GstBin* bin, const HostPort& from, const char* encoding, const Admission& admission,
                     const std::string& name, std::vector<GstElement*>* added) {
  GstElement* udp = add_element(bin, "udpsrc", name + "_udp");
  added->push_back(udp);
  // What comes to a port that two have taken reaches one of them: the second one is an error. A group's reaches both.
  g_object_set(udp, "reuse", is_group(from.host), nullptr);
  if (!from.host.empty())
    g_object_set(udp, "address", from.host.c_str(), "auto-multicast", TRUE, nullptr);
  else if (has_ipv6())
    g_object_set(udp, "address", "::", nullptr);
  GstCaps* caps = gst_caps_new_simple(admission.key_file.empty() ? "application/x-rtp" : "application/x-srtp", "media",
                                      G_TYPE_STRING, "application", "clock-rate", G_TYPE_INT, 90000, "encoding-name",
                                      G_TYPE_STRING, encoding, nullptr);
  g_object_set(udp, "port", from.port, "buffer-size", kReceiveBuffer, "caps", caps, nullptr);
  gst_caps_unref(caps);
  GstElement* gate = add_element(bin, "lfrtpgate", name + "_gate");
  added->push_back(gate);
  g_object_set(gate, "key-file", text_or_null(admission.key_file), "peers", text_or_null(admission.peers), nullptr);
  // A viewer seals a request once for all of its hosts.
  const bool has_copies = is_group(from.host) || std::strcmp(encoding, "X-LIGHTFIELD-REQUEST") == 0;
  g_object_set(gate, "copies", has_copies, nullptr);
  GstElement* depay = add_element(bin, "rtplfdepay", name + "_depay");
  added->push_back(depay);
  if (!gst_element_link_many(udp, gate, depay, nullptr)) throw Error("udpsrc can't be linked with rtplfdepay");
  return gst_element_get_static_pad(depay, "src");
}

void follow_limits(GstBin* bin, GstElement* element) {
  for (const char* factory : {"rtplfdepay", "lfcameranode"}) {
    GstIterator* all = gst_bin_iterate_all_by_element_factory_name(bin, factory);
    GValue item = G_VALUE_INIT;
    while (gst_iterator_next(all, &item) == GST_ITERATOR_OK) {
      auto* const follower = static_cast<GObject*>(g_value_get_object(&item));
      for (const char* name : RequestGuard::kNames)
        if (follower != G_OBJECT(element) && g_object_class_find_property(G_OBJECT_GET_CLASS(element), name))
          g_object_bind_property(element, name, follower, name, G_BINDING_SYNC_CREATE);
      g_value_reset(&item);
    }
    g_value_unset(&item);
    gst_iterator_free(all);
  }
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
  const gchar* reason = debug ? std::strrchr(debug, '\n') : nullptr;  // behind the place in udpsrc's source
  g_autoptr(GError) told =
      g_error_new(error->domain, error->code, "UDP port %d: %s", port, reason ? reason + 1 : error->message);
  GstMessage* better = gst_message_new_error(GST_MESSAGE_SRC(message), told, debug);
  gst_message_set_seqnum(better, gst_message_get_seqnum(message));
  gst_message_unref(message);
  return better;
}

}  // namespace lf
