// SPDX-License-Identifier: LGPL-2.1-or-later
// What a viewer tells its page and the server of itself.
#include <gst/video/video.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "viewer.h"

namespace lf::serve {
namespace {

using nlohmann::json;

uint64_t count_in(const GstStructure* stats, const char* name) {
  guint64 value = 0;
  gst_structure_get_uint64(stats, name, &value);
  return value;
}

}  // namespace

void Viewer::tell_pixel(const ControlMessage::Pixel& pixel) {
  auto view = eye_->asked();
  if (!view) return;
  const bool right = settings_.eye.eye_distance > 0 && pixel.x >= view->width;
  if (right) view = seen_beside(*view, settings_.eye.eye_distance);
  nlohmann::json cameras = field_.array()->pixel(*view, pixel.x - (right ? view->width : 0), pixel.y);
  peer_->send(info_message(json{{"pixel", {{"x", pixel.x}, {"y", pixel.y}, {"cameras", std::move(cameras)}}}}));
}

// What is left away, the machine's reasons first where both have one.
json Viewer::shed_report() const {
  const bool trials = shedding_.trial_interval() > 1, rate = pictures_left_out() > 0, size = size_divisor() > 1;
  const bool processor = trials && (!rate || shedding_.pictures_left_out() > 0);
  return {{"what", size     ? "size"
                   : rate   ? "rate"
                   : trials ? "trials"
                            : ""},
          {"why", processor      ? "processor"
                  : rate || size ? "network"
                                 : ""},
          {"trials", trials},
          {"rate", 1 + pictures_left_out()},
          {"size", size_divisor()}};
}

void Viewer::report(const LinkReport& link) {
  if (quality_.update(link.loss, link.round_trip)) use_quality();
  if (quality_.wants_key_frame())
    gst_element_send_event(encoder_, gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
  GstStructure* stats = eye_->stats();
  const auto ms = [stats](const char* name) { return static_cast<double>(count_in(stats, name)) * 1e-6; };
  json info = {{"pictures", count_in(stats, "pictures")},
               {"incomplete", count_in(stats, "incomplete")},
               {"missing", count_in(stats, "missing-fragments")},
               {"outOfService", count_in(stats, "out-of-service")},
               {"answerBytes", figures().answer_bytes},
               {"skewMs", ms("max-skew-ns")},
               {"answerMs", ms("answer-ns-p50")},
               {"addMs", ms("add-ns-p50")},
               {"pictureMs", ms("latency-ns-p50")},
               {"videoBytes", video_bytes_.load()},
               {"bitRate", quality_.bits_per_second()},
               {"frameRate", settings_.eye.framerate / (1 + pictures_left_out())},
               {"sizeDivisor", size_divisor()},
               {"sentRate", 8 * (video_bytes_ - video_bytes_told_)},
               {"shed", shed_report()},
               {"encoder", encoder_name_},
               {"busy", busy_},
               {"loss", link.loss},
               {"roundTripMs", link.round_trip * 1e3}};
  video_bytes_told_ = video_bytes_;
  json focus = {{"on", settings_.eye.focus_on.mode},
                {"rounds", count_in(stats, "focus-rounds")},
                {"interval", count_in(stats, "focus-interval")},
                {"trialBytes", count_in(stats, "trial-bytes")}};
  gdouble residual = 0, gained = 0, near = 0, far = 0;
  gboolean flat = FALSE;
  gst_structure_get(stats, "focus-residual", G_TYPE_DOUBLE, &residual, "focus-gained", G_TYPE_DOUBLE, &gained,
                    "focus-flat", G_TYPE_BOOLEAN, &flat, "focus-near", G_TYPE_DOUBLE, &near, "focus-far", G_TYPE_DOUBLE,
                    &far, nullptr);
  gst_structure_free(stats);
  focus["residual"] = std::isfinite(residual) ? residual : 0;
  focus["gained"] = std::isfinite(gained) ? gained : 0;
  focus["flat"] = flat != FALSE;
  // Where the scene is, metres; what is beyond all bounds has no place on a slider.
  constexpr double kFarthest = 30;  // times the nearest
  if (near > 0) {
    focus["near"] = near;
    focus["far"] = std::min(far, kFarthest * near);
  }
  info["focus"] = std::move(focus);
  if (const CameraStates cameras = field_.cameras(); cameras.count > 0)
    info["cameras"] = {{"count", cameras.count}, {"working", cameras.working}};
  if (!field_.is_local()) info["nodes"] = {{"count", field_.nodes()}, {"silent", field_.silent_nodes()}};
  if (json shown = eye_->shown(); shown.is_object()) info["picture"] = std::move(shown);
  info["monitored"] = settings_.monitored;
  if (const auto view = eye_->asked()) info["coverage"] = field_.array()->coverage(*view);
  json message = {{"statistics", std::move(info)}};
  if (settings_.eye.path.empty()) message["view"] = eye_->numbers();
  peer_->send(info_message(message));
}

MonitorReport Viewer::monitor() const {
  GstStructure* stats = eye_->stats();
  MonitorReport report = monitor_report(stats);
  gst_structure_free(stats);
  return report;
}

Viewer::Figures Viewer::figures() const {
  Figures figures{.video_bytes = video_bytes_,
                  .refused_messages = refused_messages_,
                  .bits_per_second = quality_.bits_per_second()};
  GstStructure* stats = eye_->stats();
  figures.pictures += count_in(stats, "pictures");
  figures.incomplete += count_in(stats, "incomplete");
  figures.answer_bytes += count_in(stats, "bytes");
  gst_structure_free(stats);
  return figures;
}

}  // namespace lf::serve
