// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "serve/adaptation.h"
#include "serve/limits.h"
#include "serve/offer.h"

typedef struct _GstWebRTCDataChannel GstWebRTCDataChannel;

namespace lf::serve {

// Thrown if webrtcbin rejects the offer of a browser. The original message of webrtcbin may quote the offer and must
// not be logged.
inline constexpr char kOfferRejected[] = "the offer can't be answered";

// The quality of the connection, as the browser reports it: packet loss and round-trip time.
struct LinkReport {
  double loss = 0;        // 0 to 1
  double round_trip = 0;  // seconds; 0: unknown
};

struct Route {
  std::string address;  // local address that sends and receives packets; empty: any
  std::vector<std::string> ice_servers;
};

// The WebRTC connection of a webrtcbin to one browser. Answers the browser's offer, carries messages on a data channel
// and detects that the browser has left. The answer is possible before there is video. The video must later arrive at
// the pad of the webrtcbin with the SSRC `ssrc`.
//
// The peer protects the server from hostile browsers. It accepts only the data channels "control" and "surface", each
// once, because each further SCTP stream would cost threads and memory. A browser that opens more, or has another
// certificate than its offer, fails, and its packets are dropped. RtcpFilter drops packets that the server does not
// need.
//
// Create a peer on the main thread. Callbacks run on the main thread, except on_message. A peer may be destroyed on any
// thread.
class Peer : public std::enable_shared_from_this<Peer> {
 public:
  struct Callbacks {
    // called once with the SDP answer, which has all candidates found within kGathering
    std::function<void(const std::string& sdp)> on_answer;
    std::function<void()> on_connected;
    std::function<void(const std::string& why)> on_failed;
    // Receives each message of the data channel "control", on a streaming thread.
    std::function<void(const std::string& text)> on_message;
    std::function<void(const LinkReport&)> on_report;
  };

  // milliseconds; without this limit, an unreachable STUN server would take five seconds
  static constexpr unsigned kGathering = 1000;

  // `webrtc` must be in a pipeline that is not started, and its pad sink_0 must be linked. Takes a reference.
  static std::shared_ptr<Peer> make(GstElement* webrtc, Offer offer, uint32_t ssrc, const Route& route,
                                    Callbacks callbacks);
  // The pipeline must be stopped before.
  ~Peer();

  // Starts to answer the offer. Call this once the pipeline is PAUSED.
  void negotiate();

  // Returns the time of the last packet from the browser, as g_get_monotonic_time(). Returns 0 if there was no packet.
  // Thread-safe.
  int64_t last_packet_time() const { return last_packet_time_; }
  bool connected() const { return connected_; }
  // Sends a text on the data channel "control". Does nothing if the channel is not open. Thread-safe.
  void send(const std::string& text);
  // Sends a message on the data channel "surface". Drops the message if the browser has not opened the channel, or if
  // earlier messages still wait. Thread-safe.
  void send_surface(std::span<const uint8_t> message);
  // Returns true if the browser has opened the data channel "surface". Thread-safe.
  bool takes_surfaces() const { return takes_surfaces_; }
  // Sets the bit rate of the video, which also limits retransmissions. Otherwise a browser could cause unlimited
  // traffic with small requests. Thread-safe.
  void set_bit_rate(int bits_per_second);
  // Returns true if a key frame may be sent for the browser's request now. Key frames are large, so their rate is
  // limited. Thread-safe.
  bool take_key_frame();
  // Disables all callbacks. Call this on the main thread.
  void leave() { has_left_ = true; }
  // Closes the encrypted connection (DTLS), so that the browser notices the end at once. Packets must still be sent, so
  // the pipeline must continue to run during the call.
  void close_dtls();
  // Requests a LinkReport from webrtcbin, for Callbacks::on_report.
  void ask_for_report();

 private:
  // Limits of retransmissions, which protect the network against endless requests. The first is a rate: bytes per
  // second, relative to the bit rate of the video. The second is the minimum burst in bytes.
  static constexpr double kRetransmitShare = 1, kRetransmitBurst = 100000;
  static constexpr double kRetransmitBytes = 1250;
  static constexpr double kKeyFrames = 2, kKeyFramesAtOnce = 5;

  Peer(GstElement* webrtc, Offer offer, uint32_t ssrc, Callbacks callbacks);
  void watch(const Route& route);
  void announce();
  void answer(bool late);
  void connection_changed(int state);
  void fail(const std::string& why);
  void call_back(std::function<void(Peer&)> what);
  void open_channel(GstWebRTCDataChannel* channel);
  GstWebRTCDataChannel* open_for_sending(GstWebRTCDataChannel* Peer::*which, uint64_t max_waiting);
  void watch_element(GstElement* element);
  bool take(GstBuffer* packet);
  static GstPadProbeReturn on_retransmission_request(GstPad* pad, GstPadProbeInfo* info, gpointer data);

  GstElement* const webrtc_;
  const std::set<std::string> fingerprints_;
  Offer offer_;
  uint32_t ssrc_;
  Callbacks callbacks_;
  std::atomic<int64_t> last_packet_time_ = 0;
  std::atomic<int> streams_ = 0;
  std::atomic<bool> connected_ = false, answered_ = false, failed_ = false, takes_surfaces_ = false;
  // True if the certificate of the peer does not match the offer. All packets are then dropped, because the peer may be
  // an attacker.
  std::atomic<bool> certificate_mismatch_ = false;
  std::mutex mutex_;
  GstWebRTCDataChannel *channel_ = nullptr, *surface_channel_ = nullptr;
  GstElement* dtls_ = nullptr;
  RtcpFilter rtcp_;
  TokenBucket retransmit_limit_{kRetransmitBurst, kRetransmitBurst}, key_frame_limit_{kKeyFrames, kKeyFramesAtOnce};
  PacketLoss loss_;        // main thread only
  bool has_left_ = false;  // main thread only
};

}  // namespace lf::serve
