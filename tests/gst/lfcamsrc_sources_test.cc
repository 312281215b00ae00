// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <ostream>
#include <string>

#include "../gst/common/common.h"
#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

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
    {"jpeg_stream", "pictures.mjpeg", "", GST_VIDEO_FORMAT_I420, Moves::kYes},
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

// --- Elements --------------------------------------------------------------------------------------------------------

class CamSrcElementsTest : public CamSrcTest {
 protected:
  static std::string rig_of(const std::string& source) {
    return rig_with([&](Camera& camera) { camera.source = source; });
  }
};

TEST_F(CamSrcElementsTest, AreReadAsGstLaunchDoes) {
  for (const char* source :
       {"videotestsrc pattern=white", "videotestsrc pattern=white ! video/x-raw,framerate=30/1",
        "videotestsrc pattern=white ! video/x-raw , width=64 ", "videotestsrc pattern=white ! jpegenc",
        "videotestsrc pattern=white is-live=true ! queue"}) {
    CameraPipeline camera("num-frames=3 rig=" + rig_of(source));
    ASSERT_EQ(camera.play(), "EOS") << source;
    EXPECT_EQ(camera.info.width, CameraFiles::kWidth) << "the rig's size is asked for";
    ASSERT_EQ(camera.frames.size(), 3u) << source;
    EXPECT_GE(camera.frames[0].level, 230) << source;
  }
}

TEST_F(CamSrcElementsTest, MayDecodeByAndBy) {
  const std::string file = "filesrc location=\"" + files->path("mjpeg.avi") + "\" ! ";
  for (const char* rest : {"decodebin", "avidemux", "avidemux ! jpegdec", "avidemux ! image/jpeg"}) {
    CameraPipeline camera("rig=" + rig_of(file + rest));
    ASSERT_EQ(camera.play(), "EOS") << rest;
    EXPECT_EQ(camera.frames.size(), static_cast<size_t>(kFrames)) << rest;
  }
}

TEST_F(CamSrcElementsTest, AreLiveWhereTheirSourceIs) {
  CameraPipeline camera("num-frames=2 rig=" + rig_of("videotestsrc is-live=true ! identity"));
  EXPECT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  EXPECT_EQ(camera.play(), "EOS");
}

TEST_F(CamSrcElementsTest, ErrorsNameThePlace) {
  const std::pair<const char*, const char*> cases[] = {
      {"nosuchelement property=1", "no element \"nosuchelement\""},
      {"videotestsrc none=1", "no property \"none\""},
      {"videotestsrc ! ! identity", "syntax error"},
      {"videotestsrc ! fakesink", "could not link"},
      {"identity ! identity", "there is no source in it"},
      {"videotestsrc ! video/x-raw,width=32", "it gives no pictures of 64x48"},
  };
  for (const auto& [source, text] : cases) {
    const std::string error = CameraPipeline("trusted=true rig=" + rig_of(source)).play();
    EXPECT_THAT(error, ::testing::AllOf(::testing::HasSubstr("camera 0 (cam_0): "), ::testing::HasSubstr(text)));
  }
}

TEST_F(CamSrcElementsTest, ThatMayDoMoreThanGivePicturesNeedTrust) {
  const std::string written = files->path("written-by-the-rig");
  const std::string picture = "videotestsrc num-buffers=3 ! video/x-raw,format=RGB,width=64,height=48 ! ";
  const std::string writes = "tee name=t t. ! queue ! filesink location=\"" + written + "\" t. ! queue";
  const std::string error = CameraPipeline("rig=" + rig_of(picture + writes)).play();
  EXPECT_THAT(error, ::testing::AllOf(::testing::HasSubstr("camera 0 (cam_0): its source has tee"),
                                      ::testing::HasSubstr("trusted=true")));
  EXPECT_FALSE(std::filesystem::exists(written));
  EXPECT_EQ(CameraPipeline("trusted=true rig=" + rig_of(picture + writes)).play(), "EOS");
  EXPECT_TRUE(std::filesystem::exists(written)) << "or the rig would have written nothing in any case";
  std::filesystem::remove(written);
  EXPECT_EQ(CameraPipeline("rig=" + rig_of(picture + "videoconvert ! queue")).play(), "EOS");
}

// A rig that names itself would open light fields without end.
TEST_F(CamSrcElementsTest, OtherLightFieldsNeedTrustAndDoNotNest) {
  const std::string itself = "lf://" + files->path("rig.json");
  EXPECT_THAT(CameraPipeline("rig=" + rig_with_source(itself)).play(),
              ::testing::HasSubstr("a URI of another light field"));
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + rig_with_source(itself)).play(),
              ::testing::HasSubstr("a URI of another light field"));
  const std::string described = "lfviewsrc trusted=true rig=\"" + files->path("rig.json") + "\" ! identity";
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + rig_with_source(described)).play(),
              ::testing::HasSubstr("does a rig name itself?"));
}

TEST_F(CamSrcElementsTest, AreOnlyTakenFromFilesOfOnesOwn) {
  const std::string path = rig_of("videotestsrc num-buffers=3 ! identity");
  std::filesystem::permissions(path, std::filesystem::perms::others_write, std::filesystem::perm_options::add);
  EXPECT_THAT(CameraPipeline("rig=" + path).play(), ::testing::HasSubstr("is written by others"));
  std::filesystem::permissions(path, std::filesystem::perms::others_write, std::filesystem::perm_options::remove);
  EXPECT_EQ(CameraPipeline("rig=" + path).play(), "EOS");
  const std::string no_elements = rig_of("mjpeg.mkv");
  std::filesystem::permissions(no_elements, std::filesystem::perms::others_write, std::filesystem::perm_options::add);
  EXPECT_EQ(CameraPipeline("rig=" + no_elements).play(), "EOS");
}

}  // namespace
}  // namespace lf::test
