// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Damaged, incomplete and unusual files: stills, image sequences and films.
#include <gmock/gmock.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "gst/camera_fixture.h"
#include "gst/camera_pipeline.h"
#include "gst/gst_test.h"
#include "image/image.h"

namespace lf::test {
namespace {

using ::testing::HasSubstr;

class CamSrcFilesTest : public CamSrcTest {
 protected:
  static std::string rig_of(const std::string& source) {
    return rig_with([&](Camera& camera) { camera.source = source; });
  }
  // The first `share` of a file.
  static void cut(const std::string& name, double share) {
    std::filesystem::resize_file(
        files->path(name),
        static_cast<uintmax_t>(share * static_cast<double>(std::filesystem::file_size(files->path(name)))));
  }
  // Pictures that are no single grey, so that their files have an inside.
  static void save_texture(const std::string& name, int seed) {
    Image image(PixelFamily::kRgb, CameraFiles::kWidth, CameraFiles::kHeight);
    for (int y = 0; y < image.height(); y++)
      for (int x = 0; x < image.width(); x++)
        for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>((x * 7 + y * 5 * c + seed * 40) % 256);
    save_image(image, files->path(name));
  }
  static std::string read(const std::string& name) {
    std::ifstream file(files->path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void write(const std::string& name, const std::string& bytes) {
    std::ofstream(files->path(name), std::ios::binary) << bytes;
  }
};

guint64 count_of_damaged(CameraPipeline& camera) {
  GstStructure* taken = nullptr;
  g_object_get(camera.camera(), "stats", &taken, nullptr);
  const StructurePtr stats(taken);
  guint64 damaged = 0;
  EXPECT_TRUE(gst_structure_get_uint64(stats.get(), "damaged", &damaged));
  return damaged;
}

TEST_F(CamSrcFilesTest, ADamagedPictureCostsItsOwnFrame) {
  for (const std::string ending : {".png", ".jpg"}) {
    for (int i = 0; i < 6; i++) save_texture("damaged_" + std::to_string(i) + ending, i);
    cut("damaged_4" + ending, 0.5);
    for (const std::string loop : {"false", "true"}) {
      CameraPipeline camera("num-frames=10 loop=" + loop + " rig=" + rig_of("damaged_%d" + ending));
      camera.set_state(GST_STATE_PLAYING);
      ASSERT_EQ(camera.wait(), "EOS");
      EXPECT_THAT(camera.warnings, HasSubstr("damaged_4" + ending)) << "the file is named";
      EXPECT_GE(count_of_damaged(camera), loop == "true" ? 2u : 1u);
      camera.set_state(GST_STATE_NULL);
      ASSERT_EQ(camera.frames.size(), loop == "true" ? 10u : 5u);
      for (size_t k = 0; k < camera.frames.size(); k++) {
        const size_t place = k / 5 * 6 + (k % 5 == 4 ? 5 : k % 5);  // in the film: number 4 has no frame
        EXPECT_NEAR(camera.frames[k].running_time, place * kPeriod, GST_MSECOND) << k;
        EXPECT_NEAR(camera.frames[k].level, static_cast<int>(place % 6) * 40, ending == ".png" ? 0 : 60) << k;
      }
    }
  }
}

// jpegdec shows the missing part grey.
TEST_F(CamSrcFilesTest, AJpegThatWasCutOffInAFilmCostsItsOwnFrame) {
  for (int i = 0; i < 6; i++) save_texture("film_" + std::to_string(i) + ".jpg", i);
  cut("film_4.jpg", 0.5);
  const std::string caps = "image/jpeg,parsed=true,framerate=15/1,width=" + std::to_string(CameraFiles::kWidth) +
                           ",height=" + std::to_string(CameraFiles::kHeight);
  GstElement* muxer = gst_parse_launch(
      ("appsrc name=in format=time caps=" + caps + " ! matroskamux ! filesink location=" + files->path("cut.mkv"))
          .c_str(),
      nullptr);
  ASSERT_TRUE(muxer);
  g_autoptr(GstElement) in = gst_bin_get_by_name(GST_BIN(muxer), "in");
  gst_element_set_state(muxer, GST_STATE_PLAYING);
  GstFlowReturn flow = GST_FLOW_OK;
  for (int i = 0; i < 6; i++) {
    const std::string bytes = read("film_" + std::to_string(i) + ".jpg");
    GstBuffer* buffer = gst_buffer_new_memdup(bytes.data(), bytes.size());
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(i) * kPeriod;
    GST_BUFFER_DURATION(buffer) = kPeriod;
    g_signal_emit_by_name(in, "push-buffer", buffer, &flow);
    gst_buffer_unref(buffer);
  }
  g_signal_emit_by_name(in, "end-of-stream", &flow);
  g_autoptr(GstBus) bus = gst_element_get_bus(muxer);
  g_autoptr(GstMessage) end = gst_bus_timed_pop_filtered(
      bus, 20 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  ASSERT_TRUE(end && GST_MESSAGE_TYPE(end) == GST_MESSAGE_EOS);
  gst_element_set_state(muxer, GST_STATE_NULL);
  gst_object_unref(muxer);

  CameraPipeline camera("rig=" + rig_of("cut.mkv"));
  camera.set_state(GST_STATE_PLAYING);
  ASSERT_EQ(camera.wait(), "EOS");
  EXPECT_EQ(count_of_damaged(camera), 1u);
  camera.set_state(GST_STATE_NULL);
  ASSERT_EQ(camera.frames.size(), 5u);
  for (size_t k = 0; k < 5; k++)
    EXPECT_NEAR(static_cast<double>(camera.frames[k].running_time), static_cast<double>((k == 4 ? 5 : k) * kPeriod),
                2e6)
        << k;
}

TEST_F(CamSrcFilesTest, WhereNoPictureIsWholeThereIsAnError) {
  for (const std::string ending : {".png", ".jpg"}) {
    for (int i = 0; i < 3; i++) {
      save_texture("broken_" + std::to_string(i) + ending, i);
      cut("broken_" + std::to_string(i) + ending, 0.4);
    }
    for (const std::string source : {"broken_%d", "broken_1"})
      for (const std::string loop : {"false", "true"})
        EXPECT_THAT(CameraPipeline("loop=" + loop + " rig=" + rig_of(source + ending)).play(),
                    ::testing::AllOf(HasSubstr("camera 0 (cam_0): "), HasSubstr("broken_"), HasSubstr("damaged")))
            << source << ending;
  }
}

// gst-launch-1.0 waits for ever after an error that is posted before its loop runs.
TEST_F(CamSrcFilesTest, AnErrorBeforePlayingFailsTheChangeOfState) {
  save_texture("half.png", 1);
  cut("half.png", 0.4);
  write("nothing.avi", "RIFF and nothing more that could be played");
  for (const std::string source : {"half.png", "nothing.avi"})
    for (const std::string line : {"lfcamsrc rig=", "lfviewsrc is-live=false num-buffers=1 rig="})
      for (int i = 0; i < 5; i++) {
        const ElementPtr pipeline = launch(line + rig_of(source) + " ! fakesink");
        ASSERT_TRUE(pipeline);
        EXPECT_EQ(gst_element_set_state(pipeline.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << line << source;
        gst_element_set_state(pipeline.get(), GST_STATE_NULL);
      }
}

TEST_F(CamSrcFilesTest, AGapInASequenceIsAnError) {
  for (const int i : {0, 1, 3}) save_texture("gap_" + std::to_string(i) + ".png", i);
  EXPECT_THAT(CameraPipeline("rig=" + rig_of("gap_%d.png")).play(), HasSubstr("gap_2.png: missing, while "));
}

// rpicam-vid --codec mjpeg and v4l2-ctl --stream-to write such files.
TEST_F(CamSrcFilesTest, JpegPicturesOneBehindAnotherAreAFilm) {
  std::string film;
  for (int k = 0; k < kFrames; k++) film += read("jpeg_0" + std::to_string(k) + ".jpg") + std::string(k % 2 * 20, '\0');
  write("film.mjpeg", film);
  const std::string rig = rig_of("film.mjpeg");
  for (const int rounds : {1, 3}) {
    CameraPipeline camera("loop=" + std::string(rounds > 1 ? "true" : "false") +
                          " num-frames=" + std::to_string(rounds * kFrames) + " rig=" + rig);
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
  const ElementPtr coded = launch("lfcamsrc decode=false rig=" + rig + " ! image/jpeg ! jpegdec ! fakesink sync=false");
  ASSERT_TRUE(coded);
  EXPECT_EQ(run(coded.get()), "");
}

// The matrix in the header of an MP4's track.
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

TEST_F(CamSrcFilesTest, FilmsAreTurnedAsTheySay) {
  if (CameraFiles::h264_encoder().empty()) GTEST_SKIP() << "no encoder and decoder of H.264 are installed";
  // White above, black below.
  run_to_end(
      "videotestsrc num-buffers=4 pattern=white ! video/x-raw,format=I420,width=64,height=48,framerate=15/1 ! "
      "videobox bottom=24 ! videobox bottom=-24 fill=black ! videoconvert ! " +
      CameraFiles::h264_encoder() + " ! h264parse ! mp4mux ! filesink location=" + files->path("up.mp4"));
  const std::string up = read("up.mp4");
  struct Case {
    const char* name;
    std::vector<int32_t> matrix;
    int width, height;
    bool white;  // at the top left
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

TEST_F(CamSrcFilesTest, ExifOrientationIsMentionedAndNotFollowed) {
  using namespace std::string_literals;
  std::string jpeg = read("jpeg_02.jpg");
  jpeg.insert(2, "\xff\xe1\0\x22"s + "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"s);
  write("turned.jpg", jpeg);
  CameraPipeline camera("num-frames=1 rig=" + rig_of("turned.jpg"));
  ASSERT_EQ(camera.play(), "EOS");
  EXPECT_THAT(camera.warnings, HasSubstr("turned by 90 degrees (orientation 6). It is shown as stored"));
  EXPECT_EQ(camera.info.width, CameraFiles::kWidth);
}

TEST_F(CamSrcFilesTest, AKindOfJpegThatNobodyDecodesIsAnErrorAtOnce) {
  std::string jpeg = read("jpeg_00.jpg");
  jpeg[jpeg.find("\xff\xc0") + 4] = 12;  // bits a sample
  for (int i = 0; i < 3; i++) write("deep_" + std::to_string(i) + ".jpg", jpeg);
  for (const std::string decode : {"true", "false"})
    EXPECT_THAT(CameraPipeline("decode=" + decode + " rig=" + rig_of("deep_%d.jpg")).play(), HasSubstr("precision 12"));
}

// The built-in scene would be a ghost in every view.
TEST_F(CamSrcFilesTest, ACameraWithoutPicturesAmongOthersIsMentioned) {
  for (const char* source : {"mjpeg.mkv", ""}) {
    CameraPipeline camera("num-frames=2 camera=1 rig=" + files->save("two.json", 2, [&](Camera& camera) {
      camera.image.clear();
      camera.source = camera.id == 1 ? "" : source;
    }));
    ASSERT_EQ(camera.play(), "EOS");
    EXPECT_EQ(camera.warnings.find("names neither an image nor a source") != std::string::npos, *source != 0)
        << camera.warnings;
  }
}

TEST_F(CamSrcFilesTest, AnyNameIsPlayed) {
  for (const std::string name :
       {"100%_cam.mkv", "cam%201.mkv", "cam-12:30:05.mkv", "take ! two.mkv", "take run=3.mkv"}) {
    std::filesystem::copy(files->path("mjpeg.mkv"), files->path(name));
    EXPECT_EQ(CameraPipeline("num-frames=2 rig=" + rig_of(name)).play(), "EOS") << name;
  }
}

}  // namespace
}  // namespace lf::test
