// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <glib.h>

namespace lf::serve {

// Prints a log line that may contain input from clients. The line is reduced to printable ASCII and kLongestLine
// characters. The rate of lines is limited, so that clients cannot fill the disk; the next line that is printed
// contains the number of suppressed lines. Thread-safe.
void say(const std::string& line);

inline constexpr size_t kLongestLine = 200;
inline constexpr double kLinesPerSecond = 5, kLinesAtOnce = 100;

std::string printable(const std::string& line);

// Runs `job` on the main thread, in a later iteration of the main loop and never inside this call. Thread-safe.
inline void on_main_thread(std::function<void()> job) {
  GSource* source = g_idle_source_new();
  g_source_set_priority(source, G_PRIORITY_DEFAULT);
  g_source_set_callback(
      source,
      [](gpointer data) -> gboolean {
        (*static_cast<std::function<void()>*>(data))();
        return G_SOURCE_REMOVE;
      },
      new std::function<void()>(std::move(job)),
      [](gpointer data) { delete static_cast<std::function<void()>*>(data); });
  g_source_attach(source, nullptr);
  g_source_unref(source);
}

// Destroys objects on separate threads, because stopping a pipeline can take seconds and would block the main thread.
// Thread-safe.
class Teardowns {
 public:
  // Calls `end`, which destroys an object, on a new thread.
  void add(std::function<void()> end);
  size_t size() const;
  // Waits until all threads have finished, but at most for this time. Returns true if all have finished.
  bool wait(std::chrono::milliseconds longest) const;

 private:
  // State shared with the threads, which may outlive this object.
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    size_t under_way = 0;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

// Sends a state such as "READY=1" or "STATUS=serving" to systemd, if this process is a service of Type=notify
// (sd_notify(3)). Does nothing otherwise.
void notify_service(const std::string& state);

// Reports to the watchdog of systemd (WatchdogSec=) four times per interval, from the main loop, so that systemd
// restarts a service if its main loop hangs. Each report follows a call of `check`, which may hang, too. If `check`
// returns a problem, there is no report, and a message when the problem begins and ends. Does nothing without a
// watchdog. Main thread only.
class ServiceWatchdog {
 public:
  explicit ServiceWatchdog(std::function<std::string()> check = {});
  ~ServiceWatchdog();
  ServiceWatchdog(const ServiceWatchdog&) = delete;

 private:
  void report();

  const std::function<std::string()> check_;
  std::string problem_;
  unsigned timer_ = 0;
};

}  // namespace lf::serve
