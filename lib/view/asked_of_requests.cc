// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/asked_of_requests.h"

#include <algorithm>
#include <iterator>
#include <utility>

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

}  // namespace lf
