// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment/request_place.h"

#include <utility>

namespace lf {

bool RequestPlace::moves(const GstSegment& segment, uint64_t time) {
  const bool back = !gst_segment_is_equal(&segment, &segment_) && time < last_time_;
  const bool moved = std::exchange(flushed_, false) || back;
  gst_segment_copy_into(&segment, &segment_);
  last_time_ = time;
  return moved && !live_;
}

void RequestPlace::clear() {
  segment_ = {};
  last_time_ = 0;
  flushed_ = false;
}

}  // namespace lf
