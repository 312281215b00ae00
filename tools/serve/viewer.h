// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "control_message.h"
#include "light_field.h"
#include "pace.h"
#include "peer.h"
#include "quality_control.h"
#include "rate_limit.h"

namespace lf::serve {

struct ViewerSettings {
  uint32_t view = 0;
  int width = 640, height = 480;  // pixels, even
  int framerate = 30;
  uint64_t capture_delay = 0;  // nanoseconds, how old a capture must be before it is asked for
  double focus = 0;            // metres, to begin with; 0: as lfviewrequest chooses
  int least_bit_rate = 300000, most_bit_rate = 6000000;
  double messages_per_second = 240;
  std::string address;  // the only one to be reached at, or ""
};

// One browser's own virtual camera, in a pipeline of its own: requests go to the light field, answers come from there,
// pictures go out. Made, used and destroyed on the main thread, where its callbacks come, too.
class Viewer {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;
    std::function<void(const std::string& why)> on_gone;  // to be destroyed, but not inside of this call
  };

  // Throws Error.
  Viewer(LightField& field, Offer offer, const ViewerSettings& settings, Callbacks callbacks);
  ~Viewer();
  Viewer(const Viewer&) = delete;

  // Once a second: looks after the bit rate, and tells the page how things are.
  void tick();
  // Seconds since the browser was last heard; or was answered; or asked.
  double silence(int64_t now) const;
  bool answered() const { return answered_ != 0; }
  bool connected() const { return peer_ && peer_->connected(); }

  struct Figures {
    uint64_t pictures = 0, incomplete = 0, answer_bytes = 0, video_bytes = 0, refused_messages = 0;
    int bits_per_second = 0;
  };
  Figures figures() const;

 private:
  void watch_pace();
  static GstFlowReturn take_request(GstAppSink* sink, gpointer data);
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);
  void control(const std::string& text);
  GstClockTime running_time() const;
  void take_answer(size_t node, GstBuffer* answer);
  void report(const LinkReport& link);
  void tell_pixel(const ControlMessage::Pixel& pixel);
  std::optional<View> asked();

  LightField& field_;
  ViewerSettings settings_;
  Callbacks callbacks_;
  GstElement* pipeline_ = nullptr;
  GstElement *compositor_ = nullptr, *encoder_ = nullptr;
  GstElement* view_ = nullptr;  // lfviewrequest
  GstPad* view_pad_ = nullptr;  // takes upstream events
  std::vector<GstAppSrc*> answers_;
  std::shared_ptr<Peer> peer_;
  guint watch_ = 0;
  int64_t began_, answered_ = 0;
  Pace pace_;
  QualityControl quality_;
  std::atomic<uint64_t> video_bytes_ = 0, refused_messages_ = 0;

  std::mutex mutex_;  // of what follows
  TokenBucket messages_;
  bool flooded_ = false;
  std::optional<View> asked_;  // for, last
  struct Change {
    uint64_t id;        // of the message
    GstClockTime time;  // running time just before it
  };
  std::optional<Change> change_;  // the latest that no request has shown yet
};

}  // namespace lf::serve
