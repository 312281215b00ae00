// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include <gst/gst.h>

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

}  // namespace lf
