// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/planned_array.h"

#include <cmath>

#include "calibration/adjustment.h"
#include "calibration/simulator.h"
#include "composite/still.h"
#include "focus/view_focus.h"
#include "image/colour_correction.h"
#include "quality/quality.h"
#include "rig/mesh.h"
#include "scene/scene.h"

namespace lf::sim {
namespace {

constexpr double kPitch = 0.06, kFieldOfView = 35;  // metres; degrees from top to bottom
constexpr double kTime = 0.55;                      // of the scene, seconds

std::vector<Pose> poses_of(const Rig& rig) {
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  return poses;
}

}  // namespace

PlannedArray::PlannedArray(int rows, int columns, int width, int height)
    : nominal(make_grid_rig({rows, columns, kPitch, kFieldOfView, width, height})) {
  ArrayOptions options{.rows = rows,
                       .columns = columns,
                       .pitch = kPitch,
                       .f = nominal.cameras[0].lens.fx(),
                       .width = width,
                       .height = height};
  options.k2 = options.k1_spread = options.k2_spread = 0;
  truth = make_array(options, 3);
  const double offsets[] = {0.02, -0.013, 0.004, 0.017, -0.02, 0.011, -0.008, 0.0, -0.011};
  for (size_t i = 0; i < truth.cameras.size(); i++) truth.cameras[i].time_offset = offsets[i % std::size(offsets)];
  faults = random_faults(truth.cameras.size(), kFaultSeed);
  faults[stuck()].gain = kStuckGain;
}

double PlannedArray::clock_error(const Rig& rig) const {
  const double n = static_cast<double>(truth.cameras.size());
  double mean = 0, squares = 0;
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const double error = rig.cameras[i].time_offset - truth.cameras[i].time_offset;
    mean += error / n, squares += error * error / n;
  }
  return std::sqrt(squares - mean * mean);
}

std::vector<double> PlannedArray::shown_db(const Rig& rig) const {
  std::vector<Image> images;
  for (CameraIndex i = 0; i < truth.cameras.size(); i++) {
    const Camera &camera = truth.cameras[i], &known = rig.cameras[i];
    const double frame = std::round((kTime - known.time_offset) * rate_of(i)) / rate_of(i);
    Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, frame + camera.time_offset);
    image = with_fault(image, faults[i], camera.principal_point(), i);
    if (known.colour) image = corrected(image, *known.colour, known.principal_point());
    images.push_back(std::move(image));
  }
  const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
  const Similarity truth_from_rig = align(poses_of(rig), poses_of(truth));
  const Quat back = glm::inverse(truth_from_rig.rotation);
  const Mesh mesh = build_mesh(rig);
  const Vec3 corner = nominal.cameras.back().pose.position - nominal.cameras.front().pose.position;
  std::vector<double> shown;
  for (const Vec3 eye : {Vec3{-0.022, -0.017, 0}, Vec3{0.29 * corner.x, 0.22 * corner.y, 0}, Vec3{0.01, 0.02, -0.05}}) {
    View view{.width = nominal.cameras[0].width,
              .height = nominal.cameras[0].height,
              .lens = nominal.cameras[0].lens,
              .pose = {eye, {1, 0, 0, 0}},
              .focus = {}};
    const Image scene = render_scene({view.width, view.height, view.lens, view.pose}, kTime);
    view.pose = {back * ((eye - truth_from_rig.translation) / truth_from_rig.scale), back};
    view.focus.plane =
        plane_through(view.pose.world_from_camera({0, 0, kSceneMiddle / truth_from_rig.scale}), view.pose.forward());
    const View focused = focus_still(rig, mesh, view, image_of, {.mode = FocusMode::kSurface});
    const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
    shown.push_back(compare(still.picture, scene, still.coverage).psnr_db);
  }
  return shown;
}

Rig PlannedArray::truth_with_colours_of(const Rig& rig) const {
  Rig known = truth;
  for (size_t i = 0; i < known.cameras.size(); i++) known.cameras[i].colour = rig.cameras[i].colour;
  return known;
}

}  // namespace lf::sim
