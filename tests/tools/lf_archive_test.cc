// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/mount.h>

#include "gst/camera_files.h"
#include "recording/camera_file.h"
#include "rig/rig_json.h"
#include "support/recorded.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf::test {
namespace {

namespace fs = std::filesystem;

class LfArchive : public testing::Test {
 protected:
  Outcome run(const std::string& arguments) const { return run_program("lf-archive", arguments, dir_.path()); }
  void film() const {
    test::expect_outcome(run_program("lf-scene", "--out films --grid 1x2 --frames 12 --framerate 15", dir_.path()), 0);
  }
  static double number(const std::string& output, const std::string& text) {
    const size_t at = output.find(text);
    return at == std::string::npos ? -1 : std::strtod(output.c_str() + at + text.size(), nullptr);
  }

  TempDir dir_;
};

TEST_F(LfArchive, PlaysLikeTheRecording) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  film();
  const Outcome outcome = run("films/rig.json --out archive");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_LT(number(outcome.output, "MB -> "), number(outcome.output, "archive: ") / 3) << outcome.output;
  EXPECT_GT(number(outcome.output, "times smaller, "), 38) << outcome.output;
  const Rig before = load_rig(dir_ / "films/rig.json"), after = load_rig(dir_ / "archive/rig.json");
  EXPECT_EQ(after.hash(), before.hash());
  for (size_t i = 0; i < 2; i++) {
    const RecordedFile film = read_recorded(before.resolve(before.cameras[i].source)),
                       archived = read_recorded(after.resolve(after.cameras[i].source));
    EXPECT_EQ(archived.kind, "video/x-h264");
    ASSERT_EQ(archived.times.size(), 12u);
    for (size_t k = 0; k < 12; k++)
      EXPECT_NEAR(static_cast<double>(archived.times[k]), static_cast<double>(film.times[k]), 3e4) << k;
    EXPECT_NEAR(static_cast<double>(archived.end), static_cast<double>(film.end), 4e4);
    EXPECT_TRUE(archived.keys[0]);
  }
  const Outcome better = run("films/rig.json --out better --quantizer 10");
  EXPECT_GT(number(better.output, "times smaller, "), number(outcome.output, "times smaller, ") + 2) << better.output;
  EXPECT_GT(number(better.output, "MB -> "), number(outcome.output, "MB -> "));
}

// A recording like a node's: gaps in the timestamps, a common end, absolute time.
TEST_F(LfArchive, KeepsTimesAndStart) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  film();
  Rig rig = load_rig(dir_ / "films/rig.json");
  const RecordedFile jpegs = read_recorded(rig.resolve(rig.cameras[0].source));
  const CapsPtr jpeg(gst_caps_from_string("image/jpeg,width=320,height=240,framerate=30/1"));
  constexpr GstClockTime kEnd = 9 * GST_SECOND;
  const std::string begins = "2026-01-02T03:04:05.678901Z";
  dir_.write("recording/rig.json", "");
  for (Camera& camera : rig.cameras) {
    camera.source = "camera" + std::to_string(camera.id) + ".mkv";
    CameraFile file(camera, dir_ / "recording/" + camera.source, 1 << 20);
    for (GstClockTime i = 0; i < (camera.id == 0 ? 12 : 8); i++) {
      const BufferPtr frame(to_buffer(jpegs.frames[i]));
      const GstClockTime time = i * 33'333'333 + camera.id * 123'456 + (i > 5 ? 7 * GST_SECOND : 0);
      ASSERT_EQ(file.add(frame.get(), jpeg.get(), time, begins), CameraFile::AddResult::kTaken);
    }
    file.end(kEnd);
    file.close(g_get_monotonic_time() + 10 * G_USEC_PER_SEC);
  }
  save_rig(rig, dir_ / "recording/rig.json");
  test::expect_outcome(run("recording --out archive"), 0);
  const PipelinePtr pipeline = launch("filesrc location=" + dir_ / "archive/camera0.mkv" +
                                      " ! matroskademux name=d d.subtitle_0 ! queue ! appsink name=s sync=false "
                                      "d.video_0 ! fakesink");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const ElementPtr sink = child_of(pipeline.get(), "s");
  g_autoptr(GstSample) text = gst_app_sink_try_pull_sample(GST_APP_SINK(sink.get()), 10 * GST_SECOND);
  ASSERT_TRUE(text);
  const std::vector<uint8_t> bytes = to_bytes(gst_sample_get_buffer(text));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), begins);
  for (const std::string camera : {"0", "1"}) {
    const RecordedFile before = read_recorded(dir_ / "recording/camera" + camera + ".mkv"),
                       after = read_recorded(dir_ / "archive/camera" + camera + ".mkv");
    ASSERT_EQ(after.times.size(), camera == "0" ? 12u : 8u);
    for (size_t k = 0; k < after.times.size(); k++)
      EXPECT_NEAR(static_cast<double>(after.times[k]), static_cast<double>(before.times[k]), 3e4) << k;
    EXPECT_NEAR(static_cast<double>(after.end), static_cast<double>(kEnd), 4e4);
  }
  const Outcome again = run("archive --out again");
  EXPECT_THAT(again.output, HasSubstr("copied unchanged"));
  EXPECT_EQ(read_recorded(dir_ / "again/camera0.mkv").frames, read_recorded(dir_ / "archive/camera0.mkv").frames);
}

TEST_F(LfArchive, UnreadableFramesAreLeftOut) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  film();
  Rig rig = load_rig(dir_ / "films/rig.json");
  rig.cameras.resize(1);
  rig.topology = {};
  const RecordedFile jpegs = read_recorded(rig.resolve(rig.cameras[0].source));
  const CapsPtr jpeg(gst_caps_from_string("image/jpeg,width=320,height=240,framerate=15/1"));
  for (const GstClockTime good : {GstClockTime{9}, GstClockTime{0}}) {
    rig.cameras[0].source = good > 0 ? "some.mkv" : "none.mkv";
    CameraFile file(rig.cameras[0], dir_ / "films/" + rig.cameras[0].source, 1 << 20);
    for (GstClockTime i = 0; i < 12; i++) {
      const BufferPtr frame(to_buffer(i < good ? jpegs.frames[i] : std::vector<uint8_t>(500, 7)));
      ASSERT_EQ(file.add(frame.get(), jpeg.get(), i * 66'666'667, ""), CameraFile::AddResult::kTaken);
    }
    file.end(GST_SECOND);
    file.close(g_get_monotonic_time() + 10 * G_USEC_PER_SEC);
    save_rig(rig, dir_ / "films/damaged.json");
    const Outcome outcome = run("films/damaged.json --out archive");
    if (good > 0) {
      EXPECT_EQ(outcome.status, 0);
      EXPECT_THAT(outcome.output, HasSubstr("9 frames")) << "kept recordings";
      EXPECT_THAT(outcome.output, mentions("3 frames", "decoded"));
      EXPECT_EQ(read_recorded(dir_ / "archive/camera0.mkv").times.size(), 9u);
      fs::remove_all(dir_ / "archive");
    } else {
      EXPECT_EQ(outcome.status, 1) << outcome.output;
      EXPECT_THAT(outcome.output, HasSubstr("films/none.mkv: "));
      EXPECT_FALSE(fs::exists(dir_ / "archive/rig.json"));
    }
  }
}

TEST_F(LfArchive, FullDiskIsAnError) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  film();
  fs::create_directories(dir_ / "disk");
  if (mount("none", (dir_ / "disk").c_str(), "tmpfs", 0, "size=16k") != 0)
    GTEST_SKIP() << "a small disk can't be mounted here";
  test::expect_outcome(run("films/rig.json --out disk/archive"), 1,
                       AllOf(HasSubstr("disk/archive/camera"), HasSubstr("No space left")));
  EXPECT_FALSE(fs::exists(dir_ / "disk/archive/rig.json")) << "incomplete folders are no recordings";
  EXPECT_EQ(umount((dir_ / "disk").c_str()), 0);
}

TEST_F(LfArchive, ErrorsNameTheProblem) {
  film();
  const auto expect_failure = [&](const std::string& arguments, const std::vector<std::string>& facts) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 1) << arguments;
    EXPECT_THAT(outcome.output, mentions(facts));
    EXPECT_FALSE(fs::exists(dir_ / "out/rig.json")) << arguments;
  };
  expect_failure("films/rig.json --out films", {"recording already"});
  Rig rig = load_rig(dir_ / "films/rig.json");
  rig.cameras[1].source = "videotestsrc is-live=true";
  save_rig(rig, dir_ / "films/live.json");
  expect_failure("films/live.json --out out", {"camera 1", "existing file"});
  dir_.write("films/broken.mkv", "no film");
  rig.cameras[1].source = "broken.mkv";
  save_rig(rig, dir_ / "films/broken.json");
  expect_failure("films/broken.json --out out", {"films/broken.mkv"});
  dir_.write("file", "");
  expect_failure("films/rig.json --out file/out", {"can't be made"});
}

}  // namespace
}  // namespace lf::test
