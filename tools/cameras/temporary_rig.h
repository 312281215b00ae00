// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <unistd.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "base/error.h"
#include "rig/rig_json.h"
#include "rig/rig_trust.h"

namespace lf::cameras {

// A rig file for as long as it lives, since cameras are opened by files. Files that the rig names are found from there.
class TemporaryRig {
 public:
  // `original`: what else the cameras have, such as their controls (rig/camera_controls.h). `path`: the file that the
  // rig was read from. Its sources must be trusted (rig/rig_trust.h), because the copy belongs to this user in any
  // case. Throws Error.
  TemporaryRig(Rig rig, const nlohmann::json& original, const std::string& path, bool trusted) {
    require_trust(rig, path, trusted);
    std::string pattern = (std::filesystem::temp_directory_path() / "lf-rig-XXXXXX").string();
    if (!mkdtemp(pattern.data())) throw Error(pattern + ": can't be made");
    directory_ = pattern;
    relocate(rig, directory_);
    save_rig(rig, this->path(), &original);
    rig_ = std::make_shared<const Rig>(load_rig(this->path()));
  }
  ~TemporaryRig() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  TemporaryRig(const TemporaryRig&) = delete;

  std::string path() const { return directory_ + "/rig.json"; }
  std::shared_ptr<const Rig> rig() const { return rig_; }

 private:
  std::string directory_;
  std::shared_ptr<const Rig> rig_;
};

}  // namespace lf::cameras
