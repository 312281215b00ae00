// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/latency_control.h"

#include <algorithm>
#include <utility>

namespace lf {

uint64_t LatencyControl::next(uint64_t latency, bool any_answered, std::optional<uint64_t> spare) {
  if (latency != latest_) {
    clear();
    set_ = latest_ = latency;
  }
  if (any_answered) late_pictures_ = late_answers_ = 0;
  if (!spare) {
    early_pictures_ = 0;
    least_spare_ = std::numeric_limits<uint64_t>::max();
  }
  if (!any_answered && ++late_pictures_ >= kLatePictures && late_answers_ >= kLateAnswers) {
    late_pictures_ = late_answers_ = 0;
    latest_ = std::min(static_cast<uint64_t>(kStep * static_cast<double>(latency)),
                       static_cast<uint64_t>(kMost * static_cast<double>(set_)));
  } else if (spare && latency > set_) {
    constexpr double kReserve = 0.1;
    least_spare_ = std::min(least_spare_, *spare);
    if (++early_pictures_ < kEarlyPictures) return latest_;
    const uint64_t shorter = std::max(static_cast<uint64_t>(static_cast<double>(latency) / kStep), set_);
    const uint64_t needed = latency - shorter + static_cast<uint64_t>(kReserve * static_cast<double>(latency));
    if (least_spare_ >= needed) latest_ = shorter;
    early_pictures_ = 0;
    least_spare_ = std::numeric_limits<uint64_t>::max();
  }
  return latest_;
}

std::optional<uint64_t> LatencyControl::clear() {
  const LatencyControl before = std::exchange(*this, {});
  return before.latest_ != before.set_ ? std::optional(before.set_) : std::nullopt;
}

}  // namespace lf
