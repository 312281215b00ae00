// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/schedule.h"
#include "common/access.h"
#include "node/camera_access.h"
#include "rig/mesh.h"
#include "view/navigator.h"
#include "view/views_json.h"
#include "viewrequest/view_request_settings.h"

namespace lf {

// The running time that a request is stamped with, how long it stands and what it asks for. `view` is null where it is
// not from a file.
struct RequestSlot {
  GstClockTime pts, duration;
  uint64_t target_time;
  const View* view = nullptr;
};

// What lfviewrequest has from start to stop: its files, and which request is next. Without locks.
class RequestStream {
 public:
  // Reads the files. Throws Error.
  explicit RequestStream(const ViewRequestSettings& settings);

  const Schedule& schedule() const { return schedule_; }
  // How the view's cameras have to be told of their parts; null: they find out themselves.
  const CameraAccess* access() const { return access_; }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }  // may be null
  uint64_t rig_hash() const { return rig_hash_; }
  const CameraSet& out_of_service() const { return out_of_service_; }
  bool from_file() const { return playback_.has_value(); }
  int default_width() const { return default_width_; }
  int default_height() const { return default_height_; }
  const Viewpoint& default_viewpoint() const { return default_viewpoint_; }
  GstClockTime end() const;  // running time; GST_CLOCK_TIME_NONE: never

  // Another rig, or null. The view stays where it is. Throws Error, and nothing has changed, where this rig does not
  // have the cameras of `out_of_service` (see below).
  void set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service);
  // Ids of cameras of the rig; unlike in tools, "" is none. Throws Error.
  void set_out_of_service(const std::string& list);

  void seek(GstClockTime running_time);  // not live
  // The next request; nothing after the end.
  std::optional<RequestSlot> next() const;
  // The same of a live stream at clock time `now`. It is stamped with the running time of its capture and leaves
  // `capture_delay` later, at clock time base_time + pts + capture_delay.
  std::optional<RequestSlot> next_live(GstClockTime now, GstClockTime base_time, GstClockTime capture_delay) const;
  // That one, leaving at clock time `now`, before its turn: for the newest capture that is old enough. As that has
  // been asked for before, it is stamped with the time that would be just old enough.
  RequestSlot ahead_of_turn(const RequestSlot& slot, GstClockTime now, GstClockTime base_time,
                            GstClockTime capture_delay) const;
  // The command that goes with a request, for cameras that have to be told (property access); empty where they have
  // not. Throws Error if the request does not fit the rig or the command is too long.
  // `rig`: rig() when the request was made. To be called by one thread, but whatever others do.
  std::vector<uint8_t> command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig);
  // The slot is used: on to the next one. Returns the request's sequence number.
  uint32_t advance(const RequestSlot& slot);
  // Which slot is next, and on to the one after that, if it still is: a slot that makes no request.
  uint64_t turn() const { return index_; }
  void pass(uint64_t turn) {
    if (index_ == turn) index_++;
  }
  // Of one more request in the slot that was used last.
  uint32_t number() { return sequence_++; }

 private:
  std::shared_ptr<const Rig> rig_;
  const CameraAccess* const access_;
  MeshCache mesh_;
  std::shared_ptr<const Rig> mesh_rig_;  // of mesh_
  uint64_t rig_hash_ = 0;
  CameraSet out_of_service_;
  int default_width_ = ViewRequestSettings::kDefaultWidth, default_height_ = ViewRequestSettings::kDefaultHeight;
  Viewpoint default_viewpoint_;
  Schedule schedule_;
  bool loop_;
  std::optional<ViewPlayback> playback_;
  uint64_t index_ = 0;  // of the next view of the file, or of the next frame
  uint32_t sequence_ = 0;
  std::optional<GstClockTime> last_pts_;
};

}  // namespace lf
