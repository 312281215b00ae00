// SPDX-License-Identifier: LGPL-2.1-or-later
#include "light_recordings.h"

#include <algorithm>
#include <functional>
#include <mutex>

#include "base/error.h"
#include "base/number_text.h"
#include "base/worker_pool.h"
#include "calibration/light_detector.h"
#include "progress.h"
#include "recordings.h"
#include "video_pictures.h"

namespace {

struct Watched {
  lf::LightSights::Camera sights;
  lf::LightRecord record;
  std::string trouble;  // why there is no recording
};

Watched watch(const std::string& folder, const lf::Rig& rig, const lf::Camera& camera,
              const std::function<void(double)>& progress) {
  Watched watched;
  watched.sights = {camera.id, camera.width, camera.height, {}};
  try {
    lf::LightDetector detector(camera.width, camera.height);
    for_each_picture(recording_of(folder, rig, camera), VideoFormat::kGrey, [&](const VideoPicture& picture) {
      if (picture.width != camera.width || picture.height != camera.height)
        throw lf::Error("its pictures are " + lf::size_text(picture.width, picture.height) + ", the rig has it as " +
                        lf::size_text(camera.width, camera.height));
      // Stamps that stand still, or go back, are of a damaged recording.
      auto& frames = watched.sights.frames;
      if (frames.empty() || picture.time > frames.back().time)
        frames.push_back({picture.time, detector.look(picture.samples, picture.stride)});
      progress(picture.progress);
      return true;
    });
    watched.record = detector.record();
  } catch (const lf::Error& e) {
    watched.trouble = std::string(": ") + e.what();
  }
  return watched;
}

}  // namespace

size_t LightRecordings::useful() const {
  return static_cast<size_t>(std::ranges::count_if(cameras, [](const Camera& c) { return c.trouble.empty(); }));
}

std::vector<std::string> LightRecordings::troubles(const lf::Rig& rig) const {
  std::vector<std::string> all;
  for (size_t i = 0; i < cameras.size(); i++)
    if (!cameras[i].trouble.empty())
      all.push_back("camera " + std::to_string(rig.cameras[i].id) + " (" + rig.cameras[i].name + ")" +
                    cameras[i].trouble);
  return all;
}

LightRecordings watch_lights(const lf::Rig& rig, const std::string& folder, bool bar, int threads) {
  check_folder(folder);
  std::vector<Watched> all(rig.cameras.size());
  constexpr int kSteps = 100;
  Progress progress_bar("looking for lights", kSteps * rig.cameras.size());
  std::mutex mutex;
  lf::WorkerPool().run(static_cast<unsigned>(threads), rig.cameras.size(), [&](size_t i) {
    int done = 0;
    const auto progress = [&](double share) {
      const std::lock_guard lock(mutex);
      for (; done < static_cast<int>(share * kSteps); done++) progress_bar.step();
    };
    all[i] = watch(folder, rig, rig.cameras[i], progress);
    progress(1);
  });
  progress_bar.finish();
  LightRecordings result;
  result.sights.bar = bar;
  for (const Watched& watched : all) {
    LightRecordings::Camera& camera = result.cameras.emplace_back();
    camera.record = watched.record;
    camera.summary = lf::summarize_lights(watched.sights, watched.record);
    camera.trouble = !watched.trouble.empty() ? watched.trouble
                     : camera.summary.trouble ? " " + *camera.summary.trouble
                                              : "";
    result.sights.cameras.push_back(watched.sights);
  }
  result.findings = lf::compare_recordings(result.sights);
  return result;
}
