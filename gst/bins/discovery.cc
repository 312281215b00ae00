// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/discovery.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <memory>
#include <tuple>
#include <utility>

#include <gio/gio.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace lf {
namespace {

constexpr int64_t kLongestSearch = 5 * G_USEC_PER_SEC;
constexpr int kCallTimeout = 2000;  // milliseconds
constexpr size_t kMaxHosts = 1024;
constexpr char kAvahi[] = "org.freedesktop.Avahi", kServer[] = "org.freedesktop.Avahi.Server",
               kServer2[] = "org.freedesktop.Avahi.Server2", kBrowser[] = "org.freedesktop.Avahi.ServiceBrowser";
constexpr int kAny = -1;  // any network interface or protocol

// One spelling per address. Returns "" if the text is not an IP address.
std::string canonical(const std::string& address) {
  g_autoptr(GInetAddress) inet = g_inet_address_new_from_string(address.c_str());
  if (!inet) return "";
  g_autofree gchar* text = g_inet_address_to_string(inet);
  return text;
}

std::set<std::string> own_addresses() {
  std::set<std::string> addresses;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return addresses;
  for (const ifaddrs* each = all; each; each = each->ifa_next) {
    if (!each->ifa_addr) continue;
    const int family = each->ifa_addr->sa_family;
    if (family != AF_INET && family != AF_INET6) continue;
    g_autoptr(GSocketAddress) socket = g_socket_address_new_from_native(
        each->ifa_addr, family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6));
    g_autofree gchar* text = g_inet_address_to_string(g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(socket)));
    addresses.insert(text);
  }
  freeifaddrs(all);
  return addresses;
}

// The search for announcements, with the D-Bus interface of avahi-daemon. Runs in the thread of its construction.
class Search {
 public:
  Search() : context_(g_main_context_new()) {
    g_main_context_push_thread_default(context_);
    g_autoptr(GError) error = nullptr;
    // A connection of g_bus_get_sync() would end the process if the bus ends.
    g_autofree gchar* address = g_dbus_address_get_for_bus_sync(G_BUS_TYPE_SYSTEM, nullptr, &error);
    constexpr auto kFlags = static_cast<GDBusConnectionFlags>(G_DBUS_CONNECTION_FLAGS_AUTHENTICATION_CLIENT |
                                                              G_DBUS_CONNECTION_FLAGS_MESSAGE_BUS_CONNECTION);
    if (address) bus_ = g_dbus_connection_new_for_address_sync(address, kFlags, nullptr, nullptr, &error);
    if (!bus_) failure_ = error->message;
  }
  ~Search() {
    if (subscription_) g_dbus_connection_signal_unsubscribe(bus_, subscription_);
    while (g_main_context_iteration(context_, FALSE)) {
    }
    g_clear_object(&bus_);
    g_main_context_pop_thread_default(context_);
    g_main_context_unref(context_);
  }
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  // Browses until `is_complete` returns true for the hosts that were found, or for kLongestSearch. Throws Error.
  std::vector<AnnouncedHost> run(const std::function<bool(const std::vector<AnnouncedHost>&)>& is_complete) {
    Reply browser;
    if (bus_)
      browser = call("/", kServer2, "ServiceBrowserPrepare",
                     g_variant_new("(iissu)", kAny, kAny, AnnouncedHost::kType, "", 0u));
    const gchar* path = nullptr;
    if (browser) g_variant_get(browser.get(), "(&o)", &path);
    if (path) {
      subscription_ = g_dbus_connection_signal_subscribe(bus_, kAvahi, kBrowser, "ItemNew", path, nullptr,
                                                         G_DBUS_SIGNAL_FLAGS_NONE, on_item, this, nullptr);
      (void)call(path, kBrowser, "Start", nullptr);
    }
    if (!failure_.empty()) throw Error("auto: the search for camera hosts needs the service avahi-daemon: " + failure_);
    GSource* wakeup = g_timeout_source_new(100);
    g_source_set_callback(
        wakeup, [](gpointer) -> gboolean { return G_SOURCE_CONTINUE; }, nullptr, nullptr);
    g_source_attach(wakeup, context_);
    size_t known = 0;
    for (bool complete = is_complete(hosts_); !complete && time_left() > 0;) {
      g_main_context_iteration(context_, TRUE);
      if (hosts_.size() != std::exchange(known, hosts_.size())) complete = is_complete(hosts_);
    }
    g_source_destroy(wakeup);
    g_source_unref(wakeup);
    (void)call(path, kBrowser, "Free", nullptr);
    return hosts_;
  }

 private:
  struct Unref {
    void operator()(GVariant* value) const { g_variant_unref(value); }
  };
  using Reply = std::unique_ptr<GVariant, Unref>;

  int64_t time_left() const { return end_ - g_get_monotonic_time(); }

  // After a failure, returns null and sets failure_.
  Reply call(const char* path, const char* interface, const char* method, GVariant* arguments) {
    g_autoptr(GError) error = nullptr;
    Reply reply(g_dbus_connection_call_sync(bus_, kAvahi, path, interface, method, arguments, nullptr,
                                            G_DBUS_CALL_FLAGS_NONE, kCallTimeout, nullptr, &error));
    if (!reply) failure_ = error->message;
    return reply;
  }

  static void on_item(GDBusConnection*, const gchar*, const gchar*, const gchar*, const gchar*, GVariant* item,
                      gpointer self) {
    if (g_variant_is_of_type(item, G_VARIANT_TYPE("(iisssu)"))) static_cast<Search*>(self)->resolve(item);
  }

  // Any host of the network can announce services, so their number and the time for them are bounded.
  void resolve(GVariant* item) {
    if (time_left() <= 0 || ++resolved_ > kMaxHosts) return;
    gint32 interface = 0, protocol = 0;
    const gchar *name = nullptr, *type = nullptr, *domain = nullptr;
    g_variant_get(item, "(ii&s&s&su)", &interface, &protocol, &name, &type, &domain, nullptr);
    const Reply reply = call("/", kServer, "ResolveService",
                             g_variant_new("(iisssiu)", interface, protocol, name, type, domain, kAny, 0u));
    if (!reply || !g_variant_is_of_type(reply.get(), G_VARIANT_TYPE("(iissssisqaayu)"))) return;
    g_autoptr(GVariant) records = g_variant_get_child_value(reply.get(), 9);
    std::vector<std::string> fields;
    for (gsize i = 0; i < g_variant_n_children(records); i++) {
      g_autoptr(GVariant) record = g_variant_get_child_value(records, i);
      gsize size = 0;
      const auto* bytes = static_cast<const char*>(g_variant_get_fixed_array(record, &size, 1));
      fields.emplace_back(bytes ? bytes : "", bytes ? size : 0);
    }
    if (auto host = parse_announcement(fields)) hosts_.push_back(std::move(*host));
  }

  GMainContext* context_;
  GDBusConnection* bus_ = nullptr;
  guint subscription_ = 0;
  std::string failure_;
  std::vector<AnnouncedHost> hosts_;
  const int64_t end_ = g_get_monotonic_time() + kLongestSearch;
  size_t resolved_ = 0;
};

std::string ids_of(const Rig& rig, const std::set<CameraIndex>& cameras) {
  std::string ids;
  for (const CameraIndex camera : cameras) ids += (ids.empty() ? "" : ", ") + std::to_string(rig.cameras[camera].id);
  return ids;
}

}  // namespace

std::string rig_hash_text(const Rig& rig) {
  char text[17];
  std::snprintf(text, sizeof text, "%016" PRIx64, rig.hash());
  return text;
}

std::optional<AnnouncedHost> parse_announcement(const std::vector<std::string>& fields) {
  AnnouncedHost host;
  for (const std::string& field : fields) {
    const size_t equals = field.find('=');
    if (equals == field.npos) continue;
    const std::string key = field.substr(0, equals), value = field.substr(equals + 1);
    if (key == "rig") host.rig = value;
    if (key == "cameras") host.cameras = value;
    if (!key.starts_with("client")) continue;
    try {
      const std::vector<NodeAddress> clients = parse_nodes(value);
      host.clients.insert(host.clients.end(), clients.begin(), clients.end());
    } catch (const Error&) {
      return std::nullopt;
    }
  }
  const auto is_address = [](const NodeAddress& client) {
    return !canonical(client.host).empty() && !canonical(client.answer_host).empty();
  };
  if (host.rig.empty() || host.cameras.empty() || host.clients.empty() ||
      !std::ranges::all_of(host.clients, is_address))
    return std::nullopt;
  return host;
}

std::vector<NodeAddress> connections_to(const std::set<std::string>& own_addresses, const Rig& rig,
                                        const std::vector<AnnouncedHost>& hosts, std::set<CameraIndex>& missing) {
  std::vector<NodeAddress> connections;
  for (const AnnouncedHost& host : hosts) {
    if (host.rig != rig_hash_text(rig)) continue;
    const auto client = std::ranges::find_if(
        host.clients, [&](const NodeAddress& each) { return own_addresses.contains(canonical(each.answer_host)); });
    if (client == host.clients.end()) continue;
    std::vector<CameraIndex> cameras;
    try {
      cameras = parse_camera_list(rig, host.cameras);
    } catch (const Error&) {
      continue;
    }
    // A host announces itself on each network interface.
    const auto is_missing = [&](CameraIndex camera) { return missing.contains(camera); };
    if (!std::ranges::all_of(cameras, is_missing)) continue;
    for (const CameraIndex camera : cameras) missing.erase(camera);
    connections.push_back(*client);
  }
  return connections;
}

std::vector<NodeAddress> find_nodes(const std::string& text, const Rig& rig,
                                    const std::function<void(const std::string&)>& warn) {
  if (text != "auto") return parse_nodes(text);
  const std::set<std::string> own = own_addresses();
  std::set<CameraIndex> all, missing;
  for (size_t i = 0; i < rig.cameras.size(); i++) all.insert(static_cast<CameraIndex>(i));
  std::vector<NodeAddress> nodes;
  const std::vector<AnnouncedHost> hosts = Search().run([&](const std::vector<AnnouncedHost>& found) {
    missing = all;
    nodes = connections_to(own, rig, found, missing);
    return missing.empty();
  });
  if (nodes.empty())
    throw Error("auto: no camera host announces cameras of this rig (hash " + rig_hash_text(rig) +
                ") and a connection to this machine; found " + std::to_string(hosts.size()) +
                " announcements. Check with: avahi-browse -rt " + AnnouncedHost::kType);
  if (!missing.empty()) warn("auto: no host announces the cameras " + ids_of(rig, missing));
  // The order of the answers on the network is random.
  std::ranges::sort(nodes, [](const NodeAddress& a, const NodeAddress& b) {
    return std::tie(a.answer_port, a.host) < std::tie(b.answer_port, b.host);
  });
  return nodes;
}

}  // namespace lf
