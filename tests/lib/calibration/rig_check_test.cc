// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/rig_check.h"

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

using testing::Field;

constexpr double kDegree = M_PI / 180;

Rig array() { return sim::make_array({.rows = 3, .columns = 3}, 3); }

Tracks film(const Rig& rig) {
  return sim::watch(rig, {.bar = 0.3, .noise = 0.05, .missed = 0.1, .outliers = 0.05}, 7).tracks;
}

// Rotates a camera about its own axes, then shifts the camera along them by `metres`.
void disturb(Camera& camera, const Vec3& degrees, const Vec3& metres) {
  camera.pose.position += camera.pose.rotation() * metres;
  for (int k = 0; k < 3; k++) {
    Vec3 axis(0, 0, 0);
    axis[k] = 1;
    camera.pose.orientation = camera.pose.orientation * glm::angleAxis(degrees[k] * kDegree, axis);
  }
}

std::vector<uint32_t> moved(const RigCheck& check) {
  std::vector<uint32_t> ids;
  for (const RigCheck::Camera& camera : check.cameras)
    if (camera.state != RigCheck::State::kHolds) ids.push_back(camera.id);
  return ids;
}

TEST(RigCheck, UnchangedRigHolds) {
  const Rig rig = array();
  const RigCheck check = check_calibration(rig, film(rig));
  EXPECT_TRUE(check.holds());
  EXPECT_TRUE(diagnose_check(rig, check, 0.3).empty());
  EXPECT_GT(check.lights, 150u);
  EXPECT_LT(check.residual_px, 0.1);
  ASSERT_TRUE(check.bar);
  EXPECT_NEAR(*check.bar, 0.3, 0.002);
  EXPECT_TRUE(check_report(rig, check, {})["holds"].get<bool>());
}

struct Case {
  const char* what;
  Vec3 degrees, metres;
  std::vector<const char*> said;
};

TEST(RigCheck, MeasuresAMovedCamera) {
  const Case cases[] = {
      {"panned", {0, 0.2, 0}, {0, 0, 0}, {"turned by 0.2", "to the right"}},
      {"tilted", {0.5, 0, 0}, {0, 0, 0}, {"turned by 0.5", "up"}},
      {"rolled", {0, 0, -1}, {0, 0, 0}, {"anticlockwise"}},
      {"pushed aside", {0, 0, 0}, {-0.004, 0, 0}, {"moved by", "to the left"}},
      {"knocked over", {3, -6, 2}, {0.01, 0.02, 0}, {"to the left", "moved by", "down"}},
  };
  const Rig rig = array();
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    Rig now = rig;
    disturb(now.cameras[4], c.degrees, c.metres);
    const RigCheck check = check_calibration(rig, film(now));
    EXPECT_FALSE(check.holds());
    EXPECT_EQ(moved(check), std::vector<uint32_t>{4});
    const RigCheck::Camera& camera = check.cameras[4];
    for (int k = 0; k < 3; k++) {
      // Tolerance: both sigmas; the rotations of `disturb` do not commute.
      EXPECT_NEAR(camera.turn[k] / kDegree, c.degrees[k],
                  0.05 + 5 * camera.turn_sigma[k] / kDegree + 0.04 * glm::length(c.degrees))
          << k;
      EXPECT_NEAR(camera.move[k], c.metres[k], 1e-3 + 5 * camera.move_sigma[k]) << k;
    }
    const auto findings = diagnose_check(rig, check, 0.3);
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0].code, "moved-camera");
    EXPECT_THAT(findings[0].text, mentions("camera 4", rig.cameras[4].name, "moved", "image"));
    for (const char* part : c.said) EXPECT_THAT(findings[0].text, HasSubstr(part));
  }
}

TEST(RigCheck, FindsSeveralMovedCameras) {
  const Rig rig = array();
  Rig now = rig;
  disturb(now.cameras[0], {0, 0.1, 0}, {0, 0, 0});
  disturb(now.cameras[5], {1, 0, 0}, {0, 0, 0});
  disturb(now.cameras[7], {0, 0, 0}, {0, 0.01, 0});
  EXPECT_EQ(moved(check_calibration(rig, film(now))), (std::vector<uint32_t>{0, 5, 7}));
}

TEST(RigCheck, FindsAChangedLens) {
  const Rig rig = array();
  Rig now = rig;
  const Lens lens = rig.cameras[2].lens;
  now.cameras[2].lens = Lens(LensModel::kRadial, {lens.fx() * 1.02, lens.cx(), lens.cy(), lens.k1(), lens.k2()});
  const RigCheck check = check_calibration(rig, film(now));
  EXPECT_EQ(moved(check), std::vector<uint32_t>{2});
  EXPECT_EQ(check.cameras[2].state, RigCheck::State::kLens);
  EXPECT_NEAR(check.cameras[2].focal_change, 0.02, 0.003);
  EXPECT_THAT(diagnose_check(rig, check, 0), ElementsAre(Field(&Finding::text, mentions("focal length", "+2."))));
}

TEST(RigCheck, UnseenCameraIsUnknown) {
  const Rig rig = array();
  Tracks tracks = film(rig);
  std::erase_if(tracks.observations, [](const Observation& o) { return o.camera == 6; });
  const RigCheck check = check_calibration(rig, tracks);
  EXPECT_EQ(check.cameras[6].state, RigCheck::State::kUnknown);
  EXPECT_THAT(diagnose_check(rig, check, 0.25),
              ElementsAre(Field(&Finding::code, "unseen-camera"), Field(&Finding::code, "wrong-scale")))
      << "the bar is 0.3 m long";
}

TEST(RigCheck, BentRigIsLost) {
  const Rig rig = array();
  Rig now = rig;
  for (size_t i = 0; i < 9; i++) disturb(now.cameras[i], {0.3 * (i % 2 ? 1 : -1), 0.4 * (i % 3) - 0.4, 0}, {0, 0, 0});
  const RigCheck check = check_calibration(rig, film(now));
  EXPECT_FALSE(check.holds());
  const auto findings = diagnose_check(rig, check, 0);
  ASSERT_FALSE(findings.empty());
  EXPECT_THAT(findings[0].text, mentions("rig", "bent"));
}

TEST(RigCheck, ErrorsNameTheProblem) {
  const Rig rig = array();
  Tracks tracks = film(rig);
  tracks.cameras[3].id = 77;
  EXPECT_ERROR(check_calibration(rig, tracks), "camera 77", "recording", "rig");
  tracks = film(rig);
  tracks.cameras[3].width = 640;
  EXPECT_ERROR(check_calibration(rig, tracks), "camera 3", "640x240", "320x240");
  tracks = film(rig);
  tracks.observations.clear();
  EXPECT_ERROR(check_calibration(rig, tracks), "three cameras", "light");
}

}  // namespace
}  // namespace lf
