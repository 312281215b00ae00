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

// Prints a log line that may contain remote input: printable ASCII only, at most kLongestLine characters, at a limited
// rate. The number of suppressed lines is printed with the next line. Thread-safe.
void say(const std::string& line);

inline constexpr size_t kLongestLine = 200;
inline constexpr double kLinesPerSecond = 5, kLinesAtOnce = 100;

std::string printable(const std::string& line);

// Runs the job in the main loop, never inside this call. Thread-safe.
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

// Runs slow destructors, such as those of pipelines, on separate threads, so that a hung element cannot block the
// server. Thread-safe.
class Teardowns {
 public:
  void add(std::function<void()> end);
  size_t size() const;
  bool wait(std::chrono::milliseconds longest) const;

 private:
  // Shared with the threads, which may outlive the object.
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    size_t under_way = 0;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace lf::serve
