// SPDX-License-Identifier: LGPL-2.1-or-later
#include "viewrequest/request_stream.h"

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/text.h"
#include "common/common.h"
#include "common/custom_events.h"
#include "wire/command_codec.h"

GST_DEBUG_CATEGORY_EXTERN(lf_view_request_debug);
#define GST_CAT_DEFAULT lf_view_request_debug

namespace lf {
namespace {

CameraSet parse_out_of_service(const Rig* rig, const std::string& list) {
  if (list.empty()) return {};
  if (!rig)
    throw Error(
        "out-of-service: requires the property rig, because the ids refer to the cameras of a rig "
        "file");
  return parse_camera_list(*rig, list);
}

std::vector<NamedView> views_of_file(const std::string& location) {
  try {
    return load_views(location);
  } catch (const Error& error) {
    std::error_code ignored;
    const bool exists = std::filesystem::exists(location, ignored);
    throw Error("location: " + std::string(error.what()) +
                (exists ? "" : ": location is the name of a views file, which lf-path can make"));
  }
}

RequestSchedule schedule_of(const ViewRequestSettings& settings) {
  const Schedule frames(settings.fps_n > 0 ? settings.fps_n : kDefaultViewFps, settings.fps_d);
  if (settings.location.empty()) return RequestSchedule(frames);
  return {frames, views_of_file(settings.location), settings.loop};
}

}  // namespace

void RequestPacer::set_unlocked(bool unlocked) {
  const std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  if (unlocked && clock_id_) gst_clock_id_unschedule(clock_id_);
  released_.notify_all();
}

void RequestPacer::note_change() {
  const std::lock_guard lock(mutex_);
  changed_ = true;
  if (ends_with_change_ && clock_id_) gst_clock_id_unschedule(clock_id_);
}

void RequestPacer::forget_change() {
  const std::lock_guard lock(mutex_);
  changed_ = false;
}

GstFlowReturn RequestPacer::wait_until(GstClock* clock, GstClockTime time, bool or_change) {
  std::unique_lock lock(mutex_);
  if (unlocked_) return GST_FLOW_FLUSHING;
  if (or_change && changed_) return GST_FLOW_OK;
  ends_with_change_ = or_change;
  GstClockID id = clock_id_ = gst_clock_new_single_shot_id(clock, time);
  lock.unlock();
  const GstClockReturn result = gst_clock_id_wait(id, nullptr);
  lock.lock();
  clock_id_ = nullptr;
  const bool ended = result == GST_CLOCK_UNSCHEDULED && !(or_change && changed_ && !unlocked_);
  lock.unlock();
  gst_clock_id_unref(id);
  return ended ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

void RequestPacer::hold(guint32 seqnum, bool held) {
  const std::lock_guard lock(mutex_);
  if (held)
    held_for_ = seqnum;
  else if (held_for_ == seqnum)
    held_for_ = GST_SEQNUM_INVALID;
  released_.notify_all();
}

GstFlowReturn RequestPacer::wait_for_seek() {
  std::unique_lock lock(mutex_);
  released_.wait(lock, [this] { return held_for_ == GST_SEQNUM_INVALID || unlocked_; });
  return unlocked_ ? GST_FLOW_FLUSHING : GST_FLOW_OK;
}

GstFlowReturn FocusWait::wait(guint view_id) {
  using WaitResult = DepthFeedback::WaitResult;
  constexpr std::chrono::milliseconds kLongest{5000};
  if (!has_focus_search_) has_focus_search_ = finds_focus(src_, view_id);
  if (!*has_focus_search_ || !last_) return GST_FLOW_OK;
  bool paused = true;
  while (paused) {
    const WaitResult waited = feedback_.wait_for(*last_, kLongest);
    if (waited != WaitResult::kTimeout) return waited == WaitResult::kAvailable ? GST_FLOW_OK : GST_FLOW_FLUSHING;
    // Keeps waiting while the output is paused, because results must not depend on the duration of the pause.
    finds_focus(src_, view_id, &paused);
  }
  GST_WARNING_OBJECT(src_, "no focal surface for request %u within the time limit: later requests don't wait", *last_);
  has_focus_search_ = false;
  return GST_FLOW_OK;
}

bool FocusWait::is_warm_up_next() {
  constexpr unsigned kMost = 8;
  warming_up_ =
      has_focus_search_.value_or(false) && warm_ups_ < kMost && (warm_ups_ == 0 || feedback_.has_hypotheses());
  warm_ups_ = warming_up_ ? warm_ups_ + 1 : kMost;
  return warming_up_;
}

void RequestRelay::set_sink(GstPad* sink) {
  const std::lock_guard lock(mutex_);
  sink_ = sink;
}

bool RequestRelay::is_on() const {
  const std::lock_guard lock(mutex_);
  return sink_ != nullptr;
}

// The caller owns a reference, because the pad may be released meanwhile.
GstPad* RequestRelay::hold_sink() const {
  const std::lock_guard lock(mutex_);
  return sink_ ? GST_PAD(gst_object_ref(sink_)) : nullptr;
}

bool RequestRelay::push_upstream(GstEvent* event) {
  g_autoptr(GstPad) sink = hold_sink();
  if (sink) return gst_pad_push_event(sink, event);
  gst_event_unref(event);
  return false;
}

bool RequestRelay::query_upstream(GstQuery* query) {
  g_autoptr(GstPad) sink = hold_sink();
  return sink && gst_pad_peer_query(sink, query);
}

void RequestRelay::set_caps(GstCaps* caps) {
  const std::lock_guard lock(mutex_);
  gst_clear_caps(&caps_);
  caps_ = gst_caps_copy(caps);
  gst_caps_set_simple(caps_, "parsed", G_TYPE_BOOLEAN, TRUE, nullptr);
}

GstCaps* RequestRelay::take_caps() {
  const std::lock_guard lock(mutex_);
  return std::exchange(caps_, nullptr);
}

GstFlowReturn RequestRelay::push(GstBuffer* request, bool live, bool* dropped) {
  BufferPtr owned(request);
  std::unique_lock lock(mutex_);
  if (!live) changed_.wait(lock, [this] { return flushing_ || unlocked_ || ended_ || waiting_.size() < kMost; });
  if (flushing_ || unlocked_) return GST_FLOW_FLUSHING;
  if (ended_) return GST_FLOW_EOS;
  *dropped = waiting_.size() >= kMost;
  if (*dropped) waiting_.pop_front();
  waiting_.push_back(std::move(owned));
  changed_.notify_all();
  return GST_FLOW_OK;
}

void RequestRelay::end() {
  std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

GstFlowReturn RequestRelay::pop(GstBuffer** request) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return unlocked_ || ended_ || !waiting_.empty(); });
  if (unlocked_) return GST_FLOW_FLUSHING;
  if (waiting_.empty()) return GST_FLOW_EOS;
  *request = waiting_.front().release();
  waiting_.pop_front();
  changed_.notify_all();
  return GST_FLOW_OK;
}

void RequestRelay::set_flushing(bool flushing) {
  std::lock_guard lock(mutex_);
  flushing_ = flushing;
  ended_ = false;
  waiting_.clear();
  changed_.notify_all();
}

void RequestRelay::set_unlocked(bool unlocked) {
  std::lock_guard lock(mutex_);
  unlocked_ = unlocked;
  changed_.notify_all();
}

void RequestRelay::clear() {
  std::lock_guard lock(mutex_);
  waiting_.clear();
  ended_ = false;
}

RequestStream::RequestStream(const ViewRequestSettings& settings)
    : schedule(schedule_of(settings)), access_(CameraAccess::of(settings.access)) {
  set_rig(settings.rig.empty() ? nullptr : shared_rig(settings.rig), settings.out_of_service);
  if (rig_) default_viewpoint_ = lf::default_viewpoint(*rig_);
}

void RequestStream::set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service) {
  if (access_ && !rig)
    throw Error(
        "access: requires the property rig, because commands for the cameras are computed "
        "from the rig");
  out_of_service_ = parse_out_of_service(rig.get(), out_of_service);
  rig_ = std::move(rig);
  rig_hash_ = rig_ ? rig_->hash() : 0;
  if (!rig_) return;
  const Camera& camera = rig_->cameras[middle_camera(*rig_)];
  default_width_ = camera.width;
  default_height_ = camera.height;
}

void RequestStream::set_out_of_service(const std::string& list) {
  out_of_service_ = parse_out_of_service(rig_.get(), list);
}

std::vector<uint8_t> RequestStream::command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig) {
  if (!access_) return {};
  if (request.rig_hash != 0 && request.rig_hash != rig->hash())
    throw Error("rig: the request is for another rig file. Use the same rig file for all viewers");
  if (std::exchange(mesh_rig_, rig) != rig) mesh_.clear();
  return wire::encode_any_request(access_->command(*rig, mesh_.get(*rig, request.out_of_service), request));
}

}  // namespace lf
