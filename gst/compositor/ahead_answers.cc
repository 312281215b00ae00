// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/ahead_answers.h"

namespace lf {

bool AheadAnswers::has_room(size_t bytes) const {
  return waiting_.empty() || (waiting_.size() < kMostUnits && bytes_ + bytes <= kMostBytes);
}

void AheadAnswers::keep(uint32_t sequence, GstBuffer* buffer) {
  try {
    waiting_.push_back({sequence, buffer});
  } catch (...) {
    gst_buffer_unref(buffer);
    throw;
  }
  bytes_ += gst_buffer_get_size(buffer);
}

std::vector<GstBuffer*> AheadAnswers::take(uint32_t sequence) {
  std::vector<GstBuffer*> taken;
  taken.reserve(waiting_.size());  // nothing is thrown from here on
  std::erase_if(waiting_, [&](const Waiting& waiting) {
    const auto ahead = static_cast<int32_t>(waiting.sequence - sequence);
    if (ahead > 0) return false;
    bytes_ -= gst_buffer_get_size(waiting.buffer);
    if (ahead == 0)
      taken.push_back(waiting.buffer);
    else
      gst_buffer_unref(waiting.buffer);
    return true;
  });
  return taken;
}

void AheadAnswers::clear() {
  for (const Waiting& waiting : waiting_) gst_buffer_unref(waiting.buffer);
  waiting_.clear();
  bytes_ = 0;
}

}  // namespace lf
