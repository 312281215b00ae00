// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/surface_files.h"

#include "base/file.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

class PointCloudTest : public testing::Test {
 protected:
  PointCloudTest() : picture_(PixelFamily::kRgb, view_.width, view_.height) {
    for (size_t i = 0; i < picture_.data().size(); i++) picture_.data()[i] = static_cast<uint8_t>(7 * i);
  }
  View view_{31,
             17,
             Lens(LensModel::kRadial, {40, 15, 8, -0.1, 0.01}),
             {{0.3, -0.2, -0.5}, glm::normalize(Quat(1, 0.1, -0.2, 0.05))},
             {plane_through({0, 0, 2}, glm::normalize(Vec3(0.2, 0.1, 1)))}};
  DepthImage depths_ = depth_image(view_);
  Image picture_;
};

TEST_F(PointCloudTest, PointsProjectToTheirPixels) {
  const std::vector<ColouredPoint> points = point_cloud(view_, depths_, picture_.view());
  ASSERT_EQ(points.size(), depths_.depths.size());
  for (size_t i = 0; i < points.size(); i++) {
    const Vec3 world(points[i].x, points[i].y, points[i].z);
    EXPECT_NEAR(view_.focus.plane.signed_distance(world), 0, 1e-6);
    const std::optional<Vec2> pixel =
        view_.lens.project(glm::transpose(view_.pose.rotation()) * (world - view_.pose.position));
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->x, static_cast<double>(i % view_.width), 1e-4);
    EXPECT_NEAR(pixel->y, static_cast<double>(i / view_.width), 1e-4);
    EXPECT_EQ(points[i].red, picture_.data()[3 * i]);
    EXPECT_EQ(points[i].green, picture_.data()[3 * i + 1]);
    EXPECT_EQ(points[i].blue, picture_.data()[3 * i + 2]);
  }
}

TEST_F(PointCloudTest, UnknownDepthsAndEdgesAreLeftOut) {
  const size_t middle = static_cast<size_t>(8) * view_.width + 15;
  for (const float depth : {0.f, std::numeric_limits<float>::infinity(), 0.9f * depths_.depths[middle]}) {
    DepthImage changed = depths_;
    changed.depths[middle] = depth;
    EXPECT_EQ(point_cloud(view_, changed, picture_.view()).size(), depths_.depths.size() - 5) << depth;
  }
  DepthImage sloping = depths_;
  sloping.depths[middle] *= 0.98f;
  EXPECT_EQ(point_cloud(view_, sloping, picture_.view()).size(), depths_.depths.size());
}

TEST_F(PointCloudTest, FilesHaveAHeaderAndPackedVertices) {
  const TempDir folder;
  const std::vector<ColouredPoint> points{{1, -2, 3.5, 10, 20, 30}, {0.1f, 0.2f, 0.3f, 255, 0, 1}};
  save_ply(points, folder / "cloud.ply");
  const std::string bytes = read_file(folder / "cloud.ply");
  const size_t header = bytes.find("end_header\n") + 11;
  EXPECT_EQ(bytes.substr(0, 55), "ply\nformat binary_little_endian 1.0\nelement vertex 2\npr");
  ASSERT_EQ(bytes.size(), header + 2 * 15);
  float position[3];
  std::memcpy(position, &bytes[header + 15], sizeof(position));
  EXPECT_EQ(position[1], 0.2f);
  EXPECT_EQ(static_cast<uint8_t>(bytes[header + 15 + 12]), 255);
  EXPECT_EQ(static_cast<uint8_t>(bytes[header + 13]), 20);
  EXPECT_ERROR(save_ply(points, folder / "missing/cloud.ply"), "missing/cloud.ply");
}

}  // namespace
}  // namespace lf
