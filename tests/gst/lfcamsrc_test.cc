// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "../gst/common/common.h"
#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

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

// Else a pipeline can't find a latency that suits it.
TEST_F(CamSrcTest, LiveLatencyHasNoBoundBelowItsLeast) {
  for (const std::string source : {"", "mjpeg.mkv"}) {
    const ElementPtr pipeline =
        launch("lfcamsrc name=camera is-live=true loop=true rig=" + rig_with_source(source) + " ! fakesink");
    ASSERT_TRUE(pipeline);
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND);
    const ElementPtr camera(gst_bin_get_by_name(GST_BIN(pipeline.get()), "camera"));
    GstPad* src = gst_element_get_static_pad(camera.get(), "src");
    GstQuery* query = gst_query_new_latency();
    ASSERT_TRUE(gst_pad_query(src, query));
    gboolean live = FALSE;
    GstClockTime least = 0, most = 0;
    gst_query_parse_latency(query, &live, &least, &most);
    EXPECT_TRUE(live) << source;
    EXPECT_GE(least, GST_SECOND / 15) << source;
    EXPECT_GE(most, least) << source;
    gst_query_unref(query);
    gst_object_unref(src);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
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

// As players do it: the first end is that of a stream which nobody has sought, the others are those of segments.
TEST_F(CamSrcTest, RoundsOfAFilmFollowEachOtherWithoutAFlush) {
  struct Count {
    std::atomic<int> flushes = 0, ends = 0, segment_ends = 0;
    static GstPadProbeReturn see(GstPad*, GstPadProbeInfo* info, gpointer data) {
      auto* self = static_cast<Count*>(data);
      const GstEventType type = GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info));
      self->flushes += type == GST_EVENT_FLUSH_START;
      self->ends += type == GST_EVENT_EOS;
      self->segment_ends += type == GST_EVENT_SEGMENT_DONE;
      return GST_PAD_PROBE_OK;
    }
    static void watch(GstElement*, GstPad* pad, gpointer data) {
      constexpr int kEvents = GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM | GST_PAD_PROBE_TYPE_EVENT_FLUSH;
      gst_pad_add_probe(pad, GstPadProbeType(kEvents), see, data, nullptr);
    }
  } count;
  constexpr int kRounds = 8;
  CameraPipeline camera("rig=" + rig_with([](Camera& c) { c.source = "mjpeg.mkv"; }) +
                        " loop=true num-frames=" + std::to_string(kRounds * kFrames));
  ASSERT_TRUE(camera.reach(GST_STATE_READY));
  GstIterator* demuxers = gst_bin_iterate_all_by_element_factory_name(GST_BIN(camera.camera()), "matroskademux");
  GValue demuxer = G_VALUE_INIT;
  ASSERT_EQ(gst_iterator_next(demuxers, &demuxer), GST_ITERATOR_OK);
  g_signal_connect(g_value_get_object(&demuxer), "pad-added", G_CALLBACK(Count::watch), &count);
  g_value_unset(&demuxer);
  gst_iterator_free(demuxers);
  ASSERT_EQ(camera.play(), "EOS");
  ASSERT_EQ(camera.frames.size(), size_t{kRounds * kFrames});
  for (size_t k = 0; k < camera.frames.size(); k++) {
    EXPECT_NEAR(camera.frames[k].level, CameraFiles::grey_of(static_cast<int>(k) % kFrames), 2) << k;
    if (k == 0) continue;
    const GstClockTime since = camera.frames[k].running_time - camera.frames[k - 1].running_time;
    EXPECT_NEAR(static_cast<double>(since), static_cast<double>(kPeriod), 2e6) << k;  // Matroska counts milliseconds
  }
  EXPECT_EQ(count.flushes, 1);
  EXPECT_GE(count.segment_ends, kRounds - 2);
  GstBus* bus = gst_element_get_bus(camera.pipeline());
  constexpr auto kSegments = GstMessageType(GST_MESSAGE_SEGMENT_START | GST_MESSAGE_SEGMENT_DONE);
  GstMessage* message = gst_bus_pop_filtered(bus, kSegments);
  EXPECT_EQ(message, nullptr) << "nobody has asked for a segment";
  gst_clear_message(&message);
  gst_object_unref(bus);
}

// Films of one array loop together, even if one has lost its end.
TEST_F(CamSrcTest, AFilmThatIsCutOffLoopsInStepWithTheOthers) {
  const std::string whole = files->path("mjpeg.mkv"), cut = files->path("cut.mkv");
  std::filesystem::copy(whole, cut);
  std::filesystem::resize_file(cut, std::filesystem::file_size(whole) * 6 / 10);
  for (const std::string properties : {" loop=true num-frames=10", " loop=true num-frames=10 is-live=true"}) {
    CameraPipeline all("rig=" + rig_with_source("mjpeg.mkv") + properties);
    ASSERT_EQ(all.play(), "EOS");
    CameraPipeline some("rig=" + rig_with_source("cut.mkv") + properties);
    ASSERT_EQ(some.play(), "EOS");
    // The first frame of the second round, by its grey.
    const auto again = [](const CameraPipeline& camera) {
      for (size_t i = 1; i < camera.frames.size(); i++)
        if (camera.frames[i].level < camera.frames[i - 1].level)
          return camera.frames[i].running_time - camera.frames[0].running_time;
      return GstClockTime{0};
    };
    EXPECT_GT(again(all), GST_SECOND / 3) << properties;
    EXPECT_NEAR(static_cast<double>(again(some)), static_cast<double>(again(all)), 2e6) << properties;
    EXPECT_EQ(some.frames.size(), all.frames.size()) << properties;
  }
}

// The whole lasts as long as its sound: that its pictures end before is no cut.
TEST_F(CamSrcTest, AFilmWithSoundBeginsAgainWhereItsPicturesEnd) {
  run_to_end("multifilesrc location=" + files->path("jpeg_%02d.jpg") +
             " caps=image/jpeg,framerate=15/1 ! jpegdec ! jpegenc ! matroskamux name=m ! filesink location=" +
             files->path("both.mkv") + " audiotestsrc num-buffers=50 ! m.");
  CameraPipeline camera("rig=" + rig_with_source("both.mkv") + " loop=true num-frames=20");
  ASSERT_EQ(camera.play(), "EOS");
  ASSERT_EQ(camera.frames.size(), 20u);
  for (size_t k = 1; k < camera.frames.size(); k++)
    EXPECT_NEAR(static_cast<double>(camera.frames[k].running_time - camera.frames[k - 1].running_time),
                static_cast<double>(kPeriod), 2e6)
        << k;
}

TEST_F(CamSrcTest, RoundsBehindASeekHaveTheirPlaceInTheFilm) {
  CameraPipeline camera("rig=" + rig_with([](Camera& c) { c.source = "mjpeg.mkv"; }) + " loop=true num-frames=20");
  ASSERT_TRUE(camera.reach(GST_STATE_PAUSED));
  constexpr auto kFlags = GstSeekFlags(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE);
  ASSERT_TRUE(gst_element_seek_simple(camera.pipeline(), GST_FORMAT_TIME, kFlags, 3 * kPeriod));
  camera.frames.clear();
  ASSERT_EQ(camera.play(), "EOS");
  ASSERT_GE(camera.frames.size(), size_t{3 * kFrames});
  const auto first = std::lround(static_cast<double>(camera.frames[0].capture_time) / static_cast<double>(kPeriod));
  for (size_t k = 0; k < camera.frames.size(); k++) {
    const auto place = static_cast<double>(camera.frames[k].capture_time) / static_cast<double>(kPeriod);
    EXPECT_NEAR(place, static_cast<double>(first + static_cast<long>(k)), 0.2) << k;
    EXPECT_NEAR(camera.frames[k].level, CameraFiles::grey_of(static_cast<int>(std::lround(place)) % kFrames), 2) << k;
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
  // A damaged picture says nothing of the size.
  std::ofstream(files->path("begins_00.jpg")) << "\xff\xd8\xff\xe0 and no more of a picture";
  std::filesystem::copy(files->path("jpeg_00.jpg"), files->path("begins_01.jpg"));
  const ElementPtr damaged = launch("lfcamsrc decode=false rig=" + files->save("damaged.json", 1, [](Camera& camera) {
    camera.source = "begins_%02d.jpg";
    camera.width = 65;
  }) + " ! fakesink");
  ASSERT_TRUE(damaged);
  EXPECT_THAT(run(damaged.get()), HasSubstr("the picture is 64x48, the rig says 65x48"));
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

}  // namespace
}  // namespace lf::test
