// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "image/colour_correction.h"
#include "rig/rig.h"

namespace lf {

// The corrections of a rig's cameras, each made when it is first asked for. For any number of threads.
class CameraColours {
 public:
  // Takes what it needs from the rig, which may go.
  explicit CameraColours(const Rig& rig);

  // Whether any camera's colours are corrected.
  bool any() const { return !cameras_.empty(); }
  // Null for a camera whose colours are taken as they come. `family`: not kNone. Valid as long as this is.
  const ColourCorrection* of(CameraIndex camera, PixelFamily family) const;

 private:
  struct OfCamera {
    ColourModel model;
    int width, height;
    Vec2 centre;
    std::once_flag made[2];  // set once the correction for a family is made
    std::unique_ptr<const ColourCorrection> correction[2];
  };
  std::vector<std::unique_ptr<OfCamera>> cameras_;  // null without colour; empty where none has one
};

}  // namespace lf
