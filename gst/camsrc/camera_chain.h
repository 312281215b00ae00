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

// Finds the capture times of a network camera from RTCP sender reports, which relate RTP timestamps to the time of day.
// Parsers and decoders drop this information but keep the timestamps of frames, so the class stores the offset between
// time of day and running time. Thread-safe.
class SenderClock : public std::enable_shared_from_this<SenderClock> {
 public:
  // Limits for the age of a packet, to recognise cameras without the correct time of day. A packet may also be older
  // by the latency.
  static constexpr GstClockTime kMostAge = 2 * GST_SECOND, kMostAhead = GST_SECOND / 10;

  // `latency`: jitter buffer latency, nanoseconds
  explicit SenderClock(GstClockTime latency) : latency_(latency) {}

  // Watches the packets of an rtspsrc. Call before the rtspsrc starts. Has no effect on other elements.
  void watch(GstElement* source);
  // Processes a packet with running time `stamp`, sent at `sent` and received at `now` (time of day).
  void see(GstClockTime stamp, GstClockTime sent, GstClockTime now);

  // Returns the time of day when the frame with this running time was captured. Returns nothing until the first
  // plausible report arrives.
  std::optional<GstClockTime> taken(GstClockTime stamp) const;
  bool is_known() const;

 private:
  static void on_pad(GstElement* rtspsrc, GstPad* pad, gpointer self);
  static GstPadProbeReturn on_packet(GstPad* pad, GstPadProbeInfo* info, gpointer self);

  const GstClockTime latency_;
  mutable std::mutex mutex_;
  std::optional<GstClockTimeDiff> offset_;  // time of day minus running time
};

// Returns the source of the camera, as find_camera_source() does. URIs that denote a device have the kind kDevice
// instead of kUri.
CameraSource find_playable_source(const Rig& rig, const Camera& camera);

struct ChainOptions {
  int fps_n = 0, fps_d = 1;  // 0/1: rate of the source, or kDefaultFps if it has no rate
  bool live = false;         // frames are synchronised to the clock
  bool loop = false;         // for image sequences only; the caller loops other files
  bool decode = true;        // false: JPEG video stays JPEG (stills are always decoded)
  bool trusted = false;      // launch descriptions may contain any element
  Controls controls = {};
  GstClockTime latency = 200 * GST_MSECOND;
};

inline constexpr int kDefaultFps = 15;

// The elements between a camera's source and the pad of lfcamsrc. The pads are borrowed from children of the bin.
//   source ! decoder ! (decoded) convert ! formats and size [! imagefreeze] (frames) [! videorate] [! clocksync] (out)
// If JPEG may stay undecoded, JPEG bypasses the elements between `decoded` and `frames`:
//   source ! (decoded) identity [! convert ! formats and size] ! identity (frames) [! videorate] [! clocksync] (out)
struct CameraChain {
  GstPad* decoded = nullptr;  // sink pad: decoded pictures of any size
  GstPad* frames = nullptr;   // source pad: one buffer per captured frame
  GstPad* out = nullptr;
  std::shared_ptr<std::atomic<guint64>> damaged = std::make_shared<std::atomic<guint64>>();
  GstElement* device = nullptr;         // element with controls; null except for kDevice and kBin
  std::shared_ptr<SenderClock> sender;  // null except for RTSP cameras
  // The elements from `decoded` to `out`, which must start before all other elements. GstBin cannot find this order
  // itself, because decoders are linked later.
  std::vector<GstElement*> tail;
};

// Thrown if a required element is not installed. what() is the name of its factory.
class MissingElement : public Error {
 public:
  using Error::Error;
};

// Adds the chain of `camera` to `bin`, in state NULL. The chain needs one streaming thread if the type of the source is
// known in advance, which excludes kDevice, kBin, kFile, kUri and stills of unknown type. Throws MissingElement, or
// Error if the source is unusable.
CameraChain build_camera_chain(GstBin* bin, const CameraSource& source, const Camera& camera,
                               const ChainOptions& options);

// Returns the rotation that the video requires (matrix of an MP4), from the tags on the pad.
GstVideoOrientationMethod orientation_of(GstPad* pad);
inline bool is_rotated(GstPad* pad) { return orientation_of(pad) != GST_VIDEO_ORIENTATION_IDENTITY; }
// Returns true if the bin has an audio stream. The video may then end before the file does.
bool has_sound(GstBin* bin);

}  // namespace lf
