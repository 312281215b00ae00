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

#include "common/properties.h"
#include "rig/camera_source.h"
#include "rig/rig.h"
#include "rig/rig_json.h"

namespace lf {

// Finds out when the frames of an RTSP camera were captured. The camera sends RTCP sender reports, which relate its RTP
// timestamps to the time of day. Parsers and decoders drop this information but keep the timestamps of the frames.
// Therefore this class watches the packets in front of them, and stores the offset between time of day and running
// time. Thread-safe.
class SenderClock : public std::enable_shared_from_this<SenderClock> {
 public:
  // A report is ignored if it says that a packet was sent more than kMaxAge (plus the latency) before it arrived, or
  // more than kMaxAhead after it arrived. The clock of such a camera does not show the right time of day.
  static constexpr GstClockTime kMaxAge = 2 * GST_SECOND, kMaxAhead = GST_SECOND / 10;

  // `latency` is the latency of the jitter buffer in nanoseconds, which delays each packet.
  explicit SenderClock(GstClockTime latency) : latency_(latency) {}

  // Watches the packets of an rtspsrc. Call before the rtspsrc starts. Has no effect on other elements.
  void watch(GstElement* source);
  // Updates the offset with a packet of running time `stamp`. `sent` is the time of day when the camera sent the
  // packet, according to its sender report, and `now` is the time of day now.
  void see(GstClockTime stamp, GstClockTime sent, GstClockTime now);

  // Returns the time of day when the frame with this running time was captured. Returns nothing until the first
  // plausible report arrives.
  std::optional<GstClockTime> taken(GstClockTime stamp) const;
  bool is_known() const;

 private:
  static void on_pad(GstElement* rtspsrc, GstPad* pad, gpointer self);
  GstPadProbeReturn on_packet(GstPad* pad, GstPadProbeInfo* info);

  const GstClockTime latency_;
  mutable std::mutex mutex_;
  std::optional<GstClockTimeDiff> offset_;  // time of day minus running time
};

// Returns the video source of the camera, as find_camera_source() does, except that a URI of a local device, such as
// v4l2:///dev/video0, has the kind kDevice instead of kUri.
CameraSource find_playable_source(const Rig& rig, const Camera& camera);

// The properties of lfcamsrc.
struct CamSrcSettings {
  std::string rig;
  guint camera = 0;
  int fps_n = 0, fps_d = 1;  // 0/1: rate of the source, or kDefaultFps if it has no rate
  bool is_live = false;
  bool loop = false;
  gint64 num_buffers = -1;
  bool decode = true;
  guint64 latency = 200 * GST_MSECOND;
  bool retry = false;
  bool trusted = false;
  bool operator==(const CamSrcSettings&) const = default;

  static PropertyTable<CamSrcSettings>& properties();
};

inline constexpr int kDefaultFps = 15;

// The chain of elements from a camera's source to the source pad of lfcamsrc. The pads belong to child elements of the
// bin. The elements in brackets are optional, and the words in parentheses are the pads below:
//   source ! decoder ! (decoded) convert ! formats and size [! imagefreeze] (frames) [! videorate] [! clocksync] (out)
// If JPEG may stay undecoded, JPEG bypasses the elements between `decoded` and `frames`:
//   source ! (decoded) identity [! convert ! formats and size] ! identity (frames) [! videorate] [! clocksync] (out)
struct CameraChain {
  GstPad* decoded = nullptr;  // sink pad: decoded pictures of any size
  GstPad* frames = nullptr;   // source pad: one buffer for each captured frame
  GstPad* out = nullptr;
  std::shared_ptr<std::atomic<guint64>> damaged = std::make_shared<std::atomic<guint64>>();
  GstElement* device = nullptr;         // element with controls; null except for kDevice and kBin
  std::shared_ptr<SenderClock> sender;  // null except for RTSP cameras
  // The elements from `decoded` to `out`, which must start before the decoder; see lf_cam_src_start_tail().
  std::vector<GstElement*> tail;
};

// Thrown if a required element is not installed. what() is the name of its factory.
class MissingElement : public Error {
 public:
  using Error::Error;
};

// Creates the elements that read and decode the source of `camera`, and adds them to `bin` in state NULL. The whole
// chain runs in one streaming thread if the kind of the source determines the decoder. The kinds kDevice, kBin, kFile,
// kUri and some stills do not, and their decoders may add threads. The chain loops only image sequences; the caller
// loops other files. Throws MissingElement, or Error if the source is unusable.
CameraChain build_camera_chain(GstBin* bin, const CameraSource& source, const Camera& camera,
                               const CamSrcSettings& settings, const Controls& controls);

// Returns the rotation that a player must apply to the video, from the tags on the pad. Phones store upright videos as
// rotated pictures in this way.
GstVideoOrientationMethod orientation_of(GstPad* pad);
inline bool is_rotated(GstPad* pad) { return orientation_of(pad) != GST_VIDEO_ORIENTATION_IDENTITY; }
// Returns true if the bin has an audio stream. The video may then end before the file does.
bool has_sound(GstBin* bin);

}  // namespace lf
