// SPDX-License-Identifier: LGPL-2.1-or-later
#include "array_info.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "composite/view_coverage.h"
#include "render/contribution_map.h"
#include "rig/camera_distances.h"
#include "rig/rig_json.h"
#include "view/navigator.h"

namespace lf::serve {
namespace {

std::string name_of(const Camera& camera) { return camera.name.empty() ? std::to_string(camera.id) : camera.name; }

nlohmann::json numbers(const Vec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

ArrayInfo::ArrayInfo(const std::string& rig) : rig_(load_rig(rig)), mesh_(build_mesh(rig_)) {
  nlohmann::json cameras = nlohmann::json::array(), faces = nlohmann::json::array();
  for (const Camera& camera : rig_.cameras) {
    names_.push_back(name_of(camera));
    cameras.push_back({{"name", names_.back()}, {"position", numbers(camera.pose.position)}});
  }
  size_ = largest_distance(rig_);
  for (const MeshFace& face : mesh_.faces)
    faces.push_back(std::vector<CameraIndex>(face.camera.begin(), face.camera.begin() + face.corners()));
  const Pose front = default_viewpoint(rig_).pose;
  json_ = nlohmann::json{{"cameras", std::move(cameras)},
                         {"faces", std::move(faces)},
                         {"right", numbers(front.right())},
                         {"down", numbers(front.down())}}
              .dump();
}

std::string ArrayInfo::hash() const {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(rig_.hash()));
  return text;
}

nlohmann::json ArrayInfo::pixel(const View& view, int x, int y) const {
  nlohmann::json cameras = nlohmann::json::array();
  if (x < 0 || y < 0 || x >= view.width || y >= view.height) return cameras;
  for (const PixelShare& share : pixel_shares(rig_, ViewPlan(rig_, mesh_, view), x, y))
    cameras.push_back({{"name", name_of(rig_.cameras[share.camera])}, {"weight", share.weight}, {"sees", share.sees}});
  return cameras;
}

double ArrayInfo::coverage(const View& view) const {
  return mean_coverage(rig_, ViewPlan(rig_, mesh_, view), ViewCoverage::kColumns, ViewCoverage::kRows);
}

}  // namespace lf::serve
