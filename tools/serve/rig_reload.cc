// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/rig_reload.h"

#include <string>
#include <utility>

#include "base/text.h"
#include "rig/rig_json.h"
#include "serve/process.h"

namespace lf::serve {
namespace {

constexpr guint kQuiet = 300;  // milliseconds; editors write a file in several steps

}  // namespace

RigReloader::RigReloader(LightField& field, Sessions& sessions, bool watch) : field_(field), sessions_(sessions) {
  if (!watch) return;
  g_autoptr(GError) error = nullptr;
  g_autoptr(GFile) file = g_file_new_for_path(field.rig().c_str());
  monitor_ = g_file_monitor_file(file, G_FILE_MONITOR_WATCH_MOVES, nullptr, &error);
  if (!monitor_) throw Error(field.rig() + ": changes of this file cannot be watched: " + error->message);
  g_signal_connect_swapped(monitor_, "changed", G_CALLBACK(+[](RigReloader* self) { self->schedule(); }), this);
}

RigReloader::~RigReloader() {
  if (timer_) g_source_remove(timer_);
  if (monitor_) g_file_monitor_cancel(monitor_);
  g_clear_object(&monitor_);
  alive_.reset();
  if (open_thread_.joinable()) open_thread_.join();
}

void RigReloader::schedule() {
  if (timer_) g_source_remove(timer_);
  timer_ = g_timeout_add(
      kQuiet,
      [](gpointer self) -> gboolean {
        static_cast<RigReloader*>(self)->timer_ = 0;
        static_cast<RigReloader*>(self)->changed();
        return G_SOURCE_REMOVE;
      },
      this);
}

void RigReloader::changed() {
  if (is_opening_) {
    changed_again_ = true;
    return;
  }
  std::shared_ptr<const ArrayInfo> array;
  try {
    array = std::make_shared<const ArrayInfo>(field_.rig());
  } catch (const Error& error) {
    return say(std::string("the changed rig file is invalid, so the old rig stays in use: ") + error.what());
  }
  if (!field_.has_cameras_of(*array)) {
    say("the changed rig file has other cameras or sources; opening these cameras");
    return open(std::move(array));
  }
  // The rig hash does not cover colours and time offsets, which may have changed, too.
  if (rig_to_json(field_.array()->rig()) == rig_to_json(array->rig())) return;
  field_.update_rig(std::move(array));
  tell();
}

void RigReloader::load(const std::string& rig) { open(std::make_shared<const ArrayInfo>(rig)); }

void RigReloader::open(std::shared_ptr<const ArrayInfo> array) {
  is_opening_ = true;
  if (open_thread_.joinable()) open_thread_.join();
  open_thread_ = std::thread([this, array, alive = std::weak_ptr(alive_)] {
    std::string problem;
    try {
      field_.restart(array);
    } catch (const Error& error) {
      problem = error.what();
    }
    on_main_thread([this, problem, alive] {
      if (!alive.lock()) return;
      is_opening_ = false;
      if (!problem.empty())
        say("the cameras cannot be opened; there are no pictures until the rig file changes again: " + problem);
      tell();
      if (std::exchange(changed_again_, false)) changed();
    });
  });
}

void RigReloader::tell() {
  sessions_.update_rig();
  say("the rig is " + field_.rig() + " as it is now, " + field_.array()->hash() + "; viewers: " +
      std::to_string(sessions_.size()));
}

}  // namespace lf::serve
