// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <mutex>
#include <vector>

#include "view/view_request.h"

namespace lf {

// Cameras that compositors announced as out of service, view by view. Thread-safe.
class OutOfService {
 public:
  // From now on these are the view's, and no others.
  void announce(uint32_t view_id, CameraSet cameras);
  // `cameras` and those announced for this view.
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMostViews = 1024;  // of viewers that come and go; then the lowest id is forgotten
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// What a compositor asks for beside its pictures, which goes along with the next request of its view. Thread-safe.
class ExtraRequests {
 public:
  // In place of those that are there.
  void ask(std::vector<ViewRequest> requests);
  // Those that are there, once, made the view's own: of the moment of `request`, without what either counts as out of
  // service, and with numbers from `next_number` on, which is raised. Those of another rig are left out.
  std::vector<ViewRequest> take_beside(const ViewRequest& request, uint32_t& next_number);
  void clear() { ask({}); }

 private:
  std::mutex mutex_;
  std::vector<ViewRequest> requests_;
};

}  // namespace lf
