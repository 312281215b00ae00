// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_stream.h"

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "common/common.h"
#include "view/views_json.h"
#include "wire/command_codec.h"

namespace lf {

namespace {

CameraSet parse_out_of_service(const Rig* rig, const std::string& list) {
  if (list.empty()) return {};
  if (!rig) throw Error("out-of-service: needs the property rig, which says what cameras there are");
  return parse_camera_list(*rig, list);
}

}  // namespace

RequestStream::RequestStream(const ViewRequestSettings& settings)
    : access_(CameraAccess::of(settings.access)), schedule_(settings.fps_n, settings.fps_d), loop_(settings.loop) {
  set_rig(settings.rig.empty() ? nullptr : shared_rig(settings.rig), settings.out_of_service);
  if (rig_) default_viewpoint_ = lf::default_viewpoint(*rig_);
  if (!settings.location.empty()) playback_.emplace(load_views(settings.location), schedule_, settings.loop);
}

GstClockTime RequestStream::end() const {
  if (!playback_ || loop_) return GST_CLOCK_TIME_NONE;
  return playback_->item(0)->time + playback_->duration();
}

void RequestStream::set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service) {
  if (access_ && !rig) throw Error("access: needs the property rig, from which commands for the cameras are made");
  out_of_service_ = parse_out_of_service(rig.get(), out_of_service);
  rig_ = std::move(rig);
  rig_hash_ = rig_ ? rig_->hash() : 0;
  if (!rig_) return;
  const Camera& camera = rig_->cameras[middle_camera(*rig_)];
  default_width_ = camera.width;
  default_height_ = camera.height;
}

void RequestStream::set_out_of_service(const std::string& list) {
  out_of_service_ = parse_out_of_service(rig_.get(), list);
}

void RequestStream::seek(GstClockTime running_time) {
  index_ = playback_ ? playback_->first_at(running_time) : schedule_.first_from(running_time);
}

std::optional<RequestSlot> RequestStream::next() const {
  if (!playback_) {
    const GstClockTime begin = schedule_.instant(index_);
    return RequestSlot{begin, schedule_.instant(index_ + 1) - begin, begin};
  }
  const auto item = playback_->item(index_);
  if (!item) return std::nullopt;
  return RequestSlot{item->time, item->duration, item->target_time, item->view};
}

std::optional<RequestSlot> RequestStream::next_live(GstClockTime now, GstClockTime base_time,
                                                    GstClockTime capture_delay) const {
  std::optional<RequestSlot> slot = next();
  if (!slot) return std::nullopt;
  if (playback_ && playback_->has_times()) {
    slot->target_time = schedule_.instant(schedule_.index_at(base_time + slot->pts));
    return slot;
  }
  // The newest instant that is old enough, but none twice and none before the stream begins.
  const GstClockTime earliest = base_time + (last_pts_ ? *last_pts_ + 1 : 0);
  const uint64_t k = std::max(schedule_.index_at(now - std::min(now, capture_delay)), schedule_.first_from(earliest));
  slot->target_time = schedule_.instant(k);
  slot->pts = slot->target_time - base_time;
  slot->duration = schedule_.instant(k + 1) - slot->target_time;
  return slot;
}

RequestSlot RequestStream::ahead_of_turn(const RequestSlot& slot, GstClockTime now, GstClockTime base_time,
                                         GstClockTime capture_delay) const {
  const GstClockTime old_enough = now - std::min(now, capture_delay);
  RequestSlot early = slot;
  early.pts = old_enough - std::min(old_enough, base_time);
  early.target_time = schedule_.instant(schedule_.index_at(old_enough));
  return early;
}

std::vector<uint8_t> RequestStream::command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig) {
  if (!access_) return {};
  if (request.rig_hash != 0 && request.rig_hash != rig->hash()) throw Error("rig: the request is for another one");
  if (std::exchange(mesh_rig_, rig) != rig) mesh_.clear();
  return wire::encode_any_request(access_->command(*rig, mesh_.get(*rig, request.out_of_service), request));
}

uint32_t RequestStream::advance(const RequestSlot& slot) {
  last_pts_ = slot.pts;
  index_++;
  return sequence_++;
}

}  // namespace lf
