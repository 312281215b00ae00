// SPDX-License-Identifier: LGPL-2.1-or-later
// Permissions, and addresses of viewers.
#include "serve/access.h"

#include "base/text.h"
#include "support/test.h"

namespace lf::serve {
namespace {

TEST(Access, Secrets) {
  EXPECT_TRUE(is_same_secret("abc", "abc"));
  for (const char* wrong : {"", "ab", "abd", "abcc", "ABC"}) EXPECT_FALSE(is_same_secret(wrong, "abc")) << wrong;
}

TEST(Access, Tokens) {
  const Access open("", {}, {}), closed("secret", {}, {});
  EXPECT_TRUE(open.has_token(nullptr));
  EXPECT_TRUE(closed.has_token("Bearer secret"));
  EXPECT_TRUE(closed.has_token("bearer secret"));
  for (const char* wrong : {"", "Bearer", "Bearer ", "Bearer secre", "Bearer secret ", "Basic secret", "secret"})
    EXPECT_FALSE(closed.has_token(wrong)) << wrong;
  EXPECT_FALSE(closed.has_token(nullptr));
}

TEST(Access, Loopback) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1", "localhost", "LOCALHOST"})
    EXPECT_TRUE(is_loopback(address)) << address;
  for (const char* address : {"0.0.0.0", "::", "10.0.0.1", "example.org", "", "127.0.0.1.example.org"})
    EXPECT_FALSE(is_loopback(address)) << address;
}

TEST(Access, Hosts) {
  const Access access("", {}, {"Cameras.example"});
  for (const char* host : {"127.0.0.1:8080", "127.0.0.1", "localhost:8080", "[::1]:8080", "192.0.2.7", "LOCALHOST",
                           "cameras.example", "cameras.example:8080"})
    EXPECT_TRUE(access.allows_host(host)) << host;
  for (const char* host : {"evil.org:8080", "", "127.0.0.1.evil.org", "cameras.example.evil.org", "[evil]", ":80"})
    EXPECT_FALSE(access.allows_host(host)) << host << ": DNS rebinding";
  EXPECT_FALSE(access.allows_host(nullptr));
}

TEST(Access, Origins) {
  const Access local("", {"https://example.org"}, {}), named("", {}, {"cameras.example"}), any("", {"*"}, {});
  EXPECT_TRUE(local.allows_origin(nullptr, "127.0.0.1:8080"));
  EXPECT_TRUE(local.allows_origin("http://localhost:8080", "localhost:8080"));
  EXPECT_TRUE(local.allows_origin("http://[::1]:8080", "[::1]:8080"));
  EXPECT_TRUE(local.allows_origin("https://example.org", "127.0.0.1:8080"));
  EXPECT_FALSE(local.allows_origin("http://localhost:9090", "localhost:8080"));
  EXPECT_FALSE(local.allows_origin("https://evil.org", "127.0.0.1:8080"));
  EXPECT_FALSE(local.allows_origin("null", "127.0.0.1:8080"));
  EXPECT_TRUE(named.allows_origin("https://cameras.example", "127.0.0.1:8080")) << "behind a proxy";
  EXPECT_FALSE(named.allows_origin("https://cameras.example.evil.org", "127.0.0.1:8080"));
  EXPECT_TRUE(any.allows_origin("https://anything", "cameras.example"));
}

TEST(Access, OriginsAndHostsAreNormalised) {
  for (const char* same :
       {"https://example.org", "https://Example.ORG", "https://example.org/", "HTTPS://example.org:443"})
    EXPECT_EQ(normal_origin(same), "https://example.org") << same;
  EXPECT_EQ(normal_origin("http://example.org:80"), "http://example.org");
  EXPECT_EQ(normal_origin("http://example.org:8080"), "http://example.org:8080");
  EXPECT_EQ(normal_origin("http://[::1]:8080"), "http://[::1]:8080");
  EXPECT_EQ(normal_origin("null"), "null");
  EXPECT_EQ(normal_origin("*"), "*");
  for (const char* wrong : {"", "example.org", "https://", "https://example.org/page", "https://a b", "://example.org",
                            "https://*.example.org", "https://user@example.org"})
    EXPECT_THROW(normal_origin(wrong), Error) << wrong;
  for (const char* same : {"example.org", "Example.org", "example.org:8080"})
    EXPECT_EQ(normal_host(same), "example.org") << same;
  for (const char* wrong : {"", ":8080", "https://example.org", "a b", "example.org/"})
    EXPECT_THROW(normal_host(wrong), Error) << wrong;
  EXPECT_TRUE(Access("", {"https://Example.org/"}, {}).allows_origin("https://example.org", "127.0.0.1"));
  EXPECT_TRUE(Access("", {}, {"Example.org:8080"}).allows_host("example.org:8080"));
}

TEST(Access, Sites) {
  const Access access("", {"https://example.org"}, {}), any("", {"*"}, {});
  constexpr char kHost[] = "127.0.0.1:8080";
  for (const char* site : {"none", "same-origin"}) EXPECT_TRUE(access.allows_site(site, nullptr, kHost)) << site;
  EXPECT_TRUE(access.allows_site(nullptr, nullptr, kHost)) << "not a browser";
  for (const char* site : {"cross-site", "same-site", "", "new-kind"}) {
    EXPECT_FALSE(access.allows_site(site, nullptr, kHost)) << site << ": an <img> of another page";
    EXPECT_FALSE(access.allows_site(site, "https://evil.org", kHost)) << site;
    EXPECT_TRUE(access.allows_site(site, "https://example.org", kHost)) << site;
    EXPECT_TRUE(any.allows_site(site, nullptr, kHost)) << site;
  }
}

TEST(ClientAddress, SubscriberIsAnAddressOrANetwork) {
  EXPECT_EQ(subscriber("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(subscriber("::ffff:192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(subscriber("2001:db8:1:2:3:4:5:6"), "2001:db8:1:2::/64");
  EXPECT_EQ(subscriber("2001:db8:1:2::9"), subscriber("2001:db8:1:2:ffff::1"));
  EXPECT_NE(subscriber("2001:db8:1:2::9"), subscriber("2001:db8:1:3::9"));
  EXPECT_EQ(subscriber("::1"), "::1");
  for (const char* wrong : {"", "example.org", "1.2.3", "1.2.3.4:80"}) EXPECT_EQ(subscriber(wrong), "") << wrong;
}

TEST(ClientAddress, TrustsOnlyProxies) {
  const std::set<std::string> proxies = {"127.0.0.1", "::1"};
  EXPECT_EQ(client_address("192.0.2.7", "198.51.100.1", proxies), "192.0.2.7");
  EXPECT_EQ(client_address("127.0.0.1", "198.51.100.1", proxies), "198.51.100.1");
  EXPECT_EQ(client_address("127.0.0.1", "10.0.0.1, 203.0.113.9 , 198.51.100.1", proxies), "198.51.100.1")
      << "earlier entries come from the client";
  EXPECT_EQ(client_address("127.0.0.1", nullptr, proxies), "127.0.0.1");
  for (const char* wrong : {"", ",", "unknown", "198.51.100.1,"})
    EXPECT_EQ(client_address("127.0.0.1", wrong, proxies), "127.0.0.1") << wrong;
}

TEST(ClientAddress, IsCanonical) {
  EXPECT_EQ(plain_address("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(plain_address("::FFFF:192.0.2.7"), "192.0.2.7") << "IPv4-mapped address";
  EXPECT_EQ(plain_address("2001:DB8:0:0::1"), "2001:db8::1");
  for (const char* wrong : {"", "localhost", "192.0.2.7:80", "[::1]"}) EXPECT_EQ(plain_address(wrong), "") << wrong;
  EXPECT_EQ(proxy_addresses("localhost"), (std::set<std::string>{"127.0.0.1", "::1"}));
  EXPECT_EQ(proxy_addresses("::ffff:10.0.0.1"), std::set<std::string>{"10.0.0.1"});
  for (const char* wrong : {"", "proxy.example", "10.0.0.1:80"}) EXPECT_THROW(proxy_addresses(wrong), Error) << wrong;
  EXPECT_TRUE(is_local_address("127.0.0.1"));
  for (const char* other : {"192.0.2.1", "", "localhost"}) EXPECT_FALSE(is_local_address(other)) << other;
}

TEST(ClientAddress, PrefixesArePlainPaths) {
  EXPECT_EQ(path_prefix("/lightfield"), "/lightfield");
  EXPECT_EQ(path_prefix("/a/b_c-1.2/"), "/a/b_c-1.2");
  for (const char* wrong : {"", "/", "lightfield", "//evil.org", "/a b", "/a\r\nX: y", "/a?b", "https://evil.org"})
    EXPECT_EQ(path_prefix(wrong), "") << wrong;
  EXPECT_EQ(path_prefix(nullptr), "");
}

}  // namespace
}  // namespace lf::serve
