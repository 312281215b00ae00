// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/request_schedule.h"

#include <algorithm>

namespace lf {

std::optional<uint64_t> RequestSchedule::end() const {
  if (!playback_ || loop_) return std::nullopt;
  return playback_->item(0)->time + playback_->duration();
}

void RequestSchedule::seek(uint64_t running_time) {
  index_ = playback_ ? playback_->first_at(running_time) : schedule_.first_from(running_time);
}

std::optional<RequestSlot> RequestSchedule::next() const {
  if (!playback_) {
    const uint64_t begin = schedule_.instant(index_);
    return RequestSlot{begin, schedule_.instant(index_ + 1) - begin, begin};
  }
  const auto item = playback_->item(index_);
  if (!item) return std::nullopt;
  return RequestSlot{item->time, item->duration, item->target_time, item->view};
}

std::optional<RequestSlot> RequestSchedule::next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const {
  std::optional<RequestSlot> slot = next();
  if (!slot) return std::nullopt;
  if (playback_ && playback_->has_times()) {
    slot->target_time = schedule_.instant(schedule_.index_at(base_time + slot->pts));
    return slot;
  }
  // The newest instant that is old enough, but none twice and none before the stream begins. A stamp that is still to
  // come is of another base time.
  const uint64_t farthest = now - std::min(now, base_time) + schedule_.instant(2);
  const uint64_t earliest = base_time + (last_pts_ && *last_pts_ <= farthest ? *last_pts_ + 1 : 0);
  const uint64_t k = std::max(schedule_.index_at(now - std::min(now, capture_delay)), schedule_.first_from(earliest));
  slot->target_time = schedule_.instant(k);
  slot->pts = slot->target_time - base_time;
  slot->duration = schedule_.instant(k + 1) - slot->target_time;
  return slot;
}

RequestSlot RequestSchedule::ahead_of_turn(const RequestSlot& slot, uint64_t now, uint64_t base_time,
                                           uint64_t capture_delay) const {
  const uint64_t old_enough = now - std::min(now, capture_delay);
  RequestSlot early = slot;
  early.pts = old_enough - std::min(old_enough, base_time);
  early.target_time = schedule_.instant(schedule_.index_at(old_enough));
  return early;
}

bool RequestSchedule::set_rate(const Schedule& schedule) {
  if (playback_ && !playback_->has_times() && index_ > 0) return false;
  if (playback_)
    playback_->set_schedule(schedule);
  else
    index_ = schedule.first_from(schedule_.instant(index_));
  schedule_ = schedule;
  return true;
}

void RequestSchedule::advance(const RequestSlot& slot) {
  last_pts_ = slot.pts;
  index_++;
}

}  // namespace lf
