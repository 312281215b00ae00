// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/coded_pictures.h"

#include <utility>

namespace lf {

bool CodedPictures::admits(GstBuffer* picture) {
  has_key_ = has_key_ || !GST_BUFFER_FLAG_IS_SET(picture, GST_BUFFER_FLAG_DELTA_UNIT);
  return has_key_;
}

void CodedPictures::begin_again() {
  has_key_ = false;
  waiting_.clear();
}

void CodedPictures::wait(GstBuffer* picture, GstClockTime taken) {
  if (waiting_.size() >= kMostWaiting) begin_again();
  if (admits(picture)) waiting_.push_back({BufferPtr(gst_buffer_ref(picture)), taken});
}

std::vector<CodedPictures::Picture> CodedPictures::take_waiting() { return std::exchange(waiting_, {}); }

GstClockTime CodedPictures::in_order(GstClockTime taken, GstClockTime captured) {
  constexpr GstClockTime kLeast = 10 * GST_USECOND;  // times in a file are multiples of it
  const bool is_newest = taken > newest_taken_;
  if (!is_newest) return captured;
  if (newest_captured_ > 0 && captured <= newest_captured_ && newest_captured_ - captured < kMostBack)
    captured = newest_captured_ + kLeast;
  newest_taken_ = taken;
  newest_captured_ = captured;
  return captured;
}

}  // namespace lf
