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
#include "focus/moments.h"
#include "render/sum_renderer.h"
#include "render/view_plan.h"
#include "rig/mesh.h"
#include "rig/rig.h"

namespace lf {

// How many times as bright a camera is as what it was compared with, as a logarithm, and how uncertain that is
// (standard deviation).
struct BrightnessRatio {
  float log = 0, error = 0;
};

// What the images of some cameras are divided by so that all of an array are equally bright. Surfaces shine, so that
// cameras of the same exposure seem to differ by a few percent, too, and what is noisy, or not in focus, cannot be
// compared exactly. So a camera is either as bright as it should be, and seems to differ by what shine and error make
// of that, or its exposure is another one, and it may differ by anything: the more likely the former (Bayes), the less
// is made of a measured gain. A plain value without locks.
class CameraGains {
 public:
  static constexpr float kLeast = 0.5f, kMost = 2;  // what differs by more is another fault than exposure
  static constexpr float kShine = 0.007f;           // standard deviation of the logarithm: it is up to 0.02
  static constexpr float kUsual = 0.9f;             // part of the cameras that are as bright as they should be
  // What most cameras agree on is looked for among those that differ from it by about this (logarithm): mean by mean it
  // moves to where most are (Fukunaga and Hostetler 1975: mean shift).
  static constexpr float kAround = 0.03f;
  // The trust in a camera of which nothing is known, beside 1 in those that are right.
  static constexpr float kUnknownTrust = 0.125f;
  // The first mean is that of cameras which all count alike: it takes those that are right along with those that are
  // wrong. Images are divided by gains from this mean on.
  static constexpr unsigned kMeans = 3;

  // What images are divided by: 1 for a camera of which nothing is known.
  float of(CameraIndex camera) const { return means_ < kMeans ? 1 : likely(camera); }
  // The gain that is likeliest by what was measured so far, for the next mean.
  float likely(CameraIndex camera) const;
  // How much the camera counts in the mean that all have in common, 0 to 1: less the farther it is off.
  float trust(CameraIndex camera) const;
  // Takes what came of comparing some cameras, divided by likely(), with a mean.
  void take(const std::map<CameraIndex, BrightnessRatio>& ratios);
  const std::map<CameraIndex, BrightnessRatio>& measured() const { return measured_; }

 private:
  float usual(CameraIndex camera) const;

  std::map<CameraIndex, BrightnessRatio> measured_;  // ratios to the mean, of images that are not divided by anything
  unsigned means_ = 0;
};

// Gains of cameras, added up with the weight that each has in a mean of luma, less for those that are hardly as bright
// as they should be, so that most cameras decide what that is: in logarithms, so that their mean is that of what they
// multiply.
struct GainSum {
  static constexpr int kWeightOne = 65536, kOctave = 256;  // kWeightOne: weight 1; kOctave: the logarithm of gain 2
  uint32_t weight = 0;
  int32_t log2 = 0;  // sum of weight x logarithm of the gain

  void add(float gain, float camera_weight);
  void add(const GainSum& other);
  float mean() const;  // the geometric mean; 1 without cameras
  bool operator==(const GainSum&) const = default;
};

// The luma that cameras have in common, and that each camera compares its own with: a value for each node, 0 where it
// is not well defined: few cameras see it, they disagree, it changes from node to node, or it is nearly black or white.
// `moments`: of luma divided by the cameras' gains. The mean is what it would be if these had the mean 1, so that they
// do not wander off together.
std::vector<uint8_t> mean_luma(const Moments& moments, const GainSum& gains);

// Decides which requests of a view ask for the mean that cameras compare their brightness with, out of those that have
// trials: the first kFirst of them, so that cameras match before the first surface is found, then fewer and fewer,
// because whole images of a dozen cameras are looked at for it. Only one asks at a time, because cameras keep what they
// saw for the latest one alone, and because what is measured of gains that are being corrected would correct them once
// more. A plain value without locks.
class MeanTurns {
 public:
  static constexpr unsigned kFirst = 4;     // as many requests as it takes to try all planes: see trials_of_round()
  static constexpr unsigned kLongest = 32;  // requests with trials from one that asks to the next
  // Requests with trials until a mean that has not come is thought to be lost.
  static constexpr unsigned kPatience = 30;

  // Whether the next request asks for the mean. `has_trials`: it has trials; `came`: the mean that was asked for is
  // there.
  bool next(bool has_trials, bool came) {
    if (came) awaited_ = 0;
    if (!has_trials) return false;
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

// The view in which cameras compare their brightness: a pixel for each node of a map that is its focal map, smoothed,
// with nodes twice as far apart. `view` has a map.
View mean_view(const View& view);

// What some cameras see of a view with wider weights than those of the mesh, so that many are compared: Gaussians of
// the distance, in the plane that the map counts from, of the camera from where the line of sight goes through it, of
// the camera mesh's median edge. Cut off at kWidest of these.
class WideLuma {
 public:
  static constexpr double kWidest = 2.5;
  static constexpr float kPeak = 0.125f;  // the largest weight: over a grid of cameras weights sum to 0.79

  // `view`: a mean_view(). `own`: cameras in service, ascending.
  WideLuma(const Rig& rig, const Mesh& mesh, const View& view, std::span<const CameraIndex> own);
  // The node's cameras that have a weight, ascending: whole images of them are looked at.
  const std::vector<CameraIndex>& cameras() const { return cameras_; }

  // What a camera saw, to be kept until there is a mean to compare with.
  struct Camera {
    CameraIndex camera = 0;
    std::vector<uint8_t> luma;  // divided by its likely gain, a value for each node
    std::vector<float> weight;  // 0 where the camera sees nothing
    bool is_from_afar = false;  // It is compared with cameras that are farther away, because too few are near.
  };
  struct Seen {
    std::vector<Camera> cameras;
    Moments moments;  // moments of all cameras together, each weighted by its trust
    GainSum gains;    // the cameras' likely gains
  };
  // What the cameras see. `sources`: images of cameras() and maybe others. The result does not depend on `parallel`.
  // Throws Error for an image that is not of its camera's size.
  Seen see(std::span<const Source> sources, const CameraGains& gains, const ParallelFor& parallel = serial_for) const;

  // How many times as bright as the mean a camera is, divided by its gain: the median over the nodes, nothing where
  // these are too few. `mean`: see mean_luma().
  static std::optional<BrightnessRatio> ratio(const Camera& seen, std::span<const uint8_t> mean);
  // The ratio() of several cameras; those that can't be compared are left out.
  static std::map<CameraIndex, BrightnessRatio> ratios(std::span<const Camera> seen, std::span<const uint8_t> mean);

 private:
  Camera see(const Source& source, float gain) const;

  ViewPlan plan_;
  // Of two cameras neither is most. Where no third one can be compared with them, half-way between them is right if the
  // array has no more; else they stay as they are, as most of the array may be as bright as either of them.
  bool most_decide_ = false;
  bool is_from_afar_ = false;  // see Camera
  std::vector<CameraIndex> cameras_;
  Vec3 across_, down_;           // axes along the plane, in units of the pitch
  std::vector<Vec2> crossings_;  // where the nodes' lines of sight cross the plane
  std::vector<float> u_, v_;     // lines of sight of the nodes, and kTrialSpare values of no meaning
  ByteBuffer levels_;            // levels of the nodes, and as many of no meaning
};

}  // namespace lf
