// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>

#include <functional>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "serve/adaptation.h"
#include "serve/array_info.h"
#include "serve/light_field.h"
#include "serve/limits.h"
#include "view/view_request.h"

namespace lf::serve {

// Counters of a viewer, or the sum over several viewers.
struct ViewerCounters {
  uint64_t pictures = 0, incomplete = 0, answer_bytes = 0, video_bytes = 0, surface_bytes = 0, refused_messages = 0;
  uint64_t encoded = 0, encoded_half = 0;  // pictures of shared flights
  ViewerCounters& operator+=(const ViewerCounters& other);
};

struct ViewSettings {
  uint32_t id = 0;  // property "view-id" of the elements
  ViewParams params;
  Limits limits;

  GstClockTime capture_delay() const { return static_cast<GstClockTime>(limits.capture_delay_ms) * GST_MSECOND; }
  int max_bit_rate() const { return best_bit_rate(params.width * params.views(), params.height, limits); }
};

// The part of a viewer's pipeline that produces pictures, of one eye or of two eyes side by side. It sends view
// requests to the light field and composes the answers of the cameras to pictures.
class ViewerPipeline {
 public:
  // Called before the requests for a picture are sent, with the running time of the picture. Runs on a streaming
  // thread.
  using OnRequest = std::function<void(GstClockTime)>;

  // Returns the launch line of this part. It ends with "... ! ", so that the consumer of the pictures can follow.
  static std::string launch_line(size_t nodes);
  // `pipeline` must contain the elements of launch_line() and must not be started yet.
  ViewerPipeline(GstElement* pipeline, LightField& field, const ViewSettings& settings, OnRequest on_request);
  // The pipeline must be stopped before.
  ~ViewerPipeline();
  ViewerPipeline(const ViewerPipeline&) = delete;

  void close();                           // stops the arrival of answers; must be called before the pipeline is stopped
  bool send_navigation(GstEvent* event);  // takes ownership of the event; returns false if it has no meaning here
  // Sets the size of each eye's pictures, starting with the next request. Width and height must be even. Has no effect
  // on camera paths.
  void set_size(int width, int height) { g_object_set(view_, "width", width, "height", height, nullptr); }
  void set_rig(const std::string& rig) const {
    for (GstElement* element : {view_, compositor_}) g_object_set(element, "rig", rig.c_str(), nullptr);
  }
  // Reduces the load: only every (left_out + 1)-th picture is made, and depths are updated once per `depth_interval`
  // requests.
  void reduce(int left_out, unsigned depth_interval);
  // Returns how many of the requests that were due since the previous call have been sent, as a fraction.
  double kept() { return pacer_.kept(); }
  // Returns true if the latest pictures are equal, so that the server makes only a few more.
  bool is_resting() const { return pacer_.is_resting(); }
  void set_monitor_interval(int interval) { g_object_set(compositor_, "monitor-interval", interval, nullptr); }
  uint32_t id() const { return settings_.id; }
  MonitorReport monitor() const;
  nlohmann::json numbers() const;
  // Returns the fields of the meta lightfield-view that lfcompositor has attached to the latest picture; null before
  // the first picture.
  nlohmann::json shown() const;
  std::optional<View> asked() const;
  // Returns the statistics of this view for the page (docs/reference/web-interface.md).
  nlohmann::json statistics() const;
  ViewerCounters counters() const;

 private:
  void pace_requests();
  GstStructure* stats() const;  // property `stats` of the lfcompositor; owned by the caller
  static GstPadProbeReturn on_picture(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstFlowReturn take_request(GstAppSink* sink, gpointer data);
  bool begins(GstBuffer* request);
  void take_answer(size_t node, GstBuffer* answer);

  LightField& field_;
  const ViewSettings settings_;
  const OnRequest on_request_;
  GstElement *compositor_ = nullptr, *view_ = nullptr;
  GstPad* view_pad_ = nullptr;
  RequestPacer pacer_;
  std::optional<ViewRequest> last_shown_;  // thread of the requests only
  std::vector<GstAppSrc*> answers_;
  mutable std::mutex mutex_;
  GstStructure* picture_fields_ = nullptr;
  GstBuffer* last_request_ = nullptr;  // first request of the latest picture, which is decoded only when needed
};

// Returns the object `shed` of the statistics: the reductions of a video of which every (left_out + 1)-th picture is
// made, at 1 / divisor of its size.
nlohmann::json shed_report(const LoadShedding& load_shedding, int left_out, int divisor);

// Returns the base time of a pipeline with this view. Requests are sent at multiples of the frame duration in running
// time, so the base time sets their phase (request_phase()).
GstClockTime request_base_time(GstClock* clock, const ViewSettings& settings);

// True if no picture results from the request, because it measures cameras or cannot be decoded.
bool is_probe(GstBuffer* request);

}  // namespace lf::serve
