// SPDX-License-Identifier: LGPL-2.1-or-later
#include <ctime>

#include <gst/gst.h>

#include "base/text.h"
#include "serve/offer.h"
#include "support/process.h"
#include "support/test.h"
#include "web/offers.h"

namespace lf::serve {
namespace {

TEST(IceServers, ListsStunAndTurnWithAPassword) {
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
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("turn:[nowhere: "));
  EXPECT_TRUE(found.contains("192.0.2.2"));
  EXPECT_TRUE(found.contains("2001:db8::1"));
  EXPECT_TRUE(found.contains("127.0.0.1") || found.contains("::1"));
  EXPECT_FALSE(found.contains("192.0.2.1"));
}

// The password is the HMAC-SHA1 of the time, as in `openssl dgst -sha1 -hmac secret -binary | base64`.
TEST(IceServers, SecretMakesTemporaryPasswords) {
  const IceServers servers({"turn:turn.example.org"}, "secret\n");
  EXPECT_EQ(servers.links(1000000000 - IceServers::kLifetime),
            "<turn:turn.example.org>; rel=\"ice-server\"; username=\"1000000000\"; "
            "credential=\"7XgaE+myt0a/Q2fC/cMCn+tSTUs=\"; credential-type=\"password\"");
  EXPECT_NE(servers.links(1), servers.links(2));
}

TEST(IceServers, RefusesCharactersThatEndAHeader) {
  for (const char* wrong : {"", "stun", "stun:", "http://example.org", "stun:a b", "stun:a>;", "stun:a?transport=udp",
                            "turn:a?transport=sctp", "turn:a?x", "turn:u:p@host"})
    EXPECT_THROW(IceServers({wrong}, "a b"), Error) << wrong;
  EXPECT_THROW(IceServers({"turn:example.org"}, ""), Error);
  EXPECT_THROW(IceServers({"turn:example.org"}, "a b c"), Error);
  EXPECT_THROW(IceServers({"turn:example.org"}, "a b\""), Error);
}

using test::browser_offer;
using test::kFallsBehind;
using test::with;

std::string refused(const std::string& text, bool h264 = true, bool vp8 = true) {
  std::string reason;
  return parse_offer(text, h264, vp8, {}, &reason) ? "" : reason;
}

TEST(Offer, UsesTheBrowsersPayloadType) {
  const auto offer = parse_offer(browser_offer(), true, true, {}, nullptr);
  ASSERT_TRUE(offer);
  EXPECT_EQ(offer->codec, VideoCodec::kH264);
  EXPECT_EQ(offer->payload_type, 108u) << "constrained baseline, mode 1";
  EXPECT_EQ(offer->profile, "42e01f");
}

// Otherwise webrtcbin rejects video from peers without level-asymmetry-allowed.
TEST(Offer, AcceptsOtherLevels) {
  const auto offer = parse_offer(with(browser_offer(), "level-asymmetry-allowed=1;", ""), true, true, {}, nullptr);
  ASSERT_TRUE(offer);
  g_autofree gchar* text = gst_sdp_message_as_text(offer->sdp.get());
  EXPECT_TRUE(strstr(text, "a=fmtp:108 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n"))
      << text;
  EXPECT_FALSE(strstr(text, "a=fmtp:108 packetization-mode")) << text;
  EXPECT_TRUE(strstr(text, "a=fmtp:104 packetization-mode=1;profile-level-id=64001f")) << "the others as they are";
}

TEST(Offer, AnswersNameTheProfile) {
  const auto offer = parse_offer(browser_offer(), true, true, {}, nullptr);
  ASSERT_TRUE(offer);
  GstSDPMessage* answer = nullptr;
  const std::string bare = "v=0\r\no=- 1 0 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\nm=video 9 UDP/TLS/RTP/SAVPF 108\r\n";
  ASSERT_EQ(gst_sdp_message_new_from_text((bare + "a=fmtp:108 packetization-mode=1\r\n").c_str(), &answer), GST_SDP_OK);
  set_profile(answer, *offer);
  g_autofree gchar* text = gst_sdp_message_as_text(answer);
  EXPECT_EQ(std::string(text),
            bare + "a=fmtp:108 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f\r\n");
  gst_sdp_message_free(answer);
}

TEST(Offer, ReadsTheIdOfThePlayoutDelay) {
  const std::string line = "a=extmap:5 http://www.webrtc.org/experiments/rtp-hdrext/playout-delay\r\n";
  const auto number = [&](const std::string& other) {
    const auto offer = parse_offer(with(browser_offer(), line, other), true, true, {}, nullptr);
    return offer ? static_cast<int>(offer->playout_delay) : -1;
  };
  EXPECT_EQ(number(line), 5);
  EXPECT_EQ(number(with(line, ":5 ", ":14/recvonly ")), 14);
  EXPECT_EQ(number(""), 0);
  for (const char* wrong : {":0 ", ":15 ", ":16 ", ":-1 ", ":5x ", ":x ", ":4294967301 ", ":5  ", ": "})
    EXPECT_EQ(number(with(line, ":5 ", wrong)), 0) << wrong;
}

TEST(Offer, FallsBackToVp8) {
  for (const std::string& text : {browser_offer(), with(browser_offer(), "H264", "H265")}) {
    const auto offer = parse_offer(text, text.find("H265") != text.npos, true, {}, nullptr);
    ASSERT_TRUE(offer);
    EXPECT_EQ(offer->codec, VideoCodec::kVp8);
    EXPECT_EQ(offer->payload_type, 96u);
  }
  EXPECT_NE(refused(browser_offer(), false, false), "");
}

TEST(Offer, KeepsOnlyCandidatesOfKnownAddresses) {
  const std::string own = "a=candidate:1 1 udp 2122260223 192.0.2.7 50000 typ host\r\n",
                    others =
                        "a=candidate:2 1 udp 2122260223 10.0.0.1 22 typ host\r\n"
                        "a=candidate:3 1 tcp 1518280447 192.0.2.7 80 typ host tcptype active\r\n"
                        "a=candidate:4 1 udp 2122260223 printer.local 9 typ host\r\n"
                        "a=candidate:\r\n";
  std::string many;
  for (int i = 0; i < 100; i++) many += own;
  const std::string text = with(browser_offer(), "a=recvonly\r\n", "a=recvonly\r\n" + others + many);
  const auto candidates = [&](const std::set<std::string>& known) {
    const auto offer = parse_offer(text, true, true, known, nullptr);
    EXPECT_TRUE(offer);
    std::vector<std::string> found;
    const GstSDPMedia* media = gst_sdp_message_get_media(offer->sdp.get(), 0);
    for (guint i = 0; const gchar* value = gst_sdp_media_get_attribute_val_n(media, "candidate", i); i++)
      found.push_back(value);
    return found;
  };
  EXPECT_TRUE(candidates({}).empty());
  EXPECT_TRUE(candidates({"192.0.2.8", ""}).empty());
  const auto kept = candidates({"192.0.2.7", "192.0.2.8"});
  EXPECT_EQ(kept.size(), Offer::kMaxCandidates);
  for (const std::string& candidate : kept) EXPECT_EQ("a=candidate:" + candidate + "\r\n", own);
}

TEST(Offer, OneMediumNeedsNoBundle) {
  const std::string good = browser_offer();
  EXPECT_EQ(refused(with(good.substr(0, good.find("m=application")), "a=group:BUNDLE 0 1\r\n", "")), "");
}

TEST(Offer, RefusesUnusableOffersWithTheReason) {
  const std::string good = browser_offer();
  const std::pair<std::string, const char*> table[] = {
      {"", "not SDP"},
      {"v", "not SDP"},
      {"hello", "not SDP"},
      {std::string("v=0\0a", 5), "not SDP"},
      {"v=0\r\n\xff\xfe", "not SDP"},
      {"v=0\r\n", "no media"},
      {good + std::string(Offer::kMaxBytes, ' '), "too long"},
      {good.substr(0, good.find("m=video")), "no media"},
      {with(good, "m=video", "m=audio"), "no video"},
      {with(good, "m=application", "m=message"), "unknown kind"},
      {with(good, "m=application 9 UDP/DTLS/SCTP webrtc-datachannel", "m=video 9 UDP/TLS/RTP/SAVPF 96"), "rtcp-mux"},
      {good + good.substr(good.find("m=application")), "one data channel"},
      {with(good, "m=application", "m=\x1b[31m"), "an unknown kind"},
      {with(good, "a=ice-ufrag:Yzk8\r\n", ""), "ice-ufrag"},
      {with(good, "a=ice-pwd:lrnRvCr0XvB7VlGEhFXcIGWV\r\n", ""), "ice-pwd"},
      {with(good, "a=fingerprint", "a=fingerpaint"), "fingerprint"},
      {with(good, ":5A\r\n", ":5\r\n"), "malformed"},
      {with(good, ":5A\r\n", "\r\n"), "malformed"},
      {with(good, "sha-256 D6", "sha-256 ZZ"), "malformed"},
      {with(good, "fingerprint:sha-256 ", "fingerprint:"), "SHA-256"},
      {with(good, "sha-256", "md5"), "SHA-256"},
      {with(good, "a=setup:actpass\r\n", ""), "setup"},
      {with(good, "a=mid:1\r\n", ""), "mid"},
      {with(good, "a=rtcp-mux\r\n", ""), "rtcp-mux"},
      {with(good, "a=group:BUNDLE 0 1\r\n", ""), "bundle"},
      {with(good, "BUNDLE 0 1", "BUNDLE 0"), "bundle"},
      {with(good, "BUNDLE 0 1", "BUNDLE"), "bundle"},
      {with(good, "BUNDLE 0 1", "LS 0 1"), "bundle"},
      {with(good, "a=mid:1", "a=mid:01"), "bundle"},
      {with(good, "a=recvonly", "a=sendonly"), "receive"},
      {with(good, "a=recvonly", "a=inactive"), "receive"},
      {with(with(good, "42e01f", "640c1f"), "VP8/", "VP9/"), "codec"},
      {with(with(good, "mode=1", "mode=2"), "VP8/", "VP9/"), "codec"},
      {with(good, "a=rtpmap", "a=rtpmop"), "codec"}};
  for (const auto& [text, why] : table) EXPECT_THAT(refused(text), HasSubstr(why));
  EXPECT_EQ(refused(good), "");
}

std::string large_offer(size_t formats, const std::string& line, const std::string& format = "1") {
  std::string list;
  for (size_t i = 0; i < formats; i++) list += " " + format;
  const std::string good = with(browser_offer(), " 96 97 103 104 108 109\r\n", list + "\r\n");
  std::string lines;
  while (good.size() + lines.size() + line.size() <= Offer::kMaxBytes) lines += line;
  return with(good, "a=recvonly\r\n", "a=recvonly\r\n" + lines);
}

// Measures thread time, which is independent of other programs. The parser once took minutes.
TEST(Offer, ParsesInLinearTime) {
  const auto seconds = [] {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  const std::string parameters = "a=fmtp:108 " + std::string(60000, 'x') + "\r\n";
  for (const std::string& text : {large_offer(10500, "a=rtpmap:1\r\n"), large_offer(10500, "a=fmtp:1 a\r\n"),
                                  large_offer(128, "a=rtpmap:1\r\n"), large_offer(128, "a=candidate:1\r\n"),
                                  large_offer(128, "a=extmap:1 a\r\n"), large_offer(900, parameters, "108"),
                                  large_offer(1, "m=video 9 UDP/TLS/RTP/SAVPF 96\r\n"), large_offer(1, "b=AS:1\r\n")}) {
    const double began = seconds();
    EXPECT_NE(refused(text), "");
    EXPECT_LT(seconds() - began, kFallsBehind ? 5 : 0.5) << text.substr(text.find("m=video"), 60);
  }
}

TEST(Offer, LimitsFormatsAndAttributes) {
  std::string more;
  for (guint i = 0; i < 250; i++) more += "a=rtcp-fb:108 kind" + std::to_string(i) + "\r\n";
  EXPECT_EQ(refused(with(browser_offer(), "a=recvonly\r\n", "a=recvonly\r\n" + more)), "");
  for (guint i = 0; i < Offer::kMaxAttributes; i++) more += "a=x\r\n";
  EXPECT_MENTIONS(refused(with(browser_offer(), "a=recvonly\r\n", "a=recvonly\r\n" + more)), "offer", "attributes");
  EXPECT_MENTIONS(refused(with(browser_offer(), "t=0 0\r\n", "t=0 0\r\n" + more)), "offer", "attributes");
}

// GStreamer's payloaders reject static payload types.
TEST(Offer, NeedsADynamicPayloadType) {
  for (const char* number : {"0", "35", "95", "128", "x", "-1"}) {
    const std::string text =
        with(with(with(browser_offer(), " 108", std::string(" ") + number), ":108 ", std::string(":") + number + " "),
             "VP8/", "VP9/");
    EXPECT_MENTIONS(refused(text), "96 to 127") << number << ": " << refused(text);
  }
  EXPECT_EQ(refused(with(with(browser_offer(), " 108", " 127"), ":108 ", ":127 ")), "");
}

// Critical messages of GStreamer's parser end the program.
TEST(Offer, SurvivesDamage) {
  g_log_set_always_fatal(GLogLevelFlags(G_LOG_LEVEL_CRITICAL | G_LOG_FATAL_MASK));
  const std::string good = browser_offer();
  std::mt19937 random(1);
  for (size_t i = 0; i < good.size(); i += 7) refused(good.substr(0, i));
  for (int n = 0; n < 4000; n++) {
    std::string text = good;
    for (int i = 0; i < 4; i++) {
      const size_t at = 3 + random() % (text.size() - 3);
      if (random() % 3 == 0)
        text.erase(at, random() % 40);
      else
        text[at] = "\r\n=: 0Aaz/;\x01"[random() % 12];
    }
    refused(text);
  }
}

}  // namespace
}  // namespace lf::serve
