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

// Brightness of a camera relative to its reference, as a natural logarithm, and the standard deviation of this value.
struct BrightnessRatio {
  float log = 0, error = 0;
};

// Exposure gains. Images are divided by them so that all cameras of an array are equally bright.
//
// Reflections make cameras of the same exposure differ by a few percent, and noise and defocus limit the measurement.
// So a camera either has the right exposure and its measured ratio is reflection and error, or it has another exposure
// and the ratio can have any value. The likelier the first case (Bayes), the smaller the part of the measured ratio
// that becomes gain. A plain value without locks.
class ExposureCompensation {
 public:
  static constexpr float kLeast = 0.5f, kMost = 2;  // limits of gains; a larger difference is another fault
  // standard deviation of the log ratio due to reflections, which reach 0.02
  static constexpr float kShine = 0.007f;
  static constexpr float kUsual = 0.9f;  // part of the cameras that have the right exposure
  // Bandwidth (logarithm) of the mean shift that finds the brightness of most cameras (Fukunaga and Hostetler 1975):
  // each mean weights the cameras by their distance from the last one.
  static constexpr float kAround = 0.03f;
  // Trust in a camera without a measurement; right cameras have 1.
  static constexpr float kUnknownTrust = 0.125f;
  // Images are divided by gains from this mean on. The first mean weights all cameras equally and includes wrong
  // exposures.
  static constexpr unsigned kMeans = 3;

  // Returns the divisor for the camera's images: 1 for a camera without a measurement.
  float of(CameraIndex camera) const { return means_ < kMeans ? 1 : likely(camera); }
  // Returns the likeliest gain given the measurements so far, for the next mean.
  float likely(CameraIndex camera) const;
  // Returns the weight of the camera in the common mean, 0 to 1, which falls with its difference from the mean.
  float trust(CameraIndex camera) const;
  // Takes the ratios of cameras, divided by likely(), to a mean.
  void take(const std::map<CameraIndex, BrightnessRatio>& ratios);
  const std::map<CameraIndex, BrightnessRatio>& measured() const { return measured_; }

 private:
  float usual(CameraIndex camera) const;

  std::map<CameraIndex, BrightnessRatio> measured_;  // ratios of undivided images to the mean
  unsigned means_ = 0;
};

// Sum of the cameras' log gains, each with its weight in a mean of luma times its trust. Logarithms give the geometric
// mean, which suits factors.
struct GainSum {
  static constexpr int kWeightOne = 65536, kOctave = 256;  // weight 1; logarithm of gain 2
  uint32_t weight = 0;
  int32_t log2 = 0;  // sum of weight x logarithm of the gain

  void add(float gain, float camera_weight);
  void add(const GainSum& other);
  float mean() const;  // the geometric mean; 1 without cameras
  bool operator==(const GainSum&) const = default;
};

// Returns the common luma that cameras compare their own luma with, one value per node. 0: undefined, because few
// cameras see the node, they disagree, luma changes from node to node, or it is nearly black or white. `moments`: sums
// of luma divided by the cameras' gains. The result is scaled by the mean gain, so that the gains do not drift
// together.
std::vector<uint8_t> mean_luma(const PhotoConsistency& moments, const GainSum& gains);

// Selects the requests that include a mean for the comparison of brightness. Requests without hypotheses never do. The
// first kFirst requests do, so that cameras match before the first surface is found. Later, fewer requests do,
// because a mean reads whole images of a dozen cameras. Only one mean is pending: cameras keep samples for the latest
// mean only, and a second measurement during a correction would correct gains twice. A plain value without locks.
class ExposureSchedule {
 public:
  static constexpr unsigned kFirst = 4;     // number of requests that try all planes: see hypotheses_of_round()
  static constexpr unsigned kLongest = 32;  // maximum interval of the means, in requests with hypotheses
  // Requests with hypotheses until a missing mean counts as lost.
  static constexpr unsigned kPatience = 30;

  // True if the next request includes the mean. `has_hypotheses`: the request has hypotheses. `came`: the pending mean
  // has arrived.
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

// Returns the view in which cameras compare their brightness: one pixel per node of the smoothed focal map of `view`,
// with nodes twice as far apart. `view` must have a map.
View mean_view(const View& view);

// Samples several cameras for one view, with wider weights than the mesh's, to compare many cameras. A weight is a
// Gaussian of the distance, in the reference plane of the map, between the camera and the line of sight. Its standard
// deviation is the median edge of the mesh, and it is cut off at kWidest standard deviations.
class WideLuma {
 public:
  static constexpr double kWidest = 2.5;
  static constexpr float kPeak = 0.125f;  // largest weight; over a grid of cameras the weights sum to 0.79

  // `view`: a mean_view(). `own`: the node's cameras in service, ascending.
  WideLuma(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own);
  // The node's cameras with a weight, ascending. see() reads their whole images.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

  // Samples of a camera, kept until the mean arrives.
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

  // Returns the brightness of a camera, divided by its gain, relative to the mean: the median over the nodes, or
  // nothing if there are too few nodes. `mean`: see mean_luma().
  static std::optional<BrightnessRatio> ratio(const Camera& seen, std::span<const uint8_t> mean);
  // Returns the ratio() of each camera that can be compared.
  static std::map<CameraIndex, BrightnessRatio> ratios(std::span<const Camera> seen, std::span<const uint8_t> mean);

 private:
  Camera see(const Source& source, float gain) const;

  ViewPlan plan_;
  // False if only two cameras can be compared: two have no majority. If the array has no other cameras, their mean is
  // right. Otherwise none are compared, as most of the array may be as bright as either of the two.
  bool most_decide_ = false;
  bool is_from_afar_ = false;  // see Camera
  std::vector<CameraIndex> cameras_;
  Vec3 across_, down_;           // axes along the plane, in units of the pitch
  std::vector<Vec2> crossings_;  // intersections of the nodes' lines of sight with the plane
  std::vector<float> u_, v_;     // lines of sight of the nodes, then kHypothesisPadding unused values
  ByteBuffer levels_;            // levels of the nodes, then as many unused values
};

}  // namespace lf
