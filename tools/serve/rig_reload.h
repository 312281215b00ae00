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

// Reports changes of a file, after it has not changed for a moment. Main thread only.
class RigFileMonitor {
 public:
  // Throws Error if the file can't be watched.
  RigFileMonitor(const std::string& path, std::function<void()> on_change);
  ~RigFileMonitor();
  RigFileMonitor(const RigFileMonitor&) = delete;

 private:
  static void changed(GFileMonitor*, GFile*, GFile*, GFileMonitorEvent, gpointer self);

  std::function<void()> on_change_;
  GFileMonitor* monitor_;
  guint timer_ = 0;
};

// Reloads the rig for the light field and its viewers when the rig file changes, for example after a calibration. An
// invalid file changes nothing. If cameras or sources differ, the old cameras are closed and the new ones opened, and
// pictures pause. Main thread only.
class RigReloader {
 public:
  // The arguments must outlive this object. Throws Error if the file can't be watched.
  RigReloader(LightField& field, Sessions& sessions);
  ~RigReloader();
  RigReloader(const RigReloader&) = delete;

 private:
  void changed();
  void open(std::shared_ptr<const ArrayInfo> array);
  void tell();

  LightField& field_;
  Sessions& sessions_;
  RigFileMonitor watch_;
  std::thread open_thread_;
  bool is_opening_ = false, changed_again_ = false;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
