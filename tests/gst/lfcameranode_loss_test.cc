// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Cameras of a node that fail: the others go on, and who can comes back.
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "gst/loss_fixture.h"
#include "gst/rtsp_server.h"
#include "gst/sanitizer.h"

namespace lf::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(LossTest, AMissingFileIsTakenUpWhenItIsThere) {
  const std::string late = files->path("late.mkv");
  const ElementPtr pipeline = launch(line(rig(3, [](guint id) { return id == 1 ? "late.mkv" : "mjpeg.mkv"; })));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  ASSERT_NE(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  const ElementPtr node = child(pipeline.get(), "n"), compositor = child(pipeline.get(), "c0");
  EXPECT_TRUE(eventually([&] { return said.out_of_service() == 1; }));
  EXPECT_TRUE(eventually([&] { return stat(compositor.get(), "pictures") > 20; }));
  EXPECT_EQ(said.lost(1), 1) << "told once, tried often";
  EXPECT_THAT(said.reason(1), AllOf(HasSubstr("camera 1 (cam_1)"), HasSubstr(late + ": no such file")));
  EXPECT_THAT(said.losses(), ElementsAre(HasSubstr(late + ": no such file: out of service until it is back")));
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).retries > 1; }));
  EXPECT_EQ(camera_stats(node.get(), 1).state, "lost");
  EXPECT_THAT(camera_stats(node.get(), 1).reason, HasSubstr("no such file"));
  EXPECT_EQ(camera_stats(node.get(), 0).state, "running");

  std::filesystem::copy(files->path("mjpeg.mkv"), late);
  EXPECT_TRUE(eventually([&] { return said.found(1) == 1; }));
  EXPECT_TRUE(eventually([&] { return said.out_of_service() == 0; }));
  EXPECT_EQ(camera_stats(node.get(), 1).state, "running");
  EXPECT_EQ(camera_stats(node.get(), 1).losses, 1u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  std::filesystem::remove(late);
}

TEST_F(LossTest, HalfOfTheCamerasAtOnceAreHalfOfTheCameras) {
  const ElementPtr pipeline = launch(line(devices(4)));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n"), sink = child(pipeline.get(), "s0");
  Pictures pictures(sink.get());
  EXPECT_TRUE(eventually([&] { return pictures.count() > 10; }));
  for (const size_t id : {1, 3}) failing_device(id).broken = true;
  EXPECT_TRUE(eventually([&] { return said.out_of_service() == 2; }));
  EXPECT_THAT(said.reason(3), HasSubstr("failing://3: Device 3 is gone"));
  for (const int id : {1, 3}) EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), id).retries > 0; }));
  const int before = pictures.count();
  EXPECT_TRUE(eventually([&] { return pictures.count() > before + 10; }));
  EXPECT_THAT(camera_stats(node.get(), 1).reason, HasSubstr("Device 1 is busy"));
  // Not even a rig that is gone while a camera is.
  const std::string rig_file = files->path("loss.json");
  std::filesystem::rename(rig_file, rig_file + ".gone");
  const uint64_t tried = camera_stats(node.get(), 1).retries;
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).retries > tried; }));
  EXPECT_THAT(camera_stats(node.get(), 1).reason, HasSubstr("loss.json: no such file"));
  std::filesystem::rename(rig_file + ".gone", rig_file);
  for (const size_t id : {1, 3}) failing_device(id).broken = false;
  EXPECT_TRUE(eventually([&] { return said.found(1) == 1 && said.found(3) == 1 && said.out_of_service() == 0; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_EQ(said.losses().size(), 2u);
  EXPECT_THAT(said.errors(), IsEmpty());
}

TEST_F(LossTest, ALiveStreamThatEndsIsALoss) {
  const ElementPtr pipeline = launch(line(devices(2)));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).state == "running"; }));
  failing_device(1).ends = true;
  EXPECT_TRUE(eventually([&] { return said.lost(1) >= 1; }));
  EXPECT_THAT(said.reason(1), HasSubstr("its stream ended"));
  failing_device(1).ends = false;
  EXPECT_TRUE(eventually([&] { return said.found(1) >= 1; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
}

TEST_F(LossTest, ACameraThatFallsSilentIsLost) {
  const ElementPtr pipeline = launch(line(devices(2)));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).state == "running"; }));
  failing_device(1).stalls = true;
  EXPECT_TRUE(eventually([&] { return said.lost(1) == 1; }));
  EXPECT_THAT(said.reason(1), HasSubstr("failing://1: no frame for 5 s"));
  failing_device(1).stalls = false;
  EXPECT_TRUE(eventually([&] { return said.found(1) == 1; }));
  // While it is paused there are none, and nobody misses them.
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  g_usleep(7000000);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return said.out_of_service() == 0; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_EQ(said.lost(0) + said.lost(1), 1);
  EXPECT_THAT(said.errors(), IsEmpty());
}

TEST_F(LossTest, WithoutRetryACameraIsLostForGood) {
  const ElementPtr pipeline = launch(line(devices(2), 1, "is-live=true retry=false"));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).state == "running"; }));
  failing_device(1).broken = true;
  EXPECT_TRUE(eventually([&] { return said.out_of_service() == 1; }));
  failing_device(1).broken = false;
  g_usleep(700000);  // longer than the first retry would wait
  EXPECT_EQ(failing_device(1).opened, 1);
  EXPECT_THAT(said.losses(), ElementsAre(HasSubstr("out of service from now on")));
  EXPECT_THAT(said.errors(), IsEmpty());
  failing_device(0).broken = true;
  EXPECT_TRUE(eventually([&] { return !said.errors().empty(); })) << "none is left";
  EXPECT_THAT(said.errors()[0], AllOf(HasSubstr("Device 0 is gone"), HasSubstr("Device 1 is gone")));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

// The latest picture at a fakesink.
std::vector<uint8_t> picture_at(GstElement* sink) {
  GstSample* sample = nullptr;
  g_object_get(sink, "last-sample", &sample, nullptr);
  if (!sample) return {};
  GstMapInfo map;
  gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ);
  std::vector<uint8_t> bytes(map.data, map.data + map.size);
  gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
  gst_sample_unref(sample);
  return bytes;
}

// Viewers keep the picture that they have, and it is said once what they wait for.
TEST_F(LossTest, AllThatHaveWorkedAreWaitedFor) {
  const ElementPtr pipeline = launch(line(devices(3)));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n"), sink = child(pipeline.get(), "s0");
  Pictures pictures(sink.get());
  for (const int id : {0, 1, 2})
    EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), id).state == "running"; }));
  EXPECT_TRUE(eventually([&] { return pictures.count() > 20 && said.out_of_service() == 0; }));
  const std::vector<uint8_t> before = picture_at(sink.get()), black(before.size(), 0);
  EXPECT_NE(before, std::vector<uint8_t>(before.size(), before[0])) << "something is seen, and something is not";
  for (const int round : {1, 2}) {
    for (const size_t id : {0, 1, 2}) failing_device(id).broken = true;
    for (const guint id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return said.lost(id) == round; }));
    EXPECT_TRUE(eventually([&] { return said.none_works() == round; }));
    EXPECT_THAT(said.none_works_because(), AllOf(HasSubstr("camera 0 (cam_0)"), HasSubstr("Device 2 is")));
    // They are not lost in one instant: the picture that stays may be of those that worked to the last.
    const auto pictures_later = [&](int more) {
      return eventually([&, then = pictures.count()] { return pictures.count() > then + more; });
    };
    EXPECT_TRUE(pictures_later(5));
    const std::vector<uint8_t> kept = picture_at(sink.get());
    EXPECT_NE(kept, black);
    EXPECT_TRUE(pictures_later(10));
    EXPECT_EQ(picture_at(sink.get()), kept);
    EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 0).retries > 0; }));
    for (const size_t id : {0, 1, 2}) failing_device(id).broken = false;
    for (const guint id : {0, 1, 2}) EXPECT_TRUE(eventually([&] { return said.found(id) == round; }));
    EXPECT_TRUE(eventually([&] { return said.out_of_service() == 0 && picture_at(sink.get()) == before; }));
    EXPECT_EQ(said.none_works(), round) << "told once, tried often";
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  const std::vector<std::string> warnings = said.warnings();
  EXPECT_EQ(std::ranges::count_if(warnings, [](const auto& w) { return w.starts_with("No camera works any more: "); }),
            2);
}

TEST_F(LossTest, NoneThatWorksIsAnErrorWithAllReasons) {
  for (const size_t id : {0, 1}) failing_device(id).broken = true;
  const std::string none = rig(3, [](guint id) { return id < 2 ? "failing://" + std::to_string(id) : "no.mkv"; });
  const ElementPtr pipeline = launch(line(none));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(said.errors(), ElementsAre(AllOf(HasSubstr("No camera works"), HasSubstr("Device 0 is busy"),
                                               HasSubstr("Device 1 is busy"), HasSubstr("no.mkv: no such file"))));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

// Of files that are not live nothing is waited for: what is damaged ends where it does, and the others give the rest.
TEST_F(LossTest, DamagedFilesEndNothing) {
  std::ifstream in(files->path("mjpeg.mkv"), std::ios::binary);
  const std::string film((std::istreambuf_iterator<char>(in)), {});
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
        if (file == "png_1.png" && camera.id == 1) camera.width = 60;  // the picture is of another size
      });
      const ElementPtr pipeline =
          launch("lfviewrequest num-buffers=12 framerate=15/1 width=64 height=48 rig=" + path +
                 " ! lfcameranode name=n rig=" + path + " loop=" + loop + " ! fakesink sync=false");
      ASSERT_TRUE(pipeline);
      const Said said(pipeline.get());
      const ElementPtr node = child(pipeline.get(), "n");
      gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
      EXPECT_TRUE(eventually([&] { return said.has_ended(); }));
      EXPECT_THAT(said.errors(), IsEmpty());
      EXPECT_EQ(stat(node.get(), "answers"), 12u);
      EXPECT_EQ(camera_stats(node.get(), 1).retries, 0u);
      const bool never_worked = file[0] == 'n' || file[0] == 'p';
      if (never_worked) {
        EXPECT_EQ(camera_stats(node.get(), 1).losses, 1u);
        EXPECT_EQ(stat(node.get(), "missing-frames"), 12u) << "the others' are there";
      }
      gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    }
  }
}

// Films of one array keep their round: one that is cut off has nothing for the rest of it, and is no camera that fails.
TEST_F(LossTest, AFilmThatPausesIsNotLost) {
  const std::string whole = files->path("long.mkv"), cut = files->path("long-cut.mkv");
  run_to_end(
      "videotestsrc num-buffers=120 ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! jpegenc ! "
      "matroskamux ! filesink location=" +
      whole);
  std::filesystem::copy(whole, cut, std::filesystem::copy_options::overwrite_existing);
  std::filesystem::resize_file(cut, std::filesystem::file_size(whole) / 10);
  const std::string path = files->save(
      "loss.json", 2, [&](Camera& camera) { camera.source = camera.id == 1 ? "long-cut.mkv" : "long.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest is-live=true framerate=15/1 width=64 height=48 rig=" + path +
             " ! lfcameranode is-live=true loop=true name=n rig=" + path + " ! fakesink sync=false");
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  const ElementPtr node = child(pipeline.get(), "n");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  g_usleep(8'500'000);  // longer than its round, of which 7 s are missing
  EXPECT_EQ(camera_stats(node.get(), 1).losses, 0u);
  EXPECT_EQ(camera_stats(node.get(), 1).state, "running");
  EXPECT_EQ(said.lost(0) + said.lost(1), 0);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
}

// The last frame stands for all times behind it: it is not too old, and nobody is told to look after the camera.
TEST_F(LossTest, AFilmThatEndsStands) {
  const std::string path = files->save("loss.json", 2, [&](Camera& camera) { camera.source = "mjpeg.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest is-live=true framerate=15/1 width=64 height=48 rig=" + path +
             " ! lfcameranode is-live=true name=n rig=" + path + " ! fakesink name=s0 sync=false");
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  const ElementPtr node = child(pipeline.get(), "n"), sink = child(pipeline.get(), "s0");
  Pictures answers(sink.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).state == "ended"; }));
  EXPECT_TRUE(eventually([&, then = answers.count()] { return answers.count() > then + 20; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  EXPECT_THAT(said.warnings(), IsEmpty());
}

TEST_F(LossTest, StatesChangeAtEveryStageOfALoss) {
  const ElementPtr pipeline = launch(line(devices(3)));
  ASSERT_TRUE(pipeline);
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

long resident_kib() {
  std::ifstream statm("/proc/self/statm");
  long size = 0, resident = 0;
  statm >> size >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}
long open_files() { return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}); }

// They run for longer than they are waited for, so that the waits stay short.
TEST_F(LossTest, AHundredLossesAndReturnsLeaveNothing) {
  constexpr guint kFailing = 16;
  for (guint id = 1; id <= kFailing; id++) failing_device(id).frames_at_most = 25;
  const ElementPtr pipeline = launch(line(devices(kFailing + 1)));
  ASSERT_TRUE(pipeline);
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const auto returns = [&] {
    int sum = 0;
    for (guint id = 1; id <= kFailing; id++) sum += said.found(id);
    return sum;
  };
  EXPECT_TRUE(eventually([&] { return returns() >= 40; }));
  const long warm = resident_kib(), files_then = open_files();
  EXPECT_TRUE(eventually([&] { return returns() >= 140; }));
  const long grown = resident_kib() - warm;
  const ElementPtr node = child(pipeline.get(), "n");
  std::printf("%d returns: resident memory grew by %ld KiB after the first 40, open files from %ld to %ld\n", returns(),
              grown, files_then, open_files());
  for (guint id = 0; id <= kFailing; id++) {
    const ElementPtr camera = child(node.get(), "camera" + std::to_string(id));
    GST_OBJECT_LOCK(camera.get());
    const int children = GST_BIN_NUMCHILDREN(camera.get());
    GST_OBJECT_UNLOCK(camera.get());
    EXPECT_LE(children, 9) << "one chain, or none";
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  EXPECT_LT(open_files() - files_then, 20);
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

TEST_F(RtspLossTest, AServerIsStartedAfterItsViewers) {
  for (const std::string node_is : {"", "is-live=true"}) {
    SCOPED_TRACE(node_is);
    auto server = std::make_unique<RtspServer>();
    const int port = server->port();
    const std::string uri = server->uri("/jpeg");
    server.reset();
    const ElementPtr pipeline = launch(line(rig(2, [&](guint id) { return id == 1 ? uri : "failing://0"; }), 1,
                                            node_is + " loop=true latency=50000000"));
    ASSERT_TRUE(pipeline);
    const Said said(pipeline.get());
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    EXPECT_TRUE(eventually([&] { return said.lost(1) == 1 && said.out_of_service() == 1; }));
    EXPECT_THAT(said.losses(),
                ElementsAre(AllOf(HasSubstr(uri), HasSubstr("writing: out of service until it is back"))));
    server = std::make_unique<RtspServer>(port);
    EXPECT_TRUE(eventually([&] { return said.found(1) == 1 && said.out_of_service() == 0; })) << said.reason(1);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    EXPECT_THAT(said.errors(), IsEmpty());
  }
}

TEST_F(RtspLossTest, AServerStopsAndStartsAgainWhileTwoViewersWatch) {
  for (const std::string scheme : {"rtsp", "rtspt"}) {
    SCOPED_TRACE(scheme);
    auto server = std::make_unique<RtspServer>();
    const int port = server->port();
    const std::string uri = scheme + server->uri("/jpeg").substr(4);
    const ElementPtr pipeline = launch(line(rig(3, [&](guint id) { return id == 1 ? uri : "mjpeg.mkv"; }), 2,
                                            "is-live=true loop=true latency=50000000"));
    ASSERT_TRUE(pipeline);
    const Said said(pipeline.get());
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    const ElementPtr node = child(pipeline.get(), "n"), s0 = child(pipeline.get(), "s0"),
                     s1 = child(pipeline.get(), "s1");
    Pictures first(s0.get()), second(s1.get());
    EXPECT_TRUE(
        eventually([&] { return camera_stats(node.get(), 1).state == "running" && said.out_of_service() == 0; }));
    EXPECT_TRUE(eventually([&] { return first.count() > 10 && second.count() > 10; }));
    first.forget_pause();
    second.forget_pause();
    server.reset();
    EXPECT_TRUE(eventually([&] { return said.lost(1) == 1 && said.out_of_service() == 1; }));
    EXPECT_TRUE(eventually([&] { return camera_stats(node.get(), 1).retries > 0; }));
    const int before = second.count();
    EXPECT_TRUE(eventually([&] { return second.count() > before + 10; }));
    server = std::make_unique<RtspServer>(port);
    ASSERT_EQ(server->port(), port);
    const gint64 back = g_get_monotonic_time();
    EXPECT_TRUE(eventually([&] { return said.found(1) == 1 && said.out_of_service() == 0; })) << said.reason(1);
    std::printf("%s: longest pause of the pictures %d and %d ms; in them again %d ms after its server\n",
                scheme.c_str(), first.longest_pause(), second.longest_pause(),
                static_cast<int>((g_get_monotonic_time() - back) / 1000));
    EXPECT_LT(std::max(first.longest_pause(), second.longest_pause()), 2000);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    EXPECT_EQ(said.losses().size(), 1u);
    EXPECT_THAT(said.errors(), IsEmpty());
  }
}

}  // namespace
}  // namespace lf::test
