// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/epipolar_check.h"

#include "base/text.h"
#include "scene/scene.h"
#include "support/photographs.h"
#include "support/test.h"

namespace lf {
namespace {

using test::scene_images;
using Verdict = EpipolarPair::Verdict;

constexpr int kWidth = 240, kHeight = 180;

EpipolarCheck check(const Rig& rig, const std::vector<Image>& images) {
  return check_epipolar_geometry(rig, [&](CameraIndex i) -> const Image& { return images[i]; });
}

// The built-in scene in front of 3x4 cameras with inexact poses.
class EpipolarGeometry : public testing::Test {
 protected:
  static Rig array() {
    Rig rig = scene_rig(3, 4, kWidth, kHeight);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> off(-0.004, 0.004), degrees(-2, 2);
    for (Camera& camera : rig.cameras) {
      camera.pose.position += Vec3(off(random), off(random), off(random));
      camera.pose.orientation = quat_from_euler({degrees(random), degrees(random), degrees(random)});
    }
    return rig;
  }
  static const std::vector<Image>& images() {
    static const std::vector<Image> images = scene_images(array());
    return images;
  }
  static void expect_contradiction(const Rig& rig, const std::vector<Image>& images) {
    const EpipolarCheck result = check(rig, images);
    EXPECT_TRUE(result.has_contradiction);
    EXPECT_THAT(result.misplaced, IsEmpty());
    const std::vector<RigFinding> findings = describe(result);
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0].severity, RigFinding::Severity::kWarning);
    EXPECT_THAT(findings[0].text, mentions("cameras:", "fit", std::to_string(result.count(Verdict::kContradicts)),
                                           std::to_string(result.pairs.size() - result.count(Verdict::kUnknown))));
  }
  static void expect_no_contradiction(const EpipolarCheck& result) {
    EXPECT_EQ(result.count(Verdict::kContradicts), 0u);
    EXPECT_FALSE(result.has_contradiction);
    EXPECT_THAT(result.misplaced, IsEmpty());
    EXPECT_THAT(describe(result), IsEmpty());
  }
  static void reorder(std::vector<Image>& images, auto&& image_of) {
    std::vector<Image> ordered;
    for (size_t i = 0; i < images.size(); i++) ordered.push_back(images[image_of(i)]);
    images = ordered;
  }
};

TEST_F(EpipolarGeometry, FitsTheImages) {
  const EpipolarCheck result = check(array(), images());
  EXPECT_EQ(result.count(Verdict::kFits), result.pairs.size());
  expect_no_contradiction(result);
}

TEST_F(EpipolarGeometry, FitsAlthoughTheSceneMoves) {
  std::vector<Image> pictures = scene_images(array(), kScenePeriod / 2);
  for (size_t i = 0; i < pictures.size(); i += 2) pictures[i] = images()[i];
  expect_no_contradiction(check(array(), pictures));
}

TEST_F(EpipolarGeometry, FitsImagesOfAnotherExposure) {
  std::vector<Image> pictures = images();
  for (size_t i = 0; i < pictures.size(); i += 2)
    for (uint8_t& value : pictures[i].data()) value = static_cast<uint8_t>(value * 0.6 + 10);
  const EpipolarCheck result = check(array(), pictures);
  EXPECT_EQ(result.count(Verdict::kFits), result.pairs.size());
}

TEST_F(EpipolarGeometry, NamesSwappedCameras) {
  std::vector<Image> pictures = images();
  std::swap(pictures[5], pictures[6]);
  const EpipolarCheck result = check(array(), pictures);
  EXPECT_FALSE(result.has_contradiction);
  EXPECT_THAT(result.misplaced, ElementsAre(5u, 6u));
  const std::vector<RigFinding> findings = describe(result);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_THAT(findings[0].text, mentions("cameras[5]", "cameras[6]", "fit"));
}

TEST_F(EpipolarGeometry, NamesSwappedCamerasOfARow) {
  const Rig row = scene_rig(1, 8, kWidth, kHeight);
  std::vector<Image> pictures = scene_images(row);
  std::swap(pictures[3], pictures[4]);
  EXPECT_THAT(check(row, pictures).misplaced, ElementsAre(3u, 4u));
}

TEST_F(EpipolarGeometry, NamesARotatedCamera) {
  Rig rig = array();
  rig.cameras[9].pose.orientation = quat_from_euler({10, 0, 0});
  EXPECT_THAT(check(rig, images()).misplaced, ElementsAre(9u));
}

TEST_F(EpipolarGeometry, NamesCamerasBeyondTheLimitOfPairs) {
  std::vector<Image> pictures = images();
  std::swap(pictures[5], pictures[6]);
  const auto image = [&](CameraIndex i) -> const Image& { return pictures[i]; };
  const EpipolarCheck result = check_epipolar_geometry(array(), image, 12);
  EXPECT_GT(result.pairs.size(), 12u);
  EXPECT_THAT(result.misplaced, ElementsAre(5u, 6u));
}

TEST_F(EpipolarGeometry, ContradictsImagesInAnotherOrder) {
  const std::map<std::string, std::function<size_t(size_t)>> orders = {
      {"columns from right to left", [](size_t i) { return i / 4 * 4 + 3 - i % 4; }},
      {"rows from bottom to top", [](size_t i) { return (2 - i / 4) * 4 + i % 4; }},
      {"from last to first", [](size_t i) { return 11 - i; }},
      {"snake", [](size_t i) { return i / 4 % 2 ? i / 4 * 4 + 3 - i % 4 : i; }},
      {"column by column", [](size_t i) { return i % 4 * 3 + i / 4; }},
  };
  for (const auto& [name, order] : orders) {
    SCOPED_TRACE(name);
    std::vector<Image> pictures = images();
    reorder(pictures, order);
    expect_contradiction(array(), pictures);
  }
}

TEST_F(EpipolarGeometry, ContradictsInvertedExtrinsics) {
  Rig rig = array();
  for (Camera& camera : rig.cameras) {
    camera.pose.position = -(glm::transpose(camera.pose.rotation()) * camera.pose.position);
    camera.pose.orientation = glm::conjugate(camera.pose.orientation);
  }
  expect_contradiction(rig, images());
}

TEST_F(EpipolarGeometry, ContradictsOtherAxes) {
  Rig rig = array();
  for (Camera& camera : rig.cameras) camera.pose.orientation *= Quat(0, 1, 0, 0);  // y up, z backward
  expect_contradiction(rig, images());
}

TEST_F(EpipolarGeometry, ComparesTwoCameras) {
  const Rig rig = scene_rig(1, 2, kWidth, kHeight);
  std::vector<Image> pictures = scene_images(rig);
  expect_no_contradiction(check(rig, pictures));
  EXPECT_EQ(check(rig, pictures).count(Verdict::kFits), 1u);
  std::swap(pictures[0], pictures[1]);
  expect_contradiction(rig, pictures);
}

TEST_F(EpipolarGeometry, IsUnknownForOneCamera) {
  const Rig rig = scene_rig(1, 1, kWidth, kHeight);
  EXPECT_THAT(check(rig, scene_images(rig)).pairs, IsEmpty());
}

TEST_F(EpipolarGeometry, IsUnknownForWideBaselines) {
  for (const double radius : {1.0, 3.0}) {
    CylinderRigOptions options{2, 12, 0.3, radius, radius > 2, 45, kWidth, kHeight};
    const Rig rig = make_cylinder_rig(options);
    expect_no_contradiction(check(rig, scene_images(rig)));
  }
}

TEST_F(EpipolarGeometry, IsUnknownWithoutTexture) {
  std::vector<Image> flat(12, Image(PixelFamily::kRgb, kWidth, kHeight)), noise = flat, same = flat;
  std::mt19937 random(3);
  for (Image& image : noise)
    for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random() % 32);
  for (Image& image : same) image = images()[0];
  for (const std::vector<Image>& pictures : {flat, noise, same}) {
    Rig rig = scene_rig(3, 4, kWidth, kHeight);
    const EpipolarCheck result = check(rig, pictures);
    EXPECT_EQ(result.count(Verdict::kUnknown), result.pairs.size());
    expect_no_contradiction(result);
  }
}

TEST_F(EpipolarGeometry, LeavesOutCamerasWithoutImages) {
  const auto image = [&](CameraIndex i) -> const Image& {
    if (i == 5) throw Error("no image");
    return images()[i];
  };
  const EpipolarCheck result = check_epipolar_geometry(array(), image);
  for (const EpipolarPair& pair : result.pairs)
    EXPECT_EQ(pair.verdict(), pair.a == 5 || pair.b == 5 ? Verdict::kUnknown : Verdict::kFits);
  expect_no_contradiction(result);
}

TEST_F(EpipolarGeometry, LoadsFewImagesOnce) {
  const Rig rig = make_grid_rig({.rows = 30, .columns = 40, .pitch = 0.1, .fov_y_deg = 60, .width = 32, .height = 24});
  const Image empty(PixelFamily::kRgb, 32, 24);
  std::map<CameraIndex, int> loads;
  const auto image = [&](CameraIndex i) -> const Image& { return loads[i]++, empty; };
  EXPECT_EQ(check_epipolar_geometry(rig, image, 100).pairs.size(), 100u);
  EXPECT_EQ(loads.size(), 200u);
  EXPECT_TRUE(std::ranges::all_of(loads, [](const auto& load) { return load.second == 1; }));
}

}  // namespace
}  // namespace lf
