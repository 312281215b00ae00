// SPDX-License-Identifier: LGPL-2.1-or-later
#include "api/view_composer.h"

#include <algorithm>
#include <numeric>
#include <string>

#include "api/convert.h"
#include "base/error.h"
#include "wire/answer_parser.h"
#include "wire/moments_codec.h"

namespace lf::api {
namespace {

CameraSet to_camera_set(std::vector<uint32_t> cameras, size_t count) {
  std::ranges::sort(cameras);
  const auto repeats = std::ranges::unique(cameras);
  cameras.erase(repeats.begin(), repeats.end());
  if (!cameras.empty() && cameras.back() >= count)
    throw Error("out_of_service: " + std::to_string(cameras.back()) + " is not one of the rig's " +
                std::to_string(count) + " cameras");
  return cameras;
}

}  // namespace

ViewComposer::ViewComposer(std::shared_ptr<const Rig> rig, uint64_t rig_hash, uint32_t view_id)
    : rig_(std::move(rig)), rig_hash_(rig_hash), view_id_(view_id) {
  assembly_.set_rig(rig_);
}

const ViewRequest& ViewComposer::begin(const lightfield::View& view, const lightfield::RequestOptions& options) {
  ViewRequest request;
  request.view = to_view(view);
  request.view_id = view_id_;
  request.sequence = sequence_ + 1;
  request.target_time = options.time;
  request.absolute_time = options.time != kNoTime;
  if (options.quality < 0 || options.quality > 100) throw Error("quality: must be 0 to 100");
  request.quality = static_cast<uint8_t>(options.quality);
  request.rig_hash = rig_hash_;
  request.out_of_service = to_camera_set(options.out_of_service, rig_->cameras.size());
  const FocusControl::Settings settings = to_settings(options.focus, options.nearest, options.farthest);
  if (settings != focus_.settings()) focus_ = ViewFocus(settings);
  if (settings.mode != FocusMode::kPlane) focus_.apply(request);

  current_.reset();
  assembly_.begin(request);
  background_ = {options.background.r, options.background.g, options.background.b};
  answered_.clear();
  tried_.clear();
  moments_.clear();
  sequence_ = request.sequence;
  return current_.emplace(std::move(request));
}

ViewComposer::Added ViewComposer::add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  if (!current_) return {false, "no picture was begun"};
  const std::string why_not = wire::is_moments(unit) ? add_moments(unit) : add_answer(unit, std::move(owner));
  return {why_not.empty(), why_not};
}

// Why not; empty: they were added.
std::string ViewComposer::add_moments(std::span<const uint8_t> unit) {
  std::string reason;
  const std::optional<wire::MomentsHeader> header = wire::parse_moments_header(unit, nullptr, &reason);
  if (!header) return "damaged: " + reason;
  if (header->view_id != view_id_ || header->sequence != current_->sequence) return "of another request";
  if (header->rig_hash != rig_hash_) return "of another rig";
  const FocalMap* const map = current_->view.focus.map.get();
  if (header->gains || !map || current_->trials.empty()) return "was not asked for";
  std::optional<wire::MomentsUnit> trials =
      wire::decode_moments(unit, {map->columns, map->rows, current_->trials.size()}, &reason);
  if (!trials) return "damaged: " + reason;
  if (!tried_.insert(header->node).second) return "is there already";
  if (moments_.empty())
    moments_ = std::move(trials->trials);
  else
    for (size_t i = 0; i < moments_.size(); i++) moments_[i].add(trials->trials[i]);
  return {};
}

std::string ViewComposer::add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  std::string reason;
  const std::optional<wire::AnswerView> answer = wire::parse_answer(unit, &reason);
  if (!answer) return "damaged: " + reason;
  const unsigned damaged = assembly_.damaged();
  switch (assembly_.add(*answer, std::move(owner))) {
    case Assembly::Verdict::kOtherRequest: return "of another request";
    case Assembly::Verdict::kOtherRig: return "of another rig";
    case Assembly::Verdict::kBadFragment:
      return "is there already, or does not fit the view or the parts before: some of it was left out";
    default: break;
  }
  answered_.insert(answer->node);
  return assembly_.damaged() > damaged ? "damaged: some of it was left out" : "";
}

bool ViewComposer::is_complete() const {
  if (!current_) return false;
  CameraSet all(rig_->cameras.size());
  std::iota(all.begin(), all.end(), 0);
  CameraRanges awaited(all);
  awaited.remove(CameraRanges(current_->out_of_service));
  return assembly_.cameras().contains(awaited) &&
         (current_->trials.empty() || std::ranges::includes(tried_, answered_));
}

lightfield::Image ViewComposer::finish() {
  if (!current_) throw Error("no picture was begun");
  assembly_.finish(PixelFamily::kRgb, background_ != Background{});
  missing_ = assembly_.missing();
  lightfield::Image picture = from_image(assembly_.picture().resolve(background_));
  if (focus_.settings().mode != FocusMode::kPlane) {
    if (!array_) array_.emplace(*rig_);
    focus_.take(*current_, moments_, *array_, missing_ == 0 && assembly_.damaged() == 0);
  }
  assembly_.release();
  current_.reset();
  return picture;
}

void ViewComposer::reset_focus() { focus_ = ViewFocus(focus_.settings()); }

}  // namespace lf::api
