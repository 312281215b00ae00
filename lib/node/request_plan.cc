// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/request_plan.h"

#include <iterator>
#include <string>
#include <variant>

#include "base/text.h"
#include "focus/hypothesis_renderer.h"
#include "render/camera_projection.h"

namespace lf {

RequestPlan::RequestPlan(const Rig& rig, const Mesh& mesh, const ViewRequest& request, std::span<const CameraIndex> own,
                         const ParallelFor& parallel)
    : rig_(rig), access_(Access::kSelf), quality_(request.quality), gains_(request.gains) {
  sum_.emplace(ViewPlan(rig, mesh, displayed_view(request), parallel), own, parallel);
  cameras_ = sum_->cameras();
  if (gains_.ask) {
    std::vector<CameraIndex> in_service;
    std::ranges::set_difference(own, request.out_of_service, std::back_inserter(in_service));
    wide_.emplace(rig, mesh, mean_view(request.view), in_service);
    cameras_.clear();
    std::ranges::set_union(sum_->cameras(), wide_->cameras(), std::back_inserter(cameras_));
  }
  if (request.hypotheses.empty()) return;
  hypothesis_job_.emplace(rig, mesh, hypothesis_view(request.view), own, parallel);
  if (measures_depth(request.hypotheses)) measured_view_ = request.view;
  hypotheses_ = hypothesis_levels(request.view, request.hypotheses);
}

RequestPlan::RequestPlan(const Rig& rig, const wire::WarpCommand& command, std::span<const CameraIndex> own,
                         const ParallelFor& parallel)
    : rig_(rig), access_(Access::kWarp), quality_(command.quality) {
  sum_.emplace(ViewPlan(command.warp, rig.cameras.size(), parallel), own, parallel);
  cameras_ = sum_->cameras();
}

RequestPlan::RequestPlan(const Rig& rig, const wire::PixelCommand& command, std::span<const CameraIndex> own)
    : rig_(rig), access_(Access::kPixels), quality_(command.quality) {
  for (const wire::PixelCommand::Region& region : command.regions) {
    if (!std::ranges::binary_search(own, region.camera)) continue;
    const Camera& camera = rig.cameras[region.camera];
    if (intersect(region.rect, {0, 0, camera.width, camera.height}) != region.rect)
      throw Error("camera " + std::to_string(camera.id) + ": requested pixels are outside the image");
    cameras_.push_back(region.camera);
    pixels_.push_back(region.rect);
  }
}

bool RequestPlan::draws(CameraIndex camera) const {
  return std::ranges::binary_search(sum_ ? sum_->cameras() : cameras_, camera);
}

std::vector<CameraIndex> RequestPlan::by_part() const {
  if (!sum_) return {};
  std::vector<CameraIndex> cameras = sum_->cameras();
  const auto part = [this](CameraIndex camera) {
    const Rect& rect = sum_->plan().camera_rect(camera);
    return -static_cast<int64_t>(rect.width()) * rect.height();
  };
  std::ranges::stable_sort(cameras, {}, part);
  return cameras;
}

Rect RequestPlan::answer_region(CameraIndex camera) const {
  if (sum_) return needed_pixels(sum_->plan(), camera, rig_.cameras[camera]);
  return pixels_[static_cast<size_t>(std::ranges::lower_bound(cameras_, camera) - cameras_.begin())];
}

Rect RequestPlan::drawn_region(CameraIndex camera) const {
  if (!draws(camera)) return {};
  const Rect colour = answer_region(camera);
  if (!hypothesis_job_ || hypothesis_job_->plan().camera_rect(camera).empty()) return colour;
  return unite(colour, hypothesis_pixels(hypothesis_job_->plan(), camera, rig_.cameras[camera], hypotheses_));
}

Rect RequestPlan::region(CameraIndex camera) const {
  if (wide_ && std::ranges::binary_search(wide_->cameras(), camera))
    return {0, 0, rig_.cameras[camera].width, rig_.cameras[camera].height};
  return drawn_region(camera);
}

bool RequestPlan::shows_detail(CameraIndex camera) const {
  switch (access_) {
    case Access::kSelf: return lf::shows_detail(sum_->plan().view(), rig_.cameras[camera]);
    // A command does not contain the viewpoint.
    case Access::kWarp: return !is_coarse(sum_->plan().view().lens, rig_.cameras[camera].lens);
    case Access::kPixels: break;
  }
  return true;
}

std::unique_ptr<const RequestPlan> plan_request(const Rig& rig, MeshCache& mesh, const wire::AnyRequest& request,
                                                std::span<const CameraIndex> own, const ParallelFor& parallel) {
  if (const auto* const warp = std::get_if<wire::WarpCommand>(&request))
    return std::make_unique<const RequestPlan>(rig, *warp, own, parallel);
  if (const auto* const pixels = std::get_if<wire::PixelCommand>(&request))
    return std::make_unique<const RequestPlan>(rig, *pixels, own);
  const auto& view = std::get<ViewRequest>(request);
  return std::make_unique<const RequestPlan>(rig, mesh.get(rig, view.out_of_service), view, own, parallel);
}

}  // namespace lf
