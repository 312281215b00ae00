// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_io.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

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
