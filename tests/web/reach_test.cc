// SPDX-License-Identifier: LGPL-2.1-or-later
// Where viewers come from and how they are reached: addresses, proxies, ICE servers; and what logs say of them.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "serve/client_address.h"
#include "serve/ice_servers.h"
#include "serve/log.h"

namespace lf::serve {
namespace {

TEST(ClientAddress, ASubscriberHasOneAddressOrANetwork) {
  EXPECT_EQ(subscriber("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(subscriber("::ffff:192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(subscriber("2001:db8:1:2:3:4:5:6"), "2001:db8:1:2::/64");
  EXPECT_EQ(subscriber("2001:db8:1:2::9"), subscriber("2001:db8:1:2:ffff::1"));
  EXPECT_NE(subscriber("2001:db8:1:2::9"), subscriber("2001:db8:1:3::9"));
  EXPECT_EQ(subscriber("::1"), "::1");
  for (const char* wrong : {"", "example.org", "1.2.3", "1.2.3.4:80"}) EXPECT_EQ(subscriber(wrong), "") << wrong;
}

TEST(ClientAddress, OnlyProxiesAreBelieved) {
  const std::set<std::string> proxies = {"127.0.0.1", "::1"};
  EXPECT_EQ(client_address("192.0.2.7", "198.51.100.1", proxies), "192.0.2.7");
  EXPECT_EQ(client_address("127.0.0.1", "198.51.100.1", proxies), "198.51.100.1");
  EXPECT_EQ(client_address("127.0.0.1", "10.0.0.1, 203.0.113.9 , 198.51.100.1", proxies), "198.51.100.1")
      << "what is before was written by the client";
  EXPECT_EQ(client_address("127.0.0.1", nullptr, proxies), "127.0.0.1");
  for (const char* wrong : {"", ",", "unknown", "198.51.100.1,"})
    EXPECT_EQ(client_address("127.0.0.1", wrong, proxies), "127.0.0.1") << wrong;
}

TEST(ClientAddress, HasOneForm) {
  EXPECT_EQ(plain_address("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(plain_address("::FFFF:192.0.2.7"), "192.0.2.7") << "as a socket that listens at :: names it";
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

TEST(IceServers, StunAndTurnWithAPassword) {
  const IceServers none, servers({"stun:stun.example.org", "turn:[2001:db8::1]:443?transport=tcp"}, "me pa:ss/word\n");
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(none.links(0), "");
  EXPECT_EQ(servers.links(0),
            "<stun:stun.example.org>; rel=\"ice-server\", <turn:[2001:db8::1]:443?transport=tcp>; rel=\"ice-server\"; "
            "username=\"me\"; credential=\"pa:ss/word\"; credential-type=\"password\"");
  const std::vector<std::string> expected = {"stun://stun.example.org:3478",
                                             "turn://me:pa%3Ass%2Fword@[2001:db8::1]:443?transport=tcp"};
  EXPECT_EQ(servers.for_webrtcbin(0), expected);
}

TEST(IceServers, RelaysAreTheAddressesOfTurnServers) {
  const IceServers servers(
      {"stun:192.0.2.1", "turn:192.0.2.2:443?transport=tcp", "turn:[2001:db8::1]", "turn:localhost", "turn:[nowhere"},
      "me word");
  testing::internal::CaptureStdout();
  const std::set<std::string> found = servers.relays();
  EXPECT_NE(testing::internal::GetCapturedStdout().find("turn:[nowhere: "), std::string::npos);
  EXPECT_TRUE(found.contains("192.0.2.2"));
  EXPECT_TRUE(found.contains("2001:db8::1"));
  EXPECT_TRUE(found.contains("127.0.0.1") || found.contains("::1"));
  EXPECT_FALSE(found.contains("192.0.2.1"));
}

// The password is the HMAC-SHA1 of the time, as `openssl dgst -sha1 -hmac secret -binary | base64` makes it.
TEST(IceServers, ASecretMakesPasswordsThatEnd) {
  const IceServers servers({"turn:turn.example.org"}, "secret\n");
  EXPECT_EQ(servers.links(1000000000 - IceServers::kLifetime),
            "<turn:turn.example.org>; rel=\"ice-server\"; username=\"1000000000\"; "
            "credential=\"7XgaE+myt0a/Q2fC/cMCn+tSTUs=\"; credential-type=\"password\"");
  EXPECT_NE(servers.links(1), servers.links(2));
}

TEST(IceServers, WhatCouldEndAHeaderIsNone) {
  for (const char* wrong : {"", "stun", "stun:", "http://example.org", "stun:a b", "stun:a>;", "stun:a?transport=udp",
                            "turn:a?transport=sctp", "turn:a?x", "turn:u:p@host"})
    EXPECT_THROW(IceServers({wrong}, "a b"), Error) << wrong;
  EXPECT_THROW(IceServers({"turn:example.org"}, ""), Error);
  EXPECT_THROW(IceServers({"turn:example.org"}, "a b c"), Error);
  EXPECT_THROW(IceServers({"turn:example.org"}, "a b\""), Error);
}

TEST(Log, LinesArePrintableAndShort) {
  EXPECT_EQ(printable("view 1 opens"), "view 1 opens");
  EXPECT_EQ(printable("a\nb\x1b[31m\xc3\xa4"), "a?b?[31m??");
  EXPECT_EQ(printable(std::string(1000, 'x')).size(), kLongestLine);
}

TEST(Log, ThereAreNoMoreLinesThanAPersonReads) {
  testing::internal::CaptureStdout();
  for (int i = 0; i < 3 * kLinesAtOnce; i++) say("line");
  const std::string said = testing::internal::GetCapturedStdout();
  EXPECT_LT(std::count(said.begin(), said.end(), '\n'), 2 * kLinesAtOnce);
}

}  // namespace
}  // namespace lf::serve
