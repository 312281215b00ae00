// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>
#include <gst/video/video.h>

#include "rig/camera_source.h"
#include "rig/rig.h"
#include "rig/rig_json.h"

namespace lf {

// When a network camera's frames were taken, as it says itself: by its sender reports (RTCP), which give packets the
// time of day of the camera. Parsers and decoders keep a frame's stamp and not what else is on its packets: so it is
// known from there how far the time of day is from stamps. Thread-safe.
class SenderClock : public std::enable_shared_from_this<SenderClock> {
 public:
  // A time of day that can't be true, of a camera whose clock nobody has set, is not believed: packets were sent
  // before they came, and not longer ago than this beyond what they are made to wait.
  static constexpr GstClockTime kMostAge = 2 * GST_SECOND, kMostAhead = GST_SECOND / 10;

  // `latency`: how long packets are made to wait.
  explicit SenderClock(GstClockTime latency) : latency_(latency) {}

  // Has the packets of an rtspsrc watched, from before it starts. Other elements give none.
  void watch(GstElement* source);
  // A packet with the running time `stamp`, sent at `sent` and seen at `now`, both times of day.
  void see(GstClockTime stamp, GstClockTime sent, GstClockTime now);

  // The time of day at which the frame with this running time was taken; nothing as long as no report has come that
  // can be believed.
  std::optional<GstClockTime> taken(GstClockTime stamp) const;
  bool is_known() const;

 private:
  static void on_pad(GstElement* rtspsrc, GstPad* pad, gpointer self);
  static GstPadProbeReturn on_packet(GstPad* pad, GstPadProbeInfo* info, gpointer self);

  const GstClockTime latency_;
  mutable std::mutex mutex_;
  std::optional<GstClockTimeDiff> offset_;  // time of day less running time
};

// As find_camera_source(), with kDevice told from kUri.
CameraSource find_playable_source(const Rig& rig, const Camera& camera);

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

// The turn that a film asks for (MP4's matrix), by the tags that have passed the pad.
GstVideoOrientationMethod turn_of(GstPad* pad);
inline bool is_turned(GstPad* pad) { return turn_of(pad) != GST_VIDEO_ORIENTATION_IDENTITY; }
// Whether there is sound in what the bin's elements read: the pictures may end before the whole does.
bool has_sound(GstBin* bin);

}  // namespace lf
