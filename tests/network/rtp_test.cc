// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Requests and answers through the network elements that GStreamer comes with, over the loopback interface.
#include <gio/gio.h>
#include <gmock/gmock.h>
#include <gst/sdp/gstsdpmessage.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "base/json_value.h"
#include "lib/rtp/rtp_test.h"
#include "network/stream.h"

namespace lf::test {
namespace {

using Units = std::vector<std::vector<uint8_t>>;

// Small answers: each goes in one packet as it is.
Units small_answers(int count) {
  Units units;
  for (int i = 0; i < count; i++) units.push_back(rtp::answer(1 + i % 4, 16, 16, 60));
  return units;
}
Units requests(int count) {
  Units units;
  for (int i = 0; i < count; i++) units.push_back(rtp::request(static_cast<uint32_t>(i)));
  return units;
}

std::string rtp_caps(const char* encoding, const char* type = "application/x-rtp") {
  return std::string(type) + ",media=application,clock-rate=90000,payload=96,encoding-name=" + encoding;
}
std::string answer_source(const char* name = "udp") {
  return std::string("udpsrc name=") + name +
         " port=0 address=127.0.0.1 buffer-size=2000000 caps=" + rtp_caps("X-LIGHTFIELD-ANSWER");
}
const char* const kOut = " ! appsink name=out sync=false";

TEST(RtpLinks, Udp) {
  Receiver receiver(answer_source() + " ! rtplfdepay" + kOut);
  const std::string port = receiver.port();
  receiver.play();
  Units units = small_answers(20);
  units.push_back(rtp::answer(1, 390, 390, 95));  // in chunks
  Sender sender(kAnswers, "rtplfpay ! udpsink host=127.0.0.1 port=" + port);
  for (const auto& unit : units) sender.send(unit);
  EXPECT_EQ(receiver.take(units.size()), units);
}

TEST(RtpLinks, Srtp) {
  const std::string key = "012345678901234567890123456789012345678901234567890123456789", wrong(60, '7');
  const std::string common =
      ",ssrc=(uint)77,roc=(uint)0,srtp-cipher=aes-128-icm,srtp-auth=hmac-sha1-80,"
      "srtcp-cipher=aes-128-icm,srtcp-auth=hmac-sha1-80,srtp-key=(buffer)";
  const auto source = [&](const std::string& with) {
    return "udpsrc name=udp port=0 address=127.0.0.1 caps=\"" + rtp_caps("X-LIGHTFIELD-ANSWER", "application/x-srtp") +
           common + with + "\" ! srtpdec ! rtplfdepay" + kOut;
  };
  Receiver receiver(source(key)), eavesdropper(source(wrong));
  const std::string port = receiver.port(), other = eavesdropper.port();
  receiver.play();
  eavesdropper.play();
  Sender sender(kAnswers, "rtplfpay ssrc=77 ! srtpenc key=" + key +
                              " ! tee name=t ! queue ! udpsink host=127.0.0.1 port=" + port +
                              " t. ! queue ! udpsink host=127.0.0.1 port=" + other);
  const Units units = small_answers(10);
  for (const auto& unit : units) sender.send(unit);
  EXPECT_EQ(receiver.take(units.size()), units);
  EXPECT_TRUE(eavesdropper.take(1, 0.2).empty());
}

TEST(RtpLinks, RequestsByMulticast) {
  const std::string group = "239.255.77." + std::to_string(1 + getpid() % 250);
  const auto source = [&](const std::string& port) {
    return "udpsrc name=udp address=" + group + " port=" + port +
           " multicast-iface=lo caps=" + rtp_caps("X-LIGHTFIELD-REQUEST") + " ! rtplfdepay" + kOut;
  };
  Receiver first(source("0"));
  const std::string port = first.port();
  Receiver second(source(port));
  second.port();
  first.play();
  second.play();
  Sender sender(kRequests, "rtplfpay ! udpsink multicast-iface=lo host=" + group + " port=" + port);
  const Units units = requests(20);
  for (const auto& unit : units) sender.send(unit);
  if (first.take(1, 2).empty()) GTEST_SKIP() << "the loopback interface takes no multicast packets here";
  EXPECT_EQ(first.take(units.size()), units);
  EXPECT_EQ(second.take(units.size()), units);
}

TEST(RtpLinks, Tcp) {
  Sender sender(kAnswers, "tcpserversink name=server host=127.0.0.1 port=0");
  const ElementPtr server = sender.child("server");
  gint port = 0;
  guint clients = 0;
  const auto wait_for = [&](const char* property, auto* value) {
    for (int i = 0; i < 500 && *value <= 0; i++) {
      g_object_get(server.get(), property, value, nullptr);
      if (*value <= 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  };
  const std::vector<uint8_t> beginning = rtp::answer(0, 1, 1, 0);
  sender.send(beginning);  // a sink has no port before it has something to play
  wait_for("current-port", &port);
  ASSERT_GT(port, 0) << sender.error();
  Receiver receiver("tcpclientsrc host=127.0.0.1 port=" + std::to_string(port) + " ! lfparse" + kOut);
  receiver.play();
  wait_for("num-handles", &clients);
  ASSERT_EQ(clients, 1u);
  Units units = small_answers(20);
  units.push_back(rtp::answer_with_sum(399, 399, true));  // 1.2 MB
  units.push_back(small_answers(1)[0]);
  for (const auto& unit : units) sender.send(unit);
  // Whether the client comes in time for the beginning is not told.
  if (receiver.take(1) == Units{beginning}) units.insert(units.begin(), beginning);
  EXPECT_EQ(receiver.take(units.size()), units);
}

// What rtpbin's session says of a source: that which sends, or that which reports about it.
GstStructure* find_source(GstElement* rtpbin, const std::function<bool(const GstStructure*)>& wanted) {
  GObject* session = nullptr;
  g_signal_emit_by_name(rtpbin, "get-internal-session", 0, &session);
  GstStructure* found = nullptr;
  if (!session) return found;
  GstStructure* stats = nullptr;
  g_object_get(session, "stats", &stats, nullptr);
  const auto* sources = static_cast<GValueArray*>(g_value_get_boxed(gst_structure_get_value(stats, "source-stats")));
  G_GNUC_BEGIN_IGNORE_DEPRECATIONS
  for (guint i = 0; i < sources->n_values && !found; i++) {
    const GstStructure* source = gst_value_get_structure(g_value_array_get_nth(const_cast<GValueArray*>(sources), i));
    if (wanted(source)) found = gst_structure_copy(source);
  }
  G_GNUC_END_IGNORE_DEPRECATIONS
  gst_structure_free(stats);
  g_object_unref(session);
  return found;
}

void report_often(GstElement* rtpbin) {
  GObject* session = nullptr;
  g_signal_emit_by_name(rtpbin, "get-internal-session", 0, &session);
  ASSERT_TRUE(session);
  g_object_set(session, "rtcp-min-interval", guint64{50 * GST_MSECOND}, nullptr);
  g_object_unref(session);
}

TEST(RtpLinks, RtpbinReportsWhatIsLost) {
  Receiver receiver("rtpbin name=bin latency=20 " + answer_source() +
                    " ! identity name=loss ! bin.recv_rtp_sink_0 bin. ! rtplfdepay name=depay" + kOut +
                    " udpsrc name=rtcp port=0 address=127.0.0.1 caps=application/x-rtcp ! bin.recv_rtcp_sink_0"
                    " bin.send_rtcp_src_0 ! udpsink name=reports host=127.0.0.1 sync=false async=false");
  const std::string port = receiver.port(), rtcp_port = receiver.port("rtcp");
  Running sender(
      "rtpbin name=bin appsrc name=in is-live=true do-timestamp=true format=time caps=" + std::string(kAnswers) +
      " ! rtplfpay ssrc=4711 ! bin.send_rtp_sink_0 bin.send_rtp_src_0 ! udpsink "
      "host=127.0.0.1 port=" +
      port + " bin.send_rtcp_src_0 ! udpsink host=127.0.0.1 sync=false async=false port=" + rtcp_port +
      " udpsrc name=udp port=0 address=127.0.0.1 caps=application/x-rtcp ! bin.recv_rtcp_sink_0");
  gst_element_set_state(sender.get(), GST_STATE_PAUSED);
  gint back = 0;
  g_object_get(sender.child("udp").get(), "port", &back, nullptr);
  g_object_set(receiver.child("reports").get(), "port", back, nullptr);
  const ElementPtr sending_bin = sender.child("bin"), receiving_bin = receiver.child("bin");
  report_often(sending_bin.get());
  report_often(receiving_bin.get());
  // Every tenth packet is lost.
  int count = 0;
  GstPad* loss = gst_element_get_static_pad(receiver.child("loss").get(), "sink");
  gst_pad_add_probe(
      loss, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        return ++*static_cast<int*>(data) % 10 == 5 ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
      },
      &count, nullptr);
  gst_object_unref(loss);
  receiver.play();
  sender.play();
  const Units units = small_answers(60);
  const ElementPtr in = sender.child("in");
  for (const auto& unit : units) {
    gst_app_src_push_buffer(GST_APP_SRC(in.get()), to_buffer(unit));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(receiver.take(54).size(), 54u) << receiver.error() << sender.error();
  EXPECT_EQ(stat(receiver.child("depay").get(), "lost"), 6u);

  // The sender hears of it, and the receiver has the sender's clock.
  gint lost = 0;
  guint64 packets = 0;
  gint clock_rate = 0;
  for (int i = 0; i < 100 && (lost < 5 || packets < 54); i++) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const auto of_ours = [](const char* field) {
      return [field](const GstStructure* source) {
        guint ssrc = 0;
        gboolean yes = FALSE;
        gst_structure_get(source, "ssrc", G_TYPE_UINT, &ssrc, nullptr);
        return ssrc == 4711 && gst_structure_get_boolean(source, field, &yes) && yes;
      };
    };
    const StructurePtr received(find_source(receiving_bin.get(), of_ours("have-sr")));
    if (received) {
      gst_structure_get_uint64(received.get(), "packets-received", &packets);
      gst_structure_get_int(received.get(), "clock-rate", &clock_rate);
    }
    const StructurePtr reported(find_source(sending_bin.get(), [](const GstStructure* source) {
      gboolean have = FALSE;
      return gst_structure_get_boolean(source, "have-rb", &have) && have;
    }));
    if (reported) gst_structure_get_int(reported.get(), "rb-packetslost", &lost);
  }
  EXPECT_GE(lost, 5);  // rtpbin counts one packet of the time before it trusts a source twice
  EXPECT_LE(lost, 6);
  EXPECT_EQ(packets, 54u);
  EXPECT_EQ(clock_rate, 90000);
}

std::string free_port() {
  GSocket* socket = g_socket_new(G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  GSocketAddress* any = g_inet_socket_address_new_from_string("127.0.0.1", 0);
  g_socket_bind(socket, any, FALSE, nullptr);
  GSocketAddress* bound = g_socket_get_local_address(socket, nullptr);
  const guint16 port = g_inet_socket_address_get_port(G_INET_SOCKET_ADDRESS(bound));
  g_object_unref(bound);
  g_object_unref(any);
  g_object_unref(socket);
  return std::to_string(port);
}

std::string with_port(std::string sdp, const std::string& port) {
  const std::string media = "m=application 5004 ";
  const size_t at = sdp.find(media);
  EXPECT_NE(at, std::string::npos);
  return sdp.replace(at, media.size(), "m=application " + port + " ");
}

TEST(RtpLinks, AReceiverStartsFromAnSdpFile) {
  const std::string port = free_port();
  const std::string sdp = with_port(read_text_file(LF_SOURCE_ROOT "/pipelines/answers.sdp"), port);
  const TempFile file({sdp.begin(), sdp.end()}, ".sdp");
  Receiver receiver("filesrc location=" + file.path() + " ! sdpdemux latency=20 ! rtplfdepay" + kOut);
  receiver.play();
  Sender sender(kAnswers, "rtplfpay ! udpsink host=127.0.0.1 port=" + port);
  // The receiver has no port before it has read the file: it may miss the first ones.
  const Units units = small_answers(4);
  for (int i = 0; i < 100 && receiver.take(1, 0.05).empty(); i++) sender.send(units[0]);
  ASSERT_FALSE(receiver.take(1).empty()) << receiver.error();
  EXPECT_EQ(receiver.take(1)[0], units[0]);
}

TEST(RtpLinks, CapsSurviveSdp) {
  for (const char* caps : {kAnswers, kRequests}) {
    const ElementPtr pay(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("rtplfpay", nullptr))));
    const HarnessPtr harness(gst_harness_new_with_element(pay.get(), "sink", "src"));
    gst_harness_set_src_caps_str(harness.get(), caps);
    gst_harness_push(harness.get(), to_buffer(caps == kAnswers ? small_answers(1)[0] : requests(1)[0]));
    const CapsPtr before(gst_pad_get_current_caps(harness->sinkpad));
    GstSDPMedia* media = nullptr;
    gst_sdp_media_new(&media);
    ASSERT_EQ(gst_sdp_media_set_media_from_caps(before.get(), media), GST_SDP_OK);
    gchar* text = gst_sdp_media_as_text(media);
    EXPECT_THAT(text, testing::HasSubstr("a=rtpmap:96 X-LIGHTFIELD-"));
    g_free(text);
    CapsPtr after(gst_sdp_media_get_caps_from_media(media, 96));
    gst_sdp_media_free(media);
    ASSERT_TRUE(after);
    gst_structure_set_name(gst_caps_get_structure(after.get(), 0), "application/x-rtp");
    const ElementPtr depay(GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make("rtplfdepay", nullptr))));
    const HarnessPtr receiver(gst_harness_new_with_element(depay.get(), "sink", "src"));
    gst_harness_set_src_caps(receiver.get(), after.release());
    const CapsPtr expected(gst_caps_from_string((std::string(caps) + ",parsed=true").c_str())),
        got(gst_pad_get_current_caps(receiver->sinkpad));
    ASSERT_TRUE(got);
    EXPECT_TRUE(gst_caps_is_equal(got.get(), expected.get())) << caps_of(receiver->sinkpad);
  }
}

}  // namespace
}  // namespace lf::test
