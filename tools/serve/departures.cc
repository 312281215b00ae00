// SPDX-License-Identifier: LGPL-2.1-or-later
#include "departures.h"

#include <thread>

namespace lf::serve {

void Departures::add(std::function<void()> end) {
  {
    const std::lock_guard lock(state_->mutex);
    state_->under_way++;
  }
  std::thread([state = state_, end = std::move(end)]() mutable {
    end();
    end = nullptr;  // destroys its captures
    const std::lock_guard lock(state->mutex);
    state->under_way--;
    state->changed.notify_all();
  }).detach();
}

size_t Departures::size() const {
  const std::lock_guard lock(state_->mutex);
  return state_->under_way;
}

bool Departures::wait(std::chrono::milliseconds longest) const {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, longest, [this] { return state_->under_way == 0; });
}

}  // namespace lf::serve
