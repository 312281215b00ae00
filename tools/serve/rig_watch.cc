// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig_watch.h"

#include "base/error.h"

namespace lf::serve {
namespace {

constexpr guint kQuiet = 300;  // milliseconds: editors write a file in several steps

}  // namespace

RigWatch::RigWatch(const std::string& path, std::function<void()> on_change) : on_change_(std::move(on_change)) {
  g_autoptr(GError) error = nullptr;
  g_autoptr(GFile) file = g_file_new_for_path(path.c_str());
  monitor_ = g_file_monitor_file(file, G_FILE_MONITOR_WATCH_MOVES, nullptr, &error);
  if (!monitor_) throw Error(path + ": can't be watched: " + error->message);
  g_signal_connect(monitor_, "changed", G_CALLBACK(changed), this);
}

RigWatch::~RigWatch() {
  if (timer_) g_source_remove(timer_);
  g_file_monitor_cancel(monitor_);
  g_object_unref(monitor_);
}

void RigWatch::changed(GFileMonitor*, GFile*, GFile*, GFileMonitorEvent, gpointer data) {
  auto* self = static_cast<RigWatch*>(data);
  if (self->timer_) g_source_remove(self->timer_);
  self->timer_ = g_timeout_add(
      kQuiet,
      [](gpointer watch) -> gboolean {
        static_cast<RigWatch*>(watch)->timer_ = 0;
        static_cast<RigWatch*>(watch)->on_change_();
        return G_SOURCE_REMOVE;
      },
      self);
}

}  // namespace lf::serve
