// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/recording.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "common/common.h"
#include "rig/rig_json.h"

namespace lf {
namespace {

// Of all cameras together, while they wait for the disk.
constexpr guint64 kMostBytes = 256 << 20;
constexpr gint64 kPatience = 5 * G_USEC_PER_SEC;

std::string file_name(const Camera& camera) { return "camera" + std::to_string(camera.id) + ".mkv"; }

std::string time_of_day() {
  g_autoptr(GDateTime) now = g_date_time_new_now_utc();
  g_autofree gchar* text = g_date_time_format(now, "%Y-%m-%dT%H:%M:%S.%fZ");
  return text;
}

// What says that a recording is in the folder.
std::string rig_path(const std::string& folder) { return folder + "/rig.json"; }

void make_folder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw Error(folder + ": can't be made: " + error.message());
}

void require_free(const std::string& path, const std::string& folder) {
  std::error_code error;
  if (std::filesystem::exists(path, error))
    throw Error(folder + ": there is a recording in it already (" + std::filesystem::path(path).filename().string() +
                "): record into another folder, or remove it first");
}

}  // namespace

Recording::Recording(GstElement* owner, const std::string& folder, const Rig& rig, const std::string& rig_file,
                     const std::vector<CameraIndex>& cameras)
    : owner_(owner), folder_(folder) {
  make_folder(folder);
  require_free(rig_path(folder), folder);
  for (const CameraIndex index : cameras) require_free(folder + "/" + file_name(rig.cameras[index]), folder);
  save(rig, rig_file);
  for (const CameraIndex index : cameras) {
    const Camera& camera = rig.cameras[index];
    names_[camera.id] = "camera " + std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
    const std::string path = folder + "/" + file_name(camera);
    files_[camera.id] =
        std::make_unique<CameraFile>(camera, path, kMostBytes / cameras.size(),
                                     [this, path](const std::string& problem) { stop(path + ": " + problem); });
  }
}

Recording::~Recording() { finish(); }

// Cameras of other nodes have their names, too, so that what several
// machines have recorded can be put into one folder. True capture times are in the files.
void Recording::save(const Rig& rig, const std::string& rig_file) const {
  Rig recorded = rig;
  std::error_code error;
  const auto whole = std::filesystem::weakly_canonical(folder_, error);
  relocate(recorded, error ? folder_ : whole.string());
  for (Camera& camera : recorded.cameras) {
    camera.source = file_name(camera);
    camera.time_offset = 0;
  }
  save_rig_like(rig_file, recorded, rig_path(folder_));
}

void Recording::take_rig(const Rig& rig, const std::string& rig_file) {
  try {
    save(rig, rig_file);
  } catch (const Error& error) {
    GST_ELEMENT_WARNING(owner_, RESOURCE, WRITE, ("%s: its rig stays as it was: %s", folder_.c_str(), error.what()),
                        (nullptr));
  }
}

// Where time 0 of the files is.
GstClockTime Recording::begin(GstClockTime captured, bool live) {
  const std::lock_guard lock(mutex_);
  if (begin_) return *begin_;
  begins_ = time_of_day();
  begin_ = live ? captured : 0;
  return *begin_;
}

void Recording::add(uint32_t camera, GstBuffer* frame, GstCaps* caps, GstClockTime captured, bool live) {
  if (stopped_ || finished_) return;
  const GstClockTime begin = this->begin(captured, live);
  if (captured < begin) return;
  try {
    if (!files_.at(camera)->add(frame, caps, captured - begin, begins_)) tell_dropped(camera);
  } catch (const Error& error) {
    stop(names_.at(camera) + ": " + error.what());
  }
}

void Recording::tell_dropped(uint32_t camera) {
  if (has_dropped_.exchange(true)) return;
  GST_ELEMENT_WARNING(owner_, RESOURCE, WRITE,
                      ("%s: the disk or this machine is too slow to record all frames: some are left out, of %s at "
                       "first",
                       folder_.c_str(), names_.at(camera).c_str()),
                      ("further ones, of other cameras, too, are counted in stats"));
}

// The files stay as they are, which can be played.
void Recording::stop(const std::string& reason) {
  if (stopped_.exchange(true)) return;
  {
    const std::lock_guard lock(mutex_);
    reason_ = reason;
  }
  GstStructure* structure = gst_structure_new(LF_RECORDING_STOPPED, "folder", G_TYPE_STRING, folder_.c_str(), "reason",
                                              G_TYPE_STRING, reason.c_str(), nullptr);
  gst_element_post_message(owner_, gst_message_new_element(GST_OBJECT(owner_), structure));
  GST_ELEMENT_WARNING(
      owner_, RESOURCE, WRITE,
      ("%s: recording has stopped: %s What was recorded before can be played.", folder_.c_str(), reason.c_str()),
      (nullptr));
}

void Recording::finish() {
  if (finished_.exchange(true)) return;
  GstClockTime end = 0;
  bool any = false;
  for (const auto& [camera, file] : files_) {
    end = std::max(end, file->ends_at());
    any = any || file->counts().frames > 0;
  }
  for (const auto& [camera, file] : files_) file->end(end);
  const gint64 deadline = g_get_monotonic_time() + kPatience;
  for (const auto& [camera, file] : files_) file->close(deadline);
  std::error_code ignored;
  if (!any) std::filesystem::remove(rig_path(folder_), ignored);  // a start that failed may be tried again
}

CameraFile::Counts Recording::counts(uint32_t camera) const {
  const auto found = files_.find(camera);
  return found == files_.end() ? CameraFile::Counts{} : found->second->counts();
}

GstStructure* Recording::stats() const {
  const std::lock_guard lock(mutex_);
  return gst_structure_new("recording", "folder", G_TYPE_STRING, folder_.c_str(), "begin", G_TYPE_UINT64,
                           begin_.value_or(0), "reason", G_TYPE_STRING, reason_.c_str(), nullptr);
}

}  // namespace lf
