// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
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

}  // namespace lf
