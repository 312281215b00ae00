// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <thread>

#include "light_field.h"
#include "rig_watch.h"
#include "sessions.h"

namespace lf::serve {

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
