// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_source.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/jpeg_samples.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using Kind = CameraSource::Kind;

const std::string kPng = "\x89PNG\r\n\x1a\n and more", kMatroska = "\x1a\x45\xdf\xa3 and more";

std::string jpeg(unsigned seed) {
  const auto bytes = test::encode_jpeg(test::noisy_picture(32, 16, seed), {});
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

// Names that look like patterns, URIs and elements.
TEST_F(CameraSourceTest, AnyNameOfAFileIsThatFile) {
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

TEST_F(CameraSourceTest, WhatIsNoFileIsToldByItsText) {
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
  EXPECT_ERROR(find("file://a.mkv"), "not a file URI with an absolute path");
  EXPECT_ERROR(find("file:///a%2"), "not a file URI with an absolute path");
  EXPECT_ERROR(find("file:///a%00b"), "not a file URI with an absolute path");
}

TEST_F(CameraSourceTest, MissingFilesAreNamedWithAdvice) {
  dir_.write("cam 1.mkv", kMatroska);
  std::filesystem::create_directory(dir_ / "folder");
  EXPECT_ERROR(find("none.mkv"), dir_ / "none.mkv" + ": no such file");
  EXPECT_ERROR(find("folder"), dir_ / "folder" + ": not a file");
  EXPECT_ERROR(find("folder\\cam.mkv"), "folders are separated by /, not by back-slashes");
  EXPECT_ERROR(find("\xef\xbb\xbf"
                    "cam 1.mkv"),
               "begins with a byte order mark");
  EXPECT_ERROR(find("cam 1.mkv\r"), "ends with white space");
  EXPECT_ERROR(find_source(rig_, "cam%201.mkv", true), "\"cam 1.mkv\" exists: names of files are not percent-encoded");
  EXPECT_ERROR(find("100%_none.mkv"), "no such file, and an image sequence has exactly one %d");
}

TEST_F(CameraSourceTest, KindsAreToldByContent) {
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
  EXPECT_ERROR(find("c_%d.png"), dir_ / "c_1.png" + ": missing, while " + dir_ / "c_2.png" + " exists");
  EXPECT_ERROR(find("d_%d.png"), "no such files (the first number is 0 or 1)");
  EXPECT_ERROR(find("%d_%d.png"), "exactly one %d");
}

// A camera that has lost its first picture would be one picture early.
TEST_F(CameraSourceTest, AFirstPictureThatOthersHaveIsMissing) {
  for (const char* name : {"a_0.png", "a_1.png", "a_2.png", "b_1.png", "b_2.png", "c_1.png", "c_2.png", "c_3.png"})
    dir_.write(name, kPng);
  for (const char* source : {"a_%d.png", "b_%d.png", "c_%d.png"}) add_camera(source);
  EXPECT_EQ(find_camera_source(rig_, rig_.cameras[0]).count, 3);
  EXPECT_ERROR(find_camera_source(rig_, rig_.cameras[1]), dir_ / "b_0.png" + ": missing, while the other cameras'");
  EXPECT_EQ(find_camera_source(rig_, rig_.cameras[2]).count, 3) << "counted from 1";
}

}  // namespace
}  // namespace lf
