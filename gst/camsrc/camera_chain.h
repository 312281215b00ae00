// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <memory>
#include <vector>

#include "camsrc/camera_source.h"
#include "camsrc/sender_clock.h"
#include "rig/camera_controls.h"
#include "rig/rig.h"

namespace lf {

// How lfcamsrc's frames are to come.
struct ChainOptions {
  int fps_n = 0, fps_d = 1;  // 0/1: as the source has them, kDefaultFps where it has no rate of its own
  bool live = false;         // each frame comes at its time on the clock
  bool loop = false;         // image sequences begin again by themselves; other files are up to the caller
  bool decode = true;        // JPEG video too; stills always
  bool trusted = false;      // a source that describes elements may have any
  Controls controls = {};    // set on sources that are devices or elements
  GstClockTime latency = 200 * GST_MSECOND;  // how long packets of network sources are waited for and put in order
};

inline constexpr int kDefaultFps = 15;

// The elements between a camera's source and lfcamsrc's pad, in the order of the pads named here. The pads are borrowed
// from the bin's children and live as long as those.
//   source ! decoder ! (decoded) convert ! formats and size [! imagefreeze] (frames) [! videorate] [! clocksync] (out)
// Where JPEG is not to be decoded, what is between `decoded` and `frames` is bypassed once it is known to be JPEG:
//   source ! (decoded) identity [! convert ! formats and size] ! identity (frames) [! videorate] [! clocksync] (out)
struct CameraChain {
  GstPad* decoded = nullptr;  // sink pad: pictures as decoded, of whatever size
  GstPad* frames = nullptr;   // source pad: one buffer for each frame the camera took
  GstPad* out = nullptr;      // source pad
  std::shared_ptr<std::atomic<guint64>> damaged = std::make_shared<std::atomic<guint64>>();  // pictures left out
  GstElement* device = nullptr;         // the element that may have controls; null but for kDevice and kBin
  std::shared_ptr<SenderClock> sender;  // null but for a network camera that may tell its time
  // The elements from `decoded` to `out`. Decoders are linked with them by and by, so that GstBin does not know that
  // the elements of the tail are to be started first.
  std::vector<GstElement*> tail;
};

// An element that is part of a chain is not installed; the text is its name.
class MissingElement : public Error {
 public:
  using Error::Error;
};

// Puts the chain of `camera` into `bin`, in state NULL. It has one streaming thread for each camera wherever the kind
// of source is known in advance (all but kDevice, kBin, kFile, kUri and stills of an unknown type). Throws
// MissingElement, and Error for a source that no elements can be made of.
CameraChain build_camera_chain(GstBin* bin, const CameraSource& source, const Camera& camera,
                               const ChainOptions& options);

}  // namespace lf
