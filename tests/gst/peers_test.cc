// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/peers.h"

#include <gio/gio.h>

#include "support/expect_error.h"

namespace lf {
namespace {

Address address(const std::string& text) {
  g_autoptr(GSocketAddress) socket = g_inet_socket_address_new_from_string(text.c_str(), 7);
  return *address_of(socket);
}

TEST(Peers, AddressesAreCanonicalForEverySocket) {
  EXPECT_EQ(address("10.0.0.7"), address("::ffff:10.0.0.7"));
  EXPECT_EQ(to_text(address("::ffff:10.0.0.7")), "10.0.0.7");
  EXPECT_EQ(to_text(address("fd00::7")), "fd00::7");
  EXPECT_FALSE(address_of(nullptr));
  for (const char* here : {"127.0.0.1", "127.8.9.1", "::1", "::ffff:127.0.0.1"})
    EXPECT_TRUE(is_loopback(address(here)));
  for (const char* there : {"128.0.0.1", "10.0.0.1", "::2", "fe80::1"}) EXPECT_FALSE(is_loopback(address(there)));
}

TEST(Peers, AcceptAddressesAndNetworks) {
  Peers peers("10.0.0.7,192.168.4.0/22,fd00::/33,[::1],localhost");
  for (const char* in :
       {"10.0.0.7", "::ffff:10.0.0.7", "192.168.4.0", "192.168.7.255", "fd00::1", "fd00:0:7fff::1", "::1", "127.0.0.1"})
    EXPECT_TRUE(peers.admits(address(in))) << in;
  for (const char* out : {"10.0.0.8", "192.168.8.0", "192.168.3.255", "fd00:0:8000::1", "fd01::1", "::2", "127.0.0.2"})
    EXPECT_FALSE(peers.admits(address(out))) << out;
}

TEST(Peers, DefaultToTheFirstLoopbackSender) {
  Peers peers;
  EXPECT_FALSE(peers.admits(address("10.0.0.1")));
  EXPECT_FALSE(peers.admits(address("fe80::1")));
  EXPECT_TRUE(peers.admits(address("127.0.0.1")));
  EXPECT_FALSE(peers.admits(address("127.0.0.2")));
  EXPECT_FALSE(peers.admits(address("::1")));
  EXPECT_TRUE(peers.admits(address("127.0.0.1")));
}

// A resolver without a responding name server: like GLib's own, it returns when cancelled.
G_DECLARE_FINAL_TYPE(SilentResolver, silent_resolver, SILENT, RESOLVER, GResolver)
struct _SilentResolver {
  GResolver parent;
};
G_DEFINE_FINAL_TYPE(SilentResolver, silent_resolver, G_TYPE_RESOLVER)
static void silent_resolver_init(SilentResolver*) {}
static void silent_resolver_class_init(SilentResolverClass* klass) {
  G_RESOLVER_CLASS(klass)->lookup_by_name = [](GResolver*, const gchar*, GCancellable* cancellable,
                                               GError** error) -> GList* {
    for (int i = 0; i < 100 && !g_cancellable_is_cancelled(cancellable); i++) g_usleep(100'000);
    if (!g_cancellable_set_error_if_cancelled(cancellable, error))
      g_set_error_literal(error, G_RESOLVER_ERROR, G_RESOLVER_ERROR_TEMPORARY_FAILURE, "no answer");
    return nullptr;
  };
}

TEST(HostLookup, TimesOutForASilentNameServer) {
  g_autoptr(GResolver) before = g_resolver_get_default();
  g_autoptr(GResolver) silent = G_RESOLVER(g_object_new(silent_resolver_get_type(), nullptr));
  g_resolver_set_default(silent);
  EXPECT_ERROR(addresses_of("node1"), "node1", "2 s");
  EXPECT_EQ(addresses_of("10.0.0.7"), std::vector<std::string>{"10.0.0.7"}) << "no query";
  EXPECT_EQ(addresses_of("fd00::7"), std::vector<std::string>{"fd00::7"});
  g_resolver_set_default(before);
}

TEST(Peers, ErrorsNameTheInvalidItem) {
  EXPECT_ERROR(Peers("10.0.0.1,nobody.invalid"), "nobody.invalid: ");
  EXPECT_ERROR(Peers("10.0.0.1/33"), "\"10.0.0.1/33\": ");
  EXPECT_ERROR(Peers("localhost,,::1"), "\"\"", "network");
}

}  // namespace
}  // namespace lf
