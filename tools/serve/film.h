// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gio/gio.h>

#include <cstdint>
#include <functional>
#include <string>

namespace lf::serve {

// A film of the built-in scene that loops, made by lf-scene where it is not there yet, beside the main loop. On the
// main thread alone.
class Film {
 public:
  // The rig file, and whether it is there already.
  static std::string rig();
  static bool exists();

  // Begins. `on_end` is called once, with what went wrong or "". Throws Error.
  explicit Film(std::function<void(const std::string& problem)> on_end);
  ~Film();
  Film(const Film&) = delete;

  // How much is done, 0 to 1.
  double progress() const;

 private:
  void read_line();
  void take_line(const std::string& line);

  std::function<void(const std::string&)> on_end_;
  GSubprocess* process_ = nullptr;
  GDataInputStream* says_ = nullptr;
  GCancellable* cancellable_;
  int64_t began_;
  double told_ = 0;  // share of the film, 0 to 1, when it was last told
  int64_t told_at_ = 0;
  std::string last_line_;
};

}  // namespace lf::serve
