// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/recorder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <optional>

#include "base/file.h"
#include "base/text.h"
#include "cameras/rig_cameras.h"
#include "file_names.h"
#include "mjpeg_writer.h"

namespace lf::cameras {
namespace {

namespace fs = std::filesystem;

constexpr int kQuality = 95;

// Time before the recording, in seconds. Automatic exposure converges in kWarmUp. Network cameras state their capture
// times only in their first RTCP sender report, which arrives after at most 1.5 times the interval of 5 s (RFC 3550).
// At that moment the timestamps jump.
constexpr double kWarmUp = 1, kFirstReport = 8;

bool is_dated_by_arrival(const RigCameras& cameras, CameraIndex camera) {
  GstStructure* stats = cameras.stats(camera);
  const char* by = stats ? gst_structure_get_string(stats, "capture-time") : nullptr;
  const bool arrival = by && std::string(by) == "arrival";
  if (stats) gst_structure_free(stats);
  return arrival;
}

// The recording of one camera. Call see() on one thread, and finish() after the last frame.
class CameraRecording {
 public:
  void see(const CameraFrame& frame, const Camera& camera, const fs::path& file, double time) {
    // Frames that arrive late or out of order are skipped.
    if (!problem_.empty() || time < 0 || (frames_ > 0 && time <= last_)) return;
    try {
      const auto stamp = static_cast<GstClockTime>(std::llround(time * GST_SECOND));
      const GstStructure* format = gst_caps_get_structure(gst_sample_get_caps(frame.sample), 0);
      if (gst_structure_has_name(format, "image/jpeg")) {
        if (!writer_) writer_.emplace(file.string(), camera.width, camera.height);
        writer_->add_jpeg(gst_sample_get_buffer(frame.sample), stamp);
      } else {
        if (!writer_) writer_.emplace(file.string(), camera.width, camera.height, FrameRate{0, 1}, kQuality);
        writer_->add(rgb_of(frame.sample), stamp);
      }
      frames_++;
      last_ = time;
    } catch (const Error& error) {
      problem_ = error.what();
    }
  }
  void finish(RecordedCamera& recorded) {
    recorded.frames = frames_;
    recorded.problem = problem_;
    if (writer_ && problem_.empty()) try {
        writer_->finish();
      } catch (const Error& error) {
        recorded.problem = error.what();
      }
  }

 private:
  std::optional<MjpegWriter> writer_;
  uint64_t frames_ = 0;
  double last_ = 0;
  std::string problem_;
};

std::string film_name(const Camera& camera) { return camera.name + ".mkv"; }

// Films of different recordings have different start times, so they do not fit together. If the new recording lacks a
// camera, the previous film of this camera is moved to the folder "earlier".
void set_earlier_film_aside(const std::string& folder, const std::string& staging, const Camera& camera,
                            RecordedCamera& recorded) {
  const fs::path name = film_name(camera), old = fs::path(folder) / name, aside = fs::path(folder) / "earlier";
  if (fs::exists(fs::path(staging) / name) || !fs::exists(old)) return;
  std::error_code error;
  make_folder(aside.string());
  fs::rename(old, aside / name, error);
  if (error) throw Error(old.string() + ": cannot be moved to " + aside.string() + ": " + error.message());
  recorded.note += (recorded.note.empty() ? "" : "; ") + std::string("its previous film was moved to ") +
                   (aside / name).string() + ", because films of different recordings have different start times";
}

}  // namespace

std::vector<RecordedCamera> record_cameras(std::shared_ptr<const Rig> rig, const std::string& path,
                                           const std::string& folder, const RecordingOptions& options,
                                           const std::function<bool(double)>& on_progress) {
  check_file_names(*rig);
  // Existing films are replaced only when the new films are complete.
  AtomicFolderUpdate update(folder);
  std::vector<CameraRecording> films(rig->cameras.size());
  std::atomic<double> begin = INFINITY;
  RigCameras cameras(rig, path, {.cameras = options.cameras, .decode = false, .trusted = options.trusted},
                     [&](const CameraFrame& frame) {
                       const Camera& camera = rig->cameras[frame.camera];
                       const double time = frame.taken - camera.time_offset - begin;
                       if (options.seen) options.seen(frame);
                       if (time >= options.seconds) return;
                       films[frame.camera].see(frame, camera, fs::path(update.staging()) / film_name(camera), time);
                       if (time >= 0 && options.shown) options.shown(frame);
                     });
  bool going = true;
  cameras.start();
  cameras.wait(options.timeout, [&] {
    going = going && on_progress(-1);
    return !going || std::ranges::all_of(cameras.cameras(), [&](CameraIndex i) { return cameras.is_settled(i); });
  });
  if (going) cameras.wait(kWarmUp);
  if (going)
    cameras.wait(kFirstReport - kWarmUp, [&] {
      going = going && on_progress(-1);
      return !going || std::ranges::none_of(cameras.cameras(), [&](CameraIndex i) {
        return cameras.problem(i).empty() && is_dated_by_arrival(cameras, i);
      });
    });
  std::vector<bool> by_arrival(rig->cameras.size());
  for (const CameraIndex index : cameras.cameras()) by_arrival[index] = is_dated_by_arrival(cameras, index);
  begin = cameras.now();
  // maximum delay of the last frames, seconds
  constexpr double kLate = 0.5;
  if (going)
    cameras.wait(options.seconds + kLate,
                 [&] { return !on_progress(std::min(1.0, (cameras.now() - begin) / options.seconds)); });
  cameras.stop();
  std::vector<RecordedCamera> all;
  for (const CameraIndex index : cameras.cameras()) {
    RecordedCamera& recorded = all.emplace_back(RecordedCamera{.camera = index});
    films[index].finish(recorded);
    if (by_arrival[index])
      recorded.note =
          "capture times are arrival times, because no RTCP sender report came: time offsets include network delays. "
          "Enable these reports in the camera";
    if (recorded.problem.empty()) recorded.problem = cameras.problem(index);
    if (recorded.problem.empty() && recorded.frames == 0) recorded.problem = "the camera delivered no frame";
  }
  if (fs::is_empty(update.staging())) return all;
  for (RecordedCamera& recorded : all)
    set_earlier_film_aside(folder, update.staging(), rig->cameras[recorded.camera], recorded);
  update.commit();
  return all;
}

namespace {

constexpr double kLongestFrame = 2;  // maximum time to wait for frames around the snapshot time, seconds

class SnapshotFrames {
 public:
  ~SnapshotFrames() {
    clear(before_);
    clear(after_);
  }
  void see(const CameraFrame& frame, double instant) {
    const std::lock_guard lock(mutex_);
    if (after_.sample) return;
    BufferedFrame& kept = frame.taken < instant ? before_ : after_;
    clear(kept);
    kept = {gst_sample_ref(frame.sample), frame.taken};
  }
  bool is_complete() const {
    const std::lock_guard lock(mutex_);
    return after_.sample;
  }
  void give(double instant, SnapshotImage& still) const {
    const bool later = after_.sample && (!before_.sample || after_.taken - instant < instant - before_.taken);
    const BufferedFrame& nearest = later ? after_ : before_;
    if (!nearest.sample) {
      still.problem = "the camera delivered no frame";
      return;
    }
    still.off = nearest.taken - instant;
    try {
      still.rgb = rgb_of(nearest.sample);
    } catch (const Error& error) {
      still.problem = error.what();
    }
  }

 private:
  struct BufferedFrame {
    GstSample* sample = nullptr;
    double taken = 0;
  };
  static void clear(BufferedFrame& kept) {
    if (kept.sample) gst_sample_unref(kept.sample);
    kept = {};
  }
  mutable std::mutex mutex_;
  BufferedFrame before_, after_;
};

}  // namespace

std::vector<SnapshotImage> take_snapshot(std::shared_ptr<const Rig> rig, const std::string& path,
                                         const SnapshotOptions& options) {
  std::vector<SnapshotFrames> around(rig->cameras.size());
  std::atomic<double> instant = INFINITY;
  RigCameras cameras(rig, path, {.cameras = options.cameras, .decode = false, .trusted = options.trusted},
                     [&](const CameraFrame& frame) { around[frame.camera].see(frame, instant); });
  const auto is_complete = [&](CameraIndex i) { return !cameras.problem(i).empty() || around[i].is_complete(); };
  cameras.start();
  cameras.wait_for_frames(options.timeout);
  cameras.wait(options.warm_up);
  instant = cameras.now();
  cameras.wait(kLongestFrame, [&] { return std::ranges::all_of(cameras.cameras(), is_complete); });
  cameras.stop();
  std::vector<SnapshotImage> stills;
  for (const CameraIndex index : cameras.cameras()) {
    SnapshotImage still{.camera = index};
    around[index].give(instant, still);
    if (still.rgb.data().empty() && !cameras.problem(index).empty()) still.problem = cameras.problem(index);
    stills.push_back(std::move(still));
  }
  return stills;
}

}  // namespace lf::cameras
