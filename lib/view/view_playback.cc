// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_playback.h"

#include <cmath>
#include <utility>

namespace lf {
namespace {

uint64_t nanoseconds(double seconds) { return static_cast<uint64_t>(std::llround(seconds * 1e9)); }

}  // namespace

ViewPlayback::ViewPlayback(std::vector<NamedView> views, const Schedule& schedule, bool loop)
    : views_(std::move(views)),
      schedule_(schedule),
      loop_(loop),
      has_times_(views_.front().time != views_.back().time) {}

std::optional<ViewPlayback::Item> ViewPlayback::item(uint64_t n) const {
  const uint64_t pass = n / views_.size();
  const size_t i = n % views_.size();
  if (pass > 0 && !loop_) return std::nullopt;
  const View* view = &views_[i].view;
  const uint64_t own_time = nanoseconds(views_[i].time);
  if (!has_times_) return Item{view, schedule_.instant(n), schedule_.instant(n + 1) - schedule_.instant(n), own_time};

  const uint64_t begin = nanoseconds(views_.front().time), end = begin + duration();
  const uint64_t next = i + 1 < views_.size() ? nanoseconds(views_[i + 1].time) : end;
  const uint64_t time = own_time + pass * (end - begin);
  return Item{view, time, next - own_time, time};
}

uint64_t ViewPlayback::duration() const {
  const size_t n = views_.size();
  if (!has_times_) return schedule_.instant(n);
  const uint64_t last = nanoseconds(views_[n - 1].time), last_interval = last - nanoseconds(views_[n - 2].time);
  return last - nanoseconds(views_[0].time) + (last_interval > 0 ? last_interval : schedule_.period());
}

uint64_t ViewPlayback::first_at(uint64_t running_time) const {
  uint64_t n = 0;
  while (n < views_.size() && item(n)->time < running_time) n++;
  return n;
}

}  // namespace lf
