// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/picture_bytes.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <span>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "support/expect_error.h"
#include "support/jpeg_samples.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes png_of(const cv::Mat& picture) {
  Bytes bytes;
  cv::imencode(".png", picture, bytes);
  return bytes;
}

Bytes noisy_png() {
  const Image image = test::noisy_picture(96, 64, 3);
  return png_of(cv::Mat(64, 96, CV_8UC3, const_cast<uint8_t*>(image.data().data())));
}

Bytes noisy_jpeg(int width = 96, int height = 64, unsigned seed = 3, const test::JpegKind& kind = {}) {
  return test::encode_jpeg(test::noisy_picture(width, height, seed), kind);
}

Bytes first_part(const Bytes& bytes, size_t size) {
  return {bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(size)};
}

// A segment behind the SOI marker.
Bytes with_segment(const Bytes& jpeg, uint8_t marker, const std::string& content) {
  const size_t length = content.size() + 2;
  Bytes segment = {0xff, marker, static_cast<uint8_t>(length >> 8), static_cast<uint8_t>(length)};
  segment.insert(segment.end(), content.begin(), content.end());
  Bytes all = jpeg;
  all.insert(all.begin() + 2, segment.begin(), segment.end());
  return all;
}

std::string exif(char orientation, bool big_endian) {
  using namespace std::string_literals;
  return big_endian ? "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"s + orientation + "\0\0\0\0\0\0"s
                    : "Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"s + orientation + "\0\0\0\0\0\0\0"s;
}

TEST(PictureBytes, DamageIsAnError) {
  for (const Bytes& whole : {noisy_png(), noisy_jpeg(), noisy_jpeg(96, 64, 3, {.progressive = true})}) {
    for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420}) {
      EXPECT_EQ(decode_picture(whole, family).width(), 96);
      for (const size_t size : {whole.size() / 3, whole.size() / 2, whole.size() - 40})
        EXPECT_ERROR(decode_picture(first_part(whole, size), family), "damaged");
    }
    Bytes hole = whole;  // the length kept
    std::fill_n(hole.begin() + static_cast<ptrdiff_t>(whole.size() / 3), whole.size() / 4, 0);
    EXPECT_ERROR(decode_picture(hole, PixelFamily::kRgb), "damaged");
    EXPECT_ERROR(decode_picture(hole, PixelFamily::kI420), "damaged");
  }
  EXPECT_ERROR(decode_picture(Bytes{1, 2, 3, 4}, PixelFamily::kRgb), "neither PNG nor JPEG");
}

void put_be(Bytes& bytes, size_t at, uint32_t value, int size) {
  for (int i = 0; i < size; i++) bytes[at + static_cast<size_t>(i)] = static_cast<uint8_t>(value >> 8 * (size - 1 - i));
}

uint32_t png_crc(std::span<const uint8_t> bytes) {
  uint32_t crc = 0xffffffff;
  for (const uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc;
}

// A file of a few kilobytes may claim 16384 x 16384 pixels.
TEST(PictureBytes, TooManyPixelsAreNotDecoded) {
  Bytes png = noisy_png();
  constexpr size_t kType = 12, kSize = 16, kCrc = 29;
  for (const size_t side : {size_t{0}, size_t{4}}) put_be(png, kSize + side, 16000, 4);
  put_be(png, kCrc, png_crc(std::span(png).subspan(kType, kCrc - kType)), 4);
  EXPECT_ERROR(decode_picture(png, PixelFamily::kRgb), "too many pixels");

  Bytes jpeg = noisy_jpeg();
  constexpr uint8_t kFrame[] = {0xff, 0xc0, 0x00};
  const auto frame = static_cast<size_t>(std::ranges::search(jpeg, kFrame).begin() - jpeg.begin());
  ASSERT_LT(frame, jpeg.size());
  for (const size_t side : {size_t{5}, size_t{7}}) put_be(jpeg, frame + side, 16000, 2);
  EXPECT_ERROR(decode_picture(jpeg, PixelFamily::kRgb), "too few bytes");
  jpeg.resize(1 << 22);
  EXPECT_ERROR(decode_picture(jpeg, PixelFamily::kRgb), "too many pixels");
}

TEST(PictureBytes, PaddingIsNoDamage) {
  Bytes jpeg = noisy_jpeg();
  jpeg.insert(jpeg.end() - 2, 100, 0);  // in front of the EOI marker, as some cameras write it
  EXPECT_EQ(decode_picture(jpeg, PixelFamily::kRgb).width(), 96);
  jpeg.insert(jpeg.end(), 100, 0);
  EXPECT_EQ(decode_picture(jpeg, PixelFamily::kI420).width(), 96);
}

TEST(PictureBytes, EveryKindOfPngGivesItsColours) {
  const auto expect_colour = [](const Bytes& png, int r, int g, int b) {
    const Image image = decode_picture(png, PixelFamily::kI420);
    ASSERT_EQ(image.family(), PixelFamily::kRgb);
    EXPECT_EQ(image.pixel(1, 1)[0], r);
    EXPECT_EQ(image.pixel(1, 1)[1], g);
    EXPECT_EQ(image.pixel(1, 1)[2], b);
  };
  expect_colour(png_of(cv::Mat(4, 6, CV_16UC3, cv::Scalar(100, 0x4000, 65535))), 255, 0x40, 0);
  expect_colour(png_of(cv::Mat(4, 6, CV_16UC4, cv::Scalar(100, 0x4000, 65535, 1000))), 255, 0x40, 0);
  expect_colour(png_of(cv::Mat(4, 6, CV_8UC4, cv::Scalar(10, 20, 30, 40))), 30, 20, 10);
  expect_colour(png_of(cv::Mat(4, 6, CV_16UC1, cv::Scalar(0x4000))), 0x40, 0x40, 0x40);
  expect_colour(png_of(cv::Mat(4, 6, CV_8UC1, cv::Scalar(77))), 77, 77, 77);
}

TEST(PictureBytes, EveryKindOfJpegGivesItsColours) {
  const Image truth = test::noisy_picture(96, 64, 3);
  const test::JpegKind kinds[] = {{.h = 1, .v = 1, .rgb = true},        {.h = 4, .v = 1},      {.h = 1, .v = 2},
                                  {.h = 2, .v = 1, .arithmetic = true}, {.progressive = true}, {.h = 2, .v = 2}};
  for (const test::JpegKind& kind : kinds) {
    SCOPED_TRACE(std::to_string(&kind - kinds));
    const Image rgb = decode_picture(noisy_jpeg(96, 64, 3, kind), PixelFamily::kRgb);
    const Image from_i420 = to_rgb(decode_picture(noisy_jpeg(96, 64, 3, kind), PixelFamily::kI420));
    for (const Image* image : {&rgb, &from_i420}) {
      double error = 0;
      for (size_t i = 0; i < truth.data().size(); i++) error += std::abs(image->data()[i] - truth.data()[i]);
      EXPECT_LT(error / static_cast<double>(truth.data().size()), 12);
    }
  }
}

TEST(PictureBytes, ReadsOrientations) {
  const Bytes jpeg = noisy_jpeg();
  EXPECT_EQ(exif_orientation(jpeg), 1);
  for (const bool big_endian : {false, true}) {
    EXPECT_EQ(exif_orientation(with_segment(jpeg, 0xe1, exif(3, big_endian))), 3);
    EXPECT_EQ(exif_orientation(with_segment(jpeg, 0xe1, exif(8, big_endian))), 8);
    EXPECT_EQ(exif_orientation(with_segment(jpeg, 0xe1, exif(9, big_endian))), 1) << "not an orientation";
    for (size_t length = 0; length < 30; length++)  // cut off anywhere
      EXPECT_EQ(exif_orientation(with_segment(jpeg, 0xe1, exif(3, big_endian).substr(0, length))) & ~3, 0);
  }
  EXPECT_EQ(orientation_notice(1), "");
  EXPECT_PRED_FORMAT2(testing::IsSubstring, "turned by 180 degrees (orientation 3)", orientation_notice(3));
}

TEST(PictureBytes, TellsStreamsFromStills) {
  const Bytes jpeg = noisy_jpeg();
  EXPECT_EQ(jpeg_end(jpeg), jpeg.size());
  EXPECT_EQ(jpeg_end(first_part(jpeg, jpeg.size() - 1)), std::nullopt);
  const auto followed_by = [](const Bytes& first, const Bytes& second) {
    Bytes both = first;
    both.insert(both.end(), second.begin(), second.end());
    return both;
  };
  EXPECT_FALSE(is_jpeg_stream(jpeg));
  EXPECT_TRUE(is_jpeg_stream(followed_by(jpeg, noisy_jpeg(96, 64, 4))));
  EXPECT_TRUE(is_jpeg_stream(followed_by(followed_by(jpeg, Bytes(33, 0)), noisy_jpeg(96, 64, 4)))) << "padded";
  EXPECT_FALSE(is_jpeg_stream(followed_by(jpeg, noisy_jpeg(48, 32)))) << "a preview or a gain map";
  EXPECT_FALSE(is_jpeg_stream(followed_by(with_segment(jpeg, 0xe2, std::string("MPF\0", 4)), jpeg))) << "two eyes";
  EXPECT_FALSE(is_jpeg_stream(followed_by(jpeg, Bytes(500, 7)))) << "a trailer";
  EXPECT_FALSE(is_jpeg_stream(followed_by(first_part(jpeg, jpeg.size() / 2), Bytes(500, 0))));
  const Bytes with_thumbnail = with_segment(jpeg, 0xe1, "Exif" + std::string(jpeg.begin(), jpeg.begin() + 500));
  EXPECT_EQ(jpeg_end(with_thumbnail), with_thumbnail.size());
}

}  // namespace
}  // namespace lf
