// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/snapshot.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

#include "base/error.h"
#include "cameras/frame_picture.h"
#include "cameras/rig_cameras.h"

namespace lf::cameras {
namespace {

constexpr double kLongestFrame = 2;  // seconds that the instant's frames are waited for

// The frames of a camera on both sides of the instant.
class Around {
 public:
  ~Around() {
    clear(before_);
    clear(after_);
  }
  void see(const CameraFrame& frame, double instant) {
    const std::lock_guard lock(mutex_);
    if (after_.sample) return;
    Kept& kept = frame.taken < instant ? before_ : after_;
    clear(kept);
    kept = {gst_sample_ref(frame.sample), frame.taken};
  }
  bool is_complete() const {
    const std::lock_guard lock(mutex_);
    return after_.sample;
  }
  // Sets what is there; call when nothing comes any more.
  void give(double instant, Still& still) const {
    const bool later = after_.sample && (!before_.sample || after_.taken - instant < instant - before_.taken);
    const Kept& nearest = later ? after_ : before_;
    if (!nearest.sample) {
      still.problem = "no frame came";
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
  struct Kept {
    GstSample* sample = nullptr;
    double taken = 0;
  };
  static void clear(Kept& kept) {
    if (kept.sample) gst_sample_unref(kept.sample);
    kept = {};
  }
  mutable std::mutex mutex_;
  Kept before_, after_;
};

}  // namespace

std::vector<Still> take_snapshot(std::shared_ptr<const Rig> rig, const std::string& path,
                                 const SnapshotOptions& options) {
  std::vector<Around> around(rig->cameras.size());
  std::atomic<double> instant = INFINITY;
  RigCameras cameras(rig, path, {.cameras = options.cameras, .decode = false, .trusted = options.trusted},
                     [&](const CameraFrame& frame) { around[frame.camera].see(frame, instant); });
  const auto all = [&](const auto& of) {
    return std::all_of(cameras.cameras().begin(), cameras.cameras().end(),
                       [&](CameraIndex i) { return !cameras.problem(i).empty() || of(i); });
  };
  cameras.start();
  cameras.wait(options.patience, [&] { return all([&](CameraIndex i) { return cameras.frames(i) > 0; }); });
  cameras.wait(options.warm_up);
  instant = cameras.now();
  cameras.wait(kLongestFrame, [&] { return all([&](CameraIndex i) { return around[i].is_complete(); }); });
  cameras.stop();
  std::vector<Still> stills;
  for (const CameraIndex index : cameras.cameras()) {
    Still still{.camera = index};
    around[index].give(instant, still);
    if (still.rgb.data().empty() && !cameras.problem(index).empty()) still.problem = cameras.problem(index);
    stills.push_back(std::move(still));
  }
  return stills;
}

}  // namespace lf::cameras
