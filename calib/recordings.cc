// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recordings.h"

#include <gst/base/gsttypefindhelper.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "base/error.h"
#include "base/natural_order.h"
#include "rig/location_text.h"

namespace fs = std::filesystem;

namespace {

enum class FileKind { kFilm, kStill, kOther };

std::string beginning_of(const fs::path& path, size_t most) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(most, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(most));
  bytes.resize(static_cast<size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

// Whether a JPEG file goes on with another picture.
bool has_second_jpeg(const fs::path& path) {
  constexpr size_t kMostBytes = size_t{32} << 20;  // the first picture is smaller
  return beginning_of(path, kMostBytes).find("\xff\xd9\xff\xd8") != std::string::npos;
}

FileKind kind_of(const fs::path& path) {
  constexpr size_t kEnough = size_t{1} << 18;
  const std::string bytes = beginning_of(path, kEnough);
  if (bytes.empty()) return FileKind::kOther;
  GstCaps* const caps =
      gst_type_find_helper_for_data(nullptr, reinterpret_cast<const guint8*>(bytes.data()), bytes.size(), nullptr);
  if (!caps) return FileKind::kOther;
  const std::string type = gst_caps_get_size(caps) > 0 ? gst_structure_get_name(gst_caps_get_structure(caps, 0)) : "";
  gst_caps_unref(caps);
  if (type == "image/jpeg") return has_second_jpeg(path) ? FileKind::kFilm : FileKind::kStill;
  if (type.starts_with("image/")) return FileKind::kStill;
  for (const char* film : {"video/", "application/x-yuv4mpeg", "application/ogg", "application/mxf",
                           "application/vnd.rn-realmedia", "multipart/x-mixed-replace"})
    if (type.starts_with(film)) return FileKind::kFilm;
  return FileKind::kOther;
}

struct Recorded {
  std::vector<std::string> films, stills, others;  // paths in natural order
};

// The files of `folder` that `belongs` to.
template <typename Belongs>
Recorded files_in(const std::string& folder, Belongs belongs) {
  std::vector<std::string> paths;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && belongs(entry.path())) paths.push_back(entry.path().string());
  std::ranges::sort(paths, lf::natural_less);
  Recorded found;
  for (const std::string& path : paths) {
    const FileKind kind = kind_of(path);
    (kind == FileKind::kFilm ? found.films : kind == FileKind::kStill ? found.stills : found.others).push_back(path);
  }
  return found;
}

Recorded files_of(const std::string& folder, const lf::Camera& camera) {
  return files_in(folder, [&](const fs::path& path) { return path.stem() == camera.name; });
}

void require_one(const std::vector<std::string>& paths, const lf::Camera& camera, const char* what) {
  if (paths.size() > 1)
    throw lf::Error(paths[0] + " and " + paths[1] + " are both " + what + " of camera " + camera.name +
                    "; keep one of them in the folder");
}

}  // namespace

std::string recording_of(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera) {
  if (folder.empty()) {
    if (camera.source.empty())
      throw lf::Error("the rig names no source of it: give --recordings, a folder with " + camera.name + ".*");
    if (lf::is_uri(camera.source) && !camera.source.starts_with("file:"))
      throw lf::Error(lf::location_text(camera.source) + " is live: record it first, and give --recordings");
    return rig.resolve(camera.source);
  }
  const Recorded found = files_of(folder, camera);
  require_one(found.films, camera, "films");
  if (!found.films.empty()) return found.films[0];
  std::string seen;
  for (const std::string& path : found.stills) seen += (seen.empty() ? "; " : ", ") + path + " is a still";
  for (const std::string& path : found.others) seen += (seen.empty() ? "; " : ", ") + path + " is no video";
  throw lf::Error(folder + " has no recording " + camera.name + ".*" + seen);
}

lf::Rig recorded_in(const std::string& folder, lf::Rig rig) {
  rig.directory = fs::absolute(folder).string();
  const auto name_of = [](const std::string& path) { return fs::path(path).filename().string(); };
  for (lf::Camera& camera : rig.cameras) {
    const Recorded found = files_of(folder, camera);
    require_one(found.films, camera, "films");
    if (found.films.empty()) require_one(found.stills, camera, "stills");
    camera.source = found.films.empty() ? "" : name_of(found.films[0]);
    // A single file that is neither is a damaged film: the error of its reader names it.
    if (found.films.empty() && found.stills.empty() && found.others.size() == 1)
      camera.source = name_of(found.others[0]);
    camera.image = found.stills.size() == 1 ? name_of(found.stills[0]) : "";
  }
  return rig;
}

std::vector<std::string> boards_in(const std::string& folder, const lf::Camera& camera) {
  const fs::path own = fs::path(folder) / camera.name;
  if (fs::is_directory(own)) return files_in(own.string(), [](const fs::path&) { return true; }).stills;
  const std::vector<std::string> films = files_of(folder, camera).films;
  require_one(films, camera, "films");
  if (films.empty()) return {};
  return {"file://" + fs::absolute(films[0]).string()};
}

void check_folder(const std::string& folder) {
  if (!folder.empty() && !fs::is_directory(folder)) throw lf::Error(folder + ": is no folder");
}
