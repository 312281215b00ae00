// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/ownership.h"

#include <algorithm>

namespace lf {
namespace {

bool meets_focal_surface(const ViewPlan& plan, const Vec2& ray) {
  const double along = glm::dot(plan.focal_normal(), Vec3(ray, 1));
  return plan.focal_offset() > 0 ? along > 0 : along < 0;
}

// All quotients e_k / (e_0 + e_1 + e_2) >= 0. False for rays that do not exist (NaN).
bool contains(const FacePlan& face, const Vec2& ray) {
  const double e0 = FacePlan::evaluate(face.edge[0], ray), e1 = FacePlan::evaluate(face.edge[1], ray),
               e2 = FacePlan::evaluate(face.edge[2], ray), sum = e0 + e1 + e2;
  return (e0 >= 0 && e1 >= 0 && e2 >= 0 && sum > 0) || (e0 <= 0 && e1 <= 0 && e2 <= 0 && sum < 0);
}

}  // namespace

OwnerMap::OwnerMap(const ViewPlan& plan, const Rect& region)
    : region_(intersect(region, {0, 0, plan.view().width, plan.view().height})) {
  if (region_.empty()) region_ = {};
  owner_.assign(static_cast<size_t>(region_.width()) * region_.height(), kNone);
  for (size_t i = 0; i < plan.faces().size(); i++) {
    const FacePlan& face = plan.faces()[i];
    const Rect rect = intersect(face.rect, region_);
    for (int y = rect.y0; y < rect.y1; y++) {
      int32_t* owner = &owner_[static_cast<size_t>(y - region_.y0) * region_.width() - region_.x0];
      for (int x = rect.x0; x < rect.x1; x++) {
        if (owner[x] != kNone) continue;
        const Vec2 ray = plan.rays().at(x, y);
        if (contains(face, ray) && glm::dot(face.facing, Vec3(ray, 1)) > 0 && meets_focal_surface(plan, ray))
          owner[x] = static_cast<int32_t>(i);
      }
    }
  }
}

FaceWeights face_weights(const FacePlan& face, const Vec2& ray) {
  const double e0 = FacePlan::evaluate(face.edge[0], ray), e1 = FacePlan::evaluate(face.edge[1], ray),
               e2 = FacePlan::evaluate(face.edge[2], ray), sum = e0 + e1 + e2;
  return {{static_cast<float>(e0 / sum), static_cast<float>(e1 / sum), static_cast<float>(e2 / sum)}};
}

CameraCorners::CameraCorners(const ViewPlan& plan, CameraIndex camera) : corner_(plan.faces().size(), -1) {
  for (size_t i = 0; i < corner_.size(); i++)
    for (int8_t k = 0; k < 3; k++)
      if (plan.faces()[i].camera[k] == camera) corner_[i] = k;
}

Rect CameraCorners::owned(const OwnerMap& owners, const Rect& rect) const {
  Rect bounds;
  for (int y = rect.y0; y < rect.y1; y++) {
    const int32_t* const begin = owners.row(rect.x0, y);
    const int32_t* const end = begin + rect.width();
    const auto mine = [this](int32_t owner) { return has(owner); };
    const int32_t* const first = std::find_if(begin, end, mine);
    if (first == end) continue;
    const int32_t* last = end - 1;
    while (!mine(*last)) last--;
    const int x0 = rect.x0 + static_cast<int>(first - begin), x1 = rect.x0 + static_cast<int>(last - begin) + 1;
    bounds = unite(bounds, {x0, y, x1, y + 1});
  }
  return bounds;
}

std::vector<float> camera_hat(const ViewPlan& plan, const OwnerMap& owners, CameraIndex camera, const Rect& rect) {
  const CameraCorners corners(plan, camera);
  std::vector<float> hat;
  hat.reserve(static_cast<size_t>(rect.width()) * rect.height());
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) hat.push_back(corners.weight(plan, owners.at(x, y), plan.rays().at(x, y)));
  return hat;
}

}  // namespace lf
