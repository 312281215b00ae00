// SPDX-License-Identifier: LGPL-2.1-or-later
//
// More to decode than there is time for.
#include <gmock/gmock.h>
#include <gst/video/gstvideodecoder.h>

#include <atomic>

#include "gst/loss_fixture.h"
#include "gst/rtsp_server.h"

namespace lf::test {
namespace {

using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// Decoding a frame takes so much longer, microseconds.
std::atomic<gulong> slowness = 0;

void slow_down(GstBin*, GstBin*, GstElement* element, gpointer) {
  if (!GST_IS_VIDEO_DECODER(element)) return;
  GstPad* sink = gst_element_get_static_pad(element, "sink");
  gst_pad_add_probe(
      sink, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer) {
        if (slowness > 0) g_usleep(slowness);
        return GST_PAD_PROBE_OK;
      },
      nullptr, nullptr);
  gst_object_unref(sink);
}

class OverloadTest : public LossTest {
 protected:
  void SetUp() override {
    if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
    slowness = 0;
    // 3 seconds with a key frame in each.
    const ElementPtr film =
        launch("videotestsrc num-buffers=45 ! video/x-raw,width=64,height=48,framerate=15/1 ! " + encoder() +
               " ! h264parse ! matroskamux ! filesink location=" + files->path("gops.mkv"));
    ASSERT_TRUE(film);
    ASSERT_EQ(run(film.get()), "");
  }
  void TearDown() override { slowness = 0; }
  static std::string encoder() {
    const ElementPtr x264(gst_element_factory_make("x264enc", nullptr));
    // The profile is one that every decoder has: left to itself x264 takes the most that a source can give.
    return x264 ? "x264enc tune=zerolatency key-int-max=15 ! video/x-h264,profile=main" : "openh264enc gop-size=15";
  }
  static uint64_t dropped(GstElement* node) {
    uint64_t sum = 0;
    for (int id = 0; id < 3; id++) sum += camera_stats(node, id).dropped;
    return sum;
  }
};

// A frame takes 100 ms of 67: late by 1 s after 3 s, and never on time again, if all were decoded.
TEST_F(OverloadTest, FramesAreDroppedBeforeTheyAreDecoded) {
  const ElementPtr pipeline = launch(line(rig(3, [](guint) { return "gops.mkv"; }), 1, "is-live=true loop=true"));
  ASSERT_TRUE(pipeline);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  for (const int id : {0, 1, 2})
    EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), id).state == "running"; }));
  slowness = 100000;
  EXPECT_TRUE(eventually([&] { return dropped(node.get()) > 60; }));  // longer than without there were frames in time
  const uint64_t answers = stat(node.get(), "answers"), fragments = stat(node.get(), "fragments");
  EXPECT_TRUE(eventually([&] { return stat(node.get(), "answers") >= answers + 75; }));
  const double seen = static_cast<double>(stat(node.get(), "fragments") - fragments) /
                      static_cast<double>(stat(node.get(), "answers") - answers);
  std::printf("%.2f of the answers show something\n", seen);
  EXPECT_GT(seen, 0.7);
  EXPECT_THAT(said.warnings(), Contains(HasSubstr("this machine can't decode all frames")));
  EXPECT_THAT(said.warnings(), Each(Not(HasSubstr("the clock that of all machines"))));

  slowness = 0;
  EXPECT_TRUE(eventually([&] {
    const uint64_t before = dropped(node.get());
    g_usleep(1500000);
    return dropped(node.get()) == before && said.out_of_service() == 0;
  }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
}

// Their own delay, of 200 ms and more, is none. Key frames of this server come every 8 seconds.
TEST_F(OverloadTest, NetworkCamerasDropToo) {
  if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  const RtspServer server;
  const std::string uri = server.uri("/h264");
  const ElementPtr pipeline = launch(line(rig(2, [&](guint id) { return id == 1 ? uri : "mjpeg.mkv"; })));
  ASSERT_TRUE(pipeline);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).state == "running"; }));
  g_usleep(1500000);
  EXPECT_EQ(camera_stats(node.get(), 1).dropped, 0u) << "a delay is not lateness";
  slowness = 50000;  // of 33 ms
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).dropped > 30; }));
  slowness = 0;
  EXPECT_TRUE(eventually([&] {
    const uint64_t before = camera_stats(node.get(), 1).dropped;
    g_usleep(1500000);
    return camera_stats(node.get(), 1).dropped == before && said.out_of_service() == 0;
  }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_EQ(said.lost(1), 0);
  EXPECT_THAT(said.errors(), IsEmpty());
}

// A node whose answers were late for so long that nobody waits for it any more is in time again, also where requests
// are farther apart than pictures may take.
TEST_F(OverloadTest, ANodeThatStalledIsWaitedForAgain) {
  const std::string path = devices(2);
  const ElementPtr pipeline = launch(
      "lfviewrequest is-live=true framerate=5/1 width=64 height=48 capture-delay=200000000 rig=" + path +
      " ! tee name=r  r. ! queue leaky=downstream ! n.request lfcameranode name=n is-live=true trusted=true rig=" +
      path + " ! c.sink_0  r. ! queue leaky=downstream ! c.request lfcompositor name=c latency=100000000 rig=" + path +
      " ! fakesink sync=false async=false");
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr compositor = child(pipeline.get(), "c"), node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "complete") > 2; }));
  GstPad* answers = gst_element_get_static_pad(node.get(), "src");
  const gulong stall = gst_pad_add_probe(
      answers, GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_OK; }, nullptr, nullptr);
  const uint64_t incomplete = stat(compositor.get(), "incomplete");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "incomplete") > incomplete + 12; }));
  gst_pad_remove_probe(answers, stall);
  gst_object_unref(answers);
  const uint64_t complete = stat(compositor.get(), "complete"), missed = stat(compositor.get(), "incomplete");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "complete") > complete + 2; }));
  EXPECT_LT(stat(compositor.get(), "incomplete") - missed, 10u) << "5 at best; 20 when nobody looked in time";
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST_F(OverloadTest, FilesThatAreNotLiveGiveAllTheirFrames) {
  slowness = 20000;
  const std::string path = rig(2, [](guint) { return "gops.mkv"; });
  const ElementPtr pipeline = launch("lfviewrequest num-buffers=45 framerate=15/1 width=64 height=48 rig=" + path +
                                     " ! lfcameranode name=n rig=" + path + " ! fakesink sync=false");
  ASSERT_TRUE(pipeline);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return said.has_ended(); }));
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_EQ(camera_stats(node.get(), 0).dropped + camera_stats(node.get(), 1).dropped, 0u);
  EXPECT_EQ(stat(node.get(), "missing-frames"), 0u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
