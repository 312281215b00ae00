// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_file.h"

#include <sys/resource.h>

#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using namespace std::string_literals;

Image gradient(int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      uint8_t* pixel = image.pixel(x, y);
      pixel[0] = static_cast<uint8_t>(40 * x);
      pixel[1] = static_cast<uint8_t>(40 * y);
      pixel[2] = 200;
    }
  return image;
}

std::string big_endian(uint32_t value) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(value >> shift);
  return text;
}
std::string little_endian(uint32_t value) {
  const std::string text = big_endian(value);
  return {text.rbegin(), text.rend()};
}

// Header of a PNG file; there are no pixels.
std::string png_header(uint32_t width, uint32_t height) {
  return "\x89PNG\r\n\x1a\n"s + big_endian(13) + "IHDR" + big_endian(width) + big_endian(height) + "\x08\x02\0\0\0"s;
}

TEST(ImageFile, ReadsTheSizeAndThePixelsOfAllFormats) {
  const TempDir dir;
  const Image image = gradient(6, 5);
  std::vector<uint8_t> bgr = image.data();
  for (size_t i = 0; i < bgr.size(); i += 3) std::swap(bgr[i], bgr[i + 2]);
  const cv::Mat pixels(5, 6, CV_8UC3, bgr.data());
  for (const char* ending : {".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm", ".hdr"}) {
    cv::Mat coded = pixels;
    if (ending == ".hdr"s) pixels.convertTo(coded, CV_32FC3, 1 / 255.0);
    const std::string path = dir / ("picture"s + ending);
    ASSERT_TRUE(cv::imwrite(path, coded)) << path;
    EXPECT_EQ(load_image_size(path), (ImageSize{6, 5})) << path;
    const Image read = load_image(path);
    ASSERT_EQ(read.width(), 6) << path;
    const int near = ending == ".png"s || ending == ".bmp"s || ending == ".tif"s || ending == ".ppm"s ? 0 : 60;
    for (size_t i = 0; i < read.data().size(); i++) ASSERT_NEAR(read.data()[i], image.data()[i], near) << path;
  }
}

TEST(ImageFile, SavesWhatItReads) {
  const TempDir dir;
  save_image(gradient(6, 5), dir / "a.png");
  EXPECT_EQ(load_image(dir / "a.png").data(), gradient(6, 5).data());
  EXPECT_ERROR(save_image(gradient(6, 5), dir / "none/a.png"), "none/a.png: can't be written");
  EXPECT_ERROR(save_image(gradient(6, 5), dir / "a.unknown"), "a.unknown: ");
}

TEST(ImageFile, RefusesHugeSizesBeforeItDecodes) {
  const TempDir dir;
  struct Case {
    const char* name;
    std::string bytes;
    const char* said;
  };
  const std::string bmp = "BM"s + little_endian(100) + little_endian(0) + little_endian(54) + little_endian(40);
  const std::string tif = "II*\0\x08\0\0\0\x02\0"s + "\0\x01\x04\0\x01\0\0\0"s + little_endian(30000) +
                          "\x01\x01\x04\0\x01\0\0\0"s + little_endian(30000);
  for (const Case& c : {
           Case{"a.png", png_header(32000, 32000), "32000x32000"},
           {"b.png", png_header(0x7fffffff, 0x7fffffff), "2147483647x2147483647"},
           {"a.ppm", "P6 30000 30000 255\n", "30000x30000"},
           {"a.pgm", "P5 # text\n 2147483647\n2147483647 65535\n", "2147483647x2147483647"},
           {"a.pfm", "PF\n30000 30000\n-1.0\n", "30000x30000"},
           {"a.bmp", bmp + little_endian(30000) + little_endian(static_cast<uint32_t>(-30000)), "30000x30000"},
           {"a.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 20000\n", "20000x30000"},
           {"a.jpg", "\xff\xd8\xff\xe0\0\4\0\0\xff\xc0\0\x0b\x08\xff\xff\xff\xf0"s, "65520x65535"},
           {"a.tif", tif, "30000x30000"},
           {"a.webp", "RIFF\0\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0\xff\xff\xff\xff\xff\xff"s, "16777216x16777216"},
       }) {
    dir.write(c.name, c.bytes);
    EXPECT_ERROR(load_image_size(dir / c.name), std::string(c.name) + ": is " + c.said + " pixels: at most");
    EXPECT_ERROR(load_image(dir / c.name), c.said);
  }
}

// Memory would be touched if the decoder ran.
TEST(ImageFile, ASizeThatIsNotExpectedCostsNoMemory) {
  const TempDir dir;
  dir.write("a.png", png_header(12000, 12000));
  struct rusage before {
  }, after{};
  getrusage(RUSAGE_SELF, &before);
  EXPECT_ERROR(load_image_of_size(dir / "a.png", {640, 480}), "a.png: has 12000x12000 pixels, the rig says 640x480");
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 100000) << "kB";
}

TEST(ImageFile, RefusesOtherFilesAndCutHeaders) {
  const TempDir dir;
  for (const std::string& bytes :
       {""s, "hello"s, "P"s, "P6"s, "P6 640"s, "\x89PNG\r\n\x1a\n"s, png_header(8, 8).substr(0, 22), "\xff\xd8\xff"s,
        "\xff\xd8\xff\xe0\xff\xff"s, "BM"s, "II*\0"s, "II*\0\xff\xff\xff\xff"s, "RIFF1234WEBP"s, "RIFF1234WEBPVP8 "s,
        "#?RADIANCE\n"s, "#?RADIANCE\n\n-Y"s, "P6 -3 5 255\n"s, "P6 0 0 255\n"s, "<VRTDataset/>"s}) {
    dir.write("file", bytes);
    EXPECT_ERROR(load_image(dir / "file"), "file: not an image that can be read");
  }
  EXPECT_ERROR(load_image(dir / "none"), "none: no such image file");
  EXPECT_ERROR(load_image("/dev/zero"), "/dev/zero: can't be read: it is not a regular file");
}

}  // namespace
}  // namespace lf
