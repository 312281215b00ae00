// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/process.h"

#include <cstdint>
#include <cstdio>
#include <mutex>
#include <thread>

#include <glib.h>

#include "rig/source_security.h"
#include "serve/limits.h"

namespace lf::serve {

std::string printable(const std::string& line) {
  std::string text = line.substr(0, kLongestLine);
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

void say(const std::string& said) {
  const std::string line = redacted_location(said);
  static std::mutex mutex;
  static TokenBucket lines(kLinesPerSecond, kLinesAtOnce);
  static uint64_t suppressed = 0;
  const std::lock_guard lock(mutex);
  if (!lines.take(g_get_monotonic_time())) {
    suppressed++;
    return;
  }
  if (suppressed > 0) std::printf("%llu lines suppressed\n", static_cast<unsigned long long>(suppressed));
  suppressed = 0;
  std::printf("%s\n", printable(line).c_str());
}

void Teardowns::add(std::function<void()> end) {
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

size_t Teardowns::size() const {
  const std::lock_guard lock(state_->mutex);
  return state_->under_way;
}

bool Teardowns::wait(std::chrono::milliseconds longest) const {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, longest, [this] { return state_->under_way == 0; });
}

}  // namespace lf::serve
