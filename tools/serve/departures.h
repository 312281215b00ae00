// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>

namespace lf::serve {

// Ends what may take long to end, such as pipelines, each on a thread of its own: a hung element must not stop the
// server. Thread-safe.
class Departures {
 public:
  // Calls `end` on a new thread.
  void add(std::function<void()> end);
  size_t size() const;
  // Waits until none is under way. Returns false if that takes longer.
  bool wait(std::chrono::milliseconds longest) const;

 private:
  // Threads that hang outlive the object.
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    size_t under_way = 0;
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace lf::serve
