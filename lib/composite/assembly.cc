// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"

#include <algorithm>
#include <iterator>

namespace lf {

void Assembly::set_rig(std::shared_ptr<const Rig> rig) {
  rig_ = std::move(rig);
  rig_hash_ = rig_ ? rig_->hash() : 0;
  mesh_.clear();
}

void Assembly::begin(const ViewRequest& request) {
  if (rig_) mesh_.get(*rig_, request.out_of_service);
  request_ = request;
  expected_rig_ = rig_hash_ != 0 ? rig_hash_ : request.rig_hash;
  family_ = PixelFamily::kNone;
  accumulator_.reset(family_, request.view.width, request.view.height);
  received_.clear();
  have_sums_ = false;
  fragments_ = missing_ = 0;
  skew_ = 0;
}

Assembly::Verdict Assembly::add(const wire::Answer& answer) {
  if (answer.view_id != request_.view_id || answer.sequence != request_.sequence) return Verdict::kOtherRequest;
  if (expected_rig_ == 0) expected_rig_ = answer.rig_hash;
  if (answer.rig_hash != expected_rig_) return Verdict::kOtherRig;
  if (answer.view_width != request_.view.width || answer.view_height != request_.view.height)
    return Verdict::kBadFragment;
  if (family_ == PixelFamily::kNone && answer.family != PixelFamily::kNone) {
    family_ = answer.family;
    accumulator_.reset(family_, request_.view.width, request_.view.height);
  }
  bool all_good = true;
  for (const Fragment& fragment : answer.fragments) {
    // Twice the same camera (a duplicated packet, two nodes with one camera) would be too bright.
    const bool is_sum = fragment.camera == Fragment::kSum;
    if ((!is_sum && received_.contains(fragment.camera)) || !accumulator_.add(fragment)) {
      all_good = false;
      continue;
    }
    fragments_++;
    have_sums_ |= is_sum;
    if (!is_sum) received_.insert(fragment.camera);
  }
  if (answer.actual_time != kNoTime && answer.target_time != kNoTime)
    skew_ = std::max(skew_, time_between(answer.actual_time, answer.target_time));
  return all_good ? Verdict::kAdded : Verdict::kBadFragment;
}

void Assembly::finish(PixelFamily fallback, bool mark_uncovered) {
  if (family_ == PixelFamily::kNone) {
    family_ = fallback;
    accumulator_.reset(family_, request_.view.width, request_.view.height);
  }
  if (!rig_) return;
  const View& view = request_.view;
  const ViewPlan plan(*rig_, mesh_.get(*rig_, request_.out_of_service), view);
  std::vector<CameraIndex> absent;  // cameras that may have a weight somewhere and sent nothing
  if (!have_sums_)
    std::ranges::copy_if(plan.contributors(), std::back_inserter(absent),
                         [this](CameraIndex camera) { return !received_.contains(camera); });
  if (absent.empty() && !mark_uncovered) return;

  const OwnerMap owners(plan, {0, 0, view.width, view.height});
  for (const CameraIndex camera : absent) {
    const Rect rect = plan.camera_rect(camera);
    const std::vector<float> hat = camera_hat(plan, owners, camera, rect);
    if (std::ranges::all_of(hat, [](float w) { return w == 0; })) continue;
    missing_++;
    accumulator_.add_lost_hat(rect, hat);
  }
  if (mark_uncovered) accumulator_.set_uncovered(owners);
}

}  // namespace lf
