// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Requests and answers through GStreamer's own network elements, over the loopback interface.

#include <gio/gio.h>
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/sdp/gstsdpmessage.h>

#include "gst/rtp_fixture.h"
#include "support/run_program.h"

namespace lf::test {
namespace {

constexpr char kAnswers[] = "application/x-lightfield-answer";
constexpr char kRequests[] = "application/x-lightfield-request,framerate=30/1";

class Running {
 public:
  explicit Running(const std::string& line) : pipeline_(launch(line)) {}
  void play() { gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING); }
  GstElement* get() { return pipeline_.get(); }
  ElementPtr child(const char* name) { return child_of(pipeline_.get(), name); }
  std::string error() {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_.get());
    return testing::PrintToString(texts_on(bus, GST_MESSAGE_ERROR));
  }

 private:
  PipelinePtr pipeline_;
};

class Receiver : public Running {
 public:
  using Running::Running;
  // Waits until `count` buffers have arrived in total, or none has arrived for `seconds`.
  const std::vector<std::vector<uint8_t>>& take(size_t count, double seconds = 5) {
    const ElementPtr out = child("out");
    while (buffers_.size() < count) {
      g_autoptr(GstSample) sample =
          gst_app_sink_try_pull_sample(GST_APP_SINK(out.get()), static_cast<GstClockTime>(seconds * GST_SECOND));
      if (!sample) break;
      buffers_.push_back(to_bytes(gst_sample_get_buffer(sample)));
    }
    return buffers_;
  }
  std::string port(const char* name = "udp") {
    gst_element_set_state(get(), GST_STATE_PAUSED);
    return std::to_string(lf::test::get<gint>(child(name).get(), "port"));
  }

 private:
  std::vector<std::vector<uint8_t>> buffers_;
};

class Sender : public Running {
 public:
  Sender(const char* caps, const std::string& rest)
      : Running(std::string("appsrc name=in is-live=true format=time caps=") + caps + " ! " + rest) {
    play();
  }
  void send(const std::vector<uint8_t>& unit) {
    GstBuffer* buffer = to_buffer(unit);
    GST_BUFFER_PTS(buffer) = sent_++ * 10 * GST_MSECOND;
    gst_app_src_push_buffer(GST_APP_SRC(child("in").get()), buffer);
  }

 private:
  guint64 sent_ = 0;
};

using Units = std::vector<std::vector<uint8_t>>;

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
  sender.send(beginning);  // a sink has no port before its first buffer
  wait_for("current-port", &port);
  ASSERT_GT(port, 0) << sender.error();
  Receiver receiver("tcpclientsrc host=127.0.0.1 port=" + std::to_string(port) + " ! lfparse" + kOut);
  receiver.play();
  wait_for("num-handles", &clients);
  ASSERT_EQ(clients, 1u);
  Units units = small_answers(20);
  units.push_back(rtp::answer_with_sum(399, 399, true));
  units.push_back(small_answers(1)[0]);
  for (const auto& unit : units) sender.send(unit);
  // The client may connect too late for the first unit.
  if (receiver.take(1) == Units{beginning}) units.insert(units.begin(), beginning);
  EXPECT_EQ(receiver.take(units.size()), units);
}

GstStructure* find_source(GstElement* rtpbin, const std::function<bool(const GstStructure*)>& wanted) {
  g_autoptr(GObject) session = nullptr;
  g_signal_emit_by_name(rtpbin, "get-internal-session", 0, &session);
  GstStructure* found = nullptr;
  if (!session) return found;
  const StructurePtr stats = stats_of(session);
  const GValue* array = gst_structure_get_value(stats.get(), "source-stats");
  const auto* sources = static_cast<GValueArray*>(g_value_get_boxed(array));
  G_GNUC_BEGIN_IGNORE_DEPRECATIONS
  for (guint i = 0; i < sources->n_values && !found; i++) {
    const GstStructure* source = gst_value_get_structure(g_value_array_get_nth(const_cast<GValueArray*>(sources), i));
    if (wanted(source)) found = gst_structure_copy(source);
  }
  G_GNUC_END_IGNORE_DEPRECATIONS
  return found;
}

void report_often(GstElement* rtpbin) {
  g_autoptr(GObject) session = nullptr;
  g_signal_emit_by_name(rtpbin, "get-internal-session", 0, &session);
  ASSERT_TRUE(session);
  g_object_set(session, "rtcp-min-interval", guint64{50 * GST_MSECOND}, nullptr);
}

TEST(RtpLinks, RtpbinReportsLosses) {
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
  const gint back = get<gint>(sender.child("udp").get(), "port");
  g_object_set(receiver.child("reports").get(), "port", back, nullptr);
  const ElementPtr sending_bin = sender.child("bin"), receiving_bin = receiver.child("bin");
  report_often(sending_bin.get());
  report_often(receiving_bin.get());
  int count = 0;
  gst_pad_add_probe(
      pad_of(receiver.child("loss").get(), "sink").get(), GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer data) {
        return ++*static_cast<int*>(data) % 10 == 5 ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
      },
      &count, nullptr);
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
  EXPECT_GE(lost, 5);  // rtpbin ignores a packet before it trusts a source
  EXPECT_LE(lost, 6);
  EXPECT_EQ(packets, 54u);
  EXPECT_EQ(clock_rate, 90000);
}

std::string with_port(std::string sdp, const std::string& port) {
  const std::string media = "m=application 5004 ";
  const size_t at = sdp.find(media);
  EXPECT_NE(at, std::string::npos);
  return sdp.replace(at, media.size(), "m=application " + port + " ");
}

TEST(RtpLinks, ReceiverStartsFromAnSdpFile) {
  const std::string port = std::to_string(free_port(SOCK_DGRAM));
  const std::string sdp = with_port(read_text_file(LF_SOURCE_ROOT "/pipelines/answers.sdp"), port);
  const TempFile file(sdp, ".sdp");
  Receiver receiver("filesrc location=" + file.path() + " ! sdpdemux latency=20 ! rtplfdepay" + kOut);
  receiver.play();
  Sender sender(kAnswers, "rtplfpay ! udpsink host=127.0.0.1 port=" + port);
  // The receiver may miss the first packets, because its port is not open before the file is read.
  const Units units = small_answers(4);
  for (int i = 0; i < 100 && receiver.take(1, 0.05).empty(); i++) sender.send(units[0]);
  ASSERT_FALSE(receiver.take(1).empty()) << receiver.error();
  EXPECT_EQ(receiver.take(1)[0], units[0]);
}

TEST(RtpLinks, CapsSurviveSdp) {
  for (const char* caps : {kAnswers, kRequests}) {
    const ElementPtr pay = make_element("rtplfpay");
    const HarnessPtr harness(gst_harness_new_with_element(pay.get(), "sink", "src"));
    gst_harness_set_src_caps_str(harness.get(), caps);
    gst_harness_push(harness.get(), to_buffer(caps == kAnswers ? small_answers(1)[0] : requests(1)[0]));
    const CapsPtr before(gst_pad_get_current_caps(harness->sinkpad));
    GstSDPMedia* media = nullptr;
    gst_sdp_media_new(&media);
    ASSERT_EQ(gst_sdp_media_set_media_from_caps(before.get(), media), GST_SDP_OK);
    g_autofree gchar* text = gst_sdp_media_as_text(media);
    EXPECT_THAT(text, HasSubstr("a=rtpmap:96 X-LIGHTFIELD-"));
    CapsPtr after(gst_sdp_media_get_caps_from_media(media, 96));
    gst_sdp_media_free(media);
    ASSERT_TRUE(after);
    gst_structure_set_name(gst_caps_get_structure(after.get(), 0), "application/x-rtp");
    const ElementPtr depay = make_element("rtplfdepay");
    const HarnessPtr receiver(gst_harness_new_with_element(depay.get(), "sink", "src"));
    gst_harness_set_src_caps(receiver.get(), after.release());
    const CapsPtr expected(gst_caps_from_string((std::string(caps) + ",parsed=true").c_str())),
        got(gst_pad_get_current_caps(receiver->sinkpad));
    ASSERT_TRUE(got);
    EXPECT_TRUE(gst_caps_is_equal(got.get(), expected.get())) << caps_of(receiver->sinkpad);
  }
}

// Checks packets with Wireshark, an independent RTP implementation.

constexpr uint16_t kPort = 5004;

void put(Bytes& out, uint32_t value, int size) {
  for (int i = size - 1; i >= 0; i--) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

class Capture {
 public:
  Capture() {
    for (const uint32_t word : {0xa1b2c3d4u, 0x00020004u, 0u, 0u, 65535u, 101u}) put(bytes_, word, 4);  // raw IP
  }
  void add(GstClockTime time, uint32_t destination, uint16_t port, const Bytes& payload) {
    const auto udp = static_cast<uint32_t>(8 + payload.size()), ip = 20 + udp;
    put(bytes_, static_cast<uint32_t>(time / GST_SECOND), 4);
    put(bytes_, static_cast<uint32_t>(time % GST_SECOND / GST_USECOND), 4);
    put(bytes_, ip, 4);
    put(bytes_, ip, 4);
    put(bytes_, 0x45000000 | ip, 4);
    for (const uint32_t word : {0u, 0x40110000u, 0x0a000001u, destination}) put(bytes_, word, 4);
    put(bytes_, 40000, 2);
    put(bytes_, port, 2);
    put(bytes_, udp, 2);
    put(bytes_, 0, 2);
    bytes_.insert(bytes_.end(), payload.begin(), payload.end());
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
};

Bytes announcement(int clock_rate) {
  const std::string sdp =
      "v=0\r\no=- 1 1 IN IP4 10.0.0.1\r\ns=light field\r\nc=IN IP4 10.0.0.2\r\nt=0 0\r\nm=application " +
      std::to_string(kPort) + " RTP/AVP 96\r\na=rtpmap:96 X-LIGHTFIELD-ANSWER/" + std::to_string(clock_rate) + "\r\n";
  Bytes out{0x20, 0, 0, 1, 10, 0, 0, 1};
  const std::string type("application/sdp\0", 16);
  for (const char c : type + sdp) out.push_back(static_cast<uint8_t>(c));
  return out;
}

std::string tshark(const std::string& arguments) {
  const Outcome outcome = run_shell("{ tshark " + arguments + " 2>/dev/null; }");
  return outcome.status == 0 ? outcome.output : "failed: " + outcome.output;
}

// Returns ten answers of several packets each, 40 ms apart, without network delay.
std::vector<RtpPacket> sent_packets() {
  RtpElement pay("rtplfpay ssrc=0x12345678 seqnum-offset=65533", kAnswerCaps);
  for (int i = 0; i < 10; i++)
    pay.push(i % 2 ? rtp::answer_with_sum(60, 40, true) : rtp::answer(3, 60, 60, 80), i * 40 * GST_MSECOND);
  return pay.packets();
}

Bytes captured(const std::vector<RtpPacket>& packets, int clock_rate) {
  Capture capture;
  capture.add(0, 0xe0027ffe, 9875, announcement(clock_rate));
  for (const RtpPacket& packet : packets) capture.add(packet.time, 0x0a000002, kPort, packet.bytes);
  return capture.bytes();
}

class Tshark : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("tshark --version >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
  }
  const std::vector<RtpPacket> packets_ = sent_packets();
};

TEST_F(Tshark, SeesRtp) {
  const TempFile file(captured(packets_, 90000), ".pcap");
  std::ostringstream expected;
  for (const RtpPacket& packet : packets_)
    expected << "2\t96\t0x12345678\t" << packet.sequence << "\t" << packet.timestamp << "\t" << packet.marker << "\n";
  EXPECT_EQ(tshark("-r " + file.path() +
                   " -Y rtp -T fields -e rtp.version -e rtp.p_type -e rtp.ssrc -e rtp.seq -e rtp.timestamp -e "
                   "rtp.marker"),
            expected.str());
  EXPECT_EQ(tshark("-r " + file.path() + " -Y _ws.malformed"), "");
}

TEST_F(Tshark, FindsNeitherLossNorJitterByTheRightClock) {
  const auto streams = [&](int clock_rate) {
    const TempFile file(captured(packets_, clock_rate), ".pcap");
    return tshark("-q -z rtp,streams -r " + file.path());
  };
  const std::string found = "X-LIGHTFIELD-ANSWER +" + std::to_string(packets_.size()) +
                            " +0 \\(0\\.0%\\) +[0-9.]+ +[0-9.]+ +[0-9.]+ +0\\.000 +0\\.000 +0\\.000";
  EXPECT_THAT(streams(90000), ContainsRegex(found));
  EXPECT_THAT(streams(48000), Not(ContainsRegex(found)));
}

}  // namespace
}  // namespace lf::test
