// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_request.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/text.h"

namespace lf {

void OutOfService::announce(uint32_t view_id, CameraSet cameras) {
  std::lock_guard lock(mutex_);
  if (cameras.empty())
    views_.erase(view_id);
  else
    views_[view_id] = std::move(cameras);
  if (views_.size() > kMostViews) views_.erase(views_.begin());
}

CameraSet OutOfService::with_announced(uint32_t view_id, const CameraSet& cameras) const {
  std::lock_guard lock(mutex_);
  const auto view = views_.find(view_id);
  if (view == views_.end()) return cameras;
  CameraSet all;
  std::ranges::set_union(cameras, view->second, std::back_inserter(all));
  return all;
}

void OutOfService::clear() {
  std::lock_guard lock(mutex_);
  views_.clear();
}

void ExtraRequests::ask(std::vector<ViewRequest> requests) {
  const std::lock_guard lock(mutex_);
  requests_ = std::move(requests);
}

std::vector<ViewRequest> ExtraRequests::take_beside(const ViewRequest& request, uint32_t& next_number) {
  std::unique_lock lock(mutex_);
  std::vector<ViewRequest> extra = std::exchange(requests_, {});
  lock.unlock();
  std::erase_if(extra, [&](const ViewRequest& e) {
    return e.rig_hash != 0 && request.rig_hash != 0 && e.rig_hash != request.rig_hash;
  });
  for (ViewRequest& e : extra) {
    CameraSet out;
    std::ranges::set_union(e.out_of_service, request.out_of_service, std::back_inserter(out));
    e.out_of_service = std::move(out);
    e.sequence = next_number++;
    e.view_id = request.view_id;
    e.target_time = request.target_time;
    e.absolute_time = request.absolute_time;
    e.quality = request.quality;
    e.rig_hash = request.rig_hash;
  }
  return extra;
}

namespace {

RequestGate::Refusal check_cost(const RequestCost& cost, const RequestLimits& limits, double extent) {
  const uint64_t pixels = static_cast<uint64_t>(cost.width) * static_cast<uint64_t>(cost.height);
  const uint64_t views = static_cast<uint64_t>(cost.columns) * static_cast<uint64_t>(cost.rows);
  if (pixels > limits.pixels || (views > 1 && pixels * views / RequestLimits::kOfSet > limits.pixels))
    return RequestGate::kPixels;
  const double widest = limits.aperture > 0 ? limits.aperture : extent;
  if (widest > 0 && cost.aperture > widest) return RequestGate::kAperture;
  if (static_cast<double>(pixels) * cost.lens_steps > static_cast<double>(limits.pixels) * RequestLimits::kLensSteps)
    return RequestGate::kLens;
  return cost.trials > limits.trials ? RequestGate::kTrials : RequestGate::kNone;
}

std::string metres(double value) { return format_text("%.4g m", value); }

}  // namespace

double planned_work(const RequestCost& cost, size_t cameras) {
  // By an aperture many cameras make a pixel; a trial is looked at for every 4 x 4 or more of them.
  constexpr double kByAperture = 16, kTrial = 1.0 / 16;
  // A step of the lens takes about as long as two pixels, and finding the face of a pixel of a distorted view as two
  // more. Where views are not blended by the mesh, each of the points of a grid of 16 x 16 pixels looks at all cameras.
  constexpr double kLensStep = 2, kCameraOfPoint = 4.0 / (16 * 16);
  // Each request passes once over the array's cameras and faces.
  constexpr double kCamera = 16;
  const double pixels = static_cast<double>(cost.width) * cost.height, all = static_cast<double>(cameras);
  const bool blended = cost.aperture > 0 || cost.by_angle;
  double per_pixel = (blended ? kByAperture : 1) + kTrial * cost.trials;
  if (cost.lens_steps > 0) per_pixel += kLensStep * (cost.lens_steps + 1);
  if (blended) per_pixel += kCameraOfPoint * all;
  return pixels * per_pixel + kCamera * all;
}

double array_extent(const Rig& rig) {
  if (rig.cameras.empty()) return 0;
  const auto [least, most] = bounding_box(rig);
  return glm::length(most - least);
}

RequestGate::Refusal RequestGate::check(uint64_t view, const RequestCost& cost, const RequestLimits& limits,
                                        double extent, uint64_t now) {
  const auto known = views_.find(view);
  if (known == views_.end() && views_.size() >= limits.views) {
    std::erase_if(views_, [now](const auto& entry) { return now > entry.second.last + kViewQuiet; });
    if (views_.size() >= limits.views) return kViews;
  }
  View& state = known != views_.end() ? known->second : views_.emplace(view, View{now}).first->second;
  if (now > state.last) state.spare = std::min(1.0, state.spare + static_cast<double>(now - state.last) * 1e-9);
  state.last = std::max(state.last, now);
  if (limits.requests_per_second > 0) {
    const double share = 1.0 / limits.requests_per_second;
    if (state.spare < share * (1 - 1e-9)) return kRate;
    state.spare -= share;
  }
  return check_cost(cost, limits, extent);
}

std::string refusal_text(RequestGate::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent) {
  switch (refusal) {
    case RequestGate::kPixels:
      return "asks for " + std::to_string(cost.width) + "x" + std::to_string(cost.height) + " pixels" +
             (cost.columns * cost.rows > 1 ? " " + std::to_string(cost.columns * cost.rows) + " times" : "") +
             ", more than the " + std::to_string(limits.pixels) + " of max-pixels" +
             (cost.columns * cost.rows > 1 ? " (of a set " + std::to_string(RequestLimits::kOfSet) + " times that)"
                                           : "");
    case RequestGate::kAperture:
      return "asks for an aperture of " + metres(cost.aperture) +
             (limits.aperture > 0 ? ", more than the " + metres(limits.aperture) + " of max-aperture"
                                  : ", wider than the array, which has " + metres(extent) + " (max-aperture)");
    case RequestGate::kTrials:
      return "asks for " + std::to_string(cost.trials) + " trials, more than the " + std::to_string(limits.trials) +
             " of max-trials";
    case RequestGate::kRate:
      return "asks more often than the " + std::to_string(limits.requests_per_second) +
             " times a second of max-requests-per-second";
    case RequestGate::kViews:
      return "is one more than the " + std::to_string(limits.views) + " views at a time of max-views";
    case RequestGate::kLens:
      return "has a lens whose distortion takes " + format_text("%.0f", cost.lens_steps) +
             " steps a pixel to undo, at " + size_text(cost.width, cost.height) +
             " pixels more than max-pixels allows: ask for a smaller view or a lens with less distortion";
    case RequestGate::kNumRefusals:
    case RequestGate::kNone: break;
  }
  return "";
}

}  // namespace lf
