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
#include "serve/browser_stream.h"
#include "serve/control_message.h"
#include "serve/surface_sender.h"
#include "serve/viewer_pipeline.h"

namespace lf::serve {

// The virtual camera of one browser. The viewer sends requests to the light field, composes the answers of the camera
// hosts to pictures, and sends video to the browser.
class Viewer : public BrowserStream {
 public:
  // `max_aperture` is in metres.
  Viewer(LightField& field, Offer offer, const ViewSettings& settings, double max_aperture, const Route& route,
         Callbacks callbacks);
  ~Viewer() override;
  void leave() override;

  // Reloads the rig file and notifies the page. `max_aperture` is in metres.
  void update_rig(double max_aperture);
  void shed(const LoadShedding& load_shedding);
  double kept() { return view_pipeline_->kept(); }
  ViewerPipeline& view_pipeline() { return *view_pipeline_; }
  ViewerCounters counters() const override;

 private:
  void control(const std::string& text) override;
  void report(const LinkReport& link) override;
  bool key_frame_requested() override { return true; }
  void start_video() override;
  void handle_control(const std::string& text);
  void apply_quality();
  GstClockTime running_time() const;
  void requested(GstClockTime time);
  void watch_encoder();
  void send_surface(GstPad* encoded, GstBuffer* picture);
  int pictures_left_out() const { return std::max(quality_.pictures_left_out(), load_shedding_.pictures_left_out()); }
  int size_divisor() const { return std::max(quality_.size_divisor(), is_full_ ? 1 : load_shedding_.size_divisor()); }
  void send_pixel_info(const ControlMessage::Pixel& pixel);

  const ViewSettings settings_;
  std::atomic<double> max_aperture_;  // metres
  GstElement* encoder_ = nullptr;
  std::unique_ptr<ViewerPipeline> view_pipeline_;
  QualityControl quality_;
  LoadShedding load_shedding_;
  std::atomic<bool> is_at_rest_ = false;  // no navigation since pictures were equal
  bool is_full_ = false;                  // is_at_rest_ at the latest report
  std::string encoder_name_;
  uint64_t video_bytes_reported_ = 0;
  SurfaceSender surfaces_;  // thread of the encoder only
  std::atomic<uint64_t> surface_bytes_ = 0, refused_messages_ = 0;

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
