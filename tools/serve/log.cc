// SPDX-License-Identifier: LGPL-2.1-or-later
#include "log.h"

#include <glib.h>

#include <cstdint>
#include <cstdio>
#include <mutex>

#include "rate_limit.h"
#include "rig/location_text.h"

namespace lf::serve {

std::string printable(const std::string& line) {
  std::string text = line.substr(0, kLongestLine);
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

void say(const std::string& said) {
  const std::string line = location_text(said);
  static std::mutex mutex;
  static TokenBucket lines(kLinesPerSecond, kLinesAtOnce);
  static uint64_t left_away = 0;
  const std::lock_guard lock(mutex);
  if (!lines.take(g_get_monotonic_time())) {
    left_away++;
    return;
  }
  if (left_away > 0) std::printf("%llu lines left away\n", static_cast<unsigned long long>(left_away));
  left_away = 0;
  std::printf("%s\n", printable(line).c_str());
}

}  // namespace lf::serve
