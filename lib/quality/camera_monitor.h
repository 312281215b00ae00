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

#include "quality/quality.h"
#include "rig/mesh.h"
#include "view/view.h"
#include "view/view_request.h"

namespace lf {

// Watches an array as it runs: in turn, each camera is predicted from the others, and those of which something is wrong
// stand out. A bad camera spoils the predictions of its neighbours: when one becomes odd they are looked at again, the
// oddest is accused, and the others get another turn without it. Without locks.
class CameraMonitor {
 public:
  // What is wrong with a camera, as far as that can be told.
  enum class Fault {
    kColour,     // the camera is brighter or darker than the others
    kDirection,  // the camera looks elsewhere than the rig says
    kPicture,    // neither: out of focus, or something is in front of it
  };
  struct Suspect {
    CameraIndex camera = 0;
    Fault fault = Fault::kPicture;
    bool operator==(const Suspect&) const = default;
  };
  // Figures are unusual beyond kDeviations robust standard deviations (1.4826 MAD) from the median of all cameras, and
  // by at least these.
  static constexpr double kDeviations = 4;
  static constexpr double kDb = 3;        // decibels of PSNR
  static constexpr double kGain = 0.03;   // relative gain
  static constexpr double kShift = 0.25;  // pixels of the probe
  static constexpr size_t kFewest = 5;    // cameras whose figures are known, so that any can be unusual

  explicit CameraMonitor(const Rig& rig);

  // The camera whose turn it is; nothing where no camera is in service.
  std::optional<CameraIndex> next(const CameraSet& out_of_service);
  CameraSet suspected() const;
  // Whether all cameras in service (of next()) have had a turn, and none is to be looked at again. Turns may go on.
  bool settled() const;
  // What came of a camera's turn; NaN where nothing can be told, as at the corners of an array.
  void take(CameraIndex camera, const PredictionError& error);

  // What came of the camera's latest turn; NaN where nothing is known.
  const PredictionError& error(CameraIndex camera) const { return cameras_[camera].error; }
  size_t cameras() const { return cameras_.size(); }
  const std::vector<Suspect>& suspects() const { return suspects_; }  // ascending
  uint64_t turns() const { return turns_; }

 private:
  // The figures in which cameras are compared: PSNR, gain, shift.
  static constexpr size_t kFigures = 4;
  using Figures = std::array<double, kFigures>;
  struct Usual {
    Figures middle, most;  // the middle of all cameras' figures, and the largest usual deviation
  };
  struct Watched {
    PredictionError error;
    uint64_t taken = 0;                // number of its latest turn, 0: none yet
    uint64_t odd_since = 0;            // number of the turn; 0: not odd
    bool stale = false;                // odd, but because of one that has been accused since, maybe
    bool out = false;                  // the camera is out of service
    std::vector<CameraIndex> nearest;  // cameras that may have a part in predicting this one
  };
  static Figures figures_of(const PredictionError& error);
  bool is_suspect(CameraIndex camera) const;
  std::optional<Usual> usual() const;
  // How far a camera is off, in units of what is usual; and by what.
  static double oddity(const Usual& usual, const PredictionError& error, Fault* fault);
  void judge_suspect(CameraIndex camera, const Usual& usual);
  void judge_others(const Usual& usual);
  void accuse(const Suspect& suspect);
  void look_again(CameraIndex camera);

  std::vector<Watched> cameras_;
  std::vector<Suspect> suspects_;
  std::deque<CameraIndex> again_;  // have another turn before all others
  CameraIndex turn_ = 0;
  uint64_t turns_ = 0;
};

std::string_view to_string(CameraMonitor::Fault fault);  // "colour", "direction", "picture"

// A view from where a camera stands, asked for twice: of the camera alone, and of the others without it. Both are view
// requests like any other: no camera gives more than its part in a small view.
struct CameraProbe {
  CameraIndex camera = 0;
  ViewRequest seen, predicted;  // view, out_of_service and probe are set
};

// A probe has at most this many columns: every so many pixels of the camera, each as it is, so that errors are those of
// its whole image, of fewer pixels.
inline constexpr int kProbeColumns = 80;

// `focused`: the view whose focal surface the others are focused on. `without` (ascending): cameras that predict
// nothing, beside the camera itself.
CameraProbe make_probe(const Rig& rig, CameraIndex camera, const View& focused, const CameraSet& without);

// A camera monitor's turns beside the requests of a view. A turn is two probes, small views that are asked for like any
// other: what a camera sees itself, and what the others predict of it. Probes and their answers may be lost, or be
// somebody else's. Not thread-safe.
class CameraTurns {
 public:
  static constexpr unsigned kPatience = 30;  // requests after which probes, or their answers, have been lost

  // A request has been composed. The two probes of a camera's turn, if it is time: every `interval` requests, or
  // somewhat later while answers are waited for. With another rig than before all begins anew.
  std::optional<CameraProbe> next(const Rig& rig, const ViewRequest& composed, unsigned interval);

  // Whether the answer to this request, a probe, is of the turn, and its picture is to be made for take(). One that is
  // out of turn ends it.
  bool expects(const ViewRequest& probe);
  enum class Came { kHalf, kTurn, kOtherSuspects };
  // Takes the picture of a probe that was expected: half of the turn, or all of it, after which other cameras may be
  // suspect than before.
  Came take(const ViewRequest& probe, CoveredPicture picture);
  // The picture can't be made of what came: the turn is over.
  void lose();

  void clear() { *this = {}; }
  // Null before the first turn.
  const CameraMonitor* monitor() const { return monitor_ ? &*monitor_ : nullptr; }

 private:
  std::optional<CameraMonitor> monitor_;
  uint64_t rig_ = 0;       // hash of the rig that the monitor is of
  unsigned requests_ = 0;  // requests since the latest turn
  std::optional<CameraProbe> asked_;
  std::optional<CoveredPicture> seen_;
};

// How evenly a camera takes its frames, from the times that they were taken at. Seconds.
struct FrameTimes {
  size_t frames = 0;
  double period = 0;     // seconds from frame to frame on the line through all times; 0: fewer than three frames
  double first = 0;      // time of the first frame on that line
  double jitter = 0;     // rms of the times about the line: how far stamps can be believed
  size_t missing = 0;    // frames that the line has and that did not come
  size_t backwards = 0;  // times that are not after the one before; the line is through the others

  double rate() const { return period > 0 ? 1 / period : 0; }
};

// `times`: in the order that frames came in.
FrameTimes measure_frame_times(std::span<const double> times);

// How cameras that run at one rate stand to each other.
struct Skew {
  std::vector<double>
      phase;  // for each camera the seconds that it is behind the others' middle: at most half a period; NAN: not known
  double spread = 0;  // seconds between the two cameras farthest apart
  double drift = 0;   // relative rate by which the fastest camera's clock leads the slowest's
};

// Cameras whose period differs by more than 1 % from the median one are left out: their phase is NAN.
Skew measure_skew(std::span<const FrameTimes> cameras);

// Finds the camera that somebody holds a hand before: its picture is another one than it was, and those of the others
// are not. Not thread-safe.
class WaveFinder {
 public:
  explicit WaveFinder(size_t cameras) : cameras_(cameras) {}

  // A picture as the mean brightness of its parts, 0..1, always as many; taken at `time`, seconds, which do not go
  // back.
  void see(size_t camera, std::span<const float> parts, double time);
  // How far its newest picture is from its usual one, 0..1: the mean over the parts. What changes brightness as a
  // whole, as an automatic exposure does, counts half.
  double change(size_t camera) const { return cameras_[camera].change; }
  // The camera that stands out, if one does. People who walk past change several.
  std::optional<size_t> found() const;

 private:
  struct Camera {
    std::vector<float> usual;  // forgets with a time constant, so that a hand is usual after a while, too
    double time = 0, change = 0;
  };
  std::vector<Camera> cameras_;
};

}  // namespace lf
