// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "quality/image_quality.h"
#include "rig/mesh.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Detects faulty cameras in a running array, for example a camera that was bumped or is out of focus. It compares the
// image of each camera in turn with a prediction from all other cameras. A camera is an outlier if its prediction is
// much worse than usual. However, a faulty camera also spoils the predictions of its neighbours, so an outlier is
// checked again together with its neighbours. The worst of these cameras becomes a suspect, and the remaining outliers
// are checked again without the suspect. Not thread-safe.
class CameraMonitor {
 public:
  enum class Fault {
    kColour,     // the camera is brighter or darker than the array
    kDirection,  // the camera's direction differs from the rig
    kPicture,    // the image differs in another way, for example because it is out of focus or obstructed
  };
  struct Suspect {
    CameraIndex camera = 0;
    Fault fault = Fault::kPicture;
    bool operator==(const Suspect&) const = default;
  };
  // A value is an outlier if it differs from the median of all cameras by more than kDeviations robust standard
  // deviations (1.4826 MAD), and by at least the following minimums.
  static constexpr double kDeviations = 4;
  static constexpr double kDb = 3;  // decibels of PSNR
  static constexpr double kGain = 0.03;
  static constexpr double kShift = 0.25;    // pixels of the probe
  static constexpr size_t kMinCameras = 5;  // number of cameras with known values that is needed to detect outliers

  explicit CameraMonitor(const Rig& rig);

  // Returns the camera to check next, or nothing if no camera is in service. Cameras that need a second check come
  // first.
  std::optional<CameraIndex> next(const CameraSet& out_of_service);
  CameraSet suspected() const;
  // Returns true if all cameras in service (see next()) were checked and no second check is pending. Checks may
  // continue.
  bool is_settled() const;
  // Call this with the result of a camera's check. Values that could not be measured are NaN, for example at the
  // corners of an array.
  void take(CameraIndex camera, const PredictionError& error);

  const PredictionError& error(CameraIndex camera) const { return cameras_[camera].error; }
  size_t cameras() const { return cameras_.size(); }
  const std::vector<Suspect>& suspects() const { return suspects_; }  // ascending by camera
  uint64_t turns() const { return turns_; }

 private:
  // The values that are compared between cameras: PSNR, gain, shift in x and y.
  static constexpr size_t kFigures = 4;
  using Figures = std::array<double, kFigures>;
  struct FigureStats {
    Figures middle, most;  // median over all cameras; largest usual deviation
  };
  struct CameraRecord {
    PredictionError error;
    uint64_t taken = 0;          // number of the latest check; 0: none
    uint64_t outlier_since = 0;  // number of the check; 0: not an outlier
    bool stale = false;          // an outlier, possibly because of a camera that has become a suspect since
    bool out = false;
    std::vector<CameraIndex> nearest;  // cameras that may contribute to the prediction of this camera
  };
  static Figures figures_of(const PredictionError& error);
  bool is_suspect(CameraIndex camera) const;
  std::optional<FigureStats> usual() const;
  // Returns the deviation of a camera relative to the usual deviation (above 1: outlier) and its most likely fault.
  static double deviation(const FigureStats& usual, const PredictionError& error, Fault* fault);
  void update_suspect(CameraIndex camera, const FigureStats& usual);
  void update_others(const FigureStats& usual);
  void add_suspect(const Suspect& suspect);
  void recheck(CameraIndex camera);

  std::vector<CameraRecord> cameras_;
  std::vector<Suspect> suspects_;
  std::deque<CameraIndex> recheck_;
  CameraIndex turn_ = 0;
  uint64_t turns_ = 0;
};

std::string_view to_string(CameraMonitor::Fault fault);  // "colour", "direction", "picture"

// Two small views from a camera's pose: one from the camera alone, and one from all other cameras. The difference
// between the views shows whether the camera is faulty.
struct CameraProbe {
  CameraIndex camera = 0;
  ViewRequest seen, predicted;  // view, out_of_service and probe are set
};

// Maximum columns of a probe. A probe takes every n-th pixel of the camera without filtering, so its errors are
// representative of the whole image.
inline constexpr int kProbeColumns = 80;

// Returns the two views that check `camera`. `focused` is the view with the focal surface (the depths in focus) that
// the prediction uses. The cameras in `without` (ascending) are excluded from the prediction, too.
CameraProbe make_probe(const Rig& rig, CameraIndex camera, const View& focused, const CameraSet& without);

// Runs the checks of a camera monitor between the requests of a view. A check consists of two probes: the camera's own
// image, and its prediction from the remaining cameras. Not thread-safe.
class ProbeScheduler {
 public:
  static constexpr unsigned kProbeTimeout = 30;  // number of requests until pending probes count as lost

  // Call this after each composed request. Returns the probes of a new check every `interval` requests. If answers are
  // pending, the next check may begin up to kProbeTimeout requests later. Starts over if the rig has changed.
  std::optional<CameraProbe> next(const Rig& rig, const ViewRequest& composed, unsigned interval);

  // Returns true if the probe belongs to the current check, so that take() needs its picture. A probe out of order ends
  // the check.
  bool expects(const ViewRequest& probe);
  enum class TurnResult { kFirstProbe, kBothProbes, kSuspectsChanged };
  // Takes the picture of an expected probe. The second picture completes the check and may change the suspects.
  TurnResult take(const ViewRequest& probe, CoverageImage picture);
  void lose();

  void clear() { *this = {}; }
  const CameraMonitor* monitor() const { return monitor_ ? &*monitor_ : nullptr; }

 private:
  std::optional<CameraMonitor> monitor_;
  uint64_t rig_ = 0;
  unsigned requests_ = 0;
  std::optional<CameraProbe> asked_;
  std::optional<CoverageImage> seen_;
};

// Describes how regular the frame times of a camera are. A line is fitted to the times, in seconds over frame numbers.
struct FrameTimeStats {
  size_t frames = 0;
  double period = 0;     // slope of the line, seconds per frame; 0 if there are fewer than three frames
  double first = 0;      // time of the first frame on the line
  double jitter = 0;     // RMS deviation of the times from the line, which is the accuracy of the timestamps
  size_t missing = 0;    // frames of the line that did not arrive
  size_t backwards = 0;  // times not later than their predecessor; excluded from the fit

  double rate() const { return period > 0 ? 1 / period : 0; }
};

// Fits a line to the frame times of a camera, to find its frame rate and lost frames. `times` are in order of arrival.
FrameTimeStats frame_time_stats(std::span<const double> times);

// Time offsets between cameras with the same frame rate.
struct Skew {
  std::vector<double> phase;  // seconds behind the mean phase of all cameras, at most half a period; NaN: unknown
  double spread = 0;          // seconds between the earliest and the latest camera
  double drift = 0;           // relative rate difference between the fastest and the slowest camera clock
};

// Compares the phases of cameras. A camera with a period more than 1 % off the median gets a phase of NaN, because its
// phase keeps changing.
Skew camera_skew(std::span<const FrameTimeStats> cameras);

// Finds out which camera a person means by waving a hand in front of a camera: only the image of this camera changes
// strongly. Not thread-safe.
class HandWaveDetector {
 public:
  explicit HandWaveDetector(size_t cameras) : cameras_(cameras) {}

  // Takes an image of a camera, as the mean brightness (0..1) of a constant number of parts. `time` is in seconds and
  // must not decrease.
  void see(size_t camera, std::span<const float> parts, double time);
  // Returns how much the newest image differs from the usual image, as a mean over all parts, 0..1. Uniform changes, as
  // from automatic exposure, count half.
  double change(size_t camera) const { return cameras_[camera].change; }
  // Returns the camera that changes far more than all others, if any. A person who walks past changes several cameras.
  std::optional<size_t> found() const;

 private:
  struct Camera {
    std::vector<float> usual;  // moving average with a time constant, so that a hand that stays becomes usual
    double time = 0, change = 0;
  };
  std::vector<Camera> cameras_;
};

}  // namespace lf
