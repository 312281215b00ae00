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
  // From now on these cameras are out of service for the view, in place of those announced before.
  void announce(uint32_t view_id, CameraSet cameras);
  // `cameras` and those announced for this view.
  CameraSet with_announced(uint32_t view_id, const CameraSet& cameras) const;
  void clear();

 private:
  static constexpr size_t kMostViews = 1024;  // viewers come and go: with more of them the lowest id is forgotten
  mutable std::mutex mutex_;
  std::map<uint32_t, CameraSet> views_;
};

// What a compositor asks for beside its pictures, which goes along with the next request of its view. Thread-safe.
class ExtraRequests {
 public:
  // Asks for these requests, in place of any that are still to be made.
  void ask(std::vector<ViewRequest> requests);
  // Takes away the requests that were asked for, made to go beside `request`: they have its view id and its moment,
  // leave out the cameras that either counts as out of service, and have numbers from `next_number` on, which is
  // raised. Those of another rig are left out.
  std::vector<ViewRequest> take_beside(const ViewRequest& request, uint32_t& next_number);
  void clear() { ask({}); }

 private:
  std::mutex mutex_;
  std::vector<ViewRequest> requests_;
};

}  // namespace lf
