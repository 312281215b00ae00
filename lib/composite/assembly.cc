// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/assembly.h"

#include <algorithm>
#include <iterator>

#include "wire/payload.h"

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
  release();
  received_.clear();
  have_sums_ = false;
  fragments_ = missing_ = damaged_ = 0;
  skew_ = 0;
}

void Assembly::release() {
  accumulator_.reset(family_, request_.view.width, request_.view.height);
  kept_.reset();
}

Assembly::Verdict Assembly::add(const wire::AnswerView& answer, std::shared_ptr<const void> bytes) {
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
  const std::span<const wire::FragmentView> all = answer.fragments;
  for (size_t i = 0, n; i < all.size(); i += n) {
    n = wire::group_size(all.subspan(i));
    all_good = add_group(all.subspan(i, n), bytes) && all_good;
  }
  if (answer.actual_time != kNoTime && answer.target_time != kNoTime)
    skew_ = std::max(skew_, time_between(answer.actual_time, answer.target_time));
  return all_good ? Verdict::kAdded : Verdict::kBadFragment;
}

// False if some of it does not fit, which is no damage.
bool Assembly::add_group(std::span<const wire::FragmentView> group, const std::shared_ptr<const void>& bytes) {
  std::span<const FragmentPlanes> planes;
  if (group[0].codec != wire::Codec::kRaw16) {
    planes = decoder_.decode(group);
    if (planes.empty()) {
      damaged_ += static_cast<unsigned>(group.size());
      return true;
    }
  }
  bool all_good = true;
  for (size_t i = 0; i < group.size(); i++) {
    // Twice the same camera (a duplicated packet, two nodes with one camera) would be too bright.
    const bool is_sum = group[i].camera == Fragment::kSum;
    if ((!is_sum && received_.contains(group[i].camera)) ||
        !(planes.empty() ? add_sums(group[i], bytes) : accumulator_.add(planes[i]))) {
      all_good = false;
      continue;
    }
    fragments_++;
    have_sums_ |= is_sum;
    if (!is_sum) received_.insert(group[i].camera);
  }
  return all_good;
}

bool Assembly::add_sums(const wire::FragmentView& fragment, const std::shared_ptr<const void>& bytes) {
  bool copied;
  const ConstSumPlanes sums = decoder_.sums(fragment, &copied);
  if (!bytes || copied) return accumulator_.add(sums);
  const bool added = accumulator_.add_kept(sums);
  if (added && !kept_) kept_ = bytes;
  return added;
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
