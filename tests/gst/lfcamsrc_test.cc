// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "../gst/common.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

class CamSrcTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { files = new CameraFiles; }
  static void TearDownTestSuite() {
    delete files;
    files = nullptr;
  }
  // A rig of one camera.
  static std::string rig_with(const std::function<void(Camera&)>& edit) { return files->save("rig.json", 1, edit); }
  static std::string rig_with_source(const std::string& source) {
    return rig_with([&](Camera& camera) { camera.source = source; });
  }
  static CameraFiles* files;
};
CameraFiles* CamSrcTest::files = nullptr;

enum class Moves { kYes, kNo, kScene };
struct SourceCase {
  const char* name;
  const char* source;  // "URI:" stands for the folder's URI
  const char* image;
  GstVideoFormat format;
  Moves moves;
};
void PrintTo(const SourceCase& c, std::ostream* out) { *out << c.name; }

const SourceCase kSources[] = {
    {"mjpeg_in_matroska", "mjpeg.mkv", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"raw_in_matroska", "raw.mkv", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"matroska_uri", "URI:mjpeg.mkv", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"other_file", "mjpeg.avi", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"h264_in_mp4", "h264.mp4", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"h264_in_matroska", "h264.mkv", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"jpeg_sequence", "jpeg_%02d.jpg", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"png_sequence_from_1", "png_%d.png", "", GST_VIDEO_FORMAT_RGB, Moves::kYes},
    {"source_before_image", "mjpeg.mkv", "png_1.png", GST_VIDEO_FORMAT_I420, Moves::kYes},
    {"png_still", "", "png_1.png", GST_VIDEO_FORMAT_RGB, Moves::kNo},
    {"jpeg_still", "", "jpeg_00.jpg", GST_VIDEO_FORMAT_I420, Moves::kNo},
    {"still_as_source", "png_1.png", "", GST_VIDEO_FORMAT_RGB, Moves::kNo},
    {"scene", "", "", GST_VIDEO_FORMAT_RGB, Moves::kScene},
};

class CamSrcSourceTest : public CamSrcTest, public ::testing::WithParamInterface<SourceCase> {
 protected:
  static bool is_h264() { return std::string(GetParam().source).starts_with("h264"); }
  void SetUp() override {
    if (is_h264() && CameraFiles::h264_encoder().empty())
      GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  }
  static std::string rig() {
    return rig_with([](Camera& camera) {
      const std::string source = GetParam().source;
      camera.source = source.starts_with("URI:") ? files->uri(source.substr(4)) : source;
      camera.image = GetParam().image;
    });
  }
};
INSTANTIATE_TEST_SUITE_P(Kinds, CamSrcSourceTest, ::testing::ValuesIn(kSources),
                         [](const auto& param) { return param.param.name; });

TEST_P(CamSrcSourceTest, GivesAllFramesWithTrueCapsEventAndMeta) {
  const std::string path = rig();
  CameraPipeline camera("rig=" + path + " num-frames=" + std::to_string(kFrames));
  ASSERT_EQ(camera.play(), "EOS");

  EXPECT_EQ(GST_VIDEO_INFO_FORMAT(&camera.info), GetParam().format);
  EXPECT_EQ(camera.info.width, CameraFiles::kWidth);
  EXPECT_EQ(camera.info.height, CameraFiles::kHeight);
  EXPECT_EQ(camera.info.fps_n, CameraFiles::kRate * camera.info.fps_d);
  if (GetParam().format == GST_VIDEO_FORMAT_I420 && !is_h264()) {
    EXPECT_EQ(camera.info.colorimetry.range, GST_VIDEO_COLOR_RANGE_0_255) << "as JPEG has it";
  }
  ASSERT_EQ(camera.frames.size(), static_cast<size_t>(kFrames));
  for (int k = 0; k < kFrames; ++k) {
    const Frame& frame = camera.frames[k];
    EXPECT_NEAR(frame.running_time, k * kPeriod, GST_MSECOND) << k;
    EXPECT_EQ(frame.capture_time, frame.running_time) << k;
    const int shown = GetParam().moves == Moves::kYes ? k : 0;
    if (GetParam().moves != Moves::kScene) {
      EXPECT_NEAR(frame.level, CameraFiles::grey_of(shown), 2) << k;
    }
  }

  EXPECT_EQ(camera.camera_index, 0u);
  EXPECT_EQ(camera.rig_hash, load_rig(path).hash());
  const auto place = [&](const char* name) {
    return std::find(camera.items.begin(), camera.items.end(), name) - camera.items.begin();
  };
  EXPECT_LT(place("caps"), place("segment"));
  EXPECT_LT(place("segment"), place(LF_CAMERA_EVENT));
  EXPECT_EQ(place(LF_CAMERA_EVENT) + 1, place("buffer")) << "sent once, just before the first frame";
}

TEST_P(CamSrcSourceTest, GoesThroughAllStateChanges) {
  CameraPipeline camera("rig=" + rig() + " loop=true");
  // Every change there is, those over several states included.
  for (const GstState state :
       {GST_STATE_READY, GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PAUSED,
        GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL,
        GST_STATE_PAUSED, GST_STATE_NULL, GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_NULL})
    ASSERT_TRUE(camera.reach(state)) << gst_element_state_get_name(state) << ": " << camera.wait(0);
  EXPECT_EQ(GST_BIN_NUMCHILDREN(camera.camera()), 0) << "children live from READY to NULL";
  EXPECT_EQ(camera.wait(0), "timeout") << "no message";
}

TEST_P(CamSrcSourceTest, StartsAndStopsManyTimes) {
  CameraPipeline camera("rig=" + rig() + " num-frames=2");
  for (int i = 0; i < 50; ++i) {
    camera.frames.clear();
    ASSERT_EQ(camera.play(), "EOS") << i;
    ASSERT_EQ(camera.frames.size(), 2u) << i;
  }
  EXPECT_EQ(GST_OBJECT_REFCOUNT_VALUE(camera.camera()), 2) << "the pipeline's and ours";
}

TEST_P(CamSrcSourceTest, LoopsWithRunningTimeGoingOn) {
  constexpr int kWanted = 2 * kFrames + 3;
  CameraPipeline camera("rig=" + rig() + " loop=true num-frames=" + std::to_string(kWanted));
  ASSERT_EQ(camera.play(), "EOS");
  ASSERT_EQ(camera.frames.size(), static_cast<size_t>(kWanted));
  for (int k = 0; k < kWanted; ++k) {
    const Frame& frame = camera.frames[k];
    EXPECT_NEAR(frame.running_time, k * kPeriod, 2 * GST_MSECOND) << k;
    EXPECT_EQ(frame.capture_time, frame.running_time) << k;
    if (k > 0) {
      EXPECT_GT(frame.running_time, camera.frames[k - 1].running_time) << k;
    }
    if (GetParam().moves == Moves::kYes) {
      EXPECT_NEAR(frame.level, CameraFiles::grey_of(k % kFrames), 2) << k;
    }
  }
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), "flush-start"), 0) << "the stream just goes on";
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), "eos"), 1);
}

TEST_P(CamSrcSourceTest, EndsAtAnEosEvent) {
  CameraPipeline camera("rig=" + rig() + " loop=true");
  ASSERT_TRUE(camera.reach(GST_STATE_PLAYING));
  EXPECT_TRUE(gst_element_send_event(camera.pipeline(), gst_event_new_eos()));
  EXPECT_EQ(camera.wait(), "EOS");
}

TEST_P(CamSrcSourceTest, LiveFramesComeAtTheirTime) {
  constexpr int kRate = 40, kWanted = 11;
  CameraPipeline camera("rig=" + rig() + " is-live=true loop=true framerate=40/1 num-frames=11");
  ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(camera.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_ASYNC);
  ASSERT_EQ(gst_element_get_state(camera.pipeline(), nullptr, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);

  GstQuery* query = gst_query_new_latency();
  ASSERT_TRUE(gst_pad_peer_query(camera.pad(), query));
  gboolean live = FALSE;
  GstClockTime latency = 0;
  gst_query_parse_latency(query, &live, &latency, nullptr);
  gst_query_unref(query);
  EXPECT_TRUE(live);
  EXPECT_GE(latency, GST_SECOND / kRate);
  EXPECT_LT(latency, 3 * GST_SECOND / kRate);

  ASSERT_EQ(camera.wait(), "EOS");
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_GT(seconds, 0.8 * (kWanted - 1) / kRate);
  EXPECT_LT(seconds, 5);
  const GstClockTime base_time = gst_element_get_base_time(camera.pipeline());
  camera.set_state(GST_STATE_NULL);
  ASSERT_EQ(camera.frames.size(), static_cast<size_t>(kWanted));
  for (const Frame& frame : camera.frames)
    EXPECT_NEAR(frame.capture_time, base_time + frame.running_time, kPeriod + GST_MSECOND)
        << "clock time, of the frame that is shown";
}

// uridecodebin goes to PAUSED by and by, the camera at once: the pipeline must not wait for the one after the other.
TEST_F(CamSrcTest, DecodersDoNotKeepALivePipelineWaiting) {
  const std::string camera = "lfcamsrc is-live=true loop=true rig=" + rig_with_source("mjpeg.avi") + " ! queue ! ";
  const ElementPtr pipeline = launch("funnel name=all ! fakesink name=sink  " + camera + "all.  " + camera + "all.  " +
                                     camera + "all.  " + camera + "all.");
  ASSERT_TRUE(pipeline);
  for (int i = 0; i < 60; ++i) {
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    GstState state = GST_STATE_NULL;
    ASSERT_EQ(gst_element_get_state(pipeline.get(), &state, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_SUCCESS) << i;
    ASSERT_EQ(state, GST_STATE_PLAYING) << i;
    const ElementPtr sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
    ASSERT_EQ(GST_STATE(sink.get()), GST_STATE_PLAYING) << i;
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
}

TEST_F(CamSrcTest, CaptureTimeCountsTheTimeOffset) {
  struct Case {
    double offset;
    GstClockTimeDiff first, second;
  };
  for (const Case& c : {Case{0.25, 250, 316}, Case{-0.01, 0, 56}}) {  // no time is before 0
    const std::string rig = rig_with([&](Camera& camera) {
      camera.image = "png_1.png";
      camera.time_offset = c.offset;
    });
    CameraPipeline camera("rig=" + rig + " num-frames=2");
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.frames[0].running_time, 0u);
    EXPECT_EQ(camera.frames[0].capture_time / GST_MSECOND, static_cast<GstClockTime>(c.first));
    EXPECT_EQ(camera.frames[1].capture_time / GST_MSECOND, static_cast<GstClockTime>(c.second));
  }
}

TEST_F(CamSrcTest, SceneIsFilmedAtTheCaptureTime) {
  const std::string path = rig_with([](Camera& camera) { camera.time_offset = 0.5; });
  CameraPipeline camera("rig=" + path + " num-frames=2 framerate=4/1");
  ASSERT_EQ(camera.play(), "EOS");
  const Camera model = load_rig(path).cameras[0];
  for (int k = 0; k < 2; ++k) {
    const Image truth =
        render_scene({model.width, model.height, model.lens, model.pose}, static_cast<double>(k) / 4 + 0.5);
    const std::vector<uint8_t> row(truth.pixel(0, 0), truth.pixel(0, 0) + truth.width() * 3);
    EXPECT_EQ(camera.frames[k].first_row, row) << k;
  }
}

TEST_F(CamSrcTest, LiveSceneKeepsToTheScheduleOfTheClock) {
  CameraPipeline camera("rig=" + rig_with([](Camera&) {}) + " is-live=true framerate=40/1 num-frames=5");
  ASSERT_EQ(camera.play(), "EOS");
  for (const Frame& frame : camera.frames) EXPECT_EQ(frame.capture_time % (GST_SECOND / 40), 0u) << "k / 40 s";
}

TEST_F(CamSrcTest, FramerateIsImposedOnVideosToo) {
  for (const int rate : {5, 30}) {
    CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") + " framerate=" + std::to_string(rate) + "/1");
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.info.fps_n, rate);
    const int wanted = kFrames * rate / CameraFiles::kRate;
    ASSERT_NEAR(camera.frames.size(), wanted, 1);
    for (size_t k = 0; k < camera.frames.size(); ++k) {
      EXPECT_NEAR(camera.frames[k].running_time, k * (GST_SECOND / rate), GST_MSECOND);
      EXPECT_NEAR(camera.frames[k].capture_time, camera.frames[k].running_time, kPeriod + GST_MSECOND)
          << "of the frame that is shown";
      const auto source_frame = static_cast<int>(std::lround(1.0 * camera.frames[k].capture_time / kPeriod));
      EXPECT_NEAR(camera.frames[k].level, CameraFiles::grey_of(source_frame), 2);
    }
  }
}

TEST_F(CamSrcTest, StopsLoopingWhenNobodyWantsMore) {
  for (const char* source : {"mjpeg.mkv", "jpeg_%02d.jpg"}) {
    CameraPipeline camera("rig=" + rig_with_source(source) + " loop=true",
                          "identity eos-after=" + std::to_string(kFrames + 3));
    EXPECT_EQ(camera.play(), "EOS") << source;
  }
}

TEST_F(CamSrcTest, EndsWithTheFileWithoutLoop) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv"));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.frames.size(), static_cast<size_t>(kFrames));
}

TEST_F(CamSrcTest, FormatsOutsideTheFamiliesAreConverted) {
  const std::string rig = rig_with([](Camera& camera) { camera.image = "grey.png"; });
  CameraPipeline camera("rig=" + rig + " num-frames=1");
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_TRUE(GST_VIDEO_INFO_FORMAT(&camera.info) == GST_VIDEO_FORMAT_I420 || GST_VIDEO_INFO_IS_RGB(&camera.info));
}

TEST_F(CamSrcTest, DownstreamMayChooseTheFormat) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") + " num-frames=1", "video/x-raw,format=BGRx");
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(GST_VIDEO_INFO_FORMAT(&camera.info), GST_VIDEO_FORMAT_BGRx);
  EXPECT_NEAR(camera.frames[0].level, CameraFiles::grey_of(0), 2);
}

TEST_F(CamSrcTest, JpegComesAsItIsWhereItIsNotDecoded) {
  for (const std::string source : {"mjpeg.mkv", "mjpeg.avi", "jpeg_%02d.jpg"})
    for (const std::string framerate : {"0/1", "30/1"}) {
      const ElementPtr pipeline =
          launch("lfcamsrc decode=false framerate=" + framerate + " rig=" + rig_with_source(source) +
                 " ! image/jpeg ! jpegdec ! fakesink sync=false");
      ASSERT_TRUE(pipeline);
      EXPECT_EQ(run(pipeline.get()), "") << source << " " << framerate;
    }
  const ElementPtr wrong = launch("lfcamsrc decode=false rig=" + files->save("wrong.json", 1, [](Camera& camera) {
    camera.source = "jpeg_%02d.jpg";
    camera.width = 65;
  }) + " ! fakesink");
  ASSERT_TRUE(wrong);
  EXPECT_THAT(run(wrong.get()), HasSubstr("the picture is 64x48, the rig says 65x48"));
  for (const std::string source : {"raw.mkv", "png_%d.png"}) {  // nothing to bypass
    const ElementPtr pipeline =
        launch("lfcamsrc decode=false rig=" + rig_with_source(source) + " ! video/x-raw ! fakesink sync=false");
    ASSERT_TRUE(pipeline);
    EXPECT_EQ(run(pipeline.get()), "") << source;
  }
}

TEST_F(CamSrcTest, EventComesAgainAfterAFlush) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv"));
  ASSERT_TRUE(camera.reach(GST_STATE_PAUSED));
  ASSERT_TRUE(gst_element_seek_simple(camera.pipeline(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, 0));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), LF_CAMERA_EVENT), 2);
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), "flush-stop"), 1);
}

TEST_F(CamSrcTest, PropertiesSetInReadyCount) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv"));
  ASSERT_TRUE(camera.reach(GST_STATE_READY));
  g_object_set(camera.camera(), "num-frames", gint64{1}, nullptr);
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.frames.size(), 1u);
}

// Each bad input and what the message says of the place.
TEST_F(CamSrcTest, ErrorsNameThePlace) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(files->path(name)) << text;
    return files->path(name);
  };
  const auto good = [&](const std::string& name, const std::string& source, int width = CameraFiles::kWidth) {
    return files->save(name, 1, [&](Camera& camera) {
      camera.source = source;
      camera.width = width;
    });
  };
  write("empty.mkv", "");
  write("broken.png", "\x89PNG\r\n\x1a\nnothing more");
  write("broken.mkv", "\x1a\x45\xdf\xa3 nothing more");
  std::filesystem::create_directory(files->path("folder"));
  const std::string in_a = files->path("a.json") + ": camera 0 (cam_0): ";
  struct Case {
    const char* what;
    std::string properties;
    bool at_state_change;  // else with the data
    std::vector<std::string> words;
  };
  const std::vector<std::function<Case()>> cases = {
      [&] {
        return Case{"no rig", "", true, {"rig: not set"}};
      },
      [&] {
        return Case{"rig missing", "rig=" + files->path("none.json"), true, {"none.json", "no such file"}};
      },
      [&] {
        return Case{"rig not JSON", "rig=" + write("b.json", "{\"format\": "), true, {files->path("b.json")}};
      },
      [&] {
        return Case{"rig without cameras",
                    "rig=" + write("c.json", R"({"format": "lightfield-rig", "version": 1})"),
                    true,
                    {files->path("c.json"), "cameras"}};
      },
      [&] {
        return Case{"no such camera", "camera=7 rig=" + good("a.json", ""), true, {"a.json", "no camera 7"}};
      },
      [&] {
        return Case{
            "file missing", "rig=" + good("a.json", "no.mkv"), true, {in_a + files->path("no.mkv"), "no such file"}};
      },
      [&] {
        return Case{"folder", "rig=" + good("a.json", "folder"), true, {in_a + files->path("folder"), "not a file"}};
      },
      [&] {
        return Case{"sequence missing",
                    "rig=" + good("a.json", "no_%03d.png"),
                    true,
                    {in_a + files->path("no_%03d.png"), "no such files"}};
      },
      [&] {
        return Case{"pattern with two numbers", "rig=" + good("a.json", "%d_%d.png"), true, {in_a, "\"%d_%d.png\""}};
      },
      [&] {
        return Case{"pattern with a string", "rig=" + good("a.json", "a_%s.png"), true, {in_a, "\"a_%s.png\""}};
      },
      [&] {
        return Case{"sequence of videos", "rig=" + good("a.json", "empty%%_%d.mkv"), true, {in_a, "no such files"}};
      },
      [&] {
        return Case{"wrong size of a video",
                    "rig=" + good("a.json", "mjpeg.mkv", 100),
                    false,
                    {in_a + files->path("mjpeg.mkv"), "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of a sequence",
                    "rig=" + good("a.json", "jpeg_%02d.jpg", 100),
                    false,
                    {in_a, "jpeg_%02d.jpg", "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of a still",
                    "rig=" + good("a.json", "png_1.png", 100),
                    false,
                    {in_a + files->path("png_1.png"), "64x48", "100x48"}};
      },
      [&] {
        return Case{"wrong size of another file",
                    "rig=" + good("a.json", "mjpeg.avi", 100),
                    false,
                    {in_a, "mjpeg.avi", "64x48", "100x48"}};
      },
      [&] {
        return Case{"empty file", "rig=" + good("a.json", "empty.mkv"), false, {in_a, "empty.mkv"}};
      },
      [&] {
        return Case{"broken PNG", "rig=" + good("a.json", "broken.png"), false, {in_a, "broken.png"}};
      },
      [&] {
        return Case{"broken Matroska", "rig=" + good("a.json", "broken.mkv"), false, {in_a, "broken.mkv"}};
      },
      [&] {
        return Case{"no video", "rig=" + good("a.json", "sound.mkv"), false, {in_a, "sound.mkv", "no video"}};
      },
      [&] {
        return Case{"unknown URI", "rig=" + good("a.json", "nothing://x"), false, {in_a, "nothing://x"}};
      },
  };
  for (const auto& make : cases) {
    const Case c = make();
    SCOPED_TRACE(c.what);
    CameraPipeline camera(c.properties);
    const GstStateChangeReturn result = camera.set_state(GST_STATE_PLAYING);
    if (c.at_state_change) {
      EXPECT_EQ(result, GST_STATE_CHANGE_FAILURE);
    }
    const std::string text = camera.wait();
    for (const std::string& word : c.words) EXPECT_THAT(text, HasSubstr(word));
    EXPECT_EQ(camera.wait(GST_MSECOND), "timeout") << "one error is enough";
    camera.set_state(GST_STATE_NULL);
    EXPECT_TRUE(camera.frames.empty());
    EXPECT_EQ(GST_BIN_NUMCHILDREN(camera.camera()), 0);
  }
}

TEST_F(CamSrcTest, IsUsableAgainAfterAnError) {
  CameraPipeline camera("rig=" + rig_with_source("no.mkv") + " num-frames=1");
  ASSERT_THAT(camera.play(), HasSubstr("no.mkv"));
  rig_with_source("mjpeg.mkv");
  g_object_set(camera.camera(), "rig", files->path("rig.json").c_str(), nullptr);
  EXPECT_EQ(camera.play(), "EOS");
}

}  // namespace
}  // namespace lf::test
