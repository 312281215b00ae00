// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#if LF_HAS_RTSP_SERVER

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "gst/rtsp_server.h"
#include "rig/rig.h"

namespace lf::test {

// The film of a camera, a file of JPEG pictures, that an RTSP server gives out at its times, again and again. It must
// outlive the server.
class LiveFilm {
 public:
  // `hold`: each picture of the file stays for so many frames, at 15 a second; 0: the file's own times.
  explicit LiveFilm(const std::string& path, int hold = 0) {
    GstElement* pipeline = gst_parse_launch(
        ("filesrc location=" + path + " ! matroskademux ! image/jpeg ! appsink name=sink sync=false").c_str(), nullptr);
    GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "sink");
    gst_element_set_state(pipeline, GST_STATE_PLAYING);
    while (GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(sink))) {
      if (!caps_) caps_ = gst_caps_copy(gst_sample_get_caps(sample));
      const GstClockTime pts = GST_BUFFER_PTS(gst_sample_get_buffer(sample));
      for (int i = 0; i < std::max(1, hold); i++)
        frames_.push_back({gst_buffer_ref(gst_sample_get_buffer(sample)),
                           hold ? gst_util_uint64_scale(frames_.size(), GST_SECOND, kHeldRate) : pts});
      gst_sample_unref(sample);
    }
    gst_element_set_state(pipeline, GST_STATE_NULL);
    gst_object_unref(sink);
    gst_object_unref(pipeline);
    if (frames_.size() < 2) throw std::runtime_error(path + ": no film");
    length_ = frames_.back().time - frames_.front().time + frames_[1].time - frames_[0].time;
    if (hold && caps_) gst_caps_set_simple(caps_, "framerate", GST_TYPE_FRACTION, kHeldRate, 1, nullptr);
  }
  ~LiveFilm() {
    for (const Frame& frame : frames_) gst_buffer_unref(frame.buffer);
    if (caps_) gst_caps_unref(caps_);
  }
  LiveFilm(const LiveFilm&) = delete;
  LiveFilm& operator=(const LiveFilm&) = delete;

  // Films that begin at one time of the system's clock, which has come, show one instant.
  void serve(GstRTSPServer* server, const std::string& path, GstClockTime begin) {
    begin_ = begin;
    GstRTSPMountPoints* mounts = gst_rtsp_server_get_mount_points(server);
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    gst_rtsp_media_factory_set_launch(factory, "( appsrc name=film is-live=true format=time ! rtpjpegpay name=pay0 )");
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    g_signal_connect(factory, "media-configure",
                     G_CALLBACK(+[](GstRTSPMediaFactory*, GstRTSPMedia* media, gpointer film) {
                       GstElement* element = gst_rtsp_media_get_element(media);
                       GstElement* source = gst_bin_get_by_name_recurse_up(GST_BIN(element), "film");
                       g_object_set(source, "caps", static_cast<LiveFilm*>(film)->caps_, nullptr);
                       g_signal_connect(source, "need-data", G_CALLBACK(give), film);
                       gst_object_unref(source);
                       gst_object_unref(element);
                     }),
                     this);
    gst_rtsp_mount_points_add_factory(mounts, path.c_str(), factory);
    g_object_unref(mounts);
  }

 private:
  static constexpr int kHeldRate = 15;
  struct Frame {
    GstBuffer* buffer;
    GstClockTime time;
  };

  // The next frame, when its time has come.
  static void give(GstElement* source, guint, gpointer data) {
    const auto* film = static_cast<LiveFilm*>(data);
    GstClock* clock = gst_element_get_clock(source);
    if (!clock) return;
    const GstClockTime now = gst_clock_get_time(clock), base = gst_element_get_base_time(source);
    GstClockTime round = film->begin_ + (now - film->begin_) / film->length_ * film->length_, due = 0;
    auto frame = film->frames_.begin();
    while ((due = round + frame->time) <= now || due < base)
      if (++frame == film->frames_.end()) frame = film->frames_.begin(), round += film->length_;
    g_usleep((due - now) / 1000);
    GstBuffer* buffer = gst_buffer_copy(frame->buffer);
    GST_BUFFER_PTS(buffer) = due - base;
    GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
    gst_app_src_push_buffer(GST_APP_SRC(source), buffer);
    gst_object_unref(clock);
  }

  GstClockTime begin_ = 0, length_ = 0;
  GstCaps* caps_ = nullptr;
  std::vector<Frame> frames_;
};

// Cameras of a rig, each behind an RTSP server of its own that gives out FOLDER/NAME.mkv. All show one instant.
class FilmServers {
 public:
  FilmServers(Rig rig, const std::string& folder, int hold = 0) : rig_(std::move(rig)) {
    for (const Camera& camera : rig_.cameras)
      films_.push_back(std::make_unique<LiveFilm>(folder + "/" + camera.name + ".mkv", hold));
    GstClock* clock = gst_system_clock_obtain();
    const GstClockTime begin = gst_clock_get_time(clock);
    gst_object_unref(clock);
    for (size_t i = 0; i < films_.size(); i++) {
      servers_.push_back(std::make_unique<RtspServer>());
      films_[i]->serve(servers_[i]->server(), "/film", begin);
      rig_.cameras[i].source = servers_[i]->uri("/film");
    }
  }
  ~FilmServers() {
    servers_.clear();
    RtspServer::clean_up();
  }

  // The rig with its cameras' addresses.
  const Rig& rig() const { return rig_; }

 private:
  Rig rig_;
  std::vector<std::unique_ptr<LiveFilm>> films_;
  std::vector<std::unique_ptr<RtspServer>> servers_;
};

}  // namespace lf::test

#endif
