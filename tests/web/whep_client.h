// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

#include "support/process.h"

typedef struct _GstWebRTCDataChannel GstWebRTCDataChannel;

namespace lf::test {

// A viewer of lf-serve without a browser. Receives packets without decoding, so that hundreds of viewers are cheap.
// Errors are std::runtime_error. Not thread-safe.
class WhepClient {
 public:
  static constexpr uint8_t kPlayoutDelay = 7;
  struct Options {
    std::string url;  // server, "http://127.0.0.1:8080/"
    int width = kFallsBehind ? 160 : 640, height = kFallsBehind ? 120 : 480;
    bool vp8 = false;                           // offers only VP8 instead of H.264
    bool playout_delay = false;                 // offers the RTP header extension kPlayoutDelay
    double loss = 0;                            // share of received packets to drop
    std::string fingerprint = {};               // replaces the offer's fingerprint unless empty
    double patience = kFallsBehind ? 120 : 30;  // timeout for the first frame, seconds
    std::string address = "127.0.0.1";          // local address for media
    std::string query = {};                     // further query parameters, "&path=tour"
    std::string first_message = {};             // sent when the data channel opens; "": none
  };

  // Sends the offer, connects, and blocks until the first frame arrives.
  explicit WhepClient(const Options& options);
  ~WhepClient();
  WhepClient(const WhepClient&) = delete;

  const std::string& answer() const { return answer_; }
  uint64_t pictures() const { return pictures_; }  // frames with their last packet
  uint64_t bytes() const { return bytes_; }
  uint64_t lost() const { return lost_; }            // packets dropped by Options::loss
  uint64_t undelayed() const { return undelayed_; }  // packets with a playout delay of 0 to 0
  uint64_t gaps() const { return gaps_; }            // packets that never arrived
  uint64_t repeated() const { return repeated_; }    // retransmitted packets (RFC 4588)
  uint64_t received() const { return received_; }    // bytes, including retransmissions
  void set_loss(double loss) { loss_ = loss; }
  // Stops sending without ending the session, like a killed browser.
  void vanish() { vanished_ = true; }
  // Sends on the data channel; returns when the server has received the text.
  void send(const std::string& text);
  // Requests retransmission of the latest packets by a single RTCP packet (generic NACK), or a key frame (PLI).
  void ask_again();
  void ask_for_key_frame();
  // Sends RTCP feedback about the video (RFC 4585): type, format, and control information.
  void send_feedback(uint8_t type, uint8_t format, const std::vector<uint8_t>& control);
  void open_channel(const std::string& label);
  bool ended() const;
  std::vector<std::string> messages() const;

 private:
  WhepClient(GstElement* pipeline, const Options& options);

  static void pad_added(GstElement* webrtc, GstPad* pad, gpointer data);
  static void transport_added(GstBin* bin, GstBin* parent, GstElement* element, gpointer data);
  static GstPadProbeReturn rtp_received(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstPadProbeReturn rtp_sent(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstPadProbeReturn packet(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  void post(const std::string& offer);

  Options options_;
  GstElement *pipeline_ = nullptr, *webrtc_ = nullptr, *dtls_ = nullptr, *srtp_ = nullptr;  // srtp_: the encoder
  GstWebRTCDataChannel *channel_ = nullptr, *other_ = nullptr;
  std::string answer_, session_;
  std::atomic<uint64_t> pictures_ = 0, bytes_ = 0, lost_ = 0, gaps_ = 0, undelayed_ = 0, received_ = 0, repeated_ = 0;
  std::atomic<double> loss_;
  std::atomic<bool> vanished_ = false;
  std::atomic<int> sequence_ = -1;
  std::atomic<uint32_t> ssrc_ = 0;
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
};

}  // namespace lf::test
