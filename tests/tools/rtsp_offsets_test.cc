// SPDX-License-Identifier: LGPL-2.1-or-later
// Network cameras that run freely, at 15 and 30 frames/s, film a moved bar: lf-rig records them through RTSP, and
// lf-calibrate is to find by how much each of them is late.
#include <gmock/gmock.h>
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "gst/rtsp_server.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;
using testing::Not;

#if LF_HAS_RTSP_SERVER

// A film whose frames are given out at their times, counted from one instant for all films.
class LiveFilm {
 public:
  LiveFilm(const std::string& path, GstClockTime begin) : begin_(begin) {
    GstElement* pipeline = gst_parse_launch(
        ("filesrc location=" + path + " ! matroskademux ! image/jpeg ! appsink name=sink sync=false").c_str(), nullptr);
    GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "sink");
    gst_element_set_state(pipeline, GST_STATE_PLAYING);
    while (GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(sink))) frames_.push_back(sample);
    gst_element_set_state(pipeline, GST_STATE_NULL);
    gst_object_unref(sink);
    gst_object_unref(pipeline);
  }
  ~LiveFilm() {
    for (GstSample* frame : frames_) gst_sample_unref(frame);
  }
  LiveFilm(const LiveFilm&) = delete;

  void serve(GstRTSPServer* server, const std::string& path) {
    GstRTSPMountPoints* mounts = gst_rtsp_server_get_mount_points(server);
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    gst_rtsp_media_factory_set_launch(factory, "( appsrc name=film is-live=true format=time ! rtpjpegpay name=pay0 )");
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    g_signal_connect(factory, "media-configure",
                     G_CALLBACK(+[](GstRTSPMediaFactory*, GstRTSPMedia* media, gpointer film) {
                       GstElement* element = gst_rtsp_media_get_element(media);
                       GstElement* source = gst_bin_get_by_name_recurse_up(GST_BIN(element), "film");
                       GstCaps* caps = gst_sample_get_caps(static_cast<LiveFilm*>(film)->frames_.front());
                       g_object_set(source, "caps", caps, nullptr);
                       g_signal_connect(source, "need-data", G_CALLBACK(give), film);
                       gst_object_unref(source);
                       gst_object_unref(element);
                     }),
                     this);
    gst_rtsp_mount_points_add_factory(mounts, path.c_str(), factory);
    g_object_unref(mounts);
  }

 private:
  // The next frame, when its time has come.
  static void give(GstElement* source, guint, gpointer data) {
    const auto* film = static_cast<LiveFilm*>(data);
    GstClock* clock = gst_element_get_clock(source);
    if (!clock) return;
    const GstClockTime now = gst_clock_get_time(clock), base = gst_element_get_base_time(source);
    for (GstSample* frame : film->frames_) {
      GstBuffer* taken = gst_sample_get_buffer(frame);
      const GstClockTime due = film->begin_ + GST_BUFFER_PTS(taken);
      if (due <= now || due < base) continue;
      g_usleep((due - now) / 1000);
      GstBuffer* buffer = gst_buffer_copy(taken);
      GST_BUFFER_PTS(buffer) = due - base;
      GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
      gst_app_src_push_buffer(GST_APP_SRC(source), buffer);
      break;
    }
    gst_object_unref(clock);
  }

  const GstClockTime begin_;
  std::vector<GstSample*> frames_;
};

TEST(RtspOffsets, AreFoundToHalfAMillisecond) {
  g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, FALSE);
  gst_init(nullptr, nullptr);
  const TempDir dir;
  Rig truth = scene_rig(2, 2, 240, 176);
  const double offsets[] = {0.033, -0.033, 0.02, -0.011};
  for (size_t i = 0; i < 4; i++) truth.cameras[i].time_offset = offsets[i];
  save_rig(truth, dir / "true.json");
  const Outcome filmed = run_program(
      "lf-scene", "lights --rig true.json --out films --framerate 30,15 --seconds 40 --speed 0.5", dir.path());
  ASSERT_EQ(filmed.status, 0) << filmed.output;
  {
    test::RtspServer server;
    GstClock* clock = gst_system_clock_obtain();
    const GstClockTime begin = gst_clock_get_time(clock);
    gst_object_unref(clock);
    std::vector<std::unique_ptr<LiveFilm>> films;
    Rig rig = truth;
    for (Camera& camera : rig.cameras) {
      films.push_back(std::make_unique<LiveFilm>(dir / "films/" + camera.name + ".mkv", begin));
      films.back()->serve(server.server(), "/" + camera.name);
      camera.source = server.uri("/" + camera.name);
      camera.time_offset = 0;
    }
    save_rig(rig, dir / "rig.json");
    const Outcome recorded = run_program("lf-rig", "record rig.json --out lights --seconds 10 --lights 2", dir.path());
    ASSERT_EQ(recorded.status, 0) << recorded.output;
    EXPECT_THAT(recorded.output, Not(HasSubstr("dated as they came")));
    server.stop();
  }
  test::RtspServer::clean_up();
  const Outcome solved =
      run_program("../calib/lf-calibrate", "all rig.json --lights lights --bar 0.3 --out found.json", dir.path());
  ASSERT_TRUE(std::filesystem::exists(dir / "found.json")) << solved.output;
  const Rig found = load_rig(dir / "found.json");
  double mean = 0, squares = 0;
  for (size_t i = 0; i < 4; i++) {
    const double error = found.cameras[i].time_offset - offsets[i];
    std::printf("camera %zu: %.3f ms\n", i, 1e3 * error);
    mean += error / 4, squares += error * error / 4;
  }
  const double rms = std::sqrt(squares - mean * mean);
  std::printf("offsets through RTSP: %.3f ms root mean square\n", 1e3 * rms);
  EXPECT_LE(rms, 5e-4);
}

#else
TEST(RtspOffsets, AreFoundToHalfAMillisecond) { GTEST_SKIP() << test::kRtspServerMissing; }
#endif

}  // namespace
}  // namespace lf
