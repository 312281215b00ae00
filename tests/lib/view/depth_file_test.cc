// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/surface_files.h"

#include <opencv2/imgcodecs.hpp>

#include "base/file.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(DepthFile, FilesContainTheDepths) {
  const TempDir dir;
  const DepthImage image{2, 3, {0, 1.5f, 0.0004f, 65.4321f, 70, std::numeric_limits<float>::infinity()}};
  save_depth_png(image, dir / "d.png");
  const cv::Mat png = cv::imread(dir / "d.png", cv::IMREAD_UNCHANGED);
  ASSERT_EQ(png.type(), CV_16UC1);
  ASSERT_EQ(png.size(), cv::Size(2, 3));
  const uint16_t expected[] = {0, 1500, 0, 65432, 65535, 65535};
  for (int i = 0; i < 6; i++) EXPECT_EQ(png.at<uint16_t>(i / 2, i % 2), expected[i]) << i;

  save_depth_pfm(image, dir / "d.pfm");
  const std::string pfm = read_file(dir / "d.pfm");
  const std::string header = "Pf\n2 3\n-1\n";
  ASSERT_EQ(pfm.size(), header.size() + 6 * sizeof(float));
  EXPECT_EQ(pfm.substr(0, header.size()), header);
  for (size_t row = 0; row < 3; row++) {
    float values[2];
    std::memcpy(values, pfm.data() + header.size() + row * sizeof(values), sizeof(values));
    for (size_t x = 0; x < 2; x++) EXPECT_EQ(values[x], image.depths[2 * (2 - row) + x]) << "bottom row first";
  }
  EXPECT_ERROR(save_depth_png(image, dir / "none/d.png"), "none/d.png");
  EXPECT_ERROR(save_depth_pfm(image, dir / "none/d.pfm"), "none/d.pfm");
}

TEST(DepthFile, ConfidencesAreInterpolated) {
  const TempDir dir;
  FocalMap map = FocalMap::for_view(13, 7);
  map.nearest = 1;
  for (int i = 0; i < map.columns * map.rows; i++) map.levels.push_back(static_cast<uint8_t>(37 * i));
  for (const FocalMap* confidence : {static_cast<const FocalMap*>(&map), static_cast<const FocalMap*>(nullptr)}) {
    save_confidence_png(confidence, 13, 7, dir / "c.png");
    const cv::Mat png = cv::imread(dir / "c.png", cv::IMREAD_UNCHANGED);
    ASSERT_EQ(png.type(), CV_8UC1);
    ASSERT_EQ(png.size(), cv::Size(13, 7));
    for (int y = 0; y < 7; y++)
      for (int x = 0; x < 13; x++)
        EXPECT_NEAR(png.at<uint8_t>(y, x), confidence ? 255 * map.inverse_at(x, y) : 0, 0.51) << x << ", " << y;
  }
  EXPECT_ERROR(save_confidence_png(&map, 13, 7, dir / "none/c.png"), "none/c.png");
}

}  // namespace
}  // namespace lf
