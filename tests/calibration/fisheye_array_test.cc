// SPDX-License-Identifier: LGPL-2.1-or-later
#include <optional>

#include "calibration/placement.h"
#include "calibration/simulator.h"
#include "composite/still.h"
#include "focus/still_focus.h"
#include "quality/image_quality.h"
#include "rig/mesh.h"
#include "scene/scene.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr double kPitch = 0.06, kTime = 0.55;  // metres, seconds
constexpr int kPerRadian = 160;                // pixels in the middle of each picture
const CalibrationBoard kBoard{.columns = 8, .rows = 5, .square = 0.03};

// Returns an array of 3 x 3 cameras. All lenses have kPerRadian pixels per radian on the axis, so that both arrays
// resolve the middle of the view equally. The fisheye picture has a circle of 180 degrees; the perspective picture has
// 100 degrees, because its cameras see the edges of a view of 90 degrees from other places.
Rig array_with(bool fisheye) {
  const int width = kPerRadian * (fisheye ? 16 : 12) / 5;
  Rig rig = make_grid_rig({3, 3, kPitch, 90, width, width});
  const double middle = (width - 1) / 2.0;
  for (Camera& camera : rig.cameras)
    camera.lens = fisheye ? Lens(LensModel::kOpenCvFisheye,
                                 {1.0 * kPerRadian, 1.0 * kPerRadian, middle, middle, 0.01, -0.002, 0, 0})
                          : Lens(LensModel::kRadial, {kPerRadian, middle, middle, 0, 0});
  return rig;
}

// Returns the rig as lf-calibrate boards finds it from views of a board, with the coordinates of `truth`.
Rig calibrated(const Rig& truth, uint64_t seed) {
  sim::PathOptions path{.positions = 60, .near = 0.15, .far = 0.6, .noise = 0.1};
  path.board = kBoard;
  const BoardSolution solved = solve_boards(sim::sightings_of(sim::watch(truth, path, seed).tracks, kBoard), {});
  Rig rig = truth;
  std::vector<Pose> found, expected;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    EXPECT_TRUE(solved.solution.scene.cameras[i].used);
    found.push_back(solved.solution.scene.cameras[i].pose());
    expected.push_back(truth.cameras[i].pose);
    rig.cameras[i].lens = solved.solution.scene.cameras[i].lens();
    EXPECT_EQ(rig.cameras[i].lens.distortion().fisheye, truth.cameras[i].lens.distortion().fisheye);
  }
  const Similarity truth_from_found = align(found, expected, true);
  for (size_t i = 0; i < rig.cameras.size(); i++) rig.cameras[i].pose = truth_from_found(found[i]);
  return rig;
}

// Returns the PSNR of a view, rendered through a focal surface with the cameras of `rig`. `truth` filmed the scene.
double shown_db(const Rig& truth, const Rig& rig, View view) {
  std::vector<Image> images;
  for (const Camera& camera : truth.cameras)
    images.push_back(render_scene({camera.width, camera.height, camera.lens, camera.pose}, kTime));
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  view.pose = {truth.cameras[4].pose.position + Vec3(0.021, -0.013, 0), {1, 0, 0, 0}};
  const Image scene = render_scene({view.width, view.height, view.lens, view.pose}, kTime);
  view.focus.plane = plane_through(view.pose.world_from_camera({0, 0, kSceneMiddle}), view.pose.forward());
  const Mesh mesh = build_mesh(rig);
  const View focused = focus_still(rig, mesh, view, image_of, {.mode = FocusMode::kSurface});
  const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
  return compare(still.picture, scene, still.coverage).psnr_db;
}

TEST(FisheyeArray, ShowsWhatAPerspectiveArrayShows) {
  constexpr int kWidth = 2 * kPerRadian, kHeight = kWidth * 3 / 4;
  const View view{.width = kWidth,
                  .height = kHeight,
                  .lens = Lens::pinhole(kPerRadian, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0),
                  .pose = {},
                  .focus = {}};
  double db[2], exact_db[2];
  for (const bool fisheye : {false, true}) {
    const Rig truth = array_with(fisheye);
    exact_db[fisheye] = shown_db(truth, truth, view);
    db[fisheye] = shown_db(truth, calibrated(truth, 6), view);
    RecordProperty(fisheye ? "fisheye_db" : "perspective_db", std::to_string(db[fisheye]));
    std::printf("%s: %.2f dB, with the true rig %.2f dB\n", fisheye ? "fisheye" : "perspective", db[fisheye],
                exact_db[fisheye]);
  }
  EXPECT_GT(db[1], db[0] - 1);
  EXPECT_GT(db[1], exact_db[1] - 0.5) << "calibration";
}

TEST(FisheyeArray, ShowsADomeMaster) {
  constexpr int kSide = 2 * kPerRadian;
  const double f = kSide / M_PI, middle = (kSide - 1) / 2.0;
  const Rig truth = array_with(true);
  const double db = shown_db(truth, truth,
                             {.width = kSide,
                              .height = kSide,
                              .lens = Lens(LensModel::kOpenCvFisheye, {f, f, middle, middle, 0, 0, 0, 0}),
                              .pose = {},
                              .focus = {}});
  std::printf("dome master: %.2f dB\n", db);
  EXPECT_GT(db, 30);
}

}  // namespace
}  // namespace lf
