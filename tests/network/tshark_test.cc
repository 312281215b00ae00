// SPDX-License-Identifier: LGPL-2.1-or-later
//
// What Wireshark makes of our packets: a program that knows RTP and not us.
#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <sstream>

#include "gst/rtp_fixture.h"

namespace lf::test {
namespace {

constexpr uint16_t kPort = 5004;

void put(Bytes& out, uint32_t value, int size) {
  for (int i = size - 1; i >= 0; i--) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

// A capture file of UDP packets in IPv4.
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

// An announcement (RFC 2974) of what is said of the stream in SDP.
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
  FILE* pipe = popen(("tshark " + arguments + " 2>/dev/null").c_str(), "r");
  std::string out;
  std::array<char, 4096> buffer;
  while (const size_t n = fread(buffer.data(), 1, buffer.size(), pipe)) out.append(buffer.data(), n);
  return pclose(pipe) == 0 ? out : "failed: " + out;
}

// Ten answers of several packets each, 40 ms apart, on a wire without delay.
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
  EXPECT_THAT(streams(90000), testing::ContainsRegex(found));
  EXPECT_THAT(streams(48000), testing::Not(testing::ContainsRegex(found)));
}

}  // namespace
}  // namespace lf::test
