// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_source.h"
#include "image/image.h"
#include "rig/still_image_cache.h"
#include "support/expect_error.h"
#include "support/jpeg_samples.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

using Kind = CameraSource::Kind;

const std::string kPng = "\x89PNG\r\n\x1a\n and more", kMatroska = "\x1a\x45\xdf\xa3 and more";

std::string jpeg(unsigned seed, int height = 16) {
  const auto bytes = test::encode_jpeg(test::noisy_picture(32, height, seed), {});
  return {bytes.begin(), bytes.end()};
}

class CameraSourceTest : public testing::Test {
 protected:
  void SetUp() override { rig_.directory = dir_.path(); }
  CameraSource find(const std::string& source) const { return find_source(rig_, source, false); }
  void add_camera(const std::string& source) { rig_.cameras.emplace_back().source = source; }
  TempDir dir_;
  Rig rig_;
};

TEST_F(CameraSourceTest, ExistingFilesTakePrecedence) {
  for (const char* name : {"plain.mkv", "with space.mkv", "100%_cam.mkv", "cam%201.mkv", "cam-12:30:05.mkv",
                           "2024-05-19 20:23:45.mkv", "take ! two.mkv", "take run=3.mkv", "-dash.mkv", "#1.mkv",
                           "gr\xc3\xbcn.mkv", "back\\slash.mkv", "%d.mkv", "file:x.mkv"}) {
    dir_.write(name, kMatroska);
    const CameraSource source = find(name);
    EXPECT_EQ(source.kind, Kind::kMatroska) << name;
    EXPECT_EQ(source.location, dir_ / name);
    EXPECT_EQ(find_source(rig_, name, true).kind, Kind::kStill) << name;
  }
}

TEST_F(CameraSourceTest, KindOfOtherSourcesFollowsFromTheText) {
  EXPECT_EQ(find("rtsp://host/a ! b").kind, Kind::kUri);
  EXPECT_EQ(find("v4l2:///dev/video0").kind, Kind::kUri);
  EXPECT_EQ(find("testbin:videotestsrc").kind, Kind::kUri);
  EXPECT_EQ(find("videotestsrc ! identity").kind, Kind::kBin);
  EXPECT_EQ(find("videotestsrc pattern=white").kind, Kind::kBin);
  EXPECT_EQ(find_camera_source(rig_, Camera{}).kind, Kind::kScene);
}

TEST_F(CameraSourceTest, FileUrisAreDecoded) {
  dir_.write("a b%.mkv", kMatroska);
  for (const std::string scheme : {"file://", "file://localhost", "file:"})
    EXPECT_EQ(find(scheme + dir_.path() + "/a%20b%25.mkv").location, dir_ / "a b%.mkv");
  EXPECT_ERROR(find("file://a.mkv"), "file URI", "absolute path");
  EXPECT_ERROR(find("file:///a%2"), "file URI", "absolute path");
  EXPECT_ERROR(find("file:///a%00b"), "file URI", "absolute path");
}

TEST_F(CameraSourceTest, MissingFilesAreNamedWithAdvice) {
  dir_.write("cam 1.mkv", kMatroska);
  std::filesystem::create_directory(dir_ / "folder");
  EXPECT_ERROR(find("none.mkv"), dir_ / "none.mkv", "no such");
  EXPECT_ERROR(find("folder"), dir_ / "folder", "not a file");
  EXPECT_ERROR(find("folder\\cam.mkv"), "folders", "back-slashes");
  EXPECT_ERROR(find("\xef\xbb\xbf"
                    "cam 1.mkv"),
               "byte order mark");
  EXPECT_ERROR(find("cam 1.mkv\r"), "ends", "white space");
  EXPECT_ERROR(find_source(rig_, "cam%201.mkv", true), "cam 1.mkv", "percent-encoded");
  EXPECT_ERROR(find("100%_none.mkv"), "no such", "image sequence", "one %d");
}

TEST_F(CameraSourceTest, KindOfFilesFollowsFromTheContent) {
  dir_.write("png", kPng);
  dir_.write("jpeg", jpeg(1));
  dir_.write("stream", jpeg(1) + jpeg(2) + jpeg(3));
  dir_.write("other", "anything else");
  EXPECT_EQ(find("png").codec, CameraSource::Codec::kPng);
  EXPECT_EQ(find("jpeg").kind, Kind::kStill);
  EXPECT_EQ(find("stream").kind, Kind::kJpegStream);
  EXPECT_EQ(find_source(rig_, "stream", true).kind, Kind::kStill) << "an image is a still";
  EXPECT_EQ(find("other").kind, Kind::kFile);
}

TEST_F(CameraSourceTest, SequencesHaveNoGaps) {
  for (const char* name : {"a_0.png", "a_1.png", "a_2.png", "b_01.png", "b_02.png", "c_0.png", "c_2.png", "d_2.png"})
    dir_.write(name, kPng);
  const CameraSource a = find("a_%d.png"), b = find("b_%02d.png");
  EXPECT_EQ(a.kind, Kind::kSequence);
  EXPECT_EQ(a.first, 0);
  EXPECT_EQ(a.count, 3);
  EXPECT_EQ(sequence_file(a, 2), dir_ / "a_2.png");
  EXPECT_EQ(b.first, 1);
  EXPECT_EQ(b.count, 2);
  EXPECT_ERROR(find("c_%d.png"), dir_ / "c_1.png", "missing", dir_ / "c_2.png");
  EXPECT_ERROR(find("d_%d.png"), "no such", "0 or 1");
  EXPECT_ERROR(find("%d_%d.png"), "exactly one %d");
}

// A camera without its first picture would be one picture ahead.
TEST_F(CameraSourceTest, MissingFirstPictureIsAnError) {
  for (const char* name : {"a_0.png", "a_1.png", "a_2.png", "b_1.png", "b_2.png", "c_1.png", "c_2.png", "c_3.png"})
    dir_.write(name, kPng);
  for (const char* source : {"a_%d.png", "b_%d.png", "c_%d.png"}) add_camera(source);
  EXPECT_EQ(find_camera_source(rig_, rig_.cameras[0]).count, 3);
  EXPECT_ERROR(find_camera_source(rig_, rig_.cameras[1]), dir_ / "b_0.png", "missing", "other cameras");
  EXPECT_EQ(find_camera_source(rig_, rig_.cameras[2]).count, 3) << "counted from 1";
}

Rig three_cameras(const std::string& directory) {
  Rig rig = test::camera_grid(1, 3, 0.1, 32, 24, 30, 100);
  for (int i = 0; i < 3; i++) rig.cameras[i].image = "cam_" + std::to_string(i) + ".png";
  rig.directory = directory;
  return rig;
}

Image picture(int seed, int width = 32, int height = 24) {
  Image image(PixelFamily::kRgb, width, height);
  for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>((i * 37 + seed * 91) % 251);
  return image;
}

TEST(StillImageCache, LoadsOnDemandAndLimitsMemory) {
  const TempDir dir;
  Rig rig = three_cameras(dir.path());
  for (int i = 0; i < 3; i++) save_image(picture(i), dir / rig.cameras[i].image);
  StillImageCache images(rig, PixelFamily::kRgb, 2 * 32 * 24 * 3);
  for (CameraIndex i = 0; i < 3; i++) EXPECT_EQ(images.get(i).data(), picture(static_cast<int>(i)).data());
  for (int i = 0; i < 3; i++) std::filesystem::remove(dir / rig.cameras[i].image);
  EXPECT_EQ(images.get(1).data(), picture(1).data());
  EXPECT_EQ(images.get(2).data(), picture(2).data());
  EXPECT_ERROR(images.get(0), "no such image");  // evicted before
}

TEST(StillImageCache, HasImagesIfEveryCameraNamesOne) {
  Rig rig = three_cameras("");
  EXPECT_TRUE(has_images(rig));
  rig.cameras[1].image = "";
  EXPECT_FALSE(has_images(rig));
}

TEST(StillImageCache, ReturnsI420IfRequested) {
  const TempDir dir;
  const Rig rig = three_cameras(dir.path());
  save_image(picture(0), dir / "cam_0.png");
  EXPECT_EQ(StillImageCache(rig, PixelFamily::kI420).get(0).data(), to_i420(picture(0)).data());
}

TEST(StillImageCache, RotatedImagesAreReported) {
  using namespace std::string_literals;
  const TempDir dir;
  Rig rig = three_cameras(dir.path());
  std::string rotated = jpeg(1, 24);
  for (Camera& camera : rig.cameras) camera.image = "upright.jpg";
  dir.write("upright.jpg", rotated);
  EXPECT_EQ(orientation_notice(rig), "");
  // an EXIF segment with orientation 3, rotated by 180 degrees
  rotated.insert(2, "\xff\xe1\0\x22"s + "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0"s);
  dir.write("rotated.jpg", rotated);
  rig.cameras[1].image = rig.cameras[2].image = "rotated.jpg";
  EXPECT_EQ(orientation_notice(rig).find("cameras[1].image: " + dir / "rotated.jpg" + ": "), 0u);
  EXPECT_TRUE(orientation_notice(rig).ends_with("; 1 more"));
  rig.cameras[1].width = 24;
  rig.cameras[1].height = 32;
  EXPECT_ERROR(StillImageCache(rig).get(1), "EXIF");
}

TEST(StillImageCache, ErrorsNameCameraAndFile) {
  const TempDir dir;
  Rig rig = three_cameras(dir.path());
  rig.cameras[0].image = "";
  save_image(picture(0, 31, 24), dir / "cam_2.png");
  StillImageCache images(rig);
  EXPECT_ERROR(images.get(0), "camera 100", "no image");
  EXPECT_ERROR(images.get(1), "camera 101: " + dir / "cam_1.png");
  EXPECT_ERROR(images.get(2), "camera 102", dir / "cam_2.png", "31x24", "32x24");
}

}  // namespace
}  // namespace lf
