// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gio/gio.h>

#include <functional>
#include <string>

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

}  // namespace lf::serve
