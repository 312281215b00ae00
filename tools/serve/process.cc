// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/process.h"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <thread>
#include <utility>

#include <glib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

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

void notify_service(const std::string& state) {
  const char* path = std::getenv("NOTIFY_SOCKET");
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  const size_t size = path ? std::strlen(path) : 0;
  if (size < 2 || size >= sizeof address.sun_path || (path[0] != '/' && path[0] != '@')) return;
  std::memcpy(address.sun_path, path, size);
  if (path[0] == '@') address.sun_path[0] = '\0';  // the abstract namespace of Linux
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return;
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + size);
  // A failure is ignored, because the service works without systemd, too.
  (void)!sendto(socket, state.data(), state.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), length);
  close(socket);
}

ServiceWatchdog::ServiceWatchdog(std::function<std::string()> check) : check_(std::move(check)) {
  const char *interval = std::getenv("WATCHDOG_USEC"), *process = std::getenv("WATCHDOG_PID");
  const guint64 microseconds = interval ? g_ascii_strtoull(interval, nullptr, 10) : 0;
  if (microseconds == 0 || (process && std::atol(process) != getpid())) return;
  timer_ = g_timeout_add(
      static_cast<guint>(microseconds / 4000),
      [](gpointer data) -> gboolean {
        static_cast<ServiceWatchdog*>(data)->report();
        return G_SOURCE_CONTINUE;
      },
      this);
}

void ServiceWatchdog::report() {
  const std::string problem = check_ ? check_() : "";
  if (problem.empty()) notify_service("WATCHDOG=1");
  if (problem.empty() != problem_.empty()) say(problem.empty() ? "works again" : "warning: " + problem);
  problem_ = problem;
}

ServiceWatchdog::~ServiceWatchdog() {
  if (timer_) g_source_remove(timer_);
}

}  // namespace lf::serve
