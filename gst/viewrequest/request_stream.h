// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/access.h"
#include "node/camera_access.h"
#include "rig/mesh.h"
#include "view/navigator.h"
#include "view/request_schedule.h"
#include "viewrequest/view_request_settings.h"

namespace lf {

// What lfviewrequest has from start to stop: its files, and which request is next. Without locks.
class RequestStream {
 public:
  // Reads the files. Throws Error.
  explicit RequestStream(const ViewRequestSettings& settings);

  RequestSchedule schedule;  // streaming thread
  uint32_t next_number = 0;  // number of the next request; streaming thread

  // How the view's cameras have to be told of their parts; null: they find out themselves.
  const CameraAccess* access() const { return access_; }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }  // may be null
  uint64_t rig_hash() const { return rig_hash_; }
  const CameraSet& out_of_service() const { return out_of_service_; }
  bool from_file() const { return schedule.from_file(); }
  int default_width() const { return default_width_; }
  int default_height() const { return default_height_; }
  const Viewpoint& default_viewpoint() const { return default_viewpoint_; }

  // Takes another rig, or none (null); the view stays where it is. Throws Error, and nothing has changed, where this
  // rig does not have the cameras of `out_of_service` (see below).
  void set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service);
  // Ids of cameras of the rig; unlike in tools, "" is none. Throws Error.
  void set_out_of_service(const std::string& list);

  // The command that goes with a request, for cameras that have to be told (property access); empty where they have
  // not. Throws Error if the request does not fit the rig or the command is too long.
  // `rig`: rig() when the request was made. To be called by one thread, but whatever others do.
  std::vector<uint8_t> command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig);

 private:
  std::shared_ptr<const Rig> rig_;
  const CameraAccess* const access_;
  MeshCache mesh_;
  std::shared_ptr<const Rig> mesh_rig_;  // the rig that mesh_ is of
  uint64_t rig_hash_ = 0;
  CameraSet out_of_service_;
  int default_width_ = ViewRequestSettings::kDefaultWidth, default_height_ = ViewRequestSettings::kDefaultHeight;
  Viewpoint default_viewpoint_;
};

}  // namespace lf
