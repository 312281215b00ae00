// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>

#include <functional>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "serve/light_field.h"
#include "serve/limits.h"
#include "view/view_request.h"

namespace lf::serve {

struct ViewerPipelineSettings {
  uint32_t view = 0;
  int width = 640, height = 480;  // pixels, even
  int framerate = 30;
  uint64_t capture_delay = 0;  // minimum age of a requested capture, nanoseconds
  double focus = 0;            // initial focus distance, metres; 0: chosen by lfviewrequest
  FocusSettings focus_settings;
  double eye_distance = 0;  // metres between two eyes; 0: one eye
  std::string path;         // camera path (views.json) played in a loop, or ""
};

// Part of a viewer's pipeline that renders one or two eyes. Sends requests to the light field, receives answers and
// outputs pictures; two eyes side by side.
class ViewerPipeline {
 public:
  // Called on a streaming thread before the requests for a picture of this running time are sent.
  using OnRequest = std::function<void(GstClockTime)>;

  // Returns the launch line of this part, up to "... ! " before the consumer of its pictures.
  static std::string launch_line(size_t nodes);
  // `pipeline` was made with launch_line() and is not started.
  ViewerPipeline(GstElement* pipeline, LightField& field, const ViewerPipelineSettings& settings, OnRequest on_request);
  // Stop the pipeline first.
  ~ViewerPipeline();
  ViewerPipeline(const ViewerPipeline&) = delete;

  void close();                           // stops answers; call before the pipeline is stopped
  bool send_navigation(GstEvent* event);  // takes ownership; false if the event has no meaning here
  // Sets the size of an eye's pictures from the next request, pixels, even. No effect on camera paths.
  void set_size(int width, int height) { g_object_set(view_, "width", width, "height", height, nullptr); }
  void set_rig(const std::string& rig) const {
    for (GstElement* element : {view_, compositor_}) g_object_set(element, "rig", rig.c_str(), nullptr);
  }
  void set_monitor_interval(int interval) { g_object_set(compositor_, "monitor-interval", interval, nullptr); }
  void set_depth_interval(unsigned interval) { g_object_set(compositor_, "depth-interval", interval, nullptr); }
  GstPad* requests() const { return view_pad_; }
  GstElement* compositor() const { return compositor_; }
  GstStructure* stats() const;  // `stats` of the lfcompositor; owned by the caller
  nlohmann::json numbers() const;
  // Returns the fields of the latest picture's meta lightfield-view (lfcompositor); null before the first picture.
  nlohmann::json shown() const;
  std::optional<View> asked() const;  // latest requested view; for two eyes, the left one

 private:
  static GstPadProbeReturn on_picture(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstFlowReturn take_request(GstAppSink* sink, gpointer data);
  bool begins(GstBuffer* request);
  void take_answer(size_t node, GstBuffer* answer);

  LightField& field_;
  const uint32_t id_;
  const OnRequest on_request_;
  GstElement *compositor_ = nullptr, *view_ = nullptr;
  GstPad* view_pad_ = nullptr;
  std::vector<GstAppSrc*> answers_;
  mutable std::mutex mutex_;
  GstStructure* picture_fields_ = nullptr;
  GstBuffer* last_request_ = nullptr;  // first request of the latest picture; decoded on demand
};

// True if the request does not become a picture: it measures cameras or is undecodable.
bool is_probe(GstBuffer* request);

}  // namespace lf::serve
