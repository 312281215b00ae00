// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recordings.h"

#include <filesystem>
#include <set>
#include <vector>

#include "base/error.h"
#include "rig/location_text.h"

namespace fs = std::filesystem;

std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera) {
  if (folder.empty()) {
    if (camera.source.empty())
      throw lf::Error("the rig names no source of it: give --recordings, a folder with " + camera.name + ".*");
    if (lf::is_uri(camera.source) && !camera.source.starts_with("file:"))
      throw lf::Error(lf::location_text(camera.source) + " is live: record it first, and give --recordings");
    return rig.resolve(camera.source);
  }
  static const std::set<std::string> kOthers = {".png", ".json"};
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().stem() == camera.name && !kOthers.contains(entry.path().extension()))
      found.push_back(entry.path().string());
  if (found.empty()) throw lf::Error(folder + " has no recording " + camera.name + ".*");
  if (found.size() > 1) throw lf::Error(found[0] + " and " + found[1] + " are both of one camera");
  return found[0];
}

lf::Rig recorded_in(const std::string& folder, lf::Rig rig) {
  static const std::set<std::string> kStills = {".png", ".jpg", ".jpeg"};
  rig.directory = fs::absolute(folder).string();
  for (lf::Camera& camera : rig.cameras) {
    camera.source = camera.image = "";
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (!entry.is_regular_file() || entry.path().stem() != camera.name || entry.path().extension() == ".json")
        continue;
      (kStills.contains(entry.path().extension()) ? camera.image : camera.source) = entry.path().filename().string();
    }
  }
  return rig;
}

void check_folder(const std::string& folder) {
  if (!folder.empty() && !fs::is_directory(folder)) throw lf::Error(folder + ": is no folder");
}
