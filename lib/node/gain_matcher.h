// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "focus/camera_gains.h"
#include "view/view_request.h"

namespace lf {

// The gains of a node's cameras, found view by view: what a camera shows depends on where it looks from, and views
// differ in what they make of it. Not thread-safe.
class GainMatcher {
 public:
  static constexpr size_t kMostViews = 64;  // with more views those asked for longest ago are forgotten

  // The gains that a request's images are to be divided by, once its mean has told about the cameras that were seen for
  // it. A view that is new begins with what the one before came to.
  const CameraGains& gains_for(uint32_t view_id, const GainRequest& request);
  // Keeps what was seen for a request until its mean comes.
  void keep(uint32_t view_id, uint32_t sequence, std::vector<WideLuma::Camera> seen);

  // The images divided by `gains` where they are in `region` of a camera (empty: as they are), in `memory`.
  static std::vector<Source> match(std::span<const Source> sources, const CameraGains& gains,
                                   const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                   const ParallelFor& parallel = serial_for);
  void clear();
  // New views begin with what the other matcher's latest view came to.
  void begin_like(const GainMatcher& other) { latest_ = other.latest_; }

 private:
  struct View {
    CameraGains gains;
    uint32_t sequence = 0;  // number of the request that `seen` is of
    std::vector<WideLuma::Camera> seen;
    uint64_t used = 0;
  };
  View& view_of(uint32_t view_id);

  std::map<uint32_t, View> views_;
  CameraGains latest_;
  uint64_t uses_ = 0;
};

}  // namespace lf
