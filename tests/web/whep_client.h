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

// A viewer of an lf-serve without a browser: takes packets in and decodes nothing, so that hundreds cost little. Errors
// are std::runtime_error. Functions are for one thread.
class WhepClient {
 public:
  static constexpr uint8_t kPlayoutDelay = 7;
  struct Options {
    std::string url;  // of the server, "http://127.0.0.1:8080/"
    int width = kFallsBehind ? 160 : 640, height = kFallsBehind ? 120 : 480;
    bool vp8 = false;                           // offers that alone, else H.264
    bool playout_delay = false;                 // offers this RTP header extension, under kPlayoutDelay
    double loss = 0;                            // of the packets that come
    std::string fingerprint = {};               // replaces the one in the offer unless empty
    double patience = kFallsBehind ? 120 : 30;  // seconds until a picture must have come
    std::string first_message = {};             // on the data channel, as soon as it is open; "": none
  };

  // Offers, connects, and blocks until the first picture has come.
  explicit WhepClient(const Options& options);
  // Says goodbye.
  ~WhepClient();
  WhepClient(const WhepClient&) = delete;

  const std::string& answer() const { return answer_; }
  uint64_t pictures() const { return pictures_; }  // whose last packet has come
  uint64_t bytes() const { return bytes_; }
  uint64_t lost() const { return lost_; }            // packets, by Options::loss
  uint64_t undelayed() const { return undelayed_; }  // packets whose playout delay is 0 to 0
  uint64_t gaps() const { return gaps_; }            // packets that did not come in the end
  uint64_t repeated() const { return repeated_; }    // packets that were sent again (RFC 4588)
  uint64_t received() const { return received_; }    // bytes of all that came, repeated packets included
  void set_loss(double loss) { loss_ = loss; }
  // Says nothing more, not even goodbye, as a browser that was stopped.
  void vanish() { vanished_ = true; }
  // On the data channel; returns when the server has taken it over.
  void send(const std::string& text);
  // Asks for the latest packets again, whether they came or not, by one RTCP packet (generic NACK); or for a key frame
  // (PLI).
  void ask_again();
  void ask_for_key_frame();
  // Any RTCP feedback about the video (RFC 4585): type, format, and the control information.
  void send_feedback(uint8_t type, uint8_t format, const std::vector<uint8_t>& control);
  // One more data channel.
  void open_channel(const std::string& label);
  // Whether the server has closed the connection.
  bool ended() const;
  // Of the data channel, so far.
  std::vector<std::string> messages() const;

 private:
  WhepClient(GstElement* pipeline, const Options& options);

  static void pad_added(GstElement* webrtc, GstPad* pad, gpointer data);
  static void transport_added(GstBin* bin, GstBin* parent, GstElement* element, gpointer data);
  static GstPadProbeReturn arrives(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstPadProbeReturn leaves(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstPadProbeReturn packet(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  void post(const std::string& offer);

  Options options_;
  GstElement *pipeline_ = nullptr, *webrtc_ = nullptr, *dtls_ = nullptr, *srtp_ = nullptr;  // srtp_: the encoder
  GstWebRTCDataChannel *channel_ = nullptr, *other_ = nullptr;
  std::string answer_, session_;
  std::atomic<uint64_t> pictures_ = 0, bytes_ = 0, lost_ = 0, gaps_ = 0, undelayed_ = 0, received_ = 0, repeated_ = 0;
  std::atomic<double> loss_;
  std::atomic<bool> vanished_ = false;
  std::atomic<int> sequence_ = -1;  // of the packet before
  std::atomic<uint32_t> ssrc_ = 0;  // of the video
  mutable std::mutex mutex_;
  std::vector<std::string> messages_;
};

}  // namespace lf::test
