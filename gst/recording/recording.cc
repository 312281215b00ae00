// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/recording.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include <unistd.h>

#include "base/file.h"
#include "base/text.h"
#include "common/common.h"
#include "rig/rig_json.h"

namespace lf {

// A camera that was absent during a clock step cannot decide between the offsets, so frames of other cameras decide.
bool CaptureTimeline::belongs_to_latest(gint64 time, const Camera& camera) const {
  if (camera.offset == offset_) return false;
  if (time < camera.newest - kSetBack) return true;
  const gint64 by_latest = time - camera.offset + offset_;
  return time > camera.newest + kSetBack && std::abs(by_latest - newest_) < std::abs(time - newest_);
}

CaptureTimeline::Place CaptureTimeline::place(uint32_t number, GstClockTime captured) {
  Camera& camera = cameras_[number];
  const gint64 taken = static_cast<gint64>(captured) - begin_;
  if (belongs_to_latest(taken + camera.offset, camera)) camera.offset = offset_;
  Place place{taken + camera.offset, 0};
  if (camera.is_seen && place.time < camera.newest - kSetBack) {
    const gint64 since = camera.stray ? taken - *camera.stray : 0;
    camera.stray = taken;
    if (since <= 0 || since > kSetBack) return place;
    const gint64 next = camera.newest + camera.period + since;
    place.set_back = next - place.time;
    place.time = next;
    camera.offset = offset_ = next - taken;
  }
  if (place.time < 0) return place;
  camera.stray.reset();
  if (place.time > camera.newest) {
    if (camera.is_seen && place.time - camera.newest <= kSetBack) camera.period = place.time - camera.newest;
    camera.newest = place.time;
  }
  camera.is_seen = true;
  newest_ = std::max(newest_, place.time);
  return place;
}

namespace {

constexpr guint64 kMaxBytes = 256 << 20;
constexpr gint64 kFinishTimeout = 5 * G_USEC_PER_SEC;

std::string file_name(const Camera& camera) { return "camera" + std::to_string(camera.id) + ".mkv"; }

std::string time_of_day() {
  g_autoptr(GDateTime) now = g_date_time_new_now_utc();
  g_autofree gchar* text = g_date_time_format(now, "%Y-%m-%dT%H:%M:%S.%fZ");
  return text;
}

std::string rig_path(const std::string& folder) { return folder + "/rig.json"; }

void require_free(const std::string& path, const std::string& folder) {
  std::error_code error;
  // Also refuses a dangling symbolic link, because the recording would be written to its target.
  if (std::filesystem::exists(std::filesystem::symlink_status(path, error)))
    throw Error(folder + ": contains a recording already (" + std::filesystem::path(path).filename().string() +
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
    Track& track = tracks_[camera.id];
    track.name = "camera " + std::to_string(camera.id) + (camera.name.empty() ? "" : " (" + camera.name + ")");
    track.file = std::make_unique<CameraFile>(camera, folder + "/" + file_name(camera), kMaxBytes / cameras.size());
  }
}

Recording::~Recording() { finish(); }

// The rig.json also has the cameras of other nodes, so that recordings of several hosts can be merged into one folder.
// It has no time offsets, because the timestamps in the files include these offsets.
void Recording::save(const Rig& rig, const std::string& rig_file) const {
  Rig recorded = rig;
  std::error_code error;
  const auto whole = std::filesystem::weakly_canonical(folder_, error);
  rebase_paths(recorded, error ? folder_ : whole.string());
  for (Camera& camera : recorded.cameras) {
    camera.source = file_name(camera);
    camera.image.clear();
    camera.time_offset = 0;
  }
  save_rig_like(rig_file, recorded, rig_path(folder_));
}

void Recording::update_rig(const Rig& rig, const std::string& rig_file) {
  try {
    save(rig, rig_file);
  } catch (const Error& error) {
    GST_ELEMENT_WARNING(owner_, RESOURCE, WRITE,
                        ("%s: the rig file can't be updated: %s", folder_.c_str(), error.what()), (nullptr));
  }
}

// Returns the time in the camera's file; nothing if the frame is from before the recording. Films keep their times.
// Coded pictures from shortly before the start get the time 0, because later pictures refer to these pictures.
std::optional<GstClockTime> Recording::time_of(uint32_t camera, GstClockTime captured, bool live, bool coded) {
  std::unique_lock lock(mutex_);
  if (!timeline_) {
    begins_ = time_of_day();
    timeline_.emplace(live ? captured : 0);
  }
  if (!live) return captured;
  const CaptureTimeline::Place place = timeline_->place(camera, captured);
  lock.unlock();
  if (place.set_back > 0) warn_clock_set_back(place.set_back);
  if (place.time >= 0) return static_cast<GstClockTime>(place.time);
  if (place.time < -CaptureTimeline::kSetBack)
    tracks_.at(camera).file->note_dropped();
  else if (coded)
    return 0;
  return std::nullopt;
}

void Recording::warn_clock_set_back(gint64 nanoseconds) {
  if (warned_set_back_.exchange(true)) return;
  GST_ELEMENT_WARNING(owner_, CORE, CLOCK,
                      ("%s: the clock was set back by %s s: the recording continues without a gap.", folder_.c_str(),
                       format_text("%.1f", static_cast<double>(nanoseconds) / GST_SECOND).c_str()),
                      (nullptr));
}

void Recording::add(uint32_t camera, GstBuffer* frame, GstCaps* caps, GstClockTime captured, bool live) {
  if (stopped_ || finished_) return;
  const std::optional<GstClockTime> time = time_of(camera, captured, live, find_coded_video(caps));
  if (!time) return;
  Track& track = tracks_.at(camera);
  tell(track, caps, track.file->add(frame, caps, *time, begins_));
}

void Recording::tell(Track& track, GstCaps* caps, CameraFile::AddResult added) {
  switch (added) {
    case CameraFile::AddResult::kTaken:
    case CameraFile::AddResult::kNotLater:
    case CameraFile::AddResult::kNoKeyFrame: return;
    case CameraFile::AddResult::kBehind: return warn_behind(track);
    case CameraFile::AddResult::kOtherCodec: return warn_other_codec(track, caps);
    case CameraFile::AddResult::kFailed: return report_failure(track);
  }
}

void Recording::warn_behind(const Track& track) {
  if (warned_behind_.exchange(true)) return;
  GST_ELEMENT_WARNING(owner_, RESOURCE, WRITE,
                      ("%s: the disk or this machine is too slow to record all frames. Frames are missing in the "
                       "recording, first of %s",
                       folder_.c_str(), track.name.c_str()),
                      ("further missing frames, also of other cameras, are counted in stats"));
}

void Recording::warn_other_codec(Track& track, GstCaps* caps) {
  if (track.warned_codec.exchange(true)) return;
  const char* const kind = gst_structure_get_name(gst_caps_get_structure(caps, 0));
  GST_ELEMENT_WARNING(owner_, STREAM, FORMAT,
                      ("%s: %s changed to %s, but a file can contain only one codec. Its frames are no longer "
                       "recorded.",
                       folder_.c_str(), track.name.c_str(), kind),
                      ("unrecorded frames are counted in stats"));
}

void Recording::report_failure(Track& track) {
  if (stopped_ || track.reported_failure.exchange(true)) return;
  const CameraFile::Problem problem = track.file->problem().value_or(CameraFile::Problem{});
  const bool is_last = ++failed_ == tracks_.size();
  if (is_last || problem.disk_is_full || access(folder_.c_str(), W_OK | X_OK) != 0) return stop(problem.text);
  GST_ELEMENT_WARNING(owner_, RESOURCE, WRITE,
                      ("%s is no longer recorded: %s The frames recorded so far can be played.", track.name.c_str(),
                       problem.text.c_str()),
                      ("unrecorded frames are counted in stats"));
}

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
      ("%s: recording has stopped: %s The frames recorded so far can be played.", folder_.c_str(), reason.c_str()),
      (nullptr));
}

void Recording::finish() {
  if (finished_.exchange(true)) return;
  GstClockTime end = 0;
  bool any = false;
  for (const auto& [camera, track] : tracks_) {
    end = std::max(end, track.file->ends_at());
    any = any || track.file->counts().frames > 0;
  }
  for (const auto& [camera, track] : tracks_) track.file->end(end);
  const gint64 deadline = g_get_monotonic_time() + kFinishTimeout;
  for (const auto& [camera, track] : tracks_) track.file->close(deadline);
  for (auto& [camera, track] : tracks_)
    if (track.file->problem()) report_failure(track);
  std::error_code ignored;
  if (!any) std::filesystem::remove(rig_path(folder_), ignored);  // a failed start can be repeated
}

CameraFile::Counts Recording::counts(uint32_t camera) const {
  const auto found = tracks_.find(camera);
  return found == tracks_.end() ? CameraFile::Counts{} : found->second.file->counts();
}

GstStructure* Recording::stats() const {
  const std::lock_guard lock(mutex_);
  return gst_structure_new("lightfield-recording", "folder", G_TYPE_STRING, folder_.c_str(), "begin", G_TYPE_UINT64,
                           timeline_ ? timeline_->begin() : 0, "reason", G_TYPE_STRING, reason_.c_str(), nullptr);
}

}  // namespace lf
