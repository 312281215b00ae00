// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/stanford_focus.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/text.h"
#include "render/focus_range.h"
#include "rig/still_image_cache.h"

namespace lf {
namespace {

constexpr double kAcross = 50;        // horizontal field of view of a common lens, degrees
constexpr double kSweep = 0.1;        // relative to the image width, in both directions, between neighbours
constexpr double kStandsStill = 0.5;  // between neighbours, pixels
constexpr double kDeep = 3;           // ratio of the farthest to the nearest distance

double neighbour_distance(const Rig& rig) {
  std::vector<double> nearest;
  for (const Camera& a : rig.cameras) {
    double least = std::numeric_limits<double>::infinity();
    for (const Camera& b : rig.cameras)
      if (const double d = glm::length(a.pose.position - b.pose.position); d > 0) least = std::min(least, d);
    nearest.push_back(least);
  }
  std::nth_element(nearest.begin(), nearest.begin() + static_cast<ptrdiff_t>(nearest.size() / 2), nearest.end());
  return nearest[nearest.size() / 2];
}

double rounded(double value) {
  const double unit = std::pow(10, std::floor(std::log10(value)) - 2);
  return std::round(value / unit) * unit;
}

// Returns the rig with images shifted by `shift` pixels per metre of camera offset.
Rig with_lenses(Rig rig, double f, double shift) {
  Vec3 middle(0, 0, 0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / static_cast<double>(rig.cameras.size());
  for (Camera& camera : rig.cameras) {
    const Vec3 way = (camera.pose.position - middle) * shift;
    camera.lens = Lens::pinhole(f, (camera.width - 1) / 2.0 + way.x, (camera.height - 1) / 2.0 + way.y);
  }
  return rig;
}

// Returns the focus distance, 0 if distant points do not move, or nothing if the images have too little texture.
std::optional<double> focus_distance_of(const Rig& rig, double f) {
  const double baseline = neighbour_distance(rig);
  if (!std::isfinite(baseline)) return std::nullopt;
  // Disparities between neighbouring images can have either sign, because the images may be shifted, but a plane sweep
  // only covers one sign. An additional shift, as if the cameras converged nearby, brings all possible disparities into
  // the range of the sweep. It is subtracted from the result.
  const double shift = kSweep * rig.cameras[0].width / baseline;
  const Rig swept = with_lenses(rig, f, shift);
  StillImageCache images(swept);
  const auto range = estimate_focus_range(swept, [&](CameraIndex i) -> const Image& { return images.get(i); });
  if (!range) return std::nullopt;
  const double most = f / range->near - shift, least = f / range->far - shift;
  if (least * baseline > -kStandsStill) return 0;
  // 1 / far, with 1 / near = kDeep / far
  const double inverse_far = std::max(most - least, -least) / f / (kDeep - 1);
  return 1 / (inverse_far - least / f);
}

}  // namespace

RigImport import_stanford_pictures(const std::string& directory, StanfordOptions options) {
  if (const double named_f = stanford_focal_length(directory); named_f > 0) {
    if (!(options.f > 0)) options.f = named_f;
    options.focus_distance = std::max(0.0, options.focus_distance);
  }
  const bool knows_f = options.f > 0, knows_focus = options.focus_distance >= 0;
  if (knows_f && knows_focus) return import_stanford(directory, options);
  std::vector<std::string> notes;
  const Rig rig = import_stanford(directory, {1, 0, options.unit}).rig;
  if (!knows_f) {
    options.f = rounded(rig.cameras[0].width / 2.0 / std::tan(kAcross / 2 * M_PI / 180));
    notes.push_back("the focal length is unknown; assuming " + number_text(options.f) +
                    " px, 50 degrees across (--f). Depths have the same relative error as the focal length");
  }
  if (!knows_focus) {
    const auto focus = focus_distance_of(rig, options.f);
    options.focus_distance = focus && *focus > 0 ? rounded(*focus) : 0;
    notes.push_back(
        !focus ? "the images have too little texture to estimate the focus distance; assuming unshifted images "
                 "(--focus-distance)"
        : *focus > 0
            ? "focus distance " + number_text(options.focus_distance) +
                  " m, estimated from the images, assuming that the farthest objects are three times as far away "
                  "as the nearest (--focus-distance)"
            : "assuming unshifted images: nothing in the images moves against the cameras' motion "
              "(--focus-distance)");
  }
  RigImport result = import_stanford(directory, options);
  if (!knows_focus) std::erase(result.notes, "the focus distance is 0: assuming unshifted images");
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  return result;
}

}  // namespace lf
