// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "base/schedule.h"
#include "view/views_json.h"

namespace lf {

// The running time that a request is stamped with, how long it stands and what it asks for, nanoseconds. `view` is null
// where it is not from a file.
struct RequestSlot {
  uint64_t pts, duration;
  uint64_t target_time;
  const View* view = nullptr;
};

// Says which request of a viewer is next. Times in nanoseconds. Not thread-safe.
class RequestSchedule {
 public:
  // A request each frame, for ever.
  explicit RequestSchedule(const Schedule& schedule) : schedule_(schedule) {}
  // A request for each view of a file.
  RequestSchedule(const Schedule& schedule, std::vector<NamedView> views, bool loop)
      : schedule_(schedule), playback_(std::in_place, std::move(views), schedule, loop), loop_(loop) {}

  bool from_file() const { return playback_.has_value(); }
  std::optional<uint64_t> end() const;  // running time at which the requests end; nothing: never

  void seek(uint64_t running_time);  // goes on with the request of this running time; for schedules that are not live
  // The next request; nothing after the end.
  std::optional<RequestSlot> next() const;
  // The next request of a live stream at clock time `now`. It is stamped with the running time of its capture and
  // leaves `capture_delay` later, at clock time base_time + pts + capture_delay.
  std::optional<RequestSlot> next_live(uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // The request of a slot of next_live() that leaves at clock time `now`, before its turn, for the newest capture that
  // is old enough. As that capture has been asked for before, the request is stamped with the time that would be just
  // old enough.
  RequestSlot ahead_of_turn(const RequestSlot& slot, uint64_t now, uint64_t base_time, uint64_t capture_delay) const;
  // From the next request on, this many frames per second. False, and nothing changes, once a list of views without
  // times has begun: its views are stamped by their number.
  bool set_rate(const Schedule& schedule);
  // The slot is used: on to the next one.
  void advance(const RequestSlot& slot);
  // turn() is the number of the next slot; pass() goes on to the one after it without a request, if that slot is still
  // next.
  uint64_t turn() const { return index_; }
  void pass(uint64_t turn) { index_ += index_ == turn; }

 private:
  Schedule schedule_;
  std::optional<ViewPlayback> playback_;
  bool loop_ = false;
  uint64_t index_ = 0;  // number of the next view of the file, or of the next frame
  std::optional<uint64_t> last_pts_;
};

}  // namespace lf
