// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "serve/adaptation.h"
#include "serve/limits.h"
#include "serve/offer.h"

typedef struct _GstWebRTCDataChannel GstWebRTCDataChannel;

namespace lf::serve {

// Error of a peer if webrtcbin rejects the offer. The message of webrtcbin may quote the offer and must not be logged.
inline constexpr char kOfferRejected[] = "the offer can't be answered";

struct LinkReport {
  double loss = 0;        // fraction of lost packets, 0 to 1
  double round_trip = 0;  // seconds; 0: unknown
};

struct Route {
  std::string address;                   // local address to use; "": any
  std::vector<std::string> ice_servers;  // webrtcbin's format: "stun://HOST:PORT", "turn://USER:PASSWORD@HOST:PORT"
};

// One browser at the other end of a webrtcbin: offer and answer, data channel and liveness. It negotiates before there
// is video, which must later arrive at the webrtcbin's pad with `ssrc`. A peer has one data channel, "control", and one
// SCTP stream. A browser that opens more fails and is ignored. Its certificate must match a fingerprint of the offer.
// Unneeded packets are dropped (RtcpFilter).
//
// Created on the main thread. Callbacks run on the main thread, except on_message. May be destroyed on any thread.
class Peer : public std::enable_shared_from_this<Peer> {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;  // called once, with all candidates found within kGathering
    std::function<void()> on_connected;                     // called once, when DTLS is connected
    std::function<void(const std::string& why)> on_failed;
    // Receives a message of the data channel "control"; called on a streaming thread.
    std::function<void(const std::string& text)> on_message;
    std::function<void(const LinkReport&)> on_report;
  };

  static constexpr unsigned kGathering = 1000;  // milliseconds; an unreachable STUN server would take five seconds

  // `webrtc` is in a pipeline that is not started; its sink_0 is linked. Takes a reference.
  static std::shared_ptr<Peer> make(GstElement* webrtc, Offer offer, uint32_t ssrc, const Route& route,
                                    Callbacks callbacks);
  // Stop the pipeline first.
  ~Peer();

  // Answers the offer. Call once the pipeline is PAUSED.
  void negotiate();

  // g_get_monotonic_time() of the last packet from the browser; 0: none yet. Thread-safe.
  int64_t last_packet_time() const { return last_packet_time_; }
  bool connected() const { return connected_; }
  // Sends a text on the data channel "control", if the channel is open. Thread-safe.
  void send(const std::string& text);
  // Sets the video's bit rate. It also limits retransmissions, because the small requests could be endless.
  // Thread-safe.
  void set_bit_rate(int bits_per_second);
  // Returns true if the browser may request a key frame now; key frames are large. Thread-safe.
  bool take_key_frame();
  // Disables the callbacks. Call on the main thread.
  void leave() { has_left_ = true; }
  // Closes DTLS, so that the browser notices at once. The pipeline must keep running meanwhile.
  void close_dtls();
  // on_report() receives the result.
  void ask_for_report();

 private:
  // Retransmitted bytes per second, relative to the video's bit rate, and minimum burst in bytes.
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
  std::atomic<bool> connected_ = false, answered_ = false, failed_ = false;
  // drop all packets, because the certificate does not match the offer
  std::atomic<bool> certificate_mismatch_ = false;
  std::mutex mutex_;
  GstWebRTCDataChannel* channel_ = nullptr;
  GstElement* dtls_ = nullptr;
  RtcpFilter rtcp_;
  TokenBucket retransmit_limit_{kRetransmitBurst, kRetransmitBurst}, key_frame_limit_{kKeyFrames, kKeyFramesAtOnce};
  PacketLoss loss_;        // main thread only
  bool has_left_ = false;  // main thread only
};

}  // namespace lf::serve
