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

// Why a peer fails whose offer webrtcbin does not take. Its own words may have parts of the offer in them, which are
// not for logs.
inline constexpr char kUnanswerable[] = "the offer can't be answered";

// What the receiver says of the last second.
struct LinkReport {
  double loss = 0;        // part of the packets that was lost, 0 to 1
  double round_trip = 0;  // seconds; 0: not known
};

// The addresses by which a peer is to be reached, and servers that help it.
struct Route {
  std::string address;  // the only one of this machine, or ""
  std::vector<std::string>
      ice_servers;  // "stun://HOST:PORT", "turn://USER:PASSWORD@HOST:PORT", as webrtcbin takes them
};

// One browser at the other end of a webrtcbin: offer and answer, the data channel, and whether it is still there. It
// negotiates before there is any video: what comes to the webrtcbin's pad later must be of `ssrc`. A peer has one data
// channel, "control", and one SCTP stream: who opens more has failed, and is not listened to any more. Its certificate
// must have a fingerprint of the offer. Packets that a viewer need not send are dropped (RtcpFilter).
// Made on the main thread; what it calls back comes on the main thread, but for on_message. Destroyed on any thread.
class Peer : public std::enable_shared_from_this<Peer> {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;  // called once, with all candidates found within kGathering
    std::function<void()> on_connected;                     // called once, when DTLS is up
    std::function<void(const std::string& why)> on_failed;
    // A message of the data channel "control"; called by a streaming thread.
    std::function<void(const std::string& text)> on_message;
    std::function<void(const LinkReport&)> on_report;
  };

  static constexpr unsigned kGathering = 1000;  // milliseconds: a STUN server that is away takes five seconds

  // `webrtc` is in a pipeline that has not been started; its sink_0 is linked. Takes a reference.
  static std::shared_ptr<Peer> make(GstElement* webrtc, Offer offer, uint32_t ssrc, const Route& route,
                                    Callbacks callbacks);
  // Call after the pipeline was stopped.
  ~Peer();

  // Answers the offer. Call once the pipeline is PAUSED.
  void negotiate();

  // g_get_monotonic_time() of the last packet from the browser; 0: none yet. Thread-safe.
  int64_t heard() const { return heard_; }
  bool connected() const { return connected_; }
  // Sends a text on the data channel "control", if there is one. Thread-safe.
  void send(const std::string& text);
  // The video's bit rate from now on. A browser that asks for packets again gets no more of them than that: the
  // requests are small, and may be endless. Thread-safe.
  void set_bit_rate(int bits_per_second);
  // Whether the browser may ask for a key frame now, which costs many bits. Thread-safe.
  bool take_key_frame();
  // Stops the callbacks on the main thread. Call on the main thread.
  void leave() { has_left_ = true; }
  // Closes DTLS, so that the browser knows at once; the pipeline goes on for the moment that this takes.
  void say_goodbye();
  // Asks webrtcbin for its statistics; on_report() follows.
  void ask_for_report();

 private:
  // Bytes of repeated packets per second, as a part of the video's bit rate; bytes of them at once, at least.
  static constexpr double kRepeatShare = 1, kRepeatBurst = 100000;
  static constexpr double kRepeatBytes = 1250;                   // of a repeated packet, at most
  static constexpr double kKeyFrames = 2, kKeyFramesAtOnce = 5;  // key frames that a browser may ask for, per second

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
  static GstPadProbeReturn asked_to_repeat(GstPad* pad, GstPadProbeInfo* info, gpointer data);

  GstElement* const webrtc_;
  const std::set<std::string> fingerprints_;
  Offer offer_;
  uint32_t ssrc_;
  Callbacks callbacks_;
  std::atomic<int64_t> heard_ = 0;
  std::atomic<int> streams_ = 0;  // SCTP streams from the browser
  std::atomic<bool> connected_ = false, answered_ = false, failed_ = false;
  std::atomic<bool> is_stranger_ = false;  // the certificate does not match the offer: packets are dropped
  std::mutex mutex_;
  GstWebRTCDataChannel* channel_ = nullptr;
  GstElement* dtls_ = nullptr;  // the encoder
  RtcpFilter rtcp_;
  TokenBucket repeats_{kRepeatBurst, kRepeatBurst}, key_frames_{kKeyFrames, kKeyFramesAtOnce};
  PacketLoss loss_;        // used by the main thread alone
  bool has_left_ = false;  // used by the main thread alone
};

}  // namespace lf::serve
