// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/camera_lifecycle.h"

#include <algorithm>
#include <utility>

#include <gst/video/gstvideodecoder.h>

#include "common/guard.h"

namespace lf {

void CameraLifecycle::start() {
  std::lock_guard lock(mutex_);
  report_ = {.state = State::kOpening};
  out_since_ = found_ = waited_ = 0;
}

void CameraLifecycle::stop() {
  std::lock_guard lock(mutex_);
  report_.state = State::kStopped;
}

bool CameraLifecycle::lose(const std::string& reason, uint64_t now) {
  std::lock_guard lock(mutex_);
  report_.reason = reason;
  if (report_.state == State::kLost) return false;
  report_.state = State::kLost;
  report_.losses++;
  if (out_since_ == 0 || now - found_ > waited_) out_since_ = now;
  return true;
}

uint64_t CameraLifecycle::wait(uint64_t now) {
  std::lock_guard lock(mutex_);
  return waited_ = std::clamp((now - out_since_) / 4, kMinRetryDelay, kMaxRetryDelay);
}

void CameraLifecycle::retry() {
  std::lock_guard lock(mutex_);
  report_.retries++;
}

bool CameraLifecycle::find(uint64_t now) {
  std::lock_guard lock(mutex_);
  const bool lost = report_.state == State::kLost;
  report_.state = State::kRunning;
  report_.worked = true;
  found_ = now;
  return lost;
}

void CameraLifecycle::end() {
  std::lock_guard lock(mutex_);
  if (report_.state != State::kLost) report_.state = State::kEnded;
}

CameraLifecycle::State CameraLifecycle::state() const {
  std::lock_guard lock(mutex_);
  return report_.state;
}

CameraLifecycle::Report CameraLifecycle::report() const {
  std::lock_guard lock(mutex_);
  return report_;
}

const char* to_string(CameraLifecycle::State state) {
  using State = CameraLifecycle::State;
  switch (state) {
    case State::kStopped: return "stopped";
    case State::kOpening: return "opening";
    case State::kRunning: return "running";
    case State::kEnded: return "ended";
    case State::kLost: return "lost";
  }
  return "";
}

namespace {

bool is_my_turn(uint64_t now) {
  static std::atomic<uint64_t> next = 0;
  uint64_t allowed = next;
  return now >= allowed && next.compare_exchange_strong(allowed, now + LoadShedder::kStagger);
}

}  // namespace

void LoadShedder::watch(GstElement* element) {
  if (!GST_IS_VIDEO_DECODER(element)) return;
  g_autoptr(GstPad) sink = gst_element_get_static_pad(element, "sink");
  if (!sink) return;
  constexpr auto kData =
      GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM | GST_PAD_PROBE_TYPE_EVENT_FLUSH;
  add_probe(sink, kData, [self = shared_from_this()](GstPad*, GstPadProbeInfo* info) { return self->on_input(info); });
}

GstPadProbeReturn LoadShedder::on_input(GstPadProbeInfo* info) {
  if (!(info->type & GST_PAD_PROBE_TYPE_BUFFER)) {
    const GstEventType type = GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info));
    if (type == GST_EVENT_FLUSH_STOP || type == GST_EVENT_SEGMENT) forget_position();
    return GST_PAD_PROBE_OK;
  }
  return drops(GST_PAD_PROBE_INFO_BUFFER(info)) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// Ends dropping after a seek or at a new loop, because the stored timestamps do not apply to the new data, which begins
// with a key frame.
void LoadShedder::forget_position() {
  std::lock_guard lock(mutex_);
  skip_until_ = show_from_ = GST_CLOCK_TIME_NONE;
}

void LoadShedder::restart(bool paced) {
  std::lock_guard lock(mutex_);
  best_ = paced ? 0 : G_MAXINT64;
  behind_ = 0;
  late_since_ = 0;
  skip_until_ = show_from_ = dropped_end_ = GST_CLOCK_TIME_NONE;
}

bool LoadShedder::drops(GstBuffer* buffer) {
  std::lock_guard lock(mutex_);
  if (!GST_CLOCK_TIME_IS_VALID(skip_until_)) return false;
  const GstClockTime pts = GST_BUFFER_PTS(buffer);
  const bool is_key = !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  if (is_key && (!GST_CLOCK_TIME_IS_VALID(pts) || pts >= skip_until_)) {
    skip_until_ = GST_CLOCK_TIME_NONE;
    return false;
  }
  dropped_++;
  if (!GST_CLOCK_TIME_IS_VALID(pts)) return true;
  const GstClockTime end = pts + (GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer) : 0);
  if (!GST_CLOCK_TIME_IS_VALID(dropped_end_) || end > dropped_end_) dropped_end_ = end;
  return true;
}

LoadShedder::Verdict LoadShedder::see(GstClockTime pts, GstClockTimeDiff late, GstClockTime latency,
                                      GstClockTime period, uint64_t now) {
  std::lock_guard lock(mutex_);
  best_ = std::min(best_, std::max(late, static_cast<GstClockTimeDiff>(latency)));
  behind_ = std::max<GstClockTimeDiff>(late - best_, 0);
  if (GST_CLOCK_TIME_IS_VALID(show_from_) && pts < show_from_) return Verdict::kDrop;
  show_from_ = GST_CLOCK_TIME_NONE;
  if (behind_ <= std::max(kTolerance, static_cast<GstClockTimeDiff>(2 * period))) {
    late_since_ = 0;
    return Verdict::kShow;
  }
  const bool catches_up = now - late_since_ >= kMinLateTime && behind_ < late_by_ / 2;
  if (late_since_ == 0 || catches_up) {
    late_since_ = now;
    late_by_ = behind_;
  }
  if (now - late_since_ < kMinLateTime || !is_my_turn(now)) return Verdict::kShow;
  late_since_ = 0;
  skip_until_ = show_from_ = pts + static_cast<GstClockTime>(behind_);
  return Verdict::kStartDropping;
}

GstClockTimeDiff LoadShedder::behind() const {
  std::lock_guard lock(mutex_);
  return behind_;
}

GstClockTime LoadShedder::take_dropped_end() {
  std::lock_guard lock(mutex_);
  return std::exchange(dropped_end_, GST_CLOCK_TIME_NONE);
}

}  // namespace lf
