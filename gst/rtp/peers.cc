// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/peers.h"

#include <algorithm>
#include <sstream>

#include <gst/gst.h>

#include "base/text.h"

namespace lf {
namespace {

// Cancels an operation after a time limit, unless this object is destroyed earlier.
class TimeLimit {
 public:
  TimeLimit(GCancellable* cancellable, GstClockTime limit) {
    g_autoptr(GstClock) clock = gst_system_clock_obtain();
    id_ = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + limit);
    const auto cancel = [](GstClock*, GstClockTime, GstClockID, gpointer what) -> gboolean {
      g_cancellable_cancel(G_CANCELLABLE(what));
      return TRUE;
    };
    gst_clock_id_wait_async(id_, cancel, g_object_ref(cancellable), g_object_unref);
  }
  ~TimeLimit() {
    gst_clock_id_unschedule(id_);
    gst_clock_id_unref(id_);
  }
  TimeLimit(const TimeLimit&) = delete;

 private:
  GstClockID id_;
};

constexpr std::array<uint8_t, 12> kOfIpv4 = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xff, 0xff};

bool is_ipv4(const Address& address) { return std::equal(kOfIpv4.begin(), kOfIpv4.end(), address.begin()); }

Address to_address(GInetAddress* inet) {
  Address address;
  const guint8* bytes = g_inet_address_to_bytes(inet);
  if (g_inet_address_get_family(inet) == G_SOCKET_FAMILY_IPV6) {
    std::copy_n(bytes, 16, address.begin());
  } else {
    std::copy(kOfIpv4.begin(), kOfIpv4.end(), address.begin());
    std::copy_n(bytes, 4, address.begin() + 12);
  }
  return address;
}

bool is_within(const Address& address, const Address& first, unsigned bits) {
  for (unsigned i = 0; i < bits; i += 8) {
    const unsigned differ = address[i / 8] ^ first[i / 8];
    if (bits - i >= 8 ? differ : differ >> (8 - (bits - i))) return false;
  }
  return true;
}

}  // namespace

std::vector<std::string> addresses_of(const std::string& host) {
  const bool has_scope = host.find('%') != std::string::npos;  // fe80::1%eth0
  if (has_scope || g_hostname_is_ip_address(host.c_str())) return {host};
  g_autoptr(GResolver) resolver = g_resolver_get_default();
  g_autoptr(GCancellable) cancellable = g_cancellable_new();
  g_autoptr(GError) error = nullptr;
  const TimeLimit limit(cancellable, kLookupSeconds * GST_SECOND);
  GList* found = g_resolver_lookup_by_name(resolver, host.c_str(), cancellable, &error);
  std::vector<std::string> addresses;
  for (GList* each = found; each; each = each->next) {
    g_autofree gchar* text = g_inet_address_to_string(G_INET_ADDRESS(each->data));
    addresses.emplace_back(text);
  }
  g_resolver_free_addresses(found);
  if (g_error_matches(error, G_IO_ERROR, G_IO_ERROR_CANCELLED))
    throw Error(host + ": no answer from a name server within " + std::to_string(kLookupSeconds) + " s");
  if (error) throw Error(host + ": " + error->message);
  return addresses;
}

std::optional<Address> address_of(GSocketAddress* socket) {
  if (!socket || !G_IS_INET_SOCKET_ADDRESS(socket)) return std::nullopt;
  return to_address(g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(socket)));
}

bool is_loopback(const Address& address) {
  constexpr Address kIpv6 = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  return address == kIpv6 || (is_ipv4(address) && address[12] == 127);
}

std::string to_text(const Address& address) {
  const bool v4 = is_ipv4(address);
  g_autoptr(GInetAddress) inet =
      g_inet_address_new_from_bytes(address.data() + (v4 ? 12 : 0), v4 ? G_SOCKET_FAMILY_IPV4 : G_SOCKET_FAMILY_IPV6);
  g_autofree gchar* text = g_inet_address_to_string(inet);
  return text;
}

Peers::Peers(const std::string& text) {
  std::istringstream stream(text);
  for (std::string item; std::getline(stream, item, ',');) {
    const bool brackets = item.size() > 2 && item.front() == '[' && item.back() == ']';
    add(brackets ? item.substr(1, item.size() - 2) : item);
  }
}

void Peers::add(const std::string& item) {
  g_autoptr(GInetAddressMask) mask = g_inet_address_mask_new_from_string(item.c_str(), nullptr);
  if (mask) {
    const Address first = to_address(g_inet_address_mask_get_address(mask));
    ranges_.push_back({first, g_inet_address_mask_get_length(mask) + (is_ipv4(first) ? 96 : 0)});
    return;
  }
  if (item.empty() || item.find('/') != std::string::npos)
    throw Error("\"" + item + "\": must be a name, an address or a network");
  for (const std::string& address : addresses_of(item)) {
    g_autoptr(GInetAddress) inet = g_inet_address_new_from_string(address.substr(0, address.find('%')).c_str());
    if (inet) ranges_.push_back({to_address(inet), 128});
  }
}

bool Peers::admits(const Address& address) {
  if (ranges_.empty()) {
    if (!first_ && is_loopback(address)) first_ = address;
    return first_ == address;
  }
  return std::ranges::any_of(ranges_, [&](const Range& r) { return is_within(address, r.first, r.bits); });
}

}  // namespace lf
