// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../gst/common/codecs.h"
#include "gst/camera_pipeline.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/tiff_file.h"

namespace lf::test {
namespace {

enum class Moves { kYes, kNo, kScene };
struct SourceCase {
  const char* name;
  const char* source;  // "URI:" is replaced with the folder's URI
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

TEST_P(CamSrcSourceTest, DeliversAllFramesWithCapsEventAndMeta) {
  const std::string path = rig();
  CameraPipeline camera("rig=" + path + " num-buffers=" + std::to_string(kFrames));
  ASSERT_EQ(camera.play(), "EOS");

  EXPECT_EQ(GST_VIDEO_INFO_FORMAT(&camera.info), GetParam().format);
  EXPECT_EQ(camera.info.width, CameraFiles::kWidth);
  EXPECT_EQ(camera.info.height, CameraFiles::kHeight);
  EXPECT_EQ(camera.info.fps_n, CameraFiles::kRate * camera.info.fps_d);
  if (GetParam().format == GST_VIDEO_FORMAT_I420 && !is_h264()) {
    EXPECT_EQ(camera.info.colorimetry.range, GST_VIDEO_COLOR_RANGE_0_255) << "as in JPEG";
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
  // Contains every state change, including those over several states.
  for (const GstState state :
       {GST_STATE_READY, GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_READY, GST_STATE_PAUSED,
        GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_READY, GST_STATE_PLAYING, GST_STATE_NULL,
        GST_STATE_PAUSED, GST_STATE_NULL, GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_NULL})
    ASSERT_TRUE(camera.reach(state)) << gst_element_state_get_name(state) << ": " << camera.wait(0);
  EXPECT_EQ(GST_BIN_NUMCHILDREN(camera.camera()), 0) << "children live from READY to NULL";
  EXPECT_EQ(camera.wait(0), "timeout") << "no message";
}

TEST_P(CamSrcSourceTest, StartsAndStopsManyTimes) {
  CameraPipeline camera("rig=" + rig() + " num-buffers=2");
  for (int i = 0; i < 50; ++i) {
    camera.frames.clear();
    ASSERT_EQ(camera.play(), "EOS") << i;
    ASSERT_EQ(camera.frames.size(), 2u) << i;
  }
  // A thread of a decoder may hold a reference for a moment longer.
  EXPECT_TRUE(eventually([&] { return GST_OBJECT_REFCOUNT_VALUE(camera.camera()) == 2; })) << "the pipeline's and ours";
}

TEST_P(CamSrcSourceTest, LoopsWithContinuousRunningTime) {
  constexpr int kWanted = 2 * kFrames + 3;
  CameraPipeline camera("rig=" + rig() + " loop=true num-buffers=" + std::to_string(kWanted));
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
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), "flush-start"), 0) << "the stream continues";
  EXPECT_EQ(std::count(camera.items.begin(), camera.items.end(), "eos"), 1);
}

TEST_P(CamSrcSourceTest, EosEventEndsTheStream) {
  CameraPipeline camera("rig=" + rig() + " loop=true");
  ASSERT_TRUE(camera.reach(GST_STATE_PLAYING));
  EXPECT_TRUE(gst_element_send_event(camera.pipeline(), gst_event_new_eos()));
  EXPECT_EQ(camera.wait(), "EOS");
}

TEST_P(CamSrcSourceTest, LiveFramesArriveOnTime) {
  constexpr int kRate = 40, kWanted = 11;
  CameraPipeline camera("rig=" + rig() + " is-live=true loop=true framerate=40/1 num-buffers=11");
  ASSERT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  const auto start = std::chrono::steady_clock::now();
  ASSERT_EQ(camera.set_state(GST_STATE_PLAYING), GST_STATE_CHANGE_ASYNC);
  ASSERT_EQ(gst_element_get_state(camera.pipeline(), nullptr, nullptr, 10 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);

  g_autoptr(GstQuery) query = gst_query_new_latency();
  ASSERT_TRUE(gst_pad_peer_query(camera.pad(), query));
  gboolean live = FALSE;
  GstClockTime latency = 0;
  gst_query_parse_latency(query, &live, &latency, nullptr);
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
        << "clock time of the displayed frame";
}

// --- Elements --------------------------------------------------------------------------------------------------------

class CamSrcElementsTest : public CamSrcTest {};

TEST_F(CamSrcElementsTest, AreParsedLikeGstLaunch) {
  for (const char* source :
       {"videotestsrc pattern=white", "videotestsrc pattern=white ! video/x-raw,framerate=30/1",
        "videotestsrc pattern=white ! video/x-raw , width=64 ", "videotestsrc pattern=white ! jpegenc",
        "videotestsrc pattern=white is-live=true ! queue"}) {
    CameraPipeline camera("num-buffers=3 rig=" + rig_with_source(source));
    ASSERT_EQ(camera.play(), "EOS") << source;
    EXPECT_EQ(camera.info.width, CameraFiles::kWidth) << "requests the rig's size";
    ASSERT_EQ(camera.frames.size(), 3u) << source;
    EXPECT_GE(camera.frames[0].level, 230) << source;
  }
}

TEST_F(CamSrcElementsTest, MayContainDemuxersAndDecoders) {
  const std::string file = "filesrc location=\"" + files->path("mjpeg.avi") + "\" ! ";
  for (const char* rest : {"decodebin", "avidemux", "avidemux ! jpegdec", "avidemux ! image/jpeg"}) {
    CameraPipeline camera("rig=" + rig_with_source(file + rest));
    ASSERT_EQ(camera.play(), "EOS") << rest;
    EXPECT_EQ(camera.frames.size(), static_cast<size_t>(kFrames)) << rest;
  }
}

TEST_F(CamSrcElementsTest, AreLiveIfTheirSourceIsLive) {
  CameraPipeline camera("num-buffers=2 rig=" + rig_with_source("videotestsrc is-live=true ! identity"));
  EXPECT_EQ(camera.set_state(GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  EXPECT_EQ(camera.play(), "EOS");
}

TEST_F(CamSrcElementsTest, ErrorsNameThePlace) {
  const std::pair<const char*, const char*> cases[] = {
      {"nosuchelement property=1", "no element \"nosuchelement\""},
      {"videotestsrc none=1", "no property \"none\""},
      {"videotestsrc ! ! identity", "syntax error"},
      {"videotestsrc ! fakesink", "could not link"},
      {"identity ! identity", "no source element"},
      {"videotestsrc ! video/x-raw,width=32", "64x48"},
  };
  for (const auto& [source, text] : cases) {
    const std::string error = CameraPipeline("trusted=true rig=" + rig_with_source(source)).play();
    EXPECT_THAT(error, AllOf(HasSubstr("camera 0 (cam_0): "), HasSubstr(text)));
  }
}

TEST_F(CamSrcElementsTest, UnlistedElementsNeedTrust) {
  const std::string written = files->path("written-by-the-rig");
  const std::string picture = "videotestsrc num-buffers=3 ! video/x-raw,format=RGB,width=64,height=48 ! ";
  const std::string writes = "tee name=t t. ! queue ! filesink location=\"" + written + "\" t. ! queue";
  const std::string error = CameraPipeline("rig=" + rig_with_source(picture + writes)).play();
  EXPECT_THAT(error, AllOf(mentions("camera 0", "cam_0", "tee"), HasSubstr("trusted=true")));
  EXPECT_FALSE(std::filesystem::exists(written));
  EXPECT_EQ(CameraPipeline("trusted=true rig=" + rig_with_source(picture + writes)).play(), "EOS");
  EXPECT_TRUE(std::filesystem::exists(written)) << "otherwise the test proves nothing";
  std::filesystem::remove(written);
  EXPECT_EQ(CameraPipeline("rig=" + rig_with_source(picture + "videoconvert ! queue")).play(), "EOS");
}

// A rig that refers to itself would open light fields recursively.
TEST_F(CamSrcElementsTest, OtherLightFieldsNeedTrustAndDoNotNest) {
  const std::string itself = "lf://" + files->path("rig.json");
  EXPECT_THAT(CameraPipeline("rig=" + rig_with_source(itself)).play(), mentions("URI", "light field"));
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + rig_with_source(itself)).play(), mentions("URI", "light field"));
  const std::string described = "lfviewsrc trusted=true rig=\"" + files->path("rig.json") + "\" ! identity";
  EXPECT_THAT(CameraPipeline("trusted=true rig=" + rig_with_source(described)).play(), mentions("rig", "itself"));
}

TEST_F(CamSrcElementsTest, NeedARigThatOthersCannotWrite) {
  const std::string path = rig_with_source("videotestsrc num-buffers=3 ! identity");
  std::filesystem::permissions(path, std::filesystem::perms::others_write, std::filesystem::perm_options::add);
  EXPECT_THAT(CameraPipeline("rig=" + path).play(), mentions("written", "other users"));
  std::filesystem::permissions(path, std::filesystem::perms::others_write, std::filesystem::perm_options::remove);
  EXPECT_EQ(CameraPipeline("rig=" + path).play(), "EOS");
  const std::string no_elements = rig_with_source("mjpeg.mkv");
  std::filesystem::permissions(no_elements, std::filesystem::perms::others_write, std::filesystem::perm_options::add);
  EXPECT_EQ(CameraPipeline("rig=" + no_elements).play(), "EOS");
}

// --- Damaged, incomplete and unusual files: stills, image sequences and films ----------------------------------------

class CamSrcFilesTest : public CamSrcTest {
 protected:
  static void cut(const std::string& name, double share) {
    std::filesystem::resize_file(
        files->path(name),
        static_cast<uintmax_t>(share * static_cast<double>(std::filesystem::file_size(files->path(name)))));
  }
  // Uniform pictures would compress to files too small to truncate.
  static Image texture(int seed) {
    Image image(PixelFamily::kRgb, CameraFiles::kWidth, CameraFiles::kHeight);
    for (int y = 0; y < image.height(); y++)
      for (int x = 0; x < image.width(); x++)
        for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>((x * 7 + y * 5 * c + seed * 40) % 256);
    return image;
  }
  static void save_texture(const std::string& name, int seed) { save_image(texture(seed), files->path(name)); }
  static std::string read(const std::string& name) { return read_binary(files->path(name)); }
  static void write(const std::string& name, const std::string& bytes) {
    std::ofstream(files->path(name), std::ios::binary) << bytes;
  }
};

TEST_F(CamSrcFilesTest, DamagedPictureLosesOnlyItsFrame) {
  for (const std::string ending : {".png", ".jpg"}) {
    for (int i = 0; i < 6; i++) save_texture("damaged_" + std::to_string(i) + ending, i);
    cut("damaged_4" + ending, 0.5);
    for (const std::string loop : {"false", "true"}) {
      CameraPipeline camera("num-buffers=10 loop=" + loop + " rig=" + rig_with_source("damaged_%d" + ending));
      camera.set_state(GST_STATE_PLAYING);
      ASSERT_EQ(camera.wait(), "EOS");
      EXPECT_THAT(camera.warnings, HasSubstr("damaged_4" + ending)) << "names the file";
      EXPECT_GE(stat(camera.camera(), "damaged"), loop == "true" ? 2u : 1u);
      camera.set_state(GST_STATE_NULL);
      ASSERT_EQ(camera.frames.size(), loop == "true" ? 10u : 5u);
      for (size_t k = 0; k < camera.frames.size(); k++) {
        const size_t place = k / 5 * 6 + (k % 5 == 4 ? 5 : k % 5);  // in the file: frame 4 is missing
        EXPECT_NEAR(camera.frames[k].running_time, place * kPeriod, GST_MSECOND) << k;
        EXPECT_NEAR(camera.frames[k].level, static_cast<int>(place % 6) * 40, ending == ".png" ? 0 : 60) << k;
      }
    }
  }
}

// jpegdec shows the missing part grey.
TEST_F(CamSrcFilesTest, TruncatedJpegLosesOnlyItsFrame) {
  for (int i = 0; i < 6; i++) save_texture("film_" + std::to_string(i) + ".jpg", i);
  cut("film_4.jpg", 0.5);
  const std::string caps = "image/jpeg,parsed=true,framerate=15/1,width=" + std::to_string(CameraFiles::kWidth) +
                           ",height=" + std::to_string(CameraFiles::kHeight);
  const PipelinePtr muxer = launch("appsrc name=in format=time caps=" + caps +
                                   " ! matroskamux ! filesink location=" + files->path("cut.mkv"));
  const ElementPtr in = child_of(muxer.get(), "in");
  gst_element_set_state(muxer.get(), GST_STATE_PLAYING);
  for (int i = 0; i < 6; i++) {
    const BufferPtr buffer(to_buffer(read_bytes(files->path("film_" + std::to_string(i) + ".jpg"))));
    GST_BUFFER_PTS(buffer.get()) = static_cast<GstClockTime>(i) * kPeriod;
    GST_BUFFER_DURATION(buffer.get()) = kPeriod;
    emit(in.get(), "push-buffer", buffer.get());
  }
  emit(in.get(), "end-of-stream");
  ASSERT_EQ(run(muxer.get()), "");

  CameraPipeline camera("rig=" + rig_with_source("cut.mkv"));
  camera.set_state(GST_STATE_PLAYING);
  ASSERT_EQ(camera.wait(), "EOS");
  EXPECT_EQ(stat(camera.camera(), "damaged"), 1u);
  camera.set_state(GST_STATE_NULL);
  ASSERT_EQ(camera.frames.size(), 5u);
  for (size_t k = 0; k < 5; k++)
    EXPECT_NEAR(static_cast<double>(camera.frames[k].running_time), static_cast<double>((k == 4 ? 5 : k) * kPeriod),
                2e6)
        << k;
}

TEST_F(CamSrcFilesTest, OnlyDamagedPicturesAreAnError) {
  for (const std::string ending : {".png", ".jpg"}) {
    for (int i = 0; i < 3; i++) {
      save_texture("broken_" + std::to_string(i) + ending, i);
      cut("broken_" + std::to_string(i) + ending, 0.4);
    }
    for (const std::string source : {"broken_%d", "broken_1"})
      for (const std::string loop : {"false", "true"})
        EXPECT_THAT(CameraPipeline("loop=" + loop + " rig=" + rig_with_source(source + ending)).play(),
                    AllOf(HasSubstr("camera 0 (cam_0): "), HasSubstr("broken_"), HasSubstr("damaged")))
            << source << ending;
  }
}

// gst-launch-1.0 hangs if an error is posted before its main loop runs.
TEST_F(CamSrcFilesTest, ErrorBeforePlayingFailsTheStateChange) {
  save_texture("half.png", 1);
  cut("half.png", 0.4);
  write("nothing.avi", "RIFF and nothing more that could be played");
  for (const std::string source : {"half.png", "nothing.avi"})
    for (const std::string line : {"lfcamsrc rig=", "lfviewsrc is-live=false num-buffers=1 rig="})
      for (int i = 0; i < 5; i++) {
        const PipelinePtr pipeline = launch(line + rig_with_source(source) + " ! fakesink");
        EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << line << source;
      }
}

TEST_F(CamSrcFilesTest, GapInASequenceIsAnError) {
  for (const int i : {0, 1, 3}) save_texture("gap_" + std::to_string(i) + ".png", i);
  EXPECT_THAT(CameraPipeline("rig=" + rig_with_source("gap_%d.png")).play(), HasSubstr("gap_2.png: missing, while "));
}

// rpicam-vid --codec mjpeg and v4l2-ctl --stream-to write such files.
TEST_F(CamSrcFilesTest, ConcatenatedJpegsAreAStream) {
  std::string film;
  for (int k = 0; k < kFrames; k++) film += read("jpeg_0" + std::to_string(k) + ".jpg") + std::string(k % 2 * 20, '\0');
  write("film.mjpeg", film);
  const std::string rig = rig_with_source("film.mjpeg");
  for (const int rounds : {1, 3}) {
    CameraPipeline camera("loop=" + std::string(rounds > 1 ? "true" : "false") +
                          " num-buffers=" + std::to_string(rounds * kFrames) + " rig=" + rig);
    ASSERT_EQ(camera.play(), "EOS");
    ASSERT_EQ(camera.frames.size(), static_cast<size_t>(rounds * kFrames));
    for (size_t k = 0; k < camera.frames.size(); k++) {
      EXPECT_NEAR(camera.frames[k].level, CameraFiles::grey_of(static_cast<int>(k) % kFrames), 2) << k;
      EXPECT_NEAR(camera.frames[k].running_time, k * kPeriod, GST_MSECOND) << k;
    }
  }
  CameraPipeline sought("rig=" + rig);
  ASSERT_TRUE(sought.reach(GST_STATE_PAUSED));
  ASSERT_TRUE(gst_element_seek_simple(sought.pipeline(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, 4 * kPeriod));
  sought.frames.clear();
  ASSERT_EQ(sought.play(), "EOS");
  ASSERT_GE(sought.frames.size(), 2u);
  EXPECT_NEAR(sought.frames.back().level, CameraFiles::grey_of(5), 2);
  EXPECT_NEAR(sought.frames.back().capture_time, 5 * kPeriod, GST_MSECOND);
  EXPECT_EQ(run("lfcamsrc decode=false rig=" + rig + " ! image/jpeg ! jpegdec ! fakesink sync=false"), "");
}

// Sets the transformation matrix in an MP4 track header.
void set_matrix(std::string& mp4, const std::vector<int32_t>& rotation) {
  const size_t header = mp4.find("tkhd");
  ASSERT_NE(header, std::string::npos);
  const size_t matrix = header + 4 + (mp4[header + 4] ? 52 : 40);
  const auto put = [&](size_t at, int32_t value) {
    for (int i = 0; i < 4; i++) mp4[at + i] = static_cast<char>(static_cast<uint32_t>(value) >> (24 - 8 * i));
  };
  for (size_t i = 0; i < rotation.size(); i++) put(matrix + 4 * i, rotation[i] * 0x10000);
  put(matrix + 32, 0x40000000);
}

TEST_F(CamSrcFilesTest, VideosAreRotatedByTheirMetadata) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  run_to_end(
      "videotestsrc num-buffers=4 pattern=white ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! "
      "videobox bottom=24 ! videobox bottom=-24 fill=black ! videoconvert ! " +
      CameraFiles::h264_encoder() + " ! h264parse ! mp4mux ! filesink location=" + files->path("up.mp4"));
  const std::string up = read("up.mp4");
  struct Case {
    const char* name;
    std::vector<int32_t> matrix;
    int width, height;
    bool white;
  };
  for (const Case& c : {Case{"up", {1, 0, 0, 0, 1, 0}, 64, 48, true}, Case{"down", {-1, 0, 0, 0, -1, 0}, 64, 48, false},
                        Case{"right", {0, 1, 0, -1, 0, 0}, 48, 64, false}}) {
    SCOPED_TRACE(c.name);
    std::string turned = up;
    set_matrix(turned, c.matrix);
    write("turned.mp4", turned);
    const std::string rig = rig_with([&](Camera& camera) {
      camera.source = "turned.mp4";
      camera.width = c.width;
      camera.height = c.height;
    });
    CameraPipeline camera("rig=" + rig);
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.info.width, c.width);
    ASSERT_EQ(camera.frames.size(), 4u);
    EXPECT_EQ(camera.frames[0].level > 128, c.white);
  }
}

TEST_F(CamSrcFilesTest, ExifOrientationIsReportedAndIgnored) {
  using namespace std::string_literals;
  std::string jpeg = read("jpeg_02.jpg");
  jpeg.insert(2, "\xff\xe1\0\x22"s + "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"s);
  write("turned.jpg", jpeg);
  CameraPipeline camera("num-buffers=1 rig=" + rig_with_source("turned.jpg"));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_THAT(camera.warnings, mentions("90 degrees", "orientation 6"));
  EXPECT_EQ(camera.info.width, CameraFiles::kWidth);
}

TEST_F(CamSrcFilesTest, UnsupportedJpegIsAnErrorAtOnce) {
  std::string jpeg = read("jpeg_00.jpg");
  jpeg[jpeg.find("\xff\xc0") + 4] = 12;  // bits per sample
  for (int i = 0; i < 3; i++) write("deep_" + std::to_string(i) + ".jpg", jpeg);
  for (const std::string decode : {"true", "false"})
    EXPECT_THAT(CameraPipeline("decode=" + decode + " rig=" + rig_with_source("deep_%d.jpg")).play(),
                HasSubstr("precision 12"));
}

// GStreamer's own message does not name the missing plug-in.
TEST_F(CamSrcFilesTest, UndecodableStillNamesFormatAndRemedy) {
  const auto play = [&](const std::string& image) {
    return CameraPipeline("num-buffers=2 rig=" + files->save("still.json", 1,
                                                             [&](Camera& camera) {
                                                               camera.image = image;
                                                               camera.source.clear();
                                                             }))
        .play();
  };
  write("page.jpg", "<!DOCTYPE html>\n<html><head><title>404</title></head><body>Not found</body></html>\n");
  EXPECT_THAT(play("page.jpg"), AllOf(HasSubstr("page.jpg"), HasSubstr("not an image")));
  save_tiff(texture(1), files->path("still.tif"));
  const bool has_decoder = still_decoding_problem(files->path("still.tif")).empty();
  EXPECT_THAT(play("still.tif"),
              has_decoder ? testing::Matcher<std::string>("EOS")
                          : AllOf(HasSubstr("still.tif"), HasSubstr("image/tiff"), HasSubstr("JPEG or PNG")));
}

// The built-in scene would appear as a ghost in every view.
TEST_F(CamSrcFilesTest, CameraWithoutPicturesIsReported) {
  for (const char* source : {"mjpeg.mkv", ""}) {
    CameraPipeline camera("num-buffers=2 camera=1 rig=" + files->save("two.json", 2, [&](Camera& camera) {
      camera.image.clear();
      camera.source = camera.id == 1 ? "" : source;
    }));
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.warnings.find("nor a source") != std::string::npos, *source != 0) << camera.warnings;
  }
}

TEST_F(CamSrcFilesTest, AnyFileNameWorks) {
  for (const std::string name :
       {"100%_cam.mkv", "cam%201.mkv", "cam-12:30:05.mkv", "take ! two.mkv", "take run=3.mkv"}) {
    std::filesystem::copy(files->path("mjpeg.mkv"), files->path(name));
    EXPECT_EQ(CameraPipeline("num-buffers=2 rig=" + rig_with_source(name)).play(), "EOS") << name;
  }
}

}  // namespace
}  // namespace lf::test
