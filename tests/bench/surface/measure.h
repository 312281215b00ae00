// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "bench/surface/cases.h"
#include "focus/camera_gains.h"
#include "focus/focus_control.h"
#include "focus/surface_choice.h"
#include "image/image.h"
#include "quality/quality.h"
#include "rig/mesh.h"
#include "view/view.h"

namespace lf::focus {

// One picture and what it cost. Bytes and times are of one picture.
struct Picture {
  Image image;
  std::vector<float> coverage;
  Quality quality;
  double colour_bytes = 0, trial_bytes = 0;  // 16-bit sums of the whole array, and moments
  double colour_ms = 0, trial_ms = 0;        // by one thread; images are there already
};

// Of the figures that there are: what could not be measured (NaN) and what has no number (the PSNR of equal pictures)
// does not count. NaN if there are none.
class Mean {
 public:
  void add(double figure) {
    if (!std::isfinite(figure)) return;
    sum_ += figure;
    figures_++;
  }
  double value() const {
    return figures_ > 0 ? sum_ / static_cast<double>(figures_) : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double sum_ = 0;
  size_t figures_ = 0;
};

// Single planes parallel to an array, judged by the truth: what surfaces are compared with. Distances are metres from
// the plane through the array, `from`; none needs to be known before.

using Draw = std::function<Picture(const View&)>;

View on_plane(const View& view, const Plane& from, double distance);

// Where a view's scene is, as inverse distances.
struct Depths {
  DepthRange range;   // that all but little of it is in
  double middle = 0;  // half of it is nearer
  double best = 0;    // of the plane whose picture is nearest to the truth
};
// Looks at every plane that the array tells apart, from infinity (a quarter of a pixel between neighbouring cameras) to
// where fewer and fewer pixels are seen by their cameras: at every nth pixel of the view, an eighth of the disparity
// apart (1/8 to 1/2 pixel), and around the best one finer. Nothing if no camera sees what the view shows. Throws Error
// if all cameras are at one place.
std::optional<Depths> find_depths(const Rig& rig, const Mesh& mesh, const View& view, const Image& truth,
                                  const Plane& from, const Draw& draw);

struct JudgedPlanes {
  Picture best;  // of the planes that cover half of what any covers, the one with the highest PSNR
  double best_distance = 0;
  Picture bound;  // each pixel's best of the planes through which any camera sees it
};
// If no plane covers anything the figures are NaN.
JudgedPlanes judge_planes(const View& view, const Image& truth, const Plane& from, std::span<const double> distances,
                          const Draw& draw);

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

// Where the scene of one view is: as find_depths() above.
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
