// SPDX-License-Identifier: LGPL-2.1-or-later
#include "api/view_composer.h"

#include <algorithm>
#include <functional>
#include <numeric>
#include <string>
#include <string_view>

#include <lightfield/compositor.h>

#include "api/convert.h"
#include "base/error.h"
#include "composite/assembly.h"
#include "wire/answer_parser.h"
#include "wire/moments_codec.h"
#include "wire/request_codec.h"

namespace lf::api {

namespace {

CameraSet to_camera_set(std::vector<uint32_t> cameras, size_t count) {
  std::ranges::sort(cameras);
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
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
  const bool match = options.match_brightness.value_or(!rig_->has_colour());
  if (settings != focus_.settings() || match != focus_.matches_gains()) focus_ = ViewFocus(settings, match);
  if (settings.mode != FocusMode::kPlane) focus_.apply(request);

  current_.reset();
  assembly_.begin(request);
  background_ = {options.background.r, options.background.g, options.background.b};
  answered_.clear();
  tried_.clear();
  answers_ = {};
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
  // What is the same to the last byte has come twice: no two nodes see the same.
  const size_t hash = std::hash<std::string_view>()({reinterpret_cast<const char*>(unit.data()), unit.size()});
  if (tried_.contains(hash)) return "is there already";
  const std::string why_not = lf::add_moments(unit, *header, *current_, answers_);
  if (!why_not.empty()) return "damaged, or not asked for: " + why_not;
  tried_.insert(hash);
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
  answered_.insert(answer->cameras);
  return assembly_.damaged() > damaged ? "damaged: some of it was left out" : "";
}

bool ViewComposer::is_complete() const {
  if (!current_) return false;
  CameraSet all(rig_->cameras.size());
  std::iota(all.begin(), all.end(), 0);
  CameraRanges awaited(all);
  awaited.remove(CameraRanges(current_->out_of_service));
  const size_t units = static_cast<size_t>(!current_->trials.empty()) + current_->gains.ask;  // of each node's moments
  return assembly_.cameras().contains(awaited) && tried_.size() >= units * answered_.size();
}

lightfield::Image ViewComposer::finish() {
  if (!current_) throw Error("no picture was begun");
  assembly_.finish(PixelFamily::kRgb, background_ != Background{});
  missing_ = assembly_.missing();
  lightfield::Image picture = from_image(assembly_.picture().resolve(background_));
  if (focus_.settings().mode != FocusMode::kPlane) {
    if (!array_) array_.emplace(*rig_);
    answers_.complete = missing_ == 0 && assembly_.damaged() == 0;
    focus_.take(*current_, answers_, *array_);
  }
  assembly_.release();
  current_.reset();
  return picture;
}

void ViewComposer::reset_focus() { focus_ = ViewFocus(focus_.settings(), focus_.matches_gains()); }
}  // namespace lf::api

namespace lightfield {

struct [[gnu::visibility("hidden")]] Compositor::State {
  State(const Rig& rig, uint32_t view_id) : composer(rig.data().rig, rig.data().hash, view_id) {}
  lf::api::ViewComposer composer;
};

Compositor::Compositor(Rig rig, uint32_t view_id) : state_(std::make_unique<State>(rig, view_id)) {}
Compositor::~Compositor() = default;
Compositor::Compositor(Compositor&&) noexcept = default;
Compositor& Compositor::operator=(Compositor&&) noexcept = default;

Bytes Compositor::request(const View& view, const RequestOptions& options) {
  return lf::wire::encode_request(state_->composer.begin(view, options));
}

Compositor::Added Compositor::add(const Bytes& part) { return state_->composer.add(part); }

bool Compositor::is_complete() const { return state_->composer.is_complete(); }

Image Compositor::finish() { return state_->composer.finish(); }

unsigned Compositor::missing() const { return state_->composer.missing(); }
void Compositor::reset_focus() { state_->composer.reset_focus(); }

}  // namespace lightfield
