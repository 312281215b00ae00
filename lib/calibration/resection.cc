// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include <opencv2/calib3d.hpp>

#include "base/median.h"
#include "calibration/initial_layout.h"
#include "calibration/triangulation.h"

namespace lf {
namespace {

constexpr int kLeastPoints = 6;
constexpr int kSamples = 500;
constexpr double kLeastFit = 0.4;

struct Middle {
  Vec3 centre;
  double distance;  // from it
};
Middle middle_of(const std::vector<Vec3>& places) {
  Middle m;
  std::vector<double> values(places.size());
  for (int axis = 0; axis < 3; axis++) {
    for (size_t i = 0; i < places.size(); i++) values[i] = places[i][axis];
    m.centre[axis] = median(values);
  }
  for (size_t i = 0; i < places.size(); i++) values[i] = glm::length(places[i] - m.centre);
  m.distance = median(values);
  return m;
}

}  // namespace

int resect_cameras(Reconstruction& scene, const Tracks& tracks, double threshold) {
  const auto lists = observations_of_cameras(tracks);
  int placed = 0;
  for (size_t i = 0; i < scene.cameras.size(); i++) {
    CameraState& camera = scene.cameras[i];
    if (camera.used) continue;
    std::vector<Vec3> places;
    std::vector<cv::Point2d> sights;
    for (const uint32_t index : lists[i]) {
      const Observation& o = tracks.observations[index];
      const auto uv = camera.lens().unproject(o.pixel);
      if (!scene.targets[o.position].has(o.light) || !uv) continue;
      places.push_back(scene.targets[o.position].point(o.light));
      sights.emplace_back(uv->x, uv->y);
    }
    if (places.size() < kLeastPoints) continue;
    // OpenCV takes points for one that are less than some 0.1 apart: around the origin, at unit distance.
    const auto [centre, size] = middle_of(places);
    if (!(size > 0)) continue;
    std::vector<cv::Point3d> points;
    for (const Vec3& p : places) {
      const Vec3 near = (p - centre) / size;
      points.emplace_back(near.x, near.y, near.z);
    }
    cv::Mat turn, shift, rotation;
    std::vector<int> fit;
    const double reach = threshold / camera.lens_terms()[kF];
    try {
      if (!cv::solvePnPRansac(points, sights, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, shift, false, kSamples,
                              static_cast<float>(reach), 0.999, fit, cv::SOLVEPNP_SQPNP))
        continue;
    } catch (const cv::Exception&) {  // the points are nearly one
      continue;
    }
    if (static_cast<double>(fit.size()) <
        std::max<double>(kLeastPoints, kLeastFit * static_cast<double>(points.size())))
      continue;
    cv::Rodrigues(turn, rotation);  // camera_from_world
    Mat3 r;
    for (int row = 0; row < 3; row++)
      for (int column = 0; column < 3; column++) r[row][column] = rotation.at<double>(row, column);  // transposed
    const Vec3 t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    camera.set_pose({centre - size * (r * t), glm::quat_cast(r)});
    camera.used = true;
    placed++;
  }
  return placed;
}

}  // namespace lf
