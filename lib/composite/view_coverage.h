// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"

namespace lf {

// How much of a view an array's cameras can see, from request to request. A view that moves is looked at now and then.
// Not thread-safe.
class ViewCoverage {
 public:
  static constexpr int kColumns = 32, kRows = 24;  // of pixels of the view that are looked at
  static constexpr int64_t kInterval = 500'000;    // microseconds

  // The share of the request's pixels that cameras in service can see, 0..1: `exact`, or of a view up to kInterval ago.
  // `now`: of any one clock, microseconds. The rig is the same until clear().
  // `lost`: cameras of the mesh that see nothing, ascending.
  double share(const Rig& rig, const ViewRequest& request, const CameraSet& lost, bool exact, int64_t now);
  void clear() { *this = {}; }

 private:
  MeshCache mesh_;
  View view_;  // the view that share_ is of
  CameraSet out_of_service_, lost_;
  double share_ = -1;
  int64_t known_at_ = 0;
};

}  // namespace lf
