// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/calibration.h>

#include "api/api_fixture.h"

#include "calibration/simulator.h"

namespace lightfield {
namespace {

Tracks public_tracks(const lf::Tracks& tracks) {
  Tracks out;
  for (const auto& camera : tracks.cameras) out.cameras.push_back({camera.id, camera.width, camera.height});
  out.num_positions = tracks.num_positions;
  for (const lf::Observation& o : tracks.observations)
    out.observations.push_back({o.camera, o.position, o.light, o.pixel.x, o.pixel.y, o.sigma});
  return out;
}

TEST(ApiCalibration, FindsAnArray) {
  const lf::Rig truth = lf::sim::make_array({.rows = 3, .columns = 3}, 5);
  const Tracks tracks = public_tracks(lf::sim::watch(truth, {.positions = 60}, 5).tracks);
  std::vector<std::string> steps;
  CalibrationOptions options;
  options.prior = test::public_rig(truth);
  options.distortion_terms = 2;
  options.progress = [&](const std::string& step) { steps.push_back(step); };
  const Calibration found = calibrate_rig(tracks, options);
  ASSERT_EQ(found.rig.size(), truth.cameras.size());
  ASSERT_EQ(found.covariances.size(), truth.cameras.size());
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const Camera camera = found.rig.camera(i);
    EXPECT_EQ(camera.id, truth.cameras[i].id);
    const auto& p = camera.world_from_camera.position;
    EXPECT_LT(glm::length(lf::Vec3(p.x, p.y, p.z) - truth.cameras[i].pose.position), 0.02);
    const Covariance& known = found.covariances[i];
    EXPECT_EQ(known.camera_id, camera.id);
    ASSERT_EQ(known.matrix.size(), known.parameters.size() * known.parameters.size());
    ASSERT_EQ(known.parameters[0], "f");
    EXPECT_NEAR(camera.lens.fx, truth.cameras[i].lens.fx(), 4 * std::sqrt(known.matrix[0]));
    EXPECT_LT(std::sqrt(known.matrix[0]), 0.1 * camera.lens.fx);
  }
  EXPECT_NEAR(found.sigma, 0.2, 0.05);
  EXPECT_FALSE(steps.empty());
  EXPECT_NE(found.rig.json().find("\"covariance\""), std::string::npos);

  options.prior = found.rig;
  EXPECT_EQ(calibrate_rig(tracks, options).rig.size(), truth.cameras.size());
}

TEST(ApiCalibration, ErrorsNameTheProblem) {
  const lf::Rig truth = lf::sim::make_array({.rows = 2, .columns = 2}, 5);
  const Tracks good = public_tracks(lf::sim::watch(truth, {.positions = 20}, 5).tracks);
  Tracks tracks = good;
  tracks.observations[3].camera = 9;
  EXPECT_API_ERROR(calibrate_rig(tracks), "observations[3]");
  EXPECT_API_ERROR(calibrate_rig(Tracks{}), "");
  EXPECT_API_ERROR(calibrate_rig(good, {.distortion_terms = 3}), "distortion_terms", "0 to 2");
  EXPECT_API_ERROR(calibrate_rig(good, {.pitch = -1}), "pitch");
  EXPECT_API_ERROR(load_tracks("/none/tracks.json"), "/none/tracks.json");
  CalibrationOptions cancelled;
  cancelled.progress = [](const std::string&) { throw std::runtime_error("no more"); };
  EXPECT_THROW(calibrate_rig(good, cancelled), std::runtime_error);
}

}  // namespace
}  // namespace lightfield
