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
#include "serve/light_field.h"
#include "serve/limits.h"
#include "serve/peer.h"
#include "serve/surface_sender.h"
#include "serve/viewer_pipeline.h"

namespace lf::serve {

// The virtual camera of one browser, and its pipeline. The viewer sends requests to the light field, composes the
// answers of the camera hosts to pictures, and sends video to the browser. Rendering and encoding start only when the
// browser has connected through DTLS.
//
// Create and use a viewer on the main thread, where callbacks run. Call leave() before the destructor, which may run on
// any thread and may be slow.
class Viewer {
 public:
  struct Callbacks {
    std::function<void(const std::string& sdp)> on_answer;
    std::function<void()> on_connected;
    std::function<void(const std::string& why)> on_gone;  // the viewer must be destroyed soon, but not inside this call
  };

  // `max_aperture` is in metres.
  Viewer(LightField& field, Offer offer, const ViewSettings& settings, double max_aperture, const Route& route,
         Callbacks callbacks);
  ~Viewer();
  void leave();
  Viewer(const Viewer&) = delete;

  // Adapts the bit rate and sends statistics to the page. Call this once a second. `busy` is the processor load, 0 to
  // 1.
  void tick(double busy);
  // Reloads the rig file and notifies the page. `max_aperture` is in metres.
  void update_rig(double max_aperture);
  void shed(const LoadShedding& load_shedding);
  double kept() { return pacer_.kept(); }
  // Returns the seconds since the last packet from the browser, or since the creation of the viewer if there was none.
  double silence(int64_t now) const;
  void set_monitor_interval(int interval) { view_pipeline_->set_monitor_interval(interval); }
  MonitorReport monitor() const;
  bool connected() const { return peer_ && peer_->connected(); }

  struct ViewerCounters {
    uint64_t pictures = 0, incomplete = 0, answer_bytes = 0, video_bytes = 0, surface_bytes = 0, refused_messages = 0;
    int bits_per_second = 0;
  };
  ViewerCounters counters() const;

 private:
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);
  void control(const std::string& text);
  void handle_control(const std::string& text);
  void set_request_phase();
  void start_video();
  void update_pacer();
  void apply_quality();
  GstClockTime running_time() const;
  void requested(GstClockTime time);
  void watch_encoder();
  void send_surface(GstPad* encoded, GstBuffer* picture);
  void report(const LinkReport& link);
  int pictures_left_out() const { return std::max(quality_.pictures_left_out(), load_shedding_.pictures_left_out()); }
  int size_divisor() const { return std::max(quality_.size_divisor(), load_shedding_.size_divisor()); }
  nlohmann::json load_shedding_report() const;
  void send_pixel_info(const ControlMessage::Pixel& pixel);

  LightField& field_;
  const ViewSettings settings_;
  std::atomic<double> max_aperture_;  // metres
  Callbacks callbacks_;
  // `video_` contains all elements except the webrtcbin
  GstElement *pipeline_ = nullptr, *video_ = nullptr, *encoder_ = nullptr;
  std::unique_ptr<ViewerPipeline> view_pipeline_;
  std::shared_ptr<Peer> peer_;
  guint watch_ = 0;
  int64_t began_;
  RequestPacer pacer_;
  QualityControl quality_;
  LoadShedding load_shedding_;
  double busy_ = 0;
  std::string encoder_name_;
  uint64_t video_bytes_reported_ = 0;
  SurfaceSender surfaces_;  // thread of the encoder only
  std::atomic<uint64_t> video_bytes_ = 0, surface_bytes_ = 0, refused_messages_ = 0;

  std::mutex mutex_;  // guards the members below
  TokenBucket messages_;
  bool rate_limited_ = false;
  bool video_started_ = false;
  std::vector<std::string> early_messages_;
  struct Change {
    uint64_t id;
    GstClockTime time;  // running time just before the change
  };
  std::optional<Change> change_;
};

}  // namespace lf::serve
