// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfrtpseal and lfrtpgate, with and without the shared key.
#include <gst/net/gstnetaddressmeta.h>

#include "gst/rtp_fixture.h"
#include "rtp/srtp.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

constexpr size_t kHeader = 12;
const std::string kSecret = "0123456789abcdef0123456789abcdef-secret";

Bytes rtp_packet(uint16_t sequence, size_t payload, bool marker = true) {
  Bytes bytes = {0x80, 0x60, 0, 0, 0, 0, 0, 1, 0, 0, 0, 7};
  if (marker) bytes[1] |= 0x80;
  bytes[2] = static_cast<uint8_t>(sequence >> 8);
  bytes[3] = static_cast<uint8_t>(sequence);
  for (size_t i = 0; i < payload; i++) bytes.push_back(static_cast<uint8_t>(sequence + i));
  return bytes;
}

Bytes payload_of(const Bytes& packet) { return {packet.begin() + kHeader, packet.end()}; }

class LfRtpGateTest : public testing::Test {
 protected:
  Bytes sealed(const Bytes& packet) {
    EXPECT_EQ(seal_.push(packet), GST_FLOW_OK);
    std::vector<Bytes> out = seal_.units();
    EXPECT_EQ(out.size(), 1u);
    return out.empty() ? Bytes() : out[0];
  }
  size_t passed(RtpElement& gate, const Bytes& packet) {
    EXPECT_EQ(gate.push(packet), GST_FLOW_OK);
    return gate.units().size();
  }
  static std::string gate(const TempFile& key) { return "lfrtpgate key-file=" + key.path(); }

  const TempFile key_{kSecret}, other_{kSecret + "!"};
  RtpElement seal_{("lfrtpseal key-file=" + key_.path()).c_str(), kRtpAnswerCaps};
  RtpElement gate_{gate(key_).c_str(), kRtpAnswerCaps};
};

TEST_F(LfRtpGateTest, PassesPacketsEncryptedWithItsKey) {
  EXPECT_THAT(seal_.caps(), HasSubstr("application/x-srtp, "));
  for (uint16_t i = 0; i < 20; i++) {
    const Bytes packet = rtp_packet(i, 10 * i), on_the_way = sealed(packet);
    EXPECT_EQ(on_the_way.size(), packet.size() + lf::rtp::kSrtpOverheadBytes);
    if (i > 1) {
      EXPECT_NE(Bytes(on_the_way.begin() + kHeader, on_the_way.begin() + packet.size()), payload_of(packet));
    }
    gate_.push(on_the_way, i * GST_MSECOND);
    const std::vector<RtpPacket> opened = gate_.packets();
    ASSERT_EQ(opened.size(), 1u);
    EXPECT_EQ(payload_of(opened[0].bytes), payload_of(packet));
    EXPECT_EQ(opened[0].timestamp, 1u);
    EXPECT_EQ(opened[0].time, i * GST_MSECOND);
    EXPECT_TRUE(opened[0].marker);
  }
  EXPECT_THAT(gate_.caps(), HasSubstr("application/x-rtp, "));
  EXPECT_EQ(stat(gate_.element(), "passed"), 20u);
  EXPECT_EQ(stat(gate_.element(), "streams"), 1u);
}

TEST_F(LfRtpGateTest, AcceptsBufferLists) {
  GstBufferList* list = gst_buffer_list_new();
  for (uint16_t i = 0; i < 5; i++) gst_buffer_list_add(list, to_buffer(rtp_packet(i, 100, i == 4)));
  ASSERT_EQ(gst_pad_push_list(seal_.h()->srcpad, list), GST_FLOW_OK);
  const std::vector<Bytes> out = seal_.units();
  ASSERT_EQ(out.size(), 5u);
  for (const Bytes& packet : out) EXPECT_EQ(passed(gate_, packet), 1u);
}

// A receiver that starts late has missed sequence number wrap-arounds.
TEST_F(LfRtpGateTest, AcceptsLongRunningSenders) {
  Bytes latest;
  std::vector<uint32_t> senders;
  for (int i = 0; i < 70000; i++) {
    latest = sealed(rtp_packet(static_cast<uint16_t>(i), 20, i % 100 == 99));
    const uint32_t ssrc = GST_READ_UINT32_BE(latest.data() + 8);
    if (senders.empty() || senders.back() != ssrc) senders.push_back(ssrc);
  }
  EXPECT_GE(senders.size(), 2u);
  EXPECT_LE(senders.size(), 3u) << "one stream per 65536 packets or minute";
  EXPECT_EQ(passed(gate_, latest), 1u);
}

TEST_F(LfRtpGateTest, RejectsPacketsWithoutTheKey) {
  RtpElement stranger(gate(other_).c_str(), kRtpAnswerCaps), requests(gate(key_).c_str(), kRtpRequestCaps);
  for (uint16_t i = 0; i < 10; i++) {
    const Bytes packet = sealed(rtp_packet(i, 100));
    EXPECT_EQ(passed(stranger, packet), 0u);
    EXPECT_EQ(passed(requests, packet), 0u) << "an answer, not a request";
    EXPECT_EQ(passed(gate_, rtp_packet(i, 100)), 0u) << "not encrypted";
  }
  for (RtpElement* each : {&stranger, &requests}) {
    EXPECT_EQ(stat(each->element(), "forged"), 10u);
    EXPECT_EQ(stat(each->element(), "streams"), 0u);
  }
  EXPECT_EQ(stat(gate_.element(), "unsealed"), 10u);
  EXPECT_EQ(stat(gate_.element(), "passed"), 0u);
}

// The two hosts accept the old and the new key while keys are replaced. After that, the old key has no effect.
TEST_F(LfRtpGateTest, ReplacesKeysWithoutARestart) {
  const TempDir folder;
  const std::string fresh(40, 'n'), both = kSecret + "\n" + fresh, swapped = fresh + "\n" + kSecret;
  folder.write_secret("sender", kSecret);
  folder.write_secret("receiver", kSecret);
  RtpElement seal(("lfrtpseal key-file=" + folder / "sender").c_str(), kRtpAnswerCaps);
  RtpElement gate(("lfrtpgate key-file=" + folder / "receiver").c_str(), kRtpAnswerCaps);
  uint16_t number = 0;
  const auto send = [&](bool marker = true) {
    EXPECT_EQ(seal.push(rtp_packet(number++, 50, marker)), GST_FLOW_OK);
    const std::vector<Bytes> out = seal.units();
    return out.size() == 1 ? out[0] : Bytes();
  };
  const auto ssrc = [](const Bytes& packet) { return GST_READ_UINT32_BE(packet.data() + 8); };
  EXPECT_EQ(passed(gate, send()), 1u);
  const struct {
    const char* file;
    std::string text;
    bool passes;
  } steps[] = {{"sender", both, true},    {"receiver", both, true},  {"receiver", swapped, true},
               {"sender", swapped, true}, {"sender", fresh, true},   {"receiver", fresh, true},
               {"sender", "short", true}, {"sender", kSecret, false}};
  for (const auto& [file, text, passes] : steps) {
    folder.write(file, text);
    g_usleep(1'050'000);
    EXPECT_EQ(passed(gate, send()), passes) << file << ": " << text;
  }
  // The key changes between two frames.
  const uint32_t before = ssrc(send(false));
  folder.write("sender", fresh);
  g_usleep(1'050'000);
  EXPECT_EQ(ssrc(send(true)), before);
  const Bytes next = send();
  EXPECT_NE(ssrc(next), before);
  EXPECT_EQ(passed(gate, next), 1u);
  EXPECT_EQ(passed(gate_, next), 0u) << "the old key alone";
}

// The stream of a key ends when the key is removed.
TEST_F(LfRtpGateTest, RemovedKeysEndTheirStreams) {
  const TempDir folder;
  folder.write_secret("key", kSecret);
  RtpElement gate(("lfrtpgate key-file=" + folder / "key").c_str(), kRtpAnswerCaps);
  EXPECT_EQ(passed(gate, sealed(rtp_packet(0, 50))), 1u);
  folder.write("key", std::string(40, 'n'));
  g_usleep(1'050'000);
  EXPECT_EQ(passed(gate, sealed(rtp_packet(1, 50))), 0u);
  EXPECT_EQ(stat(gate.element(), "streams"), 0u);
}

// The caps may be set after the gate.
TEST_F(LfRtpGateTest, RejectsPacketsWithoutCaps) {
  RtpElement uncapped(gate(key_).c_str(), nullptr);
  gst_harness_push_event(uncapped.h(), gst_event_new_stream_start("packets"));
  push_segment(uncapped.h());
  for (const Bytes& packet : {rtp_packet(1, 100), sealed(rtp_packet(2, 100))}) {
    EXPECT_EQ(uncapped.push(packet), GST_FLOW_NOT_NEGOTIATED);
    EXPECT_EQ(uncapped.units().size(), 0u);
  }
}

TEST_F(LfRtpGateTest, ReplayedPacketsPassOnce) {
  std::vector<Bytes> sent;
  for (uint16_t i = 0; i < 50; i++) sent.push_back(sealed(rtp_packet(i, 30)));
  std::swap(sent[10], sent[40]);
  for (const Bytes& packet : sent) EXPECT_EQ(passed(gate_, packet), 1u);
  for (const Bytes& packet : sent) EXPECT_EQ(passed(gate_, packet), 0u);
  EXPECT_EQ(stat(gate_.element(), "replayed"), 50u);
  EXPECT_EQ(passed(gate_, sealed(rtp_packet(50, 30))), 1u);
}

TEST_F(LfRtpGateTest, PacketPassesOneGatePerProcess) {
  std::vector<Bytes> sent;
  for (uint16_t i = 0; i < 50; i++) sent.push_back(sealed(rtp_packet(i, 30)));
  RtpElement beside(gate(key_).c_str(), kRtpAnswerCaps);
  for (size_t i = 0; i < sent.size(); i++) EXPECT_EQ(passed(i % 2 ? gate_ : beside, sent[i]), 1u) << i;
  Bytes damaged = sent[0];
  damaged[40] ^= 1;
  RtpElement later(gate(key_).c_str(), kRtpAnswerCaps);
  EXPECT_EQ(passed(later, damaged), 0u);
  for (RtpElement* each : {&gate_, &beside, &later})
    for (const Bytes& packet : sent) EXPECT_EQ(passed(*each, packet), 0u);
  EXPECT_EQ(stat(later.element(), "replayed"), 51u);
  EXPECT_EQ(passed(later, sealed(rtp_packet(50, 30))), 1u);

  for (const GstState state : {GST_STATE_NULL, GST_STATE_PLAYING})
    ASSERT_EQ(gst_element_set_state(gate_.h()->element, state), GST_STATE_CHANGE_SUCCESS);
  gst_harness_set_src_caps_str(gate_.h(), kRtpAnswerCaps);
  for (const Bytes& packet : sent) EXPECT_EQ(passed(gate_, packet), 0u);
  EXPECT_EQ(passed(gate_, sealed(rtp_packet(51, 30))), 1u);
}

// A request is encrypted once for several hosts, and their gates may run in one process.
TEST_F(LfRtpGateTest, CopiesPassEachGateOnce) {
  const std::string with_copies = gate(key_) + " copies=true";
  RtpElement first(with_copies.c_str(), kRtpAnswerCaps), second(with_copies.c_str(), kRtpAnswerCaps);
  for (uint16_t i = 0; i < 20; i++) {
    const Bytes packet = sealed(rtp_packet(i, 30));
    for (RtpElement* each : {&first, &second}) {
      EXPECT_EQ(passed(*each, packet), 1u);
      EXPECT_EQ(passed(*each, packet), 0u);
    }
  }
}

TEST_F(LfRtpGateTest, TruncatedAndDamagedPacketsAreDropped) {
  const Bytes whole = sealed(rtp_packet(0, 40));
  for (const bool known : {false, true}) {
    if (known) {
      EXPECT_EQ(passed(gate_, whole), 1u);
    }
    const Bytes packet = known ? sealed(rtp_packet(1, 40)) : whole;
    const uint64_t before = stat(gate_.element(), "passed");
    for (size_t size = 0; size < packet.size(); size++)
      EXPECT_EQ(passed(gate_, Bytes(packet.begin(), packet.begin() + static_cast<ptrdiff_t>(size))), 0u) << size;
    for (size_t bit = 0; bit < 8 * packet.size(); bit++) {
      Bytes damaged = packet;
      damaged[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
      EXPECT_EQ(passed(gate_, damaged), 0u) << "bit " << bit;
    }
    EXPECT_EQ(stat(gate_.element(), "passed"), before);
    EXPECT_LE(stat(gate_.element(), "streams"), 1u) << "none for invalid packets";
  }
  uint64_t dropped = 0;
  for (const char* fate : {"malformed", "unsealed", "stale", "replayed", "forged"})
    dropped += stat(gate_.element(), fate);
  EXPECT_EQ(dropped, 2 * 9 * whole.size());
  EXPECT_GT(stat(gate_.element(), "malformed"), 2 * (kHeader + lf::rtp::kSrtpOverheadBytes) - 1);
  EXPECT_EQ(passed(gate_, sealed(rtp_packet(2, 40))), 1u);
}

// Returns a plain SRTP packet with the key of that minute, as in lib/rtp/spec.md.
Bytes sealed_by_others(const std::string& secret, uint32_t minute) {
  const lf::rtp::SessionKey session =
      lf::rtp::RtpKey(secret).session("X-LIGHTFIELD-ANSWER", {7, minute, g_random_int()});
  GstElement* srtpenc = gst_element_factory_make("srtpenc", nullptr);
  const BufferPtr key(gst_buffer_new_memdup(session.key.data(), session.key.size())),
      mki(gst_buffer_new_memdup(session.mki.data(), session.mki.size()));
  g_object_set(srtpenc, "key", key.get(), "mki", mki.get(), nullptr);
  Bytes out;
  rtp::StandaloneElement hidden(srtpenc, "rtp_sink_0", "rtp_src_0", "application/x-rtp", [&](GstBuffer* packet) {
    out = to_bytes(packet);
    gst_buffer_unref(packet);
    return GST_FLOW_OK;
  });
  hidden.push(to_buffer(rtp_packet(1, 50)));
  return out;
}

TEST_F(LfRtpGateTest, RejectsPacketsOfOtherMinutes) {
  const uint32_t now = lf::rtp::current_minute();
  for (const uint32_t minute : {now - 100000, now - 3, now + 3, 0u, 0xffffffffu})
    EXPECT_EQ(passed(gate_, sealed_by_others(kSecret, minute)), 0u) << minute;
  EXPECT_EQ(stat(gate_.element(), "stale"), 5u);
  EXPECT_EQ(passed(gate_, sealed_by_others(kSecret, lf::rtp::current_minute())), 1u);
}

TEST_F(LfRtpGateTest, KeyIsNotVisible) {
  PipelinePtr pipeline =
      launch("appsrc name=in format=time caps=" + std::string("application/x-rtp,encoding-name=JPEG") +
             " ! lfrtpseal name=s key-file=" + key_.path() + " ! lfrtpgate name=g key-file=" + key_.path() +
             " ! fakesink sync=false async=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr in = child_of(pipeline.get(), "in"), gate = child_of(pipeline.get(), "g");
  emit(in.get(), "push-buffer", BufferPtr(to_buffer(rtp_packet(0, 30))).get());
  EXPECT_TRUE(eventually([&] { return stat(gate.get(), "passed") == 1; }));
  g_autofree gchar* picture = gst_debug_bin_to_dot_data(GST_BIN(pipeline.get()), GST_DEBUG_GRAPH_SHOW_ALL);
  EXPECT_THAT(picture, AllOf(HasSubstr(key_.path()), Not(HasSubstr(kSecret)), Not(HasSubstr("srtp-key")),
                             Not(HasSubstr("srtpenc")), Not(HasSubstr("srtpdec"))));
}

TEST_F(LfRtpGateTest, KeyErrorsNameTheProblem) {
  const TempFile few("few");
  struct Case {
    std::string element, words;
  };
  for (const Case& c : {Case{"lfrtpseal key-file=/nobody", "key-file: /nobody:"},
                        Case{"lfrtpgate key-file=/nobody", "key-file: /nobody:"},
                        Case{"lfrtpseal key-file=" + few.path(), "openssl rand -hex 32"},
                        Case{"lfrtpgate peers=nobody.invalid", "peers: nobody.invalid: "}}) {
    EXPECT_THAT(run("appsrc ! application/x-rtp ! " + c.element + " ! fakesink"), HasSubstr(c.words));
  }
}

std::vector<std::string> warnings(RtpElement& gate, const Bytes& packet) {
  const ElementBus bus(gate.element());
  for (int i = 0; i < 100; i++) gate.push(packet);
  return all_warnings_on(bus.get());
}

TEST_F(LfRtpGateTest, DroppedPacketsAreReportedOnce) {
  struct Case {
    Bytes packet;
    const char *fate, *words;
  };
  RtpElement others(("lfrtpseal key-file=" + other_.path()).c_str(), kRtpAnswerCaps);
  others.push(rtp_packet(0, 100));
  const uint32_t now = lf::rtp::current_minute();
  for (const Case& c :
       {Case{rtp_packet(0, 100), "unsealed", "not encrypted"},
        Case{sealed_by_others(kSecret + "!", now - 100), "unsealed", "wrong clock"},
        Case{others.units().at(0), "forged", "another key"},
        Case{sealed_by_others(kSecret, now - 100), "stale", "clocks"}, Case{rtp_packet(0, 1), "malformed", "SRTP"}}) {
    RtpElement fresh(gate(key_).c_str(), kRtpAnswerCaps);
    EXPECT_THAT(warnings(fresh, c.packet), ElementsAre(HasSubstr(c.words)));
    EXPECT_EQ(stat(fresh.element(), c.fate), 100u) << c.words;
  }
}

size_t passes_from(RtpElement& gate, const char* address) {
  GstBuffer* buffer = to_buffer(rtp_packet(1, 30));
  if (address) {
    g_autoptr(GSocketAddress) socket = g_inet_socket_address_new_from_string(address, 7);
    gst_buffer_add_net_address_meta(buffer, socket);
  }
  EXPECT_EQ(gst_harness_push(gate.h(), buffer), GST_FLOW_OK);
  return gate.units().size();
}

TEST_F(LfRtpGateTest, WithoutAKeyAddressesAreChecked) {
  RtpElement peers("lfrtpgate peers=10.0.0.7,10.1.0.0/16", kRtpRequestCaps), none("lfrtpgate", kRtpRequestCaps);
  EXPECT_EQ(passes_from(peers, "10.0.0.7"), 1u);
  EXPECT_EQ(passes_from(peers, "::ffff:10.1.2.3"), 1u);
  for (const char* stranger : {"10.0.0.8", "127.0.0.1", "::1"}) EXPECT_EQ(passes_from(peers, stranger), 0u);
  EXPECT_EQ(passes_from(peers, nullptr), 0u);
  EXPECT_EQ(stat(peers.element(), "unknown-senders"), 4u);
  EXPECT_EQ(passes_from(none, "10.0.0.7"), 0u);
  EXPECT_EQ(passes_from(none, "127.0.0.1"), 1u);
  EXPECT_EQ(passes_from(none, "127.0.0.2"), 0u);
  EXPECT_EQ(passes_from(none, "127.0.0.1"), 1u);

  // The key admits every sender, unless `peers` lists addresses.
  RtpElement both((gate(key_) + " peers=10.0.0.7").c_str(), kRtpAnswerCaps);
  EXPECT_EQ(passed(gate_, sealed(rtp_packet(0, 30))), 1u);
  EXPECT_EQ(passed(both, sealed(rtp_packet(1, 30))), 0u);
  EXPECT_EQ(stat(both.element(), "unknown-senders"), 1u);
}

TEST_F(LfRtpGateTest, WithoutAKeyPacketsAreNotEncrypted) {
  RtpElement open("lfrtpseal", kRtpAnswerCaps);
  EXPECT_THAT(open.caps(), HasSubstr("application/x-rtp, "));
  const Bytes packet = rtp_packet(3, 40);
  open.push(packet);
  EXPECT_EQ(open.units(), std::vector<Bytes>{packet});
}

TEST_F(LfRtpGateTest, Restarts) {
  for (int i = 0; i < 3; i++) {
    EXPECT_EQ(passed(gate_, sealed(rtp_packet(1, 30))), 1u);
    for (RtpElement* each : {&seal_, &gate_})
      for (const GstState state : {GST_STATE_NULL, GST_STATE_PLAYING})
        ASSERT_EQ(gst_element_set_state(each->h()->element, state), GST_STATE_CHANGE_SUCCESS);
    gst_harness_set_src_caps_str(seal_.h(), kRtpAnswerCaps);
    gst_harness_set_src_caps_str(gate_.h(), kRtpAnswerCaps);
  }
}

}  // namespace
}  // namespace lf::test
