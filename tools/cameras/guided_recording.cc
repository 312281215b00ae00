// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/guided_recording.h"

#include <cstdio>
#include <optional>

#include "cameras/light_watch.h"
#include "cameras/recording_page.h"
#include "cameras/recording_progress.h"

namespace lf::cameras {
namespace {

constexpr double kLineEvery = 4;  // seconds: about what a light takes across the pictures

}  // namespace

std::vector<Recorded> record_guided(std::shared_ptr<const Rig> rig, const std::string& path, const std::string& folder,
                                    RecordingOptions options, const RecordingGuide& guide,
                                    const std::function<bool()>& going) {
  std::optional<LightWatch> watch;
  if (guide.lights > 0) {
    watch.emplace(*rig, guide.lights);
    options.shown = [&](const CameraFrame& frame) { watch->see(frame); };
  }
  std::optional<RecordingPage> page;
  if (guide.page) {
    page.emplace(*rig, watch ? &*watch : nullptr, *guide.page);
    std::printf("The cameras are at %s\n", page->url().c_str());
    std::fflush(stdout);
    options.seen = [&](const CameraFrame& frame) { page->see(frame); };
  }
  RecordingProgress progress;
  const auto say = [&](const std::string& line) {
    progress.say(line);
    if (page) page->say(line);
  };
  bool begun = false;
  double next_line = kLineEvery;
  size_t said = 0;
  std::vector<Recorded> recorded = record_cameras(rig, path, folder, options, [&](double share) {
    progress.tell(share);
    if (page) page->serve();
    if (share < 0) return going();
    if (watch && !begun)
      say("Left and right are those of the pictures: face the cameras, and the left is on your right.");
    if (page && !watch && !begun) page->say("Recording now.");
    begun = true;
    if (watch && share < 1 && share * options.seconds >= next_line) {
      say(watch->told());
      next_line = share * options.seconds + kLineEvery;
    }
    const auto due = static_cast<size_t>(share * static_cast<double>(guide.prompts.size()));
    for (; said < guide.prompts.size() && said <= due; said++)
      say(std::to_string(said + 1) + "/" + std::to_string(guide.prompts.size()) + "  " + guide.prompts[said]);
    return going();
  });
  if (watch && begun) progress.say(watch->told());
  return recorded;
}

std::vector<std::string> board_prompts() {
  const std::string middle = "Amid the pictures, ", still = ". Keep it still for a moment.";
  return {middle + "flat towards the cameras, as near as all of it stays in the pictures" + still,
          middle + "its left side turned away, by 40 degrees" + still,
          middle + "its right side turned away" + still,
          middle + "its upper side turned away" + still,
          middle + "its lower side turned away" + still,
          "In the upper left corner of the pictures, turned a little away" + still,
          "In the upper right corner, turned a little the other way" + still,
          "In the lower right corner, turned a little away" + still,
          "In the lower left corner, turned a little the other way" + still,
          "Twice as far away, its left side turned away" + still,
          "Twice as far away, its upper side turned away" + still,
          "As near as before, turned about by 90 degrees, its right side turned away" + still};
}

}  // namespace lf::cameras
