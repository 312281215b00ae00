// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "bench/surface/cases.h"
#include "bench/surface/picture.h"
#include "bench/surface/planes.h"
#include "focus/camera_gains.h"
#include "focus/focus_control.h"
#include "image/image.h"

namespace lf::focus {

struct Options {
  FocusControl::Settings focus;
  DepthRange range;  // that planes are picked from
  Resampling resampling = Resampling::kBilinear;
  bool gains = false;         // cameras match their brightness
  int rounds = 12;            // from the viewer's plane to the picture that counts
  int planes = 32;            // that the best one and the bound are picked from
  double one_more_plane = 0;  // metres from the array; 0: none
  double start = 0;           // of the viewer's plane, metres from the array; 0: in the middle of the range
};

// Where the scene of one view is: see planes.h.
std::optional<Depths> find_depths(const Case& c, size_t view);

// A still view.
struct StillResult {
  Picture plane;                // the best single plane, picked with the truth, bilinear
  Picture plane_alike;          // the same, sampled as the surfaces are
  Picture bound;                // each pixel's best of all planes, picked with the truth
  std::vector<Picture> rounds;  // with the surface, round after round; the first on the viewer's plane
  double gain_alike_db = 0;     // of the last round over the plane, of the pixels that both show
  double best_distance = 0;     // of the best plane, metres from the array
  double start = 0;             // of the viewer's plane
  FocusControl::State state;
  std::shared_ptr<const FocalMap> map;
  std::map<CameraIndex, BrightnessRatio> gains;  // of the cameras in view, at last
};
StillResult measure_still(const Case& c, size_t view, const Options& options);

// A still view that has settled: `settle` pictures, and then `pictures` that are looked at.
struct RestResult {
  // Of a pixel over the pictures: standard deviation, of 255, the largest of the colours; median and 99th percentile of
  // the pixels whose depth is clear, and of those where several depths fit as well, as in periodic patterns.
  double clear_median = 0, clear_p99 = 0, unclear_median = 0, unclear_p99 = 0;
  double unclear = 0;      // share of the pixels
  double trial_bytes = 0;  // of a picture, mean
  double colour_bytes = 0;
  Quality quality;  // of the last one
  FocusControl::State state;
};
RestResult measure_rest(const Case& c, size_t view, const Options& options, int settle = 30, int pictures = 100);

// A film: the surface carried from picture to picture beside the plane that is best over the whole film.
struct Frame {
  double plane_db = 0, surface_db = 0;
};
std::vector<Frame> measure_film(const Case& c, const Options& options, const std::function<void()>& progress);

}  // namespace lf::focus
