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
#include "focus/depth_estimator.h"
#include "focus/depth_selection.h"
#include "focus/exposure_compensation.h"
#include "image/image.h"
#include "quality/image_quality.h"
#include "rig/mesh.h"
#include "view/view.h"

namespace lf::focus {

// One picture with its cost; bytes and times per picture.
struct Picture {
  Image image;
  std::vector<float> coverage;
  Quality quality;
  double colour_bytes = 0, consistency_bytes = 0;  // 16-bit sums of the whole array; photo-consistency sums
  double colour_ms = 0, depth_ms = 0;              // in one thread; without loading images
};

// Mean of the known figures: ignores values that could not be measured (NaN) and values without a number (PSNR of equal
// pictures). NaN without any figure.
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

// Single planes parallel to an array, judged with the truth: the baseline for surfaces. Distances are metres from the
// array's plane, `from`.

using Draw = std::function<Picture(const View&)>;

View on_plane(const View& view, const Plane& from, double distance);

// Depths of a view's scene, as inverse distances.
struct Depths {
  DepthRange range;   // contains almost all of the scene
  double middle = 0;  // half of the scene is nearer
  double best = 0;    // plane with the picture closest to the truth
};
// Tests every plane that the array can distinguish, from infinity (a quarter of a pixel between neighbouring cameras)
// to the distance where coverage declines. Tests every nth pixel of the view, with planes an eighth of the disparity
// apart (1/8 to 1/2 pixel), and finer near the best. Returns nullopt if the cameras see nothing of the view. Throws
// Error if all cameras are at one position.
std::optional<Depths> find_depths(const Rig& rig, const Mesh& mesh, const View& view, const Image& truth,
                                  const Plane& from, const Draw& draw);

struct JudgedPlanes {
  Picture best;  // the plane with the highest PSNR, among planes with at least half the maximum coverage
  double best_distance = 0;
  Picture bound;  // each pixel from its best plane, among all planes with a camera that sees the pixel
};
// The figures are NaN if no plane covers anything.
JudgedPlanes judge_planes(const View& view, const Image& truth, const Plane& from, std::span<const double> distances,
                          const Draw& draw);

struct Options {
  DepthEstimator::Settings focus;
  DepthRange range;  // candidate planes
  Resampling resampling = Resampling::kBilinear;
  bool gains = false;         // exposure gains
  int rounds = 12;            // number of pictures before the final picture, starting on the viewer's plane
  int planes = 32;            // candidates for the best plane and the bound
  double one_more_plane = 0;  // metres from the array; 0: none
  double start = 0;           // viewer's plane, metres from the array; 0: in the middle of the range
};

// Finds the depths of one view, like find_depths() above.
std::optional<Depths> find_depths(const Case& c, size_t view);

struct StillResult {
  Picture plane;                // the best single plane, selected with the truth, bilinear
  Picture plane_alike;          // the same, resampled like the surfaces
  Picture bound;                // each pixel from its best plane, selected with the truth
  std::vector<Picture> rounds;  // pictures with the surface, one per round; the first on the viewer's plane
  double gain_alike_db = 0;     // gain of the last round over the plane, on the pixels that both cover
  double best_distance = 0;     // best plane, metres from the array
  double start = 0;             // viewer's plane, metres from the array
  DepthEstimator::State state;
  std::shared_ptr<const FocalMap> map;
  std::map<CameraIndex, BrightnessRatio> gains;  // final gains of the cameras in view
};
StillResult measure_still(const Case& c, size_t view, const Options& options);

// Results of a settled still view: `settle` pictures, then `pictures` that are evaluated.
struct RestResult {
  // Standard deviation of a pixel over the pictures, of 255, largest of the colours: median and 99th percentile over
  // pixels with a clear depth, and over pixels with several equally good depths, as in periodic patterns.
  double clear_median = 0, clear_p99 = 0, unclear_median = 0, unclear_p99 = 0;
  double unclear = 0;      // fraction of the pixels
  double consistency_bytes = 0;  // per picture, mean
  double colour_bytes = 0;
  Quality quality;  // quality of the last picture
  DepthEstimator::State state;
};
RestResult measure_rest(const Case& c, size_t view, const Options& options, int settle = 30, int pictures = 100);

struct Frame {
  double plane_db = 0, surface_db = 0;
};
std::vector<Frame> measure_film(const Case& c, const Options& options, const std::function<void()>& progress);

}  // namespace lf::focus
