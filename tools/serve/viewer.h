// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <gst/app/app.h>
#include <nlohmann/json_fwd.hpp>

#include "serve/adaptation.h"
#include "serve/array_info.h"
#include "serve/control_message.h"
#include "serve/eye.h"
#include "serve/light_field.h"
#include "serve/limits.h"
#include "serve/peer.h"

namespace lf::serve {

struct ViewerSettings {
  EyeSettings eye;
  int least_bit_rate = 100000, most_bit_rate = 6000000;
  double messages_per_second = 240;
  double max_aperture = 0;  // metres
  bool monitored = false;   // whether the server watches its cameras, by this viewer's requests or another's
  Route route;
};

// One browser's own virtual camera, in a pipeline of its own: requests go to the light field, answers come from there,
// pictures go out, from the moment on that DTLS is up: before, nothing is asked for, rendered or encoded. Made and used
// on the main thread, where its callbacks come, too. Call leave() before the destructor, which may run on any thread and
// take long.
class Viewer {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;
    std::function<void()> on_connected;
    std::function<void(const std::string& why)> on_gone;  // the viewer is to be destroyed, but not inside of this call
  };

  // Throws Error.
  Viewer(LightField& field, Offer offer, const ViewerSettings& settings, Callbacks callbacks);
  ~Viewer();
  // Stops requests and callbacks.
  void leave();
  Viewer(const Viewer&) = delete;

  // Once a second: looks after the bit rate, and tells the page how things are. `busy`: of the processors, 0 to 1.
  void tick(double busy);
  // The rig file has changed: reads it again, and tells the page. `max_aperture` in metres.
  void take_rig(double max_aperture);
  // Leaves away what `shedding` says.
  void shed(const Shedding& shedding);
  // The part of requests that was made since the last call, see Pace.
  double kept() { return pace_.kept(); }
  // Seconds since the browser was last heard, or asked, where it has not connected yet.
  double silence(int64_t now) const;
  // Watches the cameras by its requests, see Limits::monitor.
  void set_monitor(int interval) { eye_->set_monitor(interval); }
  MonitorReport monitor() const;
  bool connected() const { return peer_ && peer_->connected(); }

  struct Figures {
    uint64_t pictures = 0, incomplete = 0, answer_bytes = 0, video_bytes = 0, refused_messages = 0;
    int bits_per_second = 0;
  };
  Figures figures() const;

 private:
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);
  void control(const std::string& text);
  void obey(const std::string& text);
  void take_turn();
  void begin_video();
  void watch_pace();
  void use_quality();
  GstClockTime running_time() const;
  void requested(GstClockTime time);
  void report(const LinkReport& link);
  int pictures_left_out() const { return std::max(quality_.pictures_left_out(), shedding_.pictures_left_out()); }
  int size_divisor() const { return std::max(quality_.size_divisor(), shedding_.size_divisor()); }
  nlohmann::json shed_report() const;
  void tell_pixel(const ControlMessage::Pixel& pixel);

  LightField& field_;
  ViewerSettings settings_;
  std::atomic<double> max_aperture_;  // metres
  Callbacks callbacks_;
  GstElement *pipeline_ = nullptr, *video_ = nullptr, *encoder_ = nullptr;  // `video_`: all but the webrtcbin
  std::unique_ptr<Eye> eye_;
  std::shared_ptr<Peer> peer_;
  guint watch_ = 0;
  int64_t began_;
  Pace pace_;
  QualityControl quality_;
  Shedding shedding_;
  double busy_ = 0;
  std::string encoder_name_;
  uint64_t video_bytes_told_ = 0;
  std::atomic<uint64_t> video_bytes_ = 0, refused_messages_ = 0;

  std::mutex mutex_;  // guards what follows
  TokenBucket messages_;
  bool flooded_ = false;
  bool began_video_ = false;
  std::vector<std::string> early_;  // messages that came before
  struct Change {
    uint64_t id;        // number of the message
    GstClockTime time;  // running time just before it
  };
  std::optional<Change> change_;  // the latest change that no request has shown yet
};

}  // namespace lf::serve
