// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/camera_turns.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace lf {

std::optional<CameraProbe> CameraTurns::next(const Rig& rig, const ViewRequest& composed, unsigned interval) {
  if (!monitor_ || rig_ != rig.hash()) {
    clear();
    monitor_.emplace(rig);
    rig_ = rig.hash();
  }
  if (++requests_ < (asked_ ? interval + kPatience : interval)) return {};
  requests_ = 0;
  lose();
  const std::optional<CameraIndex> camera = monitor_->next(composed.out_of_service);
  if (!camera) return {};
  CameraSet without;
  std::ranges::set_union(composed.out_of_service, monitor_->suspected(), std::back_inserter(without));
  asked_ = make_probe(rig, *camera, shown_view(composed), without);
  return asked_;
}

bool CameraTurns::expects(const ViewRequest& probe) {
  if (!asked_ || probe.view.pose != asked_->seen.view.pose) return false;  // of somebody else, or too late
  if (probe.view == asked_->seen.view || (probe.view == asked_->predicted.view && seen_)) return true;
  lose();
  return false;
}

CameraTurns::Came CameraTurns::take(const ViewRequest& probe, CoveredPicture picture) {
  if (probe.view == asked_->seen.view) {
    seen_ = std::move(picture);
    return Came::kHalf;
  }
  const std::vector<CameraMonitor::Suspect> before = monitor_->suspects();
  monitor_->take(asked_->camera, compare_prediction(picture, *seen_));
  lose();
  return monitor_->suspects() != before ? Came::kOtherSuspects : Came::kTurn;
}

void CameraTurns::lose() {
  asked_.reset();
  seen_.reset();
}

}  // namespace lf
