// SPDX-License-Identifier: LGPL-2.1-or-later

#include <sys/resource.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/file.h"
#include "image/image_file.h"
#include "support/expect_error.h"
#include "support/jpeg_samples.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

using namespace std::string_literals;

Image gradient(int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      uint8_t* pixel = image.pixel(x, y);
      pixel[0] = static_cast<uint8_t>(3 * x);
      pixel[1] = static_cast<uint8_t>(200 - 2 * y);
      pixel[2] = 77;
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

std::string png_header(uint32_t width, uint32_t height) {
  return "\x89PNG\r\n\x1a\n"s + big_endian(13) + "IHDR" + big_endian(width) + big_endian(height) + "\x08\x02\0\0\0"s;
}

TEST(ImageFile, ReadsTheSizeAndThePixelsOfAllFormats) {
  const TempDir dir;
  const Image image = gradient(6, 5);
  std::vector<uint8_t> bgr = image.data();
  for (size_t i = 0; i < bgr.size(); i += 3) std::swap(bgr[i], bgr[i + 2]);
  const cv::Mat pixels(5, 6, CV_8UC3, bgr.data());
  for (const char* ending : {".png", ".jpg", ".bmp", ".tif", ".webp", ".ppm"}) {
    const std::string path = dir / ("picture"s + ending);
    ASSERT_TRUE(cv::imwrite(path, pixels)) << path;
    EXPECT_EQ(load_image_size(path), (ImageSize{6, 5})) << path;
    const Image read = load_image(path);
    ASSERT_EQ(read.width(), 6) << path;
    const int near = ending == ".png"s || ending == ".bmp"s || ending == ".tif"s || ending == ".ppm"s ? 0 : 60;
    for (size_t i = 0; i < read.data().size(); i++) ASSERT_NEAR(read.data()[i], image.data()[i], near) << path;
  }
}

TEST(ImageFile, RoundTrips) {
  const TempDir dir;
  for (const auto& [width, height] : {std::pair(1, 1), {6, 5}, {7, 3}, {64, 48}}) {
    save_image(gradient(width, height), dir / "a.png");
    const Image back = load_image(dir / "a.png");
    EXPECT_EQ(back.width(), width);
    EXPECT_EQ(back.height(), height);
    EXPECT_EQ(back.data(), gradient(width, height).data());
  }
  const Image image = gradient(64, 48);
  save_image(image, dir / "a.jpg");
  const Image jpeg = load_image(dir / "a.jpg");
  double sum = 0;
  for (size_t i = 0; i < image.data().size(); i++) sum += std::abs(image.data()[i] - jpeg.data()[i]);
  EXPECT_LT(sum / static_cast<double>(image.data().size()), 3) << "JPEG keeps colours";
  EXPECT_ERROR(save_image(gradient(6, 5), dir / "none/a.png"), "none/a.png", "written");
  EXPECT_ERROR(save_image(gradient(6, 5), dir / "a.unknown"), "a.unknown: ", ".png or .jpg");
  EXPECT_ERROR(save_image(Image(), dir / "a.png"), "a.png: ", "RGB");
}

TEST(ImageFile, EncodesTheSamePixelsAsOpenCv) {
  const TempDir dir;
  std::mt19937 random(1);
  for (const auto& [width, height] : {std::pair(1, 1), {17, 9}, {64, 48}, {321, 243}}) {
    Image image(PixelFamily::kRgb, width, height);
    for (uint8_t& sample : image.data()) sample = static_cast<uint8_t>(random());
    cv::Mat bgr;
    cv::cvtColor(cv::Mat(height, width, CV_8UC3, image.data().data()), bgr, cv::COLOR_RGB2BGR);
    save_image(image, dir / "a.PNG");
    EXPECT_EQ(load_image(dir / "a.PNG").data(), image.data());
    for (int quality : {1, 50, 85, 95, 100}) {
      std::vector<uint8_t> expected;
      ASSERT_TRUE(cv::imencode(".jpg", bgr, expected, {cv::IMWRITE_JPEG_QUALITY, quality}));
      EXPECT_EQ(decode_still(encode_jpeg(image, quality), PixelFamily::kRgb).data(),
                decode_still(expected, PixelFamily::kRgb).data())
          << width << "x" << height << ", quality " << quality;
    }
  }
}

TEST(ImageFile, DecodesTheSamePixelsAsOpenCv) {
  const TempDir dir;
  struct Case {
    const char* name;
    int type, error;
    std::vector<int> options = {};
  };
  enum { kLzw = 5, kDeflate = 8, kPackbits = 32773 };
  for (const Case& c : {Case{"a.bmp", CV_8UC3, 0},
                        {"grey.bmp", CV_8UC1, 0},
                        {"alpha.bmp", CV_8UC4, 0},
                        {"a.ppm", CV_8UC3, 0},
                        {"a.pgm", CV_8UC1, 0},
                        {"wide.ppm", CV_16UC3, 1},
                        {"wide.pgm", CV_16UC1, 1},
                        {"lzw.tif", CV_8UC3, 0, {cv::IMWRITE_TIFF_COMPRESSION, kLzw}},
                        {"packbits.tif", CV_8UC1, 0, {cv::IMWRITE_TIFF_COMPRESSION, kPackbits}},
                        {"alpha.tif", CV_8UC4, 0},
                        {"wide.tif", CV_16UC3, 1, {cv::IMWRITE_TIFF_COMPRESSION, kDeflate}},
                        {"lossless.webp", CV_8UC3, 0, {cv::IMWRITE_WEBP_QUALITY, 101}},
                        {"lossy.webp", CV_8UC3, 0, {cv::IMWRITE_WEBP_QUALITY, 60}}})
    for (const auto& [width, height] : {std::pair(1, 1), {17, 9}, {64, 48}}) {
      cv::Mat pixels(height, width, c.type), expected;
      cv::randu(pixels, 0, pixels.depth() == CV_16U ? 65536 : 256);
      const std::string path = dir / c.name;
      ASSERT_TRUE(cv::imwrite(path, pixels, c.options)) << path;
      cv::cvtColor(cv::imread(path, cv::IMREAD_COLOR), expected, cv::COLOR_BGR2RGB);
      const Image image = load_image(path);
      ASSERT_EQ(image.data().size(), expected.total() * 3) << path;
      for (size_t i = 0; i < image.data().size(); i++)
        ASSERT_NEAR(image.data()[i], expected.data[i], c.error) << path << ", sample " << i;
    }
}

TEST(ImageFile, DecodesTheSameLumaAsOpenCv) {
  const std::vector<uint8_t> jpeg = encode_jpeg(test::noisy_picture(99, 61, 3), 90);
  for (const auto& [smaller, mode] : {std::pair(1, cv::IMREAD_GRAYSCALE),
                                      {2, cv::IMREAD_REDUCED_GRAYSCALE_2},
                                      {4, cv::IMREAD_REDUCED_GRAYSCALE_4},
                                      {8, cv::IMREAD_REDUCED_GRAYSCALE_8}}) {
    const cv::Mat expected = cv::imdecode(jpeg, mode);
    const GreyImage luma = decode_jpeg_luma(jpeg, smaller);
    ASSERT_EQ(luma.width, expected.cols) << smaller;
    ASSERT_EQ(luma.height, expected.rows) << smaller;
    for (int y = 0; y < luma.height; y++)
      for (int x = 0; x < luma.width; x++)
        ASSERT_EQ(luma.samples[static_cast<size_t>(y * luma.width + x)], expected.at<uint8_t>(y, x)) << smaller;
  }
  EXPECT_ERROR(decode_jpeg_luma({1, 2, 3}, 1), "JPEG");
}

TEST(ImageFile, DamagedBmpAndPnmAreErrors) {
  const TempDir dir;
  const cv::Mat pixels(9, 17, CV_8UC3, cv::Scalar(1, 2, 3));
  for (const char* name : {"a.bmp", "a.ppm"}) {
    ASSERT_TRUE(cv::imwrite(dir / name, pixels));
    const std::string whole = read_file(dir / name);
    dir.write(name, whole.substr(0, whole.size() - 4));
    EXPECT_ERROR(load_image(dir / name), name, "truncated");
  }
  dir.write("white.pgm", "P5 1 1 0\nx");
  EXPECT_ERROR(load_image(dir / "white.pgm"), "white.pgm", "level of white");
  std::string compressed = "BM"s + little_endian(100) + little_endian(0) + little_endian(54) + little_endian(40) +
                           little_endian(1) + little_endian(1) + "\x01\0\x08\0\x01\0\0\0"s;
  dir.write("rle.bmp", compressed + std::string(60, '\0'));
  EXPECT_ERROR(load_image(dir / "rle.bmp"), "rle.bmp", "uncompressed");
}

TEST(ImageFile, BmpMasksMustBeThoseOfBgr) {
  const TempDir dir;
  const auto save = [&dir](uint32_t red, uint32_t green, uint32_t blue) {
    const std::string header = "BM"s + little_endian(70) + little_endian(0) + little_endian(66) + little_endian(40) +
                               little_endian(1) + little_endian(1) + "\x01\0\x20\0"s + little_endian(3) +
                               std::string(20, '\0');
    dir.write("a.bmp", header + little_endian(red) + little_endian(green) + little_endian(blue) + "\1\2\3\4");
  };
  save(0xff0000, 0xff00, 0xff);
  EXPECT_THAT(load_image(dir / "a.bmp").data(), testing::ElementsAre(3, 2, 1));
  for (const auto& [red, green, blue] : {std::array{0xffu, 0xff00u, 0xff0000u},
                                         {0xff0000u, 0xff0000u, 0xffu},
                                         {0xff0000u, 0xff00u, 0xff000000u},
                                         {0xf800u, 0x7e0u, 0x1fu}}) {
    save(red, green, blue);
    EXPECT_ERROR(load_image(dir / "a.bmp"), "a.bmp", "masks");
  }
}

TEST(ImageFile, RefusesHugeSizesBeforeDecoding) {
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
           {"a.bmp", bmp + little_endian(30000) + little_endian(static_cast<uint32_t>(-30000)), "30000x30000"},
           {"a.jpg", "\xff\xd8\xff\xe0\0\4\0\0\xff\xc0\0\x0b\x08\xff\xff\xff\xf0"s, "65520x65535"},
           {"a.tif", tif, "30000x30000"},
           {"a.webp", "RIFF\0\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0\xff\xff\xff\xff\xff\xff"s, "16777216x16777216"},
       }) {
    dir.write(c.name, c.bytes);
    EXPECT_ERROR(load_image_size(dir / c.name), c.name, c.said);
    EXPECT_ERROR(load_image(dir / c.name), c.said);
  }
}

// Running the decoder would touch the memory.
TEST(ImageFile, UnexpectedSizeAllocatesNoMemory) {
  const TempDir dir;
  dir.write("a.png", png_header(12000, 12000));
  struct rusage before {
  }, after{};
  getrusage(RUSAGE_SELF, &before);
  EXPECT_ERROR(load_image_of_size(dir / "a.png", {640, 480}), "a.png", "12000x12000", "640x480");
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 100000) << "kB";
}

TEST(ImageFile, RefusesOtherFilesAndTruncatedHeaders) {
  const TempDir dir;
  for (const std::string& bytes : {""s,
                                   "hello"s,
                                   "P"s,
                                   "P6"s,
                                   "P6 640"s,
                                   "\x89PNG\r\n\x1a\n"s,
                                   png_header(8, 8).substr(0, 22),
                                   "\xff\xd8\xff"s,
                                   "\xff\xd8\xff\xe0\xff\xff"s,
                                   "BM"s,
                                   "II*\0"s,
                                   "II*\0\xff\xff\xff\xff"s,
                                   "RIFF1234WEBP"s,
                                   "RIFF1234WEBPVP8 "s,
                                   "#?RADIANCE\n\n-Y 3 +X 2\n"s,
                                   "PF\n3 3\n-1.0\n"s,
                                   "P3 1 1 255\n1 2 3\n"s,
                                   "P6 -3 5 255\n"s,
                                   "P6 0 0 255\n"s,
                                   "<VRTDataset/>"s}) {
    dir.write("file", bytes);
    EXPECT_ERROR(load_image(dir / "file"), "file", "not an image", "read");
  }
  EXPECT_ERROR(load_image(dir / "none"), "none", "no such");
  EXPECT_ERROR(load_image("/dev/zero"), "/dev/zero", "regular file");
}

// OpenCV decodes damaged files of these kinds to pictures with black or wrong parts.
TEST(ImageFile, DamagedTiffAndWebpAreErrors) {
  const TempDir dir;
  const Image image = test::noisy_picture(320, 240, 3);
  const cv::Mat pixels(240, 320, CV_8UC3, const_cast<uint8_t*>(image.data().data()));
  enum { kLzw = 5, kJpeg = 7, kDeflate = 8, kPackbits = 32773, kLossless = 101, kLossy = 80 };
  struct Case {
    const char* name;
    int how;
  };
  for (const Case& c : {Case{"lzw.tif", kLzw},
                        {"jpeg.tif", kJpeg},
                        {"deflate.tif", kDeflate},
                        {"packbits.tif", kPackbits},
                        {"lossless.webp", kLossless},
                        {"lossy.webp", kLossy}}) {
    const bool webp = std::string(c.name).ends_with(".webp");
    const std::vector<int> options = {webp ? cv::IMWRITE_WEBP_QUALITY : cv::IMWRITE_TIFF_COMPRESSION, c.how};
    const std::string path = dir / c.name;
    ASSERT_TRUE(cv::imwrite(path, pixels, options)) << path;
    EXPECT_EQ(load_image(path).width(), 320) << path;
    const std::string whole = read_file(path);
    for (const bool random : {false, true}) {
      std::string hole = whole;
      uint32_t state = 1;
      for (size_t i = whole.size() / 3; i < whole.size() / 3 + 1000; i++)
        hole[i] = random ? static_cast<char>((state = state * 1664525 + 1013904223) >> 24) : '\0';
      dir.write(c.name, hole);
      EXPECT_ERROR(load_image(path), std::string(c.name) + ": ") << random;
    }
  }
}

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
      EXPECT_EQ(decode_still(whole, family).width(), 96);
      for (const size_t size : {whole.size() / 3, whole.size() / 2, whole.size() - 40})
        EXPECT_ERROR(decode_still(first_part(whole, size), family), "damaged");
    }
    Bytes hole = whole;
    std::fill_n(hole.begin() + static_cast<ptrdiff_t>(whole.size() / 3), whole.size() / 4, 0);
    EXPECT_ERROR(decode_still(hole, PixelFamily::kRgb), "damaged");
    EXPECT_ERROR(decode_still(hole, PixelFamily::kI420), "damaged");
  }
  EXPECT_ERROR(decode_still(Bytes{1, 2, 3, 4}, PixelFamily::kRgb), "PNG", "JPEG");
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
  EXPECT_ERROR(decode_still(png, PixelFamily::kRgb), "too many pixels");

  Bytes jpeg = noisy_jpeg();
  constexpr uint8_t kFrame[] = {0xff, 0xc0, 0x00};
  const auto frame = static_cast<size_t>(std::ranges::search(jpeg, kFrame).begin() - jpeg.begin());
  ASSERT_LT(frame, jpeg.size());
  for (const size_t side : {size_t{5}, size_t{7}}) put_be(jpeg, frame + side, 16000, 2);
  EXPECT_ERROR(decode_still(jpeg, PixelFamily::kRgb), "too few bytes");
  jpeg.resize(1 << 22);
  EXPECT_ERROR(decode_still(jpeg, PixelFamily::kRgb), "too many pixels");
}

TEST(PictureBytes, PaddingIsAccepted) {
  Bytes jpeg = noisy_jpeg();
  jpeg.insert(jpeg.end() - 2, 100, 0);  // before the EOI marker, as some cameras write
  EXPECT_EQ(decode_still(jpeg, PixelFamily::kRgb).width(), 96);
  jpeg.insert(jpeg.end(), 100, 0);
  EXPECT_EQ(decode_still(jpeg, PixelFamily::kI420).width(), 96);
}

TEST(PictureBytes, DecodesEveryKindOfPng) {
  const auto expect_colour = [](const Bytes& png, int r, int g, int b) {
    const Image image = decode_still(png, PixelFamily::kI420);
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

TEST(PictureBytes, DecodesEveryKindOfJpeg) {
  const Image truth = test::noisy_picture(96, 64, 3);
  const test::JpegKind kinds[] = {{.h = 1, .v = 1, .rgb = true},        {.h = 4, .v = 1},      {.h = 1, .v = 2},
                                  {.h = 2, .v = 1, .arithmetic = true}, {.progressive = true}, {.h = 2, .v = 2}};
  for (const test::JpegKind& kind : kinds) {
    SCOPED_TRACE(std::to_string(&kind - kinds));
    const Image rgb = decode_still(noisy_jpeg(96, 64, 3, kind), PixelFamily::kRgb);
    const Image from_i420 = to_rgb(decode_still(noisy_jpeg(96, 64, 3, kind), PixelFamily::kI420));
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
    for (size_t length = 0; length < 30; length++)
      EXPECT_EQ(exif_orientation(with_segment(jpeg, 0xe1, exif(3, big_endian).substr(0, length))) & ~3, 0);
  }
  EXPECT_EQ(orientation_notice(1), "");
  EXPECT_MENTIONS(orientation_notice(3), "180 degrees", "orientation 3");
}

TEST(PictureBytes, DistinguishesStreamsFromStills) {
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
