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

// Tells when a file has been written or replaced, once it has been left alone for a moment. On the main thread alone.
class RigWatch {
 public:
  // Throws Error where files can't be watched.
  RigWatch(const std::string& path, std::function<void()> on_change);
  ~RigWatch();
  RigWatch(const RigWatch&) = delete;

 private:
  static void changed(GFileMonitor*, GFile*, GFile*, GFileMonitorEvent, gpointer self);

  std::function<void()> on_change_;
  GFileMonitor* monitor_;
  guint timer_ = 0;
};

// Brings the light field and its viewers to what the rig file says whenever that has changed, after a calibration say.
// A file that is no rig changes nothing; other cameras, or other sources, are opened in place of those there were, for
// which pictures pause. On the main thread alone.
class RigReload {
 public:
  // Both arguments must outlive this. Throws Error where files can't be watched.
  RigReload(LightField& field, Sessions& sessions);
  ~RigReload();
  RigReload(const RigReload&) = delete;

 private:
  void changed();
  void open(std::shared_ptr<const ArrayInfo> array);
  void tell();

  LightField& field_;
  Sessions& sessions_;
  RigWatch watch_;
  std::thread opens_;  // opens cameras, which may take a minute
  bool is_opening_ = false, changed_again_ = false;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace lf::serve
