// SPDX-License-Identifier: LGPL-2.1-or-later
//
// lfcameranode record=...: what is on disk, whatever happens to cameras and to the disk.
#include <gmock/gmock.h>
#include <sys/mount.h>

#include <filesystem>

#include "gst/loss_fixture.h"
#include "rig/rig_json.h"
#include "support/recorded.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class LfCameraNodeRecordingTest : public LossTest {
 protected:
  std::string folder() const { return dir_ / "recording"; }
  std::string file(int camera) const { return folder() + "/camera" + std::to_string(camera) + ".mkv"; }
  std::string line_of(const std::string& rig, const std::string& more = "") const {
    return line(rig, 1, "is-live=true loop=true record=" + folder() + " " + more);
  }
  // Of one of the cameras in the node's stats.
  static uint64_t count(GstElement* node, int id, const char* field) {
    GstStructure* stats = nullptr;
    g_object_get(node, "stats", &stats, nullptr);
    const StructurePtr owner(stats);
    const auto inner = [](const GstStructure* outer, const std::string& name) {
      return gst_value_get_structure(gst_structure_get_value(outer, name.c_str()));
    };
    guint64 value = 0;
    EXPECT_TRUE(
        gst_structure_get_uint64(inner(inner(stats, "cameras"), "camera-" + std::to_string(id)), field, &value));
    return value;
  }
  static uint64_t recorded(GstElement* node, int id) { return count(node, id, "recorded"); }

  TempDir dir_;
};

TEST_F(LfCameraNodeRecordingTest, WhatCamerasGiveIsInTheirFiles) {
  const ElementPtr pipeline = launch(line_of(rig(3, [](guint) { return "mjpeg.mkv"; }), "cameras=0,2"));
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 2) > 20; }));
  EXPECT_EQ(count(node.get(), 0, "unrecorded"), 0u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  for (const int camera : {0, 2}) {
    const RecordedFile film = read_recorded(file(camera));
    EXPECT_GT(film.times.size(), 20u);
    EXPECT_LT(film.times.front(), GST_SECOND);
    EXPECT_TRUE(std::ranges::is_sorted(film.times));
  }
  EXPECT_FALSE(std::filesystem::exists(file(1))) << "another node's";
  EXPECT_EQ(load_rig(folder() + "/rig.json").cameras[1].source, "camera1.mkv");
  EXPECT_THAT(said.errors(), IsEmpty());
}

// A film that is live, over and over: each round from its key frame on, as it is in the film.
TEST_F(LfCameraNodeRecordingTest, CodedPicturesStayAsTheyCame) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  const auto film = slices_of(read_recorded(files->path("h264.mkv")));
  ASSERT_EQ(film.size(), size_t{CameraFiles::kFrames});
  const ElementPtr pipeline = launch(line_of(rig(2, [](guint id) { return id ? "h264.mp4" : "h264.mkv"; })));
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 1) > 20; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  std::vector<double> ends;
  for (const int camera : {0, 1}) {
    const RecordedFile recording = read_recorded(file(camera));
    EXPECT_EQ(recording.kind, "video/x-h264");
    ends.push_back(static_cast<double>(recording.end));
    EXPECT_GT(recording.end, recording.times.back());
    const auto slices = slices_of(recording);
    ASSERT_GT(slices.size(), 20u);
    for (size_t i = 0; i < slices.size(); i++) EXPECT_EQ(slices[i], film[i % film.size()]) << camera << " " << i;
    for (size_t i = 0; i + 1 < slices.size(); i++) EXPECT_EQ(recording.keys[i], i % film.size() == 0) << i;
    for (size_t i = 1; i < slices.size(); i++)
      EXPECT_NEAR(static_cast<double>(recording.times[i] - recording.times[i - 1]) / GST_SECOND, 1.0 / 15, 2e-3) << i;
  }
  EXPECT_NEAR(ends[0], ends[1], 4e4) << "all begin again together in a loop";
}

TEST_F(LfCameraNodeRecordingTest, AnotherRecordingIsNotWrittenOver) {
  const std::string line = line_of(devices(2));
  for (const bool first : {true, false}) {
    const ElementPtr pipeline = launch(line);
    const Said said(pipeline.get());
    EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE, !first);
    const ElementPtr node = child(pipeline.get(), "n");
    if (first)
      EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 5; }));
    else
      EXPECT_THAT(said.errors(), testing::ElementsAre(HasSubstr(folder() + ": there is a recording in it already")));
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    EXPECT_GT(read_recorded(file(0)).times.size(), 4u);
  }
}

// What a kill would leave is what the file has without its end: in PAUSED, nothing more comes.
TEST_F(LfCameraNodeRecordingTest, AllButTheNewestFrameIsOnDiskMeanwhile) {
  const ElementPtr pipeline = launch(line_of(rig(2, [](guint) { return "mjpeg.mkv"; })));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 20 && recorded(node.get(), 1) > 20; }));
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  g_usleep(200000);  // a frame may have been on its way
  for (const int camera : {0, 1}) {
    const uint64_t frames = recorded(node.get(), camera);
    EXPECT_TRUE(eventually([&] {
      std::filesystem::copy_file(file(camera), dir_ / "copy.mkv", std::filesystem::copy_options::overwrite_existing);
      return read_recorded(dir_ / "copy.mkv").times.size() >= frames - 1;
    })) << frames;
  }
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST_F(LfCameraNodeRecordingTest, ACameraThatComesBackGoesOnInItsFile) {
  const ElementPtr pipeline = launch(line_of(devices(2)));
  const Said said(pipeline.get());
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "n");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 1) > 10; }));
  failing_device(1).broken = true;
  EXPECT_TRUE(eventually([&] { return said.lost(1) == 1; }));
  g_usleep(1000000);
  const uint64_t before = recorded(node.get(), 1), other = recorded(node.get(), 0);
  failing_device(1).broken = false;
  EXPECT_TRUE(eventually([&] { return said.found(1) == 1 && recorded(node.get(), 1) > before + 10; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_THAT(said.errors(), IsEmpty());
  const std::vector<GstClockTime> times = read_recorded(file(1)).times;
  ASSERT_GT(times.size(), before);
  EXPECT_GT(times[before] - times[before - 1], GST_SECOND) << "no frames while there was no camera";
  const std::vector<GstClockTime> meanwhile = read_recorded(file(0)).times;
  ASSERT_GT(meanwhile.size(), other);
  EXPECT_LT(meanwhile[other - 1], times[before]) << "the cameras stay in step";
}

TEST_F(LfCameraNodeRecordingTest, AFullDiskEndsTheRecordingAndNothingElse) {
  std::filesystem::create_directories(dir_ / "disk");
  if (mount("none", (dir_ / "disk").c_str(), "tmpfs", 0, "size=64k") != 0)
    GTEST_SKIP() << "a small disk can't be mounted here";
  {
    const ElementPtr pipeline = launch(line(devices(2), 1, "is-live=true record=" + dir_ / "disk/r"));
    const Said said(pipeline.get());
    const ElementPtr bus_owner = child(pipeline.get(), "n"), sink = child(pipeline.get(), "s0");
    Pictures pictures(sink.get());
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    const auto has_stopped = [&] {
      const std::vector<std::string> warnings = said.warnings();
      return std::ranges::count_if(warnings, [&](const std::string& text) {
        return text.find(dir_ / "disk/r" + ": recording has stopped: ") != std::string::npos &&
               text.find("No space left") != std::string::npos;
      });
    };
    EXPECT_TRUE(eventually([&] { return has_stopped() == 1; }));
    const int then = pictures.count();
    EXPECT_TRUE(eventually([&] { return pictures.count() > then + 10; }));
    EXPECT_EQ(has_stopped(), 1) << "told once";
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    EXPECT_THAT(said.errors(), IsEmpty());
    EXPECT_GT(read_recorded(dir_ / "disk/r/camera0.mkv").times.size(), 10u);
  }
  EXPECT_EQ(umount((dir_ / "disk").c_str()), 0);
}

// A film that is not live is recorded as fast as it is asked for, with the times that it has.
TEST_F(LfCameraNodeRecordingTest, AFilmIsRecordedAsItIs) {
  const std::string film = rig(2, [](guint) { return "mjpeg.mkv"; });
  const ElementPtr pipeline =
      launch("lfviewrequest rig=" + film +
             " framerate=15/1 num-buffers=6 width=64 height=48 ! tee name=r  r. ! queue ! "
             "n.request lfcameranode name=n rig=" +
             film + " record=" + folder() + " ! c.sink_0  r. ! queue ! c.request lfcompositor name=c ! fakesink");
  EXPECT_EQ(run(pipeline.get()), "");
  const std::vector<GstClockTime> times = read_recorded(file(0)).times;
  ASSERT_GE(times.size(), 6u);
  EXPECT_EQ(times[0], 0u);
  EXPECT_NEAR(static_cast<double>(times[5]), 5.0 * GST_SECOND / 15, 1e6);
}

// The bins around a node have its property.
TEST_F(LfCameraNodeRecordingTest, AViewSourceRecordsItsCameras) {
  const std::string source = "lfviewsrc name=v trusted=true rig=" + devices(2) + " width=64 height=48 record=" + folder();
  const ElementPtr pipeline = launch(source + " ! fakesink sync=false");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr node = child(pipeline.get(), "node");
  EXPECT_TRUE(eventually([&] { return recorded(node.get(), 0) > 5 && recorded(node.get(), 1) > 5; }));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_GT(read_recorded(file(1)).times.size(), 4u);

  const ElementPtr elsewhere = launch(source + "2 nodes=127.0.0.1:27433:27434 ! fakesink");
  const Said said(elsewhere.get());
  EXPECT_EQ(gst_element_set_state(elsewhere.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_THAT(said.errors(), testing::ElementsAre(HasSubstr("record: the cameras are on other hosts")));
  gst_element_set_state(elsewhere.get(), GST_STATE_NULL);
}

}  // namespace
}  // namespace lf::test
