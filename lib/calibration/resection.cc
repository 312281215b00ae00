// SPDX-License-Identifier: LGPL-2.1-or-later
#include <opencv2/calib3d.hpp>

#include "calibration/initial_layout.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

constexpr int kLeastPoints = 6;
constexpr int kSamples = 500;
constexpr double kLeastFit = 0.4;

}  // namespace

int resect_cameras(Scene& scene, const Tracks& tracks, double threshold) {
  const auto lists = observations_of_cameras(tracks);
  int placed = 0;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    CameraState& camera = scene.cameras[i];
    if (camera.used) continue;
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> sights;
    for (const uint32_t index : lists[i]) {
      const Observation& o = tracks.observations[index];
      const auto uv = camera.lens().unproject(o.pixel);
      if (!scene.targets[o.position].has(o.light) || !uv) continue;
      const Vec3 p = scene.targets[o.position].point(o.light);
      points.emplace_back(p.x, p.y, p.z);
      sights.emplace_back(uv->x, uv->y);
    }
    if (points.size() < kLeastPoints) continue;
    cv::Mat turn, shift, rotation;
    std::vector<int> fit;
    const double reach = threshold / camera.lens_terms()[kF];
    if (!cv::solvePnPRansac(points, sights, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, shift, false, kSamples,
                            static_cast<float>(reach), 0.999, fit, cv::SOLVEPNP_SQPNP) ||
        static_cast<double>(fit.size()) <
            std::max<double>(kLeastPoints, kLeastFit * static_cast<double>(points.size())))
      continue;
    cv::Rodrigues(turn, rotation);  // camera_from_world
    Mat3 r;
    for (int row = 0; row < 3; row++)
      for (int column = 0; column < 3; column++) r[row][column] = rotation.at<double>(row, column);  // transposed
    const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    camera.set_pose({-(r * t), glm::quat_cast(r)});
    camera.used = true;
    placed++;
  }
  return placed;
}

}  // namespace lf
