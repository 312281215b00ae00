// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <gio/gio.h>

#include "serve/light_field.h"
#include "serve/sessions.h"

namespace lf::serve {

// Applies changes of the rig file to the running light field and its viewers, for example after a calibration. An
// invalid file changes nothing. If only poses or colours have changed, pictures continue. If cameras or sources differ,
// the old cameras are closed and the new cameras are opened; pictures pause until then. Main thread only.
class RigReloader {
 public:
  // The first two arguments must outlive this object. If `watch` is false, changes of the file have no effect, and only
  // load() replaces the rig. Throws Error if the file cannot be watched.
  RigReloader(LightField& field, Sessions& sessions, bool watch);
  ~RigReloader();
  RigReloader(const RigReloader&) = delete;

  // Opens the cameras of another rig file. Throws Error if the file is invalid.
  void load(const std::string& rig);

 private:
  void schedule();
  void changed();
  void open(std::shared_ptr<const ArrayInfo> array);
  void tell();

  LightField& field_;
  Sessions& sessions_;
  GFileMonitor* monitor_ = nullptr;
  guint timer_ = 0;
  std::thread open_thread_;
  bool is_opening_ = false, changed_again_ = false;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
