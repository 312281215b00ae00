// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "offer.h"
#include "packet_loss.h"

typedef struct _GstWebRTCDataChannel GstWebRTCDataChannel;

namespace lf::serve {

// What the receiver says of the last second.
struct LinkReport {
  double loss = 0;        // of the packets
  double round_trip = 0;  // seconds; 0: not known
};

// One browser at the other end of a webrtcbin: offer and answer, the data channel, and whether it is still there.
// Made on the main thread; what it calls back comes on the main thread, but for on_message.
class Peer : public std::enable_shared_from_this<Peer> {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;  // with all candidates; once
    std::function<void(const std::string& why)> on_failed;
    std::function<void(const std::string& text)> on_message;  // of the data channel "control"; a streaming thread
    std::function<void(const LinkReport&)> on_report;
  };

  // `webrtc` is borrowed from its pipeline, which has not been started. `address`: the only one to be reached at, or
  // "".
  static std::shared_ptr<Peer> make(GstElement* webrtc, Offer offer, const std::string& address, Callbacks callbacks);
  // After the pipeline was stopped.
  ~Peer();

  // g_get_monotonic_time() of the last packet from the browser; 0: none yet. Thread-safe.
  int64_t heard() const { return heard_; }
  bool connected() const { return connected_; }
  // To the data channel "control", if there is one. Thread-safe.
  void send(const std::string& text);
  // on_report follows.
  void ask_for_report();

 private:
  Peer(GstElement* webrtc, Offer offer, Callbacks callbacks);
  void watch(const std::string& address);
  void negotiate();
  void answer();
  void fail(const std::string& why);
  void open_channel(GstWebRTCDataChannel* channel);
  void watch_element(GstElement* element);

  GstElement* webrtc_;
  Offer offer_;
  Callbacks callbacks_;
  std::atomic<int64_t> heard_ = 0;
  std::atomic<bool> connected_ = false, negotiating_ = false, answered_ = false;
  std::mutex mutex_;
  GstWebRTCDataChannel* channel_ = nullptr;
  PacketLoss loss_;  // the main thread's
};

}  // namespace lf::serve
