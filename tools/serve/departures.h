// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>

namespace lf::serve {

// Runs destructors that may take long, such as those of pipelines, on separate threads, so that a hung element cannot
// block the server. Thread-safe.
class Departures {
 public:
  // Calls `end` on a new thread.
  void add(std::function<void()> end);
  size_t size() const;
  // Waits until all have finished. Returns false on timeout.
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
