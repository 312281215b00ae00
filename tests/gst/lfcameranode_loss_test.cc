// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Cameras of a node that fail and recover.

#include <gst/video/gstvideodecoder.h>

#include "gst/loss_fixture.h"
#include "gst/rtsp_server.h"
#include "support/process.h"

namespace lf::test {
namespace {

TEST_F(LossTest, MissingFileIsOpenedWhenItAppears) {
  const std::string late = files->path("late.mkv");
  const WatchedPipeline pipeline(line(rig(3, [](guint id) { return id == 1 ? "late.mkv" : "mjpeg.mkv"; })),
                                 GST_STATE_NULL);
  ASSERT_NE(pipeline.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  const ElementPtr compositor = pipeline.child("c0");
  EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 1; }));
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "pictures") > 20; }));
  EXPECT_EQ(pipeline.lost(1), 1) << "one message, many attempts";
  EXPECT_THAT(pipeline.reason(1), AllOf(HasSubstr("camera 1 (cam_1)"), mentions(late, "no such")));
  EXPECT_THAT(pipeline.losses(), ElementsAre(mentions(late, "no such", "out of service")));
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).retries > 1; }));
  EXPECT_EQ(pipeline.camera(1).state, "lost");
  EXPECT_THAT(pipeline.camera(1).reason, HasSubstr("no such file"));
  EXPECT_EQ(pipeline.camera(0).state, "running");

  std::filesystem::copy(files->path("mjpeg.mkv"), late);
  EXPECT_TRUE(eventually([&] { return pipeline.found(1) == 1; }));
  EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 0; }));
  EXPECT_EQ(pipeline.camera(1).state, "running");
  EXPECT_EQ(pipeline.camera(1).losses, 1u);
  pipeline.stop();
  std::filesystem::remove(late);
}

TEST_F(LossTest, HalfOfTheCamerasFailTogether) {
  const WatchedPipeline pipeline(line(devices(4)));
  Pictures pictures(pipeline);
  EXPECT_TRUE(eventually([&] { return pictures.count() > 10; }));
  for (const size_t id : {1, 3}) failing_device(id).broken = true;
  EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 2; }));
  EXPECT_THAT(pipeline.reason(3), mentions("failing://3", "Device 3"));
  for (const int id : {1, 3}) EXPECT_TRUE(eventually([&] { return pipeline.camera(id).retries > 0; }));
  EXPECT_TRUE(pictures.has_more(10));
  EXPECT_THAT(pipeline.camera(1).reason, HasSubstr("Device 1 is busy"));
  // A missing rig file must not matter while a camera is lost.
  const std::string rig_file = files->path("loss.json");
  std::filesystem::rename(rig_file, rig_file + ".gone");
  const uint64_t tried = pipeline.camera(1).retries;
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).retries > tried; }));
  EXPECT_THAT(pipeline.camera(1).reason, mentions("loss.json", "no such"));
  std::filesystem::rename(rig_file + ".gone", rig_file);
  for (const size_t id : {1, 3}) failing_device(id).broken = false;
  EXPECT_TRUE(
      eventually([&] { return pipeline.found(1) == 1 && pipeline.found(3) == 1 && pipeline.out_of_service() == 0; }));
  pipeline.stop();
  EXPECT_EQ(pipeline.losses().size(), 2u);
}

TEST_F(LossTest, EndOfALiveStreamIsALoss) {
  const WatchedPipeline pipeline(line(devices(2)));
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "running"; }));
  failing_device(1).ends = true;
  EXPECT_TRUE(eventually([&] { return pipeline.lost(1) >= 1; }));
  EXPECT_THAT(pipeline.reason(1), HasSubstr("the stream ended"));
  failing_device(1).ends = false;
  EXPECT_TRUE(eventually([&] { return pipeline.found(1) >= 1; }));
  pipeline.stop();
}

TEST_F(LossTest, SilentCameraIsLost) {
  const WatchedPipeline pipeline(line(devices(2)));
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "running"; }));
  failing_device(1).stalls = true;
  EXPECT_TRUE(eventually([&] { return pipeline.lost(1) == 1; }));
  EXPECT_THAT(pipeline.reason(1), mentions("failing://1", "5 s"));
  failing_device(1).stalls = false;
  EXPECT_TRUE(eventually([&] { return pipeline.found(1) == 1; }));
  // PAUSED has no frames, which must not count as a loss.
  pipeline.set_state(GST_STATE_PAUSED);
  g_usleep(7000000);
  pipeline.set_state(GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 0; }));
  pipeline.stop();
  EXPECT_EQ(pipeline.lost(0) + pipeline.lost(1), 1);
}

TEST_F(LossTest, WithoutRetryACameraStaysLost) {
  const WatchedPipeline pipeline(line(devices(2), 1, "is-live=true retry=false"));
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "running"; }));
  failing_device(1).broken = true;
  EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 1; }));
  failing_device(1).broken = false;
  g_usleep(700000);  // longer than the first retry delay
  EXPECT_EQ(failing_device(1).opened, 1);
  EXPECT_THAT(pipeline.losses(), ElementsAre(HasSubstr("out of service")));
  EXPECT_THAT(pipeline.errors(), IsEmpty());
  failing_device(0).broken = true;
  EXPECT_TRUE(eventually([&] { return !pipeline.errors().empty(); })) << "none is left";
  EXPECT_THAT(pipeline.errors()[0], AllOf(HasSubstr("Device 0 is gone"), HasSubstr("Device 1 is gone")));
}

std::vector<uint8_t> picture_at(GstElement* sink) {
  g_autoptr(GstSample) sample = get<GstSample*>(sink, "last-sample");
  return sample ? to_bytes(gst_sample_get_buffer(sample)) : std::vector<uint8_t>{};
}

// Viewers keep the last picture, and one warning names the reason.
TEST_F(LossTest, NodeWaitsIfAllCamerasAreLost) {
  const WatchedPipeline pipeline(line(devices(3)));
  const ElementPtr sink = pipeline.child("s0");
  Pictures pictures(pipeline);
  for (const int id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return pipeline.camera(id).state == "running"; }));
  EXPECT_TRUE(eventually([&] { return pictures.count() > 20 && pipeline.out_of_service() == 0; }));
  const std::vector<uint8_t> before = picture_at(sink.get()), black(before.size(), 0);
  EXPECT_NE(before, std::vector<uint8_t>(before.size(), before[0])) << "partly visible";
  for (const int round : {1, 2}) {
    for (const size_t id : {0, 1, 2}) failing_device(id).broken = true;
    for (const guint id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return pipeline.lost(id) == round; }));
    EXPECT_TRUE(eventually([&] { return pipeline.no_camera_count() == round; }));
    EXPECT_THAT(pipeline.no_camera_reason(), AllOf(HasSubstr("camera 0 (cam_0)"), HasSubstr("Device 2 is")));
    // The cameras fail at different times, so the last picture may come from the last working cameras.
    EXPECT_TRUE(pictures.has_more(5));
    const std::vector<uint8_t> kept = picture_at(sink.get());
    EXPECT_NE(kept, black);
    EXPECT_TRUE(pictures.has_more(10));
    EXPECT_EQ(picture_at(sink.get()), kept);
    EXPECT_TRUE(eventually([&] { return pipeline.camera(0).retries > 0; }));
    for (const size_t id : {0, 1, 2}) failing_device(id).broken = false;
    for (const guint id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return pipeline.found(id) == round; }));
    EXPECT_TRUE(eventually([&] { return pipeline.out_of_service() == 0 && picture_at(sink.get()) == before; }));
    EXPECT_EQ(pipeline.no_camera_count(), round) << "one message, many attempts";
  }
  pipeline.stop();
  const std::vector<std::string> warnings = pipeline.warnings();
  EXPECT_EQ(std::ranges::count_if(warnings, [](const auto& w) { return w.find("any more: ") != w.npos; }), 2);
}

TEST_F(LossTest, NoWorkingCameraIsAnErrorWithAllReasons) {
  for (const size_t id : {0, 1}) failing_device(id).broken = true;
  const std::string none = rig(3, [](guint id) { return id < 2 ? "failing://" + std::to_string(id) : "no.mkv"; });
  const WatchedPipeline pipeline(line(none), GST_STATE_NULL);
  EXPECT_EQ(pipeline.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(pipeline.errors(), ElementsAre(AllOf(HasSubstr("No camera works"), HasSubstr("Device 0 is busy"),
                                                   HasSubstr("Device 1 is busy"), mentions("no.mkv", "no such"))));
}

// A non-live node does not wait for damaged files: each ends early and the rest play on.
TEST_F(LossTest, DamagedFilesDoNotEndThePipeline) {
  const std::string film = read_binary(files->path("mjpeg.mkv"));
  std::ofstream(files->path("cut.mkv"), std::ios::binary) << film.substr(0, film.size() / 2);
  std::string damaged = film;
  std::fill(damaged.begin() + static_cast<long>(film.size() / 2),
            damaged.begin() + static_cast<long>(film.size() * 3 / 4), '\x5a');
  std::ofstream(files->path("damaged.mkv"), std::ios::binary) << damaged;
  std::ofstream(files->path("nothing.mkv"), std::ios::binary) << "\x1a\x45\xdf\xa3 nothing more";
  for (const std::string file : {"cut.mkv", "damaged.mkv", "nothing.mkv", "nowhere.mkv", "png_1.png"}) {
    for (const std::string loop : {"false", "true"}) {
      SCOPED_TRACE(file + " loop=" + loop);
      const std::string path = files->save("loss.json", 3, [&](Camera& camera) {
        camera.source = camera.id == 1 ? file : "mjpeg.mkv";
        if (file == "png_1.png" && camera.id == 1) camera.width = 60;
      });
      const WatchedPipeline pipeline("lfviewrequest num-buffers=12 framerate=15/1 width=64 height=48 rig=" + path +
                                         " ! lfcameranode name=n rig=" + path + " loop=" + loop +
                                         " ! fakesink sync=false",
                                     GST_STATE_NULL);
      const ElementPtr node = pipeline.child("n");
      pipeline.set_state(GST_STATE_PLAYING);
      EXPECT_TRUE(eventually([&] { return pipeline.has_ended(); }));
      EXPECT_THAT(pipeline.errors(), IsEmpty());
      EXPECT_EQ(stat(node.get(), "answers"), 12u);
      EXPECT_EQ(pipeline.camera(1).retries, 0u);
      const bool never_worked = file[0] == 'n' || file[0] == 'p';
      if (never_worked) {
        EXPECT_EQ(pipeline.camera(1).losses, 1u);
        EXPECT_EQ(stat(node.get(), "missing-frames"), 12u) << "frames of the other cameras";
      }
    }
  }
}

// Files of one array loop with a common period. A truncated file has a gap at its end, which is not a failure.
TEST_F(LossTest, GapInALoopIsNotALoss) {
  const std::string whole = files->path("long.mkv"), cut = files->path("long-cut.mkv");
  run_to_end(
      "videotestsrc num-buffers=120 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! jpegenc ! "
      "matroskamux ! filesink location=" +
      whole);
  std::filesystem::copy(whole, cut, std::filesystem::copy_options::overwrite_existing);
  std::filesystem::resize_file(cut, std::filesystem::file_size(whole) / 10);
  const std::string path = files->save(
      "loss.json", 2, [&](Camera& camera) { camera.source = camera.id == 1 ? "long-cut.mkv" : "long.mkv"; });
  const WatchedPipeline pipeline("lfviewrequest is-live=true framerate=15/1 width=64 height=48 rig=" + path +
                                     " ! lfcameranode is-live=true loop=true name=n rig=" + path +
                                     " ! fakesink sync=false",
                                 GST_STATE_NULL);
  pipeline.set_state(GST_STATE_PLAYING);
  g_usleep(8'500'000);  // longer than one loop period; the last 7 s are missing
  EXPECT_EQ(pipeline.camera(1).losses, 0u);
  EXPECT_EQ(pipeline.camera(1).state, "running");
  EXPECT_EQ(pipeline.lost(0) + pipeline.lost(1), 0);
  pipeline.stop();
}

// A non-looping file repeats its last frame, without a warning about old frames.
TEST_F(LossTest, LastFrameOfAFileRepeats) {
  const std::string path = files->save("loss.json", 2, [&](Camera& camera) { camera.source = "mjpeg.mkv"; });
  const WatchedPipeline pipeline("lfviewrequest is-live=true framerate=15/1 width=64 height=48 rig=" + path +
                                     " ! lfcameranode is-live=true name=n rig=" + path +
                                     " ! fakesink name=s0 sync=false",
                                 GST_STATE_NULL);
  Pictures answers(pipeline);
  pipeline.set_state(GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "ended"; }));
  EXPECT_TRUE(eventually([&, then = answers.count()] { return answers.count() > then + 20; }));
  pipeline.stop();
  EXPECT_THAT(pipeline.warnings(), IsEmpty());
}

TEST_F(LossTest, StateChangesAtEveryStageOfALoss) {
  const PipelinePtr pipeline = launch(line(devices(3)));
  for (int i = 0; i < 30; i++) {
    failing_device(1).frames_at_most = 1 + i % 3;
    failing_device(2).broken = i % 4 == 0;
    ASSERT_NE(gst_element_set_state(pipeline.get(), i % 2 ? GST_STATE_PLAYING : GST_STATE_PAUSED),
              GST_STATE_CHANGE_FAILURE);
    g_usleep(static_cast<gulong>(25000 * (i % 5)));
    if (i % 3 == 0) {
      ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_READY), GST_STATE_CHANGE_FAILURE);
      ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
      g_usleep(static_cast<gulong>(30000 * (i % 7)));
    }
    ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_NULL), GST_STATE_CHANGE_FAILURE);
  }
}

// Each run is longer than the retry delay, which therefore stays short.
TEST_F(LossTest, HundredLossesLeakNothing) {
  constexpr guint kFailing = 16;
  for (guint id = 1; id <= kFailing; id++) failing_device(id).frames_at_most = 25;
  const WatchedPipeline pipeline(line(devices(kFailing + 1)));
  const auto returns = [&] {
    int sum = 0;
    for (guint id = 1; id <= kFailing; id++) sum += pipeline.found(id);
    return sum;
  };
  EXPECT_TRUE(eventually([&] { return returns() >= 40; }));
  const long warm = resident_kib(), files_then = count_of("fd");
  EXPECT_TRUE(eventually([&] { return returns() >= 140; }));
  const long grown = resident_kib() - warm;
  const ElementPtr node = pipeline.child("n");
  std::printf("%d returns: resident memory grew by %ld KiB after the first 40, open files from %ld to %ld\n", returns(),
              grown, files_then, count_of("fd"));
  for (guint id = 0; id <= kFailing; id++) {
    const ElementPtr camera = child_of(node.get(), "camera" + std::to_string(id));
    GST_OBJECT_LOCK(camera.get());
    const int children = GST_BIN_NUMCHILDREN(camera.get());
    GST_OBJECT_UNLOCK(camera.get());
    EXPECT_LE(children, 9) << "one chain, or none";
  }
  pipeline.stop();
  EXPECT_LT(count_of("fd") - files_then, 20);
  if (!kKeepsFreedMemory) {
    EXPECT_LT(grown, 8 * 1024);
  }
}

class RtspLossTest : public LossTest {
 protected:
  void SetUp() override {
    if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  }
};

TEST_F(RtspLossTest, ServerStartsAfterItsViewers) {
  for (const std::string node_is : {"", "is-live=true"}) {
    SCOPED_TRACE(node_is);
    auto server = std::make_unique<RtspServer>();
    const int port = server->port();
    const std::string uri = server->uri("/jpeg");
    server.reset();
    const WatchedPipeline pipeline(line(rig(2, [&](guint id) { return id == 1 ? uri : "failing://0"; }), 1,
                                        node_is + " loop=true latency=50000000"));
    EXPECT_TRUE(eventually([&] { return pipeline.lost(1) == 1 && pipeline.out_of_service() == 1; }));
    EXPECT_THAT(pipeline.losses(), ElementsAre(AllOf(HasSubstr(uri), mentions("writing", "out of service"))));
    server = std::make_unique<RtspServer>(port);
    EXPECT_TRUE(eventually([&] { return pipeline.found(1) == 1 && pipeline.out_of_service() == 0; }))
        << pipeline.reason(1);
    pipeline.stop();
  }
}

TEST_F(RtspLossTest, ServerRestartsWithTwoViewers) {
  for (const std::string scheme : {"rtsp", "rtspt"}) {
    SCOPED_TRACE(scheme);
    auto server = std::make_unique<RtspServer>();
    const int port = server->port();
    const std::string uri = scheme + server->uri("/jpeg").substr(4);
    const WatchedPipeline pipeline(line(rig(3, [&](guint id) { return id == 1 ? uri : "mjpeg.mkv"; }), 2,
                                        "is-live=true loop=true latency=50000000"));
    Pictures first(pipeline), second(pipeline, "s1");
    EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "running" && pipeline.out_of_service() == 0; }));
    EXPECT_TRUE(eventually([&] { return first.count() > 10 && second.count() > 10; }));
    first.forget_pause();
    second.forget_pause();
    server.reset();
    EXPECT_TRUE(eventually([&] { return pipeline.lost(1) == 1 && pipeline.out_of_service() == 1; }));
    EXPECT_TRUE(eventually([&] { return pipeline.camera(1).retries > 0; }));
    EXPECT_TRUE(second.has_more(10));
    server = std::make_unique<RtspServer>(port);
    ASSERT_EQ(server->port(), port);
    const gint64 back = g_get_monotonic_time();
    EXPECT_TRUE(eventually([&] { return pipeline.found(1) == 1 && pipeline.out_of_service() == 0; }))
        << pipeline.reason(1);
    std::printf("%s: longest pause of the pictures %d and %d ms; in them again %d ms after its server\n",
                scheme.c_str(), first.longest_pause(), second.longest_pause(),
                static_cast<int>((g_get_monotonic_time() - back) / 1000));
    EXPECT_LT(std::max(first.longest_pause(), second.longest_pause()), 2000);
    pipeline.stop();
    EXPECT_EQ(pipeline.losses().size(), 1u);
  }
}

// additional decoding time per frame, microseconds
std::atomic<gulong> slowness = 0;

void slow_down(GstBin*, GstBin*, GstElement* element, gpointer) {
  if (!GST_IS_VIDEO_DECODER(element)) return;
  on_buffers(element, "sink", [](GstBuffer*) {
    if (slowness > 0) g_usleep(slowness);
  });
}

class OverloadTest : public LossTest {
 protected:
  void SetUp() override {
    if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
    slowness = 0;
    ASSERT_EQ(run("videotestsrc num-buffers=45 ! video/x-raw,width=64,height=48,framerate=15/1 ! " + encoder() +
                  " ! h264parse ! matroskamux ! filesink location=" + files->path("gops.mkv")),
              "");
  }
  void TearDown() override { slowness = 0; }
  static std::string encoder() {
    const ElementPtr x264(gst_element_factory_make("x264enc", nullptr));
    // Every decoder supports this profile. By default, x264 selects the highest profile for its input.
    return x264 ? "x264enc tune=zerolatency key-int-max=15 ! video/x-h264,profile=main" : "openh264enc gop-size=15";
  }
  static uint64_t dropped(GstElement* node) {
    uint64_t sum = 0;
    for (int id = 0; id < 3; id++) sum += camera_stats(node, id).dropped;
    return sum;
  }
};

// Decoding takes 100 ms per 67 ms frame: 1 s late after 3 s and never on time again, if all frames were decoded.
TEST_F(OverloadTest, FramesAreDroppedBeforeDecoding) {
  const WatchedPipeline pipeline(line(rig(3, [](guint) { return "gops.mkv"; }), 1, "is-live=true loop=true"),
                                 GST_STATE_NULL);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  pipeline.set_state(GST_STATE_PLAYING);
  const ElementPtr node = pipeline.child("n");
  for (const int id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return pipeline.camera(id).state == "running"; }));
  slowness = 100000;
  // longer than frames would be on time without dropping
  EXPECT_TRUE(eventually([&] { return dropped(node.get()) > 60; }));
  const uint64_t answers = stat(node.get(), "answers"), fragments = stat(node.get(), "fragments");
  EXPECT_TRUE(eventually([&] { return stat(node.get(), "answers") >= answers + 75; }));
  const double seen = static_cast<double>(stat(node.get(), "fragments") - fragments) /
                      static_cast<double>(stat(node.get(), "answers") - answers);
  std::printf("%.2f of the answers show something\n", seen);
  EXPECT_GT(seen, 0.7);
  EXPECT_THAT(pipeline.warnings(), Contains(mentions("too slow", "decode")));
  EXPECT_THAT(pipeline.warnings(), Each(Not(HasSubstr("clocks of all"))));

  slowness = 0;
  EXPECT_TRUE(eventually([&] {
    const uint64_t before = dropped(node.get());
    g_usleep(1500000);
    return dropped(node.get()) == before && pipeline.out_of_service() == 0;
  }));
  pipeline.stop();
}

// Network latency (200 ms and more) must not count as lateness. This server sends key frames every 8 seconds.
TEST_F(OverloadTest, NetworkCamerasDropFrames) {
  if (kRtspServerMissing) GTEST_SKIP() << kRtspServerMissing;
  const RtspServer server;
  const std::string uri = server.uri("/h264");
  const WatchedPipeline pipeline(line(rig(2, [&](guint id) { return id == 1 ? uri : "mjpeg.mkv"; })), GST_STATE_NULL);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  pipeline.set_state(GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).state == "running"; }));
  g_usleep(1500000);
  EXPECT_EQ(pipeline.camera(1).dropped, 0u) << "a delay is not lateness";
  slowness = 50000;
  EXPECT_TRUE(eventually([&] { return pipeline.camera(1).dropped > 30; }));
  slowness = 0;
  EXPECT_TRUE(eventually([&] {
    const uint64_t before = pipeline.camera(1).dropped;
    g_usleep(1500000);
    return pipeline.camera(1).dropped == before && pipeline.out_of_service() == 0;
  }));
  pipeline.stop();
  EXPECT_EQ(pipeline.lost(1), 0);
}

// A node that was late for so long that the compositor stopped waiting for it recovers, even if requests are farther
// apart than the latency.
TEST_F(OverloadTest, CompositorWaitsAgainForAStalledNode) {
  const std::string path = devices(2);
  const WatchedPipeline pipeline(
      "lfviewrequest is-live=true framerate=5/1 width=64 height=48 capture-delay=200000000 rig=" + path +
      " ! tee name=r  r. ! queue leaky=downstream ! n.request lfcameranode name=n is-live=true trusted=true rig=" +
      path + " ! c.sink_0  r. ! queue leaky=downstream ! c.request lfcompositor name=c latency=100000000 rig=" + path +
      " ! fakesink sync=false async=false");
  const ElementPtr compositor = pipeline.child("c"), node = pipeline.child("n");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "complete") > 2; }));
  const PadPtr answers = pad_of(node.get(), "src");
  const gulong stall = gst_pad_add_probe(
      answers.get(), GST_PAD_PROBE_TYPE_BLOCK_DOWNSTREAM,
      [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_OK; }, nullptr, nullptr);
  const uint64_t incomplete = stat(compositor.get(), "incomplete");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "incomplete") > incomplete + 12; }));
  gst_pad_remove_probe(answers.get(), stall);
  const uint64_t complete = stat(compositor.get(), "complete"), missed = stat(compositor.get(), "incomplete");
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "complete") > complete + 2; }));
  EXPECT_LT(stat(compositor.get(), "incomplete") - missed, 10u) << "5 at best, 20 without a timely check";
}

TEST_F(OverloadTest, NonLiveFilesDeliverAllFrames) {
  slowness = 20000;
  const std::string path = rig(2, [](guint) { return "gops.mkv"; });
  const WatchedPipeline pipeline("lfviewrequest num-buffers=45 framerate=15/1 width=64 height=48 rig=" + path +
                                     " ! lfcameranode name=n rig=" + path + " ! fakesink sync=false",
                                 GST_STATE_NULL);
  g_signal_connect(pipeline.get(), "deep-element-added", G_CALLBACK(slow_down), nullptr);
  pipeline.set_state(GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return pipeline.has_ended(); }));
  const ElementPtr node = pipeline.child("n");
  EXPECT_EQ(pipeline.camera(0).dropped + pipeline.camera(1).dropped, 0u);
  EXPECT_EQ(stat(node.get(), "missing-frames"), 0u);
}

}  // namespace
}  // namespace lf::test
