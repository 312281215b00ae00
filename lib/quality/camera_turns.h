// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "quality/camera_monitor.h"

namespace lf {

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

}  // namespace lf
