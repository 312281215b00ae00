// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"

#include <set>
#include <tuple>

#include "base/error.h"
#include "rig/rig.h"

namespace lf {

void check_tracks(const Tracks& tracks, const std::string& name) {
  const auto fail = [&](const char* list, size_t i, const std::string& what) {
    throw Error(name + ": " + list + "[" + std::to_string(i) + "]: " + what);
  };
  std::set<uint32_t> ids;
  for (size_t i = 0; i < tracks.cameras.size(); i++) {
    const Tracks::Camera& camera = tracks.cameras[i];
    if (!ids.insert(camera.id).second) fail("cameras", i, "id " + std::to_string(camera.id) + " comes twice");
    if (camera.width < 1 || camera.height < 1 || camera.width > kMaxImageSize || camera.height > kMaxImageSize)
      fail("cameras", i, "width and height must be 1 to " + std::to_string(kMaxImageSize));
  }
  std::set<std::tuple<uint32_t, uint32_t, uint32_t>> seen;
  for (size_t i = 0; i < tracks.observations.size(); i++) {
    const Observation& o = tracks.observations[i];
    if (o.camera >= tracks.cameras.size())
      fail("observations", i,
           "camera " + std::to_string(o.camera) + " is not one of the " + std::to_string(tracks.cameras.size()) +
               " cameras");
    if (o.position >= tracks.num_positions)
      fail("observations", i, "position " + std::to_string(o.position) + " is out of range");
    if (o.light > (tracks.bar ? 1u : 0u))
      fail("observations", i, "light " + std::to_string(o.light) + (tracks.bar ? ": must be 0 or 1" : ": not a bar"));
    const Tracks::Camera& camera = tracks.cameras[o.camera];
    // Half an image beyond the border is a light that a detector extrapolated; more is a mistaken size or unit.
    const bool near = std::abs(o.pixel.x - camera.width / 2.0) <= camera.width &&
                      std::abs(o.pixel.y - camera.height / 2.0) <= camera.height;
    if (!near)
      fail("observations", i,
           "(" + std::to_string(o.pixel.x) + ", " + std::to_string(o.pixel.y) + ") is far outside of camera " +
               std::to_string(camera.id) + "'s image");
    if (!seen.insert({o.camera, o.position, o.light}).second)
      fail("observations", i, "camera " + std::to_string(camera.id) + " sees the same light twice");
  }
}

}  // namespace lf
