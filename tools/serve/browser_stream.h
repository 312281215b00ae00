// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include <gst/gst.h>

#include "serve/light_field.h"
#include "serve/limits.h"
#include "serve/offer.h"
#include "serve/peer.h"
#include "serve/viewer_pipeline.h"

namespace lf::serve {

// The pipeline that sends video to one browser, and its WebRTC connection. Subclasses produce the video, either of a
// virtual camera of this browser (Viewer) or of a flight that many browsers watch (Watcher). Elements of the video
// start only when the browser has connected through DTLS.
//
// Create and use a stream on the main thread, where callbacks run. Call leave() before the destructor, which may run on
// any thread and may be slow.
class BrowserStream {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;
    std::function<void()> on_connected;
    std::function<void(const std::string& why)> on_gone;  // the stream must be destroyed soon, but not inside this call
  };

  virtual ~BrowserStream();
  BrowserStream(const BrowserStream&) = delete;

  virtual void leave();
  // Adapts the video to the network and sends statistics to the page. Call this once a second. `busy` is the processor
  // load, 0 to 1.
  void tick(double busy);
  // Returns the seconds since the last packet from the browser, or since the creation if there was none.
  double silence(int64_t now) const;
  bool connected() const { return peer_ && peer_->connected(); }
  virtual ViewerCounters counters() const;

 protected:
  // `line` is the launch line of the video. It ends with the payloader of payloader_line(). Throws Error.
  BrowserStream(LightField& field, const std::string& line, Callbacks callbacks);
  // Answers the offer. `base_time` is the base time of the pipeline. The last call of the constructor of a subclass.
  void connect(Offer offer, const Route& route, GstClockTime base_time);
  // Stops the pipeline. The first call of the destructor of a subclass, because streaming threads use its members.
  void stop();

  virtual void control(const std::string& text) = 0;  // receives each message of the page, on a streaming thread
  virtual void report(const LinkReport& link) = 0;
  // The browser requests a key frame. Returns true if the encoder of this pipeline must make one.
  virtual bool key_frame_requested() = 0;
  virtual void start_video();

  LightField& field_;
  Callbacks callbacks_;
  // `video_` contains all elements except the webrtcbin
  GstElement *pipeline_ = nullptr, *video_ = nullptr;
  std::shared_ptr<Peer> peer_;
  double busy_ = 0;
  std::atomic<uint64_t> video_bytes_ = 0;

 private:
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);
  void watch_payloader(GstElement* payloader);

  GstElement* webrtc_ = nullptr;  // borrowed from the pipeline
  guint watch_ = 0;
  int64_t began_;
};

}  // namespace lf::serve
