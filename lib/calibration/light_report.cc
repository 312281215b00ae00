// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_report.h"
#include "base/number_text.h"

#include <algorithm>

#include "base/percentiles.h"
#include "calibration/light_paths.h"
#include "calibration/picture_places.h"

namespace lf {
namespace {

constexpr double kBlack = 20, kBlackBrightest = 40;  // of 255: a picture that shows nothing; video's black may be 16
constexpr double kBright = 50;                       // of 255: a room that is not dark
constexpr double kMostBusy = 0.2;                    // share of the pictures
constexpr double kLeastCoverage = 0.5;
constexpr double kShorter = 0.9;  // of the longest recording

double seconds_of(const LightSights::Camera& camera) {
  if (camera.frames.size() < 2) return 0;
  return camera.frames.back().time - camera.frames.front().time;
}

std::optional<std::string> trouble_of(const LightSights::Camera& camera, const LightRecord& record, bool moves) {
  const auto frames = static_cast<double>(std::max<size_t>(1, record.frames));
  if (record.frames < 3) return "has no more than " + std::to_string(record.frames) + " pictures";
  if (record.background < kBlack && record.brightest < kBlackBrightest && record.lit == 0)
    return "is black from beginning to end: is there a cap on the lens, or is the exposure far too short?";
  if (static_cast<double>(record.busy) > kMostBusy * frames)
    return format_text(
        "is full of changes in %.0f %% of its pictures, where a light can't be told from the rest: darken the room, "
        "lock the exposure, and keep people and screens out of the picture",
        100 * static_cast<double>(record.busy) / frames);
  if (record.lit == 0)
    return record.background > kBright
               ? format_text(
                     "shows no light: the room is not dark (%.0f of 255 on average). Draw the curtains, or expose less",
                     record.background)
               : std::string("shows no light: is it on, in the picture, and bright enough to be seen in the dark?");
  if (!moves)
    return camera.frames.size() < 10 ? "is too short for a light to be followed"
                                     : "shows only lights that stand still, or none for longer than a moment";
  return std::nullopt;
}

}  // namespace

LightSummary summarize_lights(const LightSights::Camera& camera, const LightRecord& record) {
  LightSummary summary;
  summary.seconds = seconds_of(camera);
  summary.lit = static_cast<double>(record.lit) / static_cast<double>(std::max<size_t>(1, record.frames));
  PicturePlaces places(camera.width, camera.height);
  std::vector<double> sigmas;
  bool moves = false;
  for (const LightPath& path : link_light_paths(camera)) {
    if (path.still) continue;
    moves = true;
    for (const LightPath::Point& point : path.points) places.come(point.sight.pixel);
  }
  for (const LightSights::Frame& frame : camera.frames)
    if (!frame.sights.empty()) sigmas.push_back(frame.sights[0].sigma);
  if (!sigmas.empty()) summary.sigma = median(std::move(sigmas));
  summary.coverage = places.share();
  summary.trouble = trouble_of(camera, record, moves);
  if (summary.trouble) return summary;
  if (summary.coverage < kLeastCoverage)
    summary.remarks.push_back(format_text("the light came to %.0f %% of its picture: move it to the %s, too",
                                          100 * summary.coverage, listed(places.gaps()).c_str()));
  if (record.background > kBright)
    summary.remarks.push_back(
        format_text("the room is not dark (%.0f of 255 on average): weak lights are missed", record.background));
  return summary;
}

std::vector<Finding> compare_recordings(const LightSights& sights) {
  std::vector<Finding> findings;
  double longest = 0;
  for (const LightSights::Camera& camera : sights.cameras) longest = std::max(longest, seconds_of(camera));
  for (const LightSights::Camera& camera : sights.cameras) {
    const double seconds = seconds_of(camera);
    if (seconds > 0 && seconds < kShorter * longest)
      findings.push_back(
          {Finding::Severity::kNote, "short-recording",
           format_text("camera %u has %.1f s of the %.1f s that others have: what is missing is not used", camera.id,
                       seconds, longest)});
  }
  return findings;
}

}  // namespace lf
