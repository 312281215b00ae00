// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/camera_pipeline.h"
#include "rig/rig_json.h"
#include "scene/scene.h"

namespace lf::test {
namespace {

// uridecodebin reaches PAUSED asynchronously, a live camera immediately: the pipeline must not wait for either.
TEST_F(CamSrcTest, DecodersDoNotDelayALivePipeline) {
  const std::string camera = "lfcamsrc is-live=true loop=true rig=" + rig_with_source("mjpeg.avi") + " ! queue ! ";
  const PipelinePtr pipeline = launch("funnel name=all ! fakesink name=sink  " + camera + "all.  " + camera + "all.  " +
                                      camera + "all.  " + camera + "all.");
  for (int i = 0; i < 60; ++i) {
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    GstState state = GST_STATE_NULL;
    ASSERT_EQ(gst_element_get_state(pipeline.get(), &state, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_SUCCESS) << i;
    ASSERT_EQ(state, GST_STATE_PLAYING) << i;
    ASSERT_EQ(GST_STATE(child_of(pipeline.get(), "sink").get()), GST_STATE_PLAYING) << i;
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
}

TEST_F(CamSrcTest, CaptureTimeIncludesTheTimeOffset) {
  struct Case {
    double offset;
    GstClockTimeDiff first, second;
  };
  for (const Case& c : {Case{0.25, 250, 316}, Case{-0.01, 0, 56}}) {  // times are clamped at 0
    const std::string rig = rig_with([&](Camera& camera) {
      camera.image = "png_1.png";
      camera.time_offset = c.offset;
    });
    CameraPipeline camera("rig=" + rig + " num-buffers=2");
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.frames[0].running_time, 0u);
    EXPECT_EQ(camera.frames[0].capture_time / GST_MSECOND, static_cast<GstClockTime>(c.first));
    EXPECT_EQ(camera.frames[1].capture_time / GST_MSECOND, static_cast<GstClockTime>(c.second));
  }
}

TEST_F(CamSrcTest, SceneShowsTheCaptureTime) {
  const std::string path = rig_with([](Camera& camera) { camera.time_offset = 0.5; });
  CameraPipeline camera("rig=" + path + " num-buffers=2 framerate=4/1");
  ASSERT_EQ(camera.play(), "EOS");
  const Camera model = load_rig(path).cameras[0];
  for (int k = 0; k < 2; ++k) {
    const Image truth =
        render_scene({model.width, model.height, model.lens, model.pose}, static_cast<double>(k) / 4 + 0.5);
    const std::vector<uint8_t> row(truth.pixel(0, 0), truth.pixel(0, 0) + truth.width() * 3);
    EXPECT_EQ(camera.frames[k].first_row, row) << k;
  }
}

TEST_F(CamSrcTest, LiveSceneFollowsTheClockSchedule) {
  CameraPipeline camera("rig=" + rig_with([](Camera&) {}) + " is-live=true framerate=40/1 num-buffers=5");
  ASSERT_EQ(camera.play(), "EOS");
  for (const Frame& frame : camera.frames) EXPECT_EQ(frame.capture_time % (GST_SECOND / 40), 0u) << "k / 40 s";
}

// Otherwise the pipeline cannot find a valid latency.
TEST_F(CamSrcTest, MaximumLatencyIsNotBelowTheMinimum) {
  for (const std::string source : {"", "mjpeg.mkv"}) {
    const PipelinePtr pipeline =
        launch("lfcamsrc name=camera is-live=true loop=true rig=" + rig_with_source(source) + " ! fakesink");
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND);
    g_autoptr(GstQuery) query = gst_query_new_latency();
    ASSERT_TRUE(gst_pad_query(pad_of(child_of(pipeline.get(), "camera").get(), "src").get(), query));
    gboolean live = FALSE;
    GstClockTime least = 0, most = 0;
    gst_query_parse_latency(query, &live, &least, &most);
    EXPECT_TRUE(live) << source;
    EXPECT_GE(least, GST_SECOND / 15) << source;
    EXPECT_GE(most, least) << source;
  }
}

TEST_F(CamSrcTest, FramerateAppliesToVideos) {
  for (const int rate : {5, 30}) {
    CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") + " framerate=" + std::to_string(rate) + "/1");
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.info.fps_n, rate);
    const int wanted = kFrames * rate / CameraFiles::kRate;
    ASSERT_NEAR(camera.frames.size(), wanted, 1);
    for (size_t k = 0; k < camera.frames.size(); ++k) {
      EXPECT_NEAR(camera.frames[k].running_time, k * (GST_SECOND / rate), GST_MSECOND);
      EXPECT_NEAR(camera.frames[k].capture_time, camera.frames[k].running_time, kPeriod + GST_MSECOND)
          << "displayed frame";
      const auto source_frame = static_cast<int>(std::lround(1.0 * camera.frames[k].capture_time / kPeriod));
      EXPECT_NEAR(camera.frames[k].level, CameraFiles::grey_of(source_frame), 2);
    }
  }
}

// Seeks like a player: the first end is EOS, later ends are SEGMENT_DONE.
TEST_F(CamSrcTest, LoopsNeedNoFlush) {
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
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") +
                        " loop=true num-buffers=" + std::to_string(kRounds * kFrames));
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
    // Matroska timestamps have millisecond resolution
    EXPECT_NEAR(static_cast<double>(since), static_cast<double>(kPeriod), 2e6) << k;
  }
  EXPECT_EQ(count.flushes, 1);
  EXPECT_GE(count.segment_ends, kRounds - 2);
  g_autoptr(GstBus) bus = gst_element_get_bus(camera.pipeline());
  constexpr auto kSegments = GstMessageType(GST_MESSAGE_SEGMENT_START | GST_MESSAGE_SEGMENT_DONE);
  EXPECT_FALSE(MessagePtr(gst_bus_pop_filtered(bus, kSegments))) << "no segment seek";
}

// Files of one array loop with a common period, even if one is truncated.
TEST_F(CamSrcTest, TruncatedFileLoopsInStep) {
  const std::string whole = files->path("mjpeg.mkv"), cut = files->path("cut.mkv");
  std::filesystem::copy(whole, cut);
  std::filesystem::resize_file(cut, std::filesystem::file_size(whole) * 6 / 10);
  for (const std::string properties : {" loop=true num-buffers=10", " loop=true num-buffers=10 is-live=true"}) {
    CameraPipeline all("rig=" + rig_with_source("mjpeg.mkv") + properties);
    ASSERT_EQ(all.play(), "EOS");
    CameraPipeline some("rig=" + rig_with_source("cut.mkv") + properties);
    ASSERT_EQ(some.play(), "EOS");
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

// Pictures may end before the sound without being truncated: the sound determines the duration.
TEST_F(CamSrcTest, FileWithAudioLoopsAtTheEndOfTheVideo) {
  run_to_end("multifilesrc location=" + files->path("jpeg_%02d.jpg") +
             " caps=image/jpeg,framerate=15/1 ! jpegdec ! jpegenc ! matroskamux name=m ! filesink location=" +
             files->path("both.mkv") + " audiotestsrc num-buffers=50 ! m.");
  CameraPipeline camera("rig=" + rig_with_source("both.mkv") + " loop=true num-buffers=20");
  ASSERT_EQ(camera.play(), "EOS");
  ASSERT_EQ(camera.frames.size(), 20u);
  for (size_t k = 1; k < camera.frames.size(); k++)
    EXPECT_NEAR(static_cast<double>(camera.frames[k].running_time - camera.frames[k - 1].running_time),
                static_cast<double>(kPeriod), 2e6)
        << k;
}

TEST_F(CamSrcTest, LoopsAfterASeekHaveFilmTimes) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") + " loop=true num-buffers=20");
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

TEST_F(CamSrcTest, StopsLoopingWhenDownstreamStops) {
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
  CameraPipeline camera("rig=" + rig + " num-buffers=1");
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_TRUE(GST_VIDEO_INFO_FORMAT(&camera.info) == GST_VIDEO_FORMAT_I420 || GST_VIDEO_INFO_IS_RGB(&camera.info));
}

TEST_F(CamSrcTest, DownstreamSelectsTheFormat) {
  CameraPipeline camera("rig=" + rig_with_source("mjpeg.mkv") + " num-buffers=1", "video/x-raw,format=BGRx");
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(GST_VIDEO_INFO_FORMAT(&camera.info), GST_VIDEO_FORMAT_BGRx);
  EXPECT_NEAR(camera.frames[0].level, CameraFiles::grey_of(0), 2);
}

TEST_F(CamSrcTest, JpegStaysJpegWithoutDecoding) {
  for (const std::string source : {"mjpeg.mkv", "mjpeg.avi", "jpeg_%02d.jpg"})
    for (const std::string framerate : {"0/1", "30/1"}) {
      EXPECT_EQ(run("lfcamsrc decode=false framerate=" + framerate + " rig=" + rig_with_source(source) +
                    " ! image/jpeg ! jpegdec ! fakesink sync=false"),
                "")
          << source << " " << framerate;
    }
  // The size is read from the first valid picture.
  std::ofstream(files->path("begins_00.jpg")) << "\xff\xd8\xff\xe0 and no more of a picture";
  std::filesystem::copy(files->path("jpeg_00.jpg"), files->path("begins_01.jpg"));
  for (const std::string source : {"jpeg_%02d.jpg", "begins_%02d.jpg"}) {
    const std::string wrong = files->save("wrong.json", 1, [&](Camera& camera) {
      camera.source = source;
      camera.width = 65;
    });
    EXPECT_THAT(run("lfcamsrc decode=false rig=" + wrong + " ! fakesink"), mentions("64x48", "65x48")) << source;
  }
  for (const std::string source : {"raw.mkv", "png_%d.png"}) {  // raw frames and PNG have no decoder to bypass
    EXPECT_EQ(run("lfcamsrc decode=false rig=" + rig_with_source(source) + " ! video/x-raw ! fakesink sync=false"), "")
        << source;
  }
}

TEST_F(CamSrcTest, EventIsRepeatedAfterAFlush) {
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
  g_object_set(camera.camera(), "num-buffers", gint64{1}, nullptr);
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.frames.size(), 1u);
}

// --- Errors ----------------------------------------------------------------------------------------------------------

TEST_F(CamSrcTest, ErrorsNameThePlace) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(files->path(name)) << text;
  };
  write("empty.mkv", "");
  write("broken.png", "\x89PNG\r\n\x1a\nnothing more");
  write("broken.mkv", "\x1a\x45\xdf\xa3 nothing more");
  std::filesystem::create_directory(files->path("folder"));
  write("b.json", "{\"format\": ");
  write("c.json", R"({"format": "lightfield-rig", "version": 1})");
  const std::string in_a = files->path("a.json") + ": camera 0 (cam_0): ";
  struct Case {
    const char* what;
    std::string properties;
    const char* source;
    bool at_state_change;  // false: with the first data
    std::vector<std::string> words;
    int width = CameraFiles::kWidth;
  };
  const Case cases[] = {
      {"no rig", "", nullptr, true, {"rig: not set"}},
      {"rig missing", "rig=" + files->path("none.json"), nullptr, true, {"none.json", "no such file"}},
      {"rig not JSON", "rig=" + files->path("b.json"), nullptr, true, {files->path("b.json")}},
      {"rig without cameras", "rig=" + files->path("c.json"), nullptr, true, {files->path("c.json"), "cameras"}},
      {"no such camera", "camera=7", "", true, {"a.json", "no camera 7"}},
      {"file missing", "", "no.mkv", true, {in_a + files->path("no.mkv"), "no such file"}},
      {"folder", "", "folder", true, {in_a + files->path("folder"), "not a file"}},
      {"sequence missing", "", "no_%03d.png", true, {in_a + files->path("no_%03d.png"), "no such files"}},
      {"pattern with two numbers", "", "%d_%d.png", true, {in_a, "\"%d_%d.png\""}},
      {"pattern with a string", "", "a_%s.png", true, {in_a, "\"a_%s.png\""}},
      {"sequence of videos", "", "empty%%_%d.mkv", true, {in_a, "no such files"}},
      {"wrong size of a video", "", "mjpeg.mkv", false, {in_a + files->path("mjpeg.mkv"), "64x48", "100x48"}, 100},
      {"wrong size of a sequence", "", "jpeg_%02d.jpg", false, {in_a, "jpeg_%02d.jpg", "64x48", "100x48"}, 100},
      {"wrong size of a still", "", "png_1.png", false, {in_a + files->path("png_1.png"), "64x48", "100x48"}, 100},
      {"wrong size of another file", "", "mjpeg.avi", false, {in_a, "mjpeg.avi", "64x48", "100x48"}, 100},
      {"empty file", "", "empty.mkv", false, {in_a, "empty.mkv"}},
      {"broken PNG", "", "broken.png", false, {in_a, "broken.png"}},
      {"broken Matroska", "", "broken.mkv", false, {in_a, "broken.mkv"}},
      {"no video", "", "sound.mkv", false, {in_a, "sound.mkv", "no video"}},
      {"unknown URI", "trusted=true", "nothing://x", false, {in_a, "nothing://x"}},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    const std::string rig = !c.source ? "" : " rig=" + files->save("a.json", 1, [&](Camera& camera) {
      camera.source = c.source;
      camera.width = c.width;
    });
    CameraPipeline camera(c.properties + rig);
    const GstStateChangeReturn result = camera.set_state(GST_STATE_PLAYING);
    if (c.at_state_change) {
      EXPECT_EQ(result, GST_STATE_CHANGE_FAILURE);
    }
    const std::string text = camera.wait();
    for (const std::string& word : c.words) EXPECT_THAT(text, HasSubstr(word));
    EXPECT_EQ(camera.wait(GST_MSECOND), "timeout") << "a single error";
    camera.set_state(GST_STATE_NULL);
    EXPECT_TRUE(camera.frames.empty());
    EXPECT_EQ(GST_BIN_NUMCHILDREN(camera.camera()), 0);
  }
}

// Collects all bus messages and our categories' log output at the highest level.
class Listener {
 public:
  Listener() {
    gst_debug_set_threshold_from_string("lf*:9", FALSE);
    gst_debug_add_log_function(log, this, nullptr);
  }
  ~Listener() {
    gst_debug_remove_log_function_by_data(this);
    gst_debug_set_threshold_from_string("lf*:1", FALSE);
  }
  // Reads until an error, or for `patience` in total: a retrying camera posts messages forever.
  void read(GstElement* pipeline, GstClockTime patience) {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
    const gint64 end = g_get_monotonic_time() + static_cast<gint64>(patience / GST_USECOND);
    for (bool going = true; going;) {
      const gint64 left = std::max<gint64>(0, end - g_get_monotonic_time());
      g_autoptr(GstMessage) message = gst_bus_timed_pop(bus, static_cast<GstClockTime>(left) * GST_USECOND);
      if (!message) break;
      going = GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR;
      if (const GstStructure* structure = gst_message_get_structure(message)) {
        g_autofree gchar* text = gst_structure_to_string(structure);
        add(text);
      }
      problems_ += GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR || GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING;
      // Structures print errors as pointers.
      g_autoptr(GError) error = nullptr;
      g_autofree gchar* debug = nullptr;
      if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) gst_message_parse_error(message, &error, &debug);
      if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_WARNING) gst_message_parse_warning(message, &error, &debug);
      if (error) add(error->message);
      if (debug) add(debug);
    }
  }
  int problems() const { return problems_; }
  std::string said() const {
    const std::lock_guard lock(mutex_);
    return said_;
  }

 private:
  void add(const char* text) {
    const std::lock_guard lock(mutex_);
    said_ += std::string(text) + "\n";
  }
  static void log(GstDebugCategory* category, GstDebugLevel, const gchar*, const gchar*, gint, GObject*,
                  GstDebugMessage* message, gpointer self) {
    if (g_str_has_prefix(gst_debug_category_get_name(category), "lf"))
      static_cast<Listener*>(self)->add(gst_debug_message_get(message));
  }
  mutable std::mutex mutex_;
  std::string said_;
  int problems_ = 0;
};

TEST_F(CamSrcTest, NeverRevealsPasswords) {
  const char* const sources[] = {
      "rtsp://admin:Hunter2Secret@127.0.0.1:1/stream",
      "rtsp://Hunter2Secret@127.0.0.1:1/stream",
      "http://admin:Hunter2Secret@127.0.0.1:1/a.jpg",
      "http://127.0.0.1:1/video.cgi?user=admin&pwd=Hunter2Secret",
      "nothing://admin:Hunter2Secret@host/x",
      "rtspsrc location=rtsp://127.0.0.1:1/ user-id=me user-pw=Hunter2Secret ! decodebin",
      "rtspsrc location=rtsp://me:Hunter2Secret@127.0.0.1:1/ ! decodebin",
      "souphttpsrc location=http://127.0.0.1:1/ user-pw=\"Hunter2Secret and more\" ! jpegdec",
      "rtspsrc nosuch=1 user-pw=Hunter2Secret ! decodebin",
      "nosuchelement password=Hunter2Secret ! decodebin",
  };
  for (const char* source : sources)
    for (const char* retry : {"false", "true"}) {
      SCOPED_TRACE(std::string(source) + " retry=" + retry);
      Listener listener;
      CameraPipeline camera("rig=" + rig_with_source(source) + " trusted=true retry=" + retry);
      camera.set_state(GST_STATE_PLAYING);
      listener.read(camera.pipeline(), (*retry == 't' ? 1 : 3) * GST_SECOND);
      g_autofree gchar* text = gst_structure_to_string(stats_of(camera.camera()).get());
      camera.set_state(GST_STATE_NULL);
      EXPECT_GT(listener.problems(), 0) << "problems to report";
      EXPECT_THAT(listener.said() + text, Not(HasSubstr("Hunter2Secret")));
    }
}

TEST_F(CamSrcTest, IsUsableAgainAfterAnError) {
  CameraPipeline camera("rig=" + rig_with_source("no.mkv") + " num-buffers=1");
  ASSERT_THAT(camera.play(), HasSubstr("no.mkv"));
  rig_with_source("mjpeg.mkv");
  g_object_set(camera.camera(), "rig", files->path("rig.json").c_str(), nullptr);
  EXPECT_EQ(camera.play(), "EOS");
}

// --- Capture devices by URI ------------------------------------------------------------------------------------------
// A fake webcam replaces hardware: a live source with two sizes, the larger first, in YUY2 and, at a higher rate, JPEG.

struct FakeWebcam {
  GstBin parent;
};
struct FakeWebcamClass {
  GstBinClass parent_class;
};

void uri_handler_init(gpointer iface, gpointer) {
  auto* handler = static_cast<GstURIHandlerInterface*>(iface);
  handler->get_type = [](GType) { return GST_URI_SRC; };
  handler->get_protocols = [](GType) -> const gchar* const* {
    static const gchar* const protocols[] = {"webcam", nullptr};
    return protocols;
  };
  handler->get_uri = [](GstURIHandler*) { return g_strdup("webcam://"); };
  handler->set_uri = [](GstURIHandler*, const gchar*, GError**) -> gboolean { return TRUE; };
}

G_DEFINE_TYPE_WITH_CODE(FakeWebcam, fake_webcam, GST_TYPE_BIN,
                        G_IMPLEMENT_INTERFACE(GST_TYPE_URI_HANDLER, uri_handler_init))

GstStaticPadTemplate webcam_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS("video/x-raw, format=YUY2, width=640, height=480, framerate=10/1;"
                                            "video/x-raw, format=YUY2, width=64, height=48, framerate={15/1, 10/1};"
                                            "image/jpeg, width=64, height=48, framerate=30/1"));

void fake_webcam_class_init(FakeWebcamClass* klass) {
  gst_element_class_add_static_pad_template(GST_ELEMENT_CLASS(klass), &webcam_template);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Webcam", "Source/Video", "Fake", "none");
}

// The format depends on the downstream caps.
void choose_format(GstPad* ghost, GstPad*, gpointer data) {
  auto* self = static_cast<GstElement*>(data);
  GstCaps* asked = gst_pad_peer_query_caps(ghost, nullptr);
  GstCaps* mine = gst_static_pad_template_get_caps(&webcam_template);
  const bool can = gst_caps_can_intersect(mine, asked);  // otherwise its own format, which downstream refuses
  GstCaps* caps = gst_caps_fixate(can ? gst_caps_intersect(mine, asked) : gst_caps_ref(mine));
  const bool jpeg = gst_structure_has_name(gst_caps_get_structure(caps, 0), "image/jpeg");
  GstElement* test = gst_element_factory_make("videotestsrc", nullptr);
  GstElement* filter = gst_element_factory_make("capsfilter", nullptr);
  GstElement* coder = gst_element_factory_make(jpeg ? "jpegenc" : "identity", nullptr);
  GstCaps* raw = gst_caps_copy(caps);
  if (jpeg) gst_structure_set_name(gst_caps_get_structure(raw, 0), "video/x-raw");
  g_object_set(test, "is-live", TRUE, nullptr);
  g_object_set(filter, "caps", raw, nullptr);
  gst_bin_add_many(GST_BIN(self), test, filter, coder, nullptr);
  gst_element_link_many(test, filter, coder, nullptr);
  gst_ghost_pad_set_target(GST_GHOST_PAD(ghost), pad_of(coder, "src").get());
  for (GstCaps* c : {asked, mine, caps, raw}) gst_caps_unref(c);
}

void fake_webcam_init(FakeWebcam* self) {
  GstPadTemplate* pad_template = gst_static_pad_template_get(&webcam_template);
  GstPad* pad = gst_ghost_pad_new_no_target_from_template("src", pad_template);
  gst_object_unref(pad_template);
  g_signal_connect(pad, "linked", G_CALLBACK(choose_format), self);
  gst_element_add_pad(GST_ELEMENT(self), pad);
}

class DeviceTest : public CamSrcTest {
 protected:
  static void SetUpTestSuite() {
    gst_element_register(nullptr, "fakewebcam", GST_RANK_PRIMARY, fake_webcam_get_type());
    CamSrcTest::SetUpTestSuite();
  }
};

TEST_F(DeviceTest, RequestsTheSizeOfTheRig) {
  for (int i = 0; i < 10; i++) {
    CameraPipeline camera("num-buffers=3 trusted=true rig=" + rig_with_source("webcam://0"));
    ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL) << "always live";
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.info.width, 64);
    EXPECT_EQ(camera.info.fps_n, 15);
    ASSERT_EQ(camera.frames.size(), 3u);
    EXPECT_GT(camera.frames[0].capture_time, camera.frames[0].running_time) << "clock time";
  }
}

TEST_F(DeviceTest, RequestsTheRateAndAcceptsJpeg) {
  CameraPipeline camera("num-buffers=3 framerate=30/1 is-live=true trusted=true rig=" + rig_with_source("webcam://0"));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_EQ(camera.info.fps_n, 30);
  EXPECT_EQ(camera.frames.size(), 3u);
}

TEST_F(DeviceTest, JpegStaysJpegWithoutDecoding) {
  EXPECT_EQ(run("lfcamsrc decode=false num-buffers=2 trusted=true rig=" + rig_with_source("webcam://0") +
                " ! image/jpeg,framerate=30/1 ! fakesink"),
            "");
}

TEST_F(DeviceTest, ErrorsNameThePlace) {
  const std::string small = files->save("small.json", 1, [](Camera& camera) {
    camera.source = "webcam://0";
    camera.width = 62;
  });
  const std::string place = small + ": camera 0 (cam_0): webcam://0: ";
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + small).play(), mentions(place, "62x48"));
  EXPECT_THAT(CameraPipeline("framerate=25/1 trusted=true rig=" + small).play(), mentions("62x48", "25/1"));
  if (!ElementPtr(gst_element_factory_make("v4l2src", nullptr))) GTEST_SKIP() << "v4l2src is not installed";
  EXPECT_THAT(CameraPipeline("rig=" + rig_with_source("v4l2:///dev/video-none")).play(),
              AllOf(mentions("camera 0", "cam_0", "v4l2:///dev/video-none"), HasSubstr("Cannot identify")));
}

}  // namespace
}  // namespace lf::test
