// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_request.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/text.h"

namespace lf {

void OutOfServiceRegistry::announce(uint32_t view_id, CameraSet cameras) {
  std::lock_guard lock(mutex_);
  if (cameras.empty())
    views_.erase(view_id);
  else
    views_[view_id] = std::move(cameras);
  if (views_.size() > kMaxViews) views_.erase(views_.begin());
}

CameraSet OutOfServiceRegistry::with_announced(uint32_t view_id, const CameraSet& cameras) const {
  std::lock_guard lock(mutex_);
  const auto view = views_.find(view_id);
  if (view == views_.end()) return cameras;
  CameraSet all;
  std::ranges::set_union(cameras, view->second, std::back_inserter(all));
  return all;
}

void OutOfServiceRegistry::clear() {
  std::lock_guard lock(mutex_);
  views_.clear();
}

void ExtraRequests::ask(std::vector<ViewRequest> requests) {
  const std::lock_guard lock(mutex_);
  requests_ = std::move(requests);
}

std::vector<ViewRequest> ExtraRequests::take_for(const ViewRequest& request, uint32_t& next_number) {
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

RequestLimiter::Refusal check_cost(const RequestCost& cost, const RequestLimits& limits, double extent) {
  const uint64_t pixels = static_cast<uint64_t>(cost.width) * static_cast<uint64_t>(cost.height);
  const uint64_t views = static_cast<uint64_t>(cost.columns) * static_cast<uint64_t>(cost.rows);
  if (pixels > limits.pixels || (views > 1 && pixels * views / RequestLimits::kSetFactor > limits.pixels))
    return RequestLimiter::kPixels;
  const double widest = limits.aperture > 0 ? limits.aperture : extent;
  if (widest > 0 && cost.aperture > widest) return RequestLimiter::kAperture;
  if (static_cast<double>(pixels) * cost.lens_steps >
      static_cast<double>(limits.pixels) * RequestLimits::kMaxLensIterations)
    return RequestLimiter::kLens;
  return cost.hypotheses > limits.hypotheses ? RequestLimiter::kHypotheses : RequestLimiter::kNone;
}

std::string metres(double value) { return format_text("%.4g m", value); }

}  // namespace

double estimated_work(const RequestCost& cost, size_t cameras) {
  // Aperture blending uses many cameras per pixel. A depth hypothesis is evaluated once per 4 x 4 or more pixels.
  constexpr double kByAperture = 16, kHypothesis = 1.0 / 16;
  // A lens iteration costs about as much as two pixels, and finding the face of a pixel in a distorted view costs two
  // more. Other blending than by mesh visits all cameras for each point of a grid of 16 x 16 pixels.
  constexpr double kLensStep = 2, kCameraOfPoint = 4.0 / (16 * 16);
  // Each request visits the cameras and faces of the array once.
  constexpr double kCamera = 16;
  const double pixels = static_cast<double>(cost.width) * cost.height, all = static_cast<double>(cameras);
  const bool blended = cost.aperture > 0 || cost.by_angle;
  double per_pixel = (blended ? kByAperture : 1) + kHypothesis * cost.hypotheses;
  if (cost.lens_steps > 0) per_pixel += kLensStep * (cost.lens_steps + 1);
  if (blended) per_pixel += kCameraOfPoint * all;
  return pixels * per_pixel + kCamera * all;
}

double array_extent(const Rig& rig) {
  if (rig.cameras.empty()) return 0;
  const auto [least, most] = bounding_box(rig);
  return glm::length(most - least);
}

RequestLimiter::Refusal RequestLimiter::check(uint64_t view, const RequestCost& cost, const RequestLimits& limits,
                                              double extent, uint64_t now) {
  const auto known = views_.find(view);
  if (known == views_.end() && views_.size() >= limits.views) {
    std::erase_if(views_, [now](const auto& entry) { return now > entry.second.last + kViewTimeout; });
    if (views_.size() >= limits.views) return kViews;
  }
  View& state = known != views_.end() ? known->second : views_.emplace(view, View{now}).first->second;
  if (now > state.last) state.credit = std::min(1.0, state.credit + static_cast<double>(now - state.last) * 1e-9);
  state.last = std::max(state.last, now);
  if (limits.requests_per_second > 0) {
    const double share = 1.0 / limits.requests_per_second;
    if (state.credit < share * (1 - 1e-9)) return kRate;
    state.credit -= share;
  }
  return check_cost(cost, limits, extent);
}

std::string refusal_text(RequestLimiter::Refusal refusal, const RequestCost& cost, const RequestLimits& limits,
                         double extent) {
  switch (refusal) {
    case RequestLimiter::kPixels:
      return "requests " + std::to_string(cost.width) + "x" + std::to_string(cost.height) + " pixels" +
             (cost.columns * cost.rows > 1 ? " " + std::to_string(cost.columns * cost.rows) + " times" : "") +
             ", more than the " + std::to_string(limits.pixels) + " of max-pixels" +
             (cost.columns * cost.rows > 1 ? " (of a set " + std::to_string(RequestLimits::kSetFactor) + " times that)"
                                           : "");
    case RequestLimiter::kAperture:
      return "requests an aperture of " + metres(cost.aperture) +
             (limits.aperture > 0 ? ", more than the " + metres(limits.aperture) + " of max-aperture"
                                  : ", wider than the array, which has " + metres(extent) + " (max-aperture)");
    case RequestLimiter::kHypotheses:
      return "requests " + std::to_string(cost.hypotheses) + " depth hypotheses, more than the " +
             std::to_string(limits.hypotheses) + " of max-hypotheses";
    case RequestLimiter::kRate:
      return "exceeds " + std::to_string(limits.requests_per_second) + " requests per second (max-requests-per-second)";
    case RequestLimiter::kViews:
      return "exceeds " + std::to_string(limits.views) + " views at the same time (max-views)";
    case RequestLimiter::kLens:
      return "has a lens with a distortion that takes " + format_text("%.0f", cost.lens_steps) +
             " steps per pixel to correct, at " + size_text(cost.width, cost.height) +
             " pixels more than max-pixels allows: request a smaller view, or use a lens with less distortion";
    case RequestLimiter::kNumRefusals:
    case RequestLimiter::kNone: break;
  }
  return "";
}

}  // namespace lf
