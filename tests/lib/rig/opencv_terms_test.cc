// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"
#include "support/mixed_rig.h"

namespace lf {
namespace {

TEST(OpenCvTerms, TheShortestModelThatHoldsALens) {
  using enum LensModel;
  EXPECT_EQ(lens_of_opencv_terms({5, 5, 2, 1}, {}), Lens(kSimplePinhole, {5, 2, 1}));
  EXPECT_EQ(lens_of_opencv_terms({5, 6, 2, 1}, {0, 0, 0, 0}), Lens(kPinhole, {5, 6, 2, 1}));
  EXPECT_EQ(lens_of_opencv_terms({5, 5, 2, 1}, {0.1}), Lens(kSimpleRadial, {5, 2, 1, 0.1}));
  EXPECT_EQ(lens_of_opencv_terms({5, 5, 2, 1}, {0, 0.1}), Lens(kRadial, {5, 2, 1, 0, 0.1}));
  EXPECT_EQ(lens_of_opencv_terms({5, 6, 2, 1}, {0.1}), Lens(kOpenCv, {5, 6, 2, 1, 0.1, 0, 0, 0}));
  EXPECT_EQ(lens_of_opencv_terms({5, 5, 2, 1}, {0, 0, 0, 0.1}), Lens(kOpenCv, {5, 5, 2, 1, 0, 0, 0, 0.1}));
  EXPECT_ERROR(lens_of_opencv_terms({0, 5, 2, 1}, {}), "focal length must be positive");
}

TEST(OpenCvTerms, MotionsInvertAndFollowEachOther) {
  const Rig rig = mixed_rig();
  const RigidMotion a = camera_from_world(rig.cameras[0].pose), b = camera_from_world(rig.cameras[1].pose);
  const Vec3 x(1, 2, 3);
  EXPECT_LT(glm::length(a(x) - rig.cameras[0].pose.camera_from_world(x)), 1e-12);
  EXPECT_LT(glm::length((b * a.inverse())(a(x)) - b(x)), 1e-12);
  const Pose back = pose_of_camera_from_world(a);
  EXPECT_LT(glm::length(back.world_from_camera(a(x)) - x), 1e-12);
}

TEST(OpenCvTerms, RoundedRotationsAreMadeRotationsOthersRefused) {
  const std::string file = "x.json";
  const auto parse = [&](const char* text) {
    const nlohmann::json json = parse_json(text, file);
    return parse_rigid_motion(JsonValue(json, file));
  };
  const RigidMotion motion = parse("[[0.8, -0.6, 0, 1], [0.6001, 0.8, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]");
  const Mat3 square = glm::transpose(motion.rotation) * motion.rotation;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) EXPECT_NEAR(square[c][r], c == r, 1e-14);
  EXPECT_NEAR(motion.rotation[0][1], 0.6, 1e-4);  // first column, second row
  EXPECT_EQ(motion.translation, Vec3(1, 2, 3));
  EXPECT_ERROR(parse("[[1, 0, 0, 1], [0, 1, 0, 2]]"), "x.json: must have 3 or 4 rows");
  EXPECT_ERROR(parse("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"), "x.json: [0]: must ");
  EXPECT_ERROR(parse("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]"), "must be a rotation");
  EXPECT_ERROR(parse("[[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]"), "must be a rotation");
  EXPECT_ERROR(parse("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]"), "[3]: must be [0, 0, 0, 1]");
}

}  // namespace
}  // namespace lf
