// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "base/memory.h"
#include "base/worker_pool.h"
#include "focus/photo_consistency.h"
#include "render/sum_renderer.h"
#include "render/view_plan.h"
#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf {

// Brightness of a camera divided by the brightness of the reference: the natural logarithm of the ratio, and the
// standard deviation of this logarithm.
struct BrightnessRatio {
  float log = 0, error = 0;
};

// Estimates the exposure gain of each camera of an array. Images are divided by their gains, so that all cameras are
// equally bright and do not disagree about correct depths.
//
// Even cameras with the same exposure differ in brightness by a few percent because of reflections, and noise and
// defocus limit the measurement. Each camera is therefore one of two kinds. Either it has the right exposure, and its
// measured ratio consists of reflections and errors. Or it has another exposure, and the ratio can have any value. The
// likelier the first kind (by Bayes' rule), the smaller is the part of the measured ratio that becomes gain. A plain
// value without locks.
class ExposureCompensation {
 public:
  static constexpr float kLeast = 0.5f, kMost = 2;  // limits of gains; a larger difference is another fault
  // standard deviation of the log ratio due to reflections, which change it by up to 0.02
  static constexpr float kShine = 0.007f;
  static constexpr float kUsual = 0.9f;  // part of the cameras that have the right exposure
  // Bandwidth, as a natural logarithm, of the mean shift that finds the brightness of most cameras (Fukunaga and
  // Hostetler 1975). Each mean gives less weight to cameras that differ more from the previous mean.
  static constexpr float kAround = 0.03f;
  // trust() of a camera without a measurement. A camera that is as bright as the mean has 1.
  static constexpr float kUnknownTrust = 0.125f;
  // Number of means before images are divided by gains. The first mean weights all cameras equally, so it includes
  // cameras with a wrong exposure.
  static constexpr unsigned kMeans = 3;

  // Returns the divisor for the camera's images: 1 for a camera without a measurement.
  float of(CameraIndex camera) const { return means_ < kMeans ? 1 : likely(camera); }
  // Returns the likeliest gain according to the measurements so far. Unlike of(), it is used immediately, for the next
  // mean.
  float likely(CameraIndex camera) const;
  // Returns the weight of the camera in the common mean, 0 to 1. It is smaller for cameras that differ more from the
  // mean.
  float trust(CameraIndex camera) const;
  // Updates the gains with new measurements. Each ratio compares a camera's images, divided by likely(), with the
  // latest mean.
  void take(const std::map<CameraIndex, BrightnessRatio>& ratios);
  const std::map<CameraIndex, BrightnessRatio>& measured() const { return measured_; }

 private:
  float usual(CameraIndex camera) const;

  std::map<CameraIndex, BrightnessRatio> measured_;  // ratios of undivided images to the mean
  unsigned means_ = 0;
};

// The weighted sum of the logarithms of the cameras' gains. The weight of a camera is its weight in a mean of luma
// times its trust(). Sums from several nodes can be added. The mean of logarithms is the geometric mean of the gains,
// which is the suitable mean of factors.
struct GainSum {
  static constexpr int kWeightOne = 65536, kOctave = 256;  // weight 1; unit of log2, so that a gain of 2 is 256
  uint32_t weight = 0;
  int32_t log2 = 0;  // sum of weight x logarithm of the gain

  void add(float gain, float camera_weight);
  void add(const GainSum& other);
  float mean() const;  // the geometric mean; 1 without cameras
  bool operator==(const GainSum&) const = default;
};

// Returns the luma that all cameras compare their own luma with, one value for each node of the map. `moments` are sums
// of luma divided by the cameras' gains. A value of 0 means that the node is unsuitable: few cameras see it, they
// disagree, luma changes from node to node, or the node is nearly black or white. The result is scaled by the mean
// gain, because otherwise all gains could slowly rise or fall together.
std::vector<uint8_t> mean_luma(const PhotoConsistency& moments, const GainSum& gains);

// Decides which requests include a measurement of brightness: the mean luma of all cameras, which each camera then
// compares with its own luma. Requests without hypotheses never include a measurement. The first kFirst requests do, so
// that cameras match before the first surface is found. Later, fewer requests do, because a measurement reads the whole
// images of a dozen cameras.
//
// There is one pending measurement at a time. Cameras keep samples for the latest mean only, and a second measurement
// during a correction would correct the gains twice. A plain value without locks.
class ExposureSchedule {
 public:
  static constexpr unsigned kFirst = 4;     // number of requests that try all planes: see hypotheses_of_round()
  static constexpr unsigned kLongest = 32;  // maximum interval of the means, in requests with hypotheses
  // Requests with hypotheses until a missing mean counts as lost.
  static constexpr unsigned kPatience = 30;

  // Returns true if the next request includes a measurement. `has_hypotheses`: the request has hypotheses. `came`: the
  // mean of the pending measurement has arrived.
  bool next(bool has_hypotheses, bool came) {
    if (came) awaited_ = 0;
    if (!has_hypotheses) return false;
    if (pause_ > 0) pause_--;
    if (awaited_ > 0) awaited_--;
    if (pause_ > 0 || awaited_ > 0) return false;
    if (asked_ < kFirst) asked_++;
    interval_ = asked_ < kFirst ? 1 : std::min(2 * interval_, kLongest);
    pause_ = interval_;
    awaited_ = kPatience;
    return true;
  }

 private:
  unsigned asked_ = 0, interval_ = 1, pause_ = 0, awaited_ = 0;
};

// Returns the view for comparing the brightness of cameras: a small view with one pixel per node of the smoothed focal
// map of `view`, with nodes twice as far apart. `view` must have a map.
View mean_view(const View& view);

// Samples luma of many cameras at the nodes of a view, to compare the brightness of cameras that are not neighbours in
// the mesh. The weights are therefore wider than the weights of the mesh. A weight is a Gaussian of the distance
// between the camera and the point where the line of sight crosses the reference plane of the map. Its standard
// deviation is the median edge of the mesh, and it is 0 beyond kWidest standard deviations.
class WideLuma {
 public:
  static constexpr double kWidest = 2.5;
  static constexpr float kPeak = 0.125f;  // largest weight; over a grid of cameras the weights sum to 0.79

  // Prepares the sampling. `view` is a mean_view(), and `own` are the node's cameras in service, ascending.
  WideLuma(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own);
  // Returns the node's cameras with a weight, ascending. see() reads their whole images.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

  // The samples of one camera, which the node keeps until the mean of all cameras arrives.
  struct Camera {
    CameraIndex camera = 0;
    std::vector<uint8_t> luma;  // divided by the camera's likely gain, one value per node
    std::vector<float> weight;  // 0: not visible
    bool is_from_afar = false;  // compared with more distant cameras, because too few are near
  };
  struct Seen {
    std::vector<Camera> cameras;
    PhotoConsistency moments;  // sums over all cameras, weighted by trust
    GainSum gains;             // the cameras' likely gains
  };
  // Samples the images in `sources`: images of cameras(), and possibly more. The result does not depend on `parallel`.
  // Throws Error if an image does not have the size of its camera.
  Seen see(std::span<const Source> sources, const ExposureCompensation& gains,
           const ParallelFor& parallel = serial_for) const;

  // Returns the brightness of a camera, divided by its gain, relative to the mean luma of all cameras. It is the median
  // over the nodes. Returns nothing if there are too few suitable nodes. `mean` is the result of mean_luma().
  static std::optional<BrightnessRatio> ratio(const Camera& seen, std::span<const uint8_t> mean);
  // Returns the ratio() of each camera that can be compared.
  static std::map<CameraIndex, BrightnessRatio> ratios(std::span<const Camera> seen, std::span<const uint8_t> mean);

 private:
  Camera see(const Source& source, float gain) const;

  ViewPlan plan_;
  // False if only two cameras can be compared. If they differ, there is no majority to tell which one is right. If the
  // array has no other cameras, their mean is taken as right. Otherwise no cameras are compared, because most of the
  // array may be as bright as either of the two.
  bool most_decide_ = false;
  bool is_from_afar_ = false;  // see Camera
  std::vector<CameraIndex> cameras_;
  Vec3 across_, down_;           // axes along the plane, in units of the pitch
  std::vector<Vec2> crossings_;  // intersections of the nodes' lines of sight with the plane
  std::vector<float> u_, v_;     // lines of sight of the nodes, then kHypothesisPadding unused values
  ByteBuffer levels_;            // levels of the nodes, then as many unused values
};

}  // namespace lf
