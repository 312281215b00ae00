// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_stream.h"

#include <utility>

#include "base/error.h"
#include "common/common.h"
#include "wire/command_codec.h"

namespace lf {

namespace {

CameraSet parse_out_of_service(const Rig* rig, const std::string& list) {
  if (list.empty()) return {};
  if (!rig) throw Error("out-of-service: needs the property rig, which says what cameras there are");
  return parse_camera_list(*rig, list);
}

RequestSchedule schedule_of(const ViewRequestSettings& settings) {
  const Schedule frames(settings.fps_n > 0 ? settings.fps_n : kUsualFps, settings.fps_d);  // until caps say more
  if (settings.location.empty()) return RequestSchedule(frames);
  return {frames, load_views(settings.location), settings.loop};
}

}  // namespace

RequestStream::RequestStream(const ViewRequestSettings& settings)
    : schedule(schedule_of(settings)), access_(CameraAccess::of(settings.access)) {
  set_rig(settings.rig.empty() ? nullptr : shared_rig(settings.rig), settings.out_of_service);
  if (rig_) default_viewpoint_ = lf::default_viewpoint(*rig_);
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

std::vector<uint8_t> RequestStream::command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig) {
  if (!access_) return {};
  if (request.rig_hash != 0 && request.rig_hash != rig->hash()) throw Error("rig: the request is for another one");
  if (std::exchange(mesh_rig_, rig) != rig) mesh_.clear();
  return wire::encode_any_request(access_->command(*rig, mesh_.get(*rig, request.out_of_service), request));
}

}  // namespace lf
