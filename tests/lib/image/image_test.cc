// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {

namespace {

TEST(Image, PackedSizesCountOddEdges) {
  EXPECT_EQ(packed_size(PixelFamily::kRgb, 3, 5), 45u);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 4, 2), 12u);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 3, 5), 15u + 2 * 2 * 3);
  EXPECT_EQ(packed_size(PixelFamily::kI420, 1, 1), 3u);
  EXPECT_EQ(packed_size(PixelFamily::kRgb, 16384, 16384), size_t{16384} * 16384 * 3);
  EXPECT_EQ(packed_size(PixelFamily::kNone, 4, 4), 0u);
}

TEST(Image, ViewDescribesThePlanes) {
  Image image(PixelFamily::kI420, 3, 5);
  const ImageView view = image.view();
  EXPECT_EQ(view.stride[0], 3);
  EXPECT_EQ(view.stride[1], 2);
  EXPECT_EQ(view.plane[1] - view.plane[0], 15);
  EXPECT_EQ(view.plane[2] - view.plane[1], 6);
  EXPECT_EQ(view.plane[2] + 6, image.data().data() + image.data().size());

  const Image rgb(PixelFamily::kRgb, 3, 5);
  EXPECT_EQ(rgb.view().stride[0], 9);
  EXPECT_EQ(rgb.pixel(2, 4) - rgb.view().plane[0], 42);
}

// Values of JFIF 1.02, section "Conversion to and from RGB".
TEST(Image, ConvertsColoursAsJfif) {
  struct {
    uint8_t rgb[3], ycc[3];
  } const cases[] = {{{0, 0, 0}, {0, 128, 128}},    {{255, 255, 255}, {255, 128, 128}},
                     {{255, 0, 0}, {76, 85, 255}},  {{0, 255, 0}, {150, 44, 21}},
                     {{0, 0, 255}, {29, 255, 107}}, {{128, 128, 128}, {128, 128, 128}}};
  for (const auto& c : cases) {
    Image rgb(PixelFamily::kRgb, 2, 2);
    for (int i = 0; i < 4; i++) std::copy(c.rgb, c.rgb + 3, rgb.pixel(i % 2, i / 2));
    const Image ycc = to_i420(rgb);
    for (int p = 0; p < 3; p++) EXPECT_EQ(ycc.plane(p)[0], c.ycc[p]) << "plane " << p;
    const Image back = to_rgb(ycc);
    for (int p = 0; p < 3; p++) EXPECT_NEAR(back.pixel(1, 1)[p], c.rgb[p], 2);
  }
}

TEST(Image, ChromaIsTheMeanOfItsPixelsAlsoAtOddEdges) {
  Image rgb(PixelFamily::kRgb, 3, 3);
  for (int y = 0; y < 3; y++)
    for (int x = 0; x < 3; x++) rgb.pixel(x, y)[2] = static_cast<uint8_t>(10 * x + 60 * y);  // blue alone
  const Image ycc = to_i420(rgb);
  const int mean[4] = {(0 + 10 + 60 + 70) / 4, (20 + 80) / 2, (120 + 130) / 2, 140};
  for (int i = 0; i < 4; i++) EXPECT_NEAR(ycc.plane(1)[i], 128 + 0.5 * mean[i], 0.51) << i;
}

TEST(Image, GreysSurviveBothWays) {
  Image rgb(PixelFamily::kRgb, 16, 16);
  for (int i = 0; i < 256; i++)
    for (int c = 0; c < 3; c++) rgb.pixel(i % 16, i / 16)[c] = static_cast<uint8_t>(i);
  EXPECT_EQ(to_rgb(to_i420(rgb)).data(), rgb.data());
}

class ImageIo : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(directory_); }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::string path(const std::string& name) const { return directory_ + "/" + name; }
  static Image pattern(int width, int height) {
    Image image(PixelFamily::kRgb, width, height);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++) {
        image.pixel(x, y)[0] = static_cast<uint8_t>(3 * x);
        image.pixel(x, y)[1] = static_cast<uint8_t>(200 - 2 * y);
        image.pixel(x, y)[2] = 77;
      }
    return image;
  }

 private:
  std::string directory_ =
      testing::TempDir() + "lf_image_io_test_" + testing::UnitTest::GetInstance()->current_test_info()->name();
};

TEST_F(ImageIo, PngKeepsEveryValue) {
  for (const auto& [w, h] : {std::pair(1, 1), std::pair(7, 3), std::pair(64, 48)}) {
    save_image(pattern(w, h), path("a.png"));
    const Image back = load_image(path("a.png"));
    EXPECT_EQ(back.width(), w);
    EXPECT_EQ(back.height(), h);
    EXPECT_EQ(back.data(), pattern(w, h).data());
  }
}

TEST_F(ImageIo, JpegComesBackInTheRightColours) {
  const Image image = pattern(64, 48);
  save_image(image, path("a.jpg"));
  const Image back = load_image(path("a.jpg"));
  double sum = 0;
  for (size_t i = 0; i < image.data().size(); i++) sum += std::abs(image.data()[i] - back.data()[i]);
  EXPECT_LT(sum / image.data().size(), 3);
}

TEST_F(ImageIo, ErrorsNameTheFile) {
  EXPECT_ERROR(load_image(path("none.png")), "none.png: no such image file");
  std::ofstream(path("text.png")) << "this is not a picture";
  EXPECT_ERROR(load_image(path("text.png")), "text.png: not an image");
  EXPECT_ERROR(save_image(pattern(2, 2), path("no_such_folder/a.png")), "no_such_folder/a.png: ");
  EXPECT_ERROR(save_image(pattern(2, 2), path("a.unknown")), "a.unknown: ");
}

}  // namespace

}  // namespace lf
