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

struct EyeSettings {
  uint32_t view = 0;              // id of the view
  int width = 640, height = 480;  // pixels, even
  int framerate = 30;
  uint64_t capture_delay = 0;  // nanoseconds, how old a capture must be before it is asked for
  double focus = 0;            // metres, to begin with; 0: as lfviewrequest chooses
  FocusOn focus_on;
  double eye_distance = 0;  // metres between two eyes; 0: one eye
  std::string path;         // a views.json that is flown over and over, or ""
};

// The eye of a viewer, or both, inside of the viewer's pipeline: requests go to the light field, answers come from
// there, and pictures leave, those of two eyes side by side.
class Eye {
 public:
  // Streaming thread: the requests for a picture of this running time begin to go.
  using OnRequest = std::function<void(GstClockTime)>;

  // The part of a launch line that makes the eye, up to "... ! ", behind which its pictures come.
  static std::string launch_line(size_t nodes);
  // The eye of a pipeline made with launch_line(), which has not been started.
  Eye(GstElement* pipeline, LightField& field, const EyeSettings& settings, OnRequest on_request);
  // Call after the pipeline was stopped.
  ~Eye();
  Eye(const Eye&) = delete;

  void close();                 // call before the pipeline is stopped: no answers come any more
  bool steer(GstEvent* event);  // takes the event; false if it means nothing here
  // The size of an eye's pictures from the next request on, pixels, even; those of a path have their own.
  void set_size(int width, int height) { g_object_set(view_, "width", width, "height", height, nullptr); }
  // Reads the rig file again.
  void set_rig(const std::string& rig) const {
    for (GstElement* element : {view_, compositor_}) g_object_set(element, "rig", rig.c_str(), nullptr);
  }
  // Watches the cameras, see lfcompositor's property "monitor-interval".
  void set_monitor(int interval) { g_object_set(compositor_, "monitor-interval", interval, nullptr); }
  // Looks for the focus by one of so many requests, see lfcompositor's property "trial-interval".
  void set_trials(unsigned interval) { g_object_set(compositor_, "trial-interval", interval, nullptr); }
  GstPad* requests() const { return view_pad_; }
  GstElement* compositor() const { return compositor_; }
  GstStructure* stats() const;  // `stats` of the lfcompositor; owned by the caller
  // The numbers of the view, as the properties of lfviewrequest.
  nlohmann::json numbers() const;
  // What the latest picture shows: the fields of its meta lightfield-view (lfcompositor); null before the first
  // picture.
  nlohmann::json shown() const;
  std::optional<View> asked() const;  // the view that was asked for last, of two that of the left eye

 private:
  static GstPadProbeReturn note_picture(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  static GstFlowReturn take_request(GstAppSink* sink, gpointer data);
  bool begins(GstBuffer* request);
  void take_answer(size_t node, GstBuffer* answer);

  LightField& field_;
  const uint32_t id_;
  const OnRequest on_request_;
  GstElement *compositor_ = nullptr, *view_ = nullptr;
  GstPad* view_pad_ = nullptr;  // takes upstream events
  std::vector<GstAppSrc*> answers_;
  mutable std::mutex mutex_;
  GstStructure* shown_ = nullptr;  // of the latest picture
  GstBuffer* asked_ = nullptr;     // the first of the latest picture's requests; decoded when somebody wants to know
};

// Whether it becomes no picture: one that measures cameras, or none at all.
bool is_probe(GstBuffer* request);

}  // namespace lf::serve
