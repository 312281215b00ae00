// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "common/gst_pointers.h"
#include "common/properties.h"
#include "focus/depth_feedback.h"
#include "node/camera_access.h"
#include "rig/mesh.h"
#include "view/navigator.h"
#include "view/view_path.h"
#include "viewrequest/view_request_settings.h"

namespace lf {

// Waits for the time of a request, a change of its view, or the end of a seek. Thread-safe, with one waiting thread.
// Waits return GST_FLOW_FLUSHING while unlocked.
class RequestPacer {
 public:
  void set_unlocked(bool unlocked);
  void note_change();
  void forget_change();
  // Waits for `time`. With `or_change`, also returns when the view changes. GstBaseSrc would wait after create(), with
  // a request that is a frame old, so this wait comes before the view is read.
  GstFlowReturn wait_until(GstClock* clock, GstClockTime time, bool or_change = false);

  // Blocks requests between hold(seqnum, true) and hold(seqnum, false), while other elements take part in the seek
  // (custom_events.h).
  void hold(guint32 seqnum, bool held);
  GstFlowReturn wait_for_seek();
  void forget_seek() { hold(GST_SEQNUM_INVALID, true); }

 private:
  std::mutex mutex_;
  std::condition_variable released_;
  GstClockID clock_id_ = nullptr;
  bool ends_with_change_ = false;
  bool unlocked_ = false, changed_ = false;
  guint32 held_for_ = GST_SEQNUM_INVALID;  // seek in progress, which blocks requests
};

// For files: delays each request until the feedback of the previous request has arrived, if a compositor finds the
// focus. Streaming thread.
class FocusWait {
 public:
  // `src`: the pad that sends the requests.
  FocusWait(DepthFeedback& feedback, GstPad* src) : feedback_(feedback), src_(src) {}

  // Waits for the feedback of the latest request. Returns GST_FLOW_FLUSHING while the feedback is unlocked.
  GstFlowReturn wait(guint view_id);
  // True if the next request is a warm-up, so that the first picture of the stream is in focus. Call after wait().
  bool is_warm_up_next();
  bool is_warming_up() const { return warming_up_; }
  void sent(uint32_t sequence) { last_ = sequence; }
  // Discards the state after a flush. The next request starts with warm-ups again.
  void flush() { last_.reset(), warm_ups_ = 0, warming_up_ = false; }
  void clear() { flush(), has_focus_search_.reset(); }

 private:
  DepthFeedback& feedback_;
  GstPad* const src_;
  std::optional<bool> has_focus_search_;  // a compositor finds the focus; empty: not queried yet
  std::optional<uint32_t> last_;
  unsigned warm_ups_ = 0;
  bool warming_up_ = false;
};

// Buffers that follow a request. They are pushed one by one, because GstBaseSrc 1.22 treats a buffer list as a buffer
// if a live source is stopped right after creating the list. Streaming thread.
class RequestOutbox {
 public:
  // Takes a buffer (null: nothing) and copies the timestamps of the request.
  void put(GstBuffer* buffer, GstBuffer* request) {
    if (!buffer) return;
    gst_buffer_copy_into(buffer, request, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    waiting_.emplace_back(buffer);
  }
  // Returns the next buffer, owned by the caller; null: create a request.
  GstBuffer* take() {
    if (waiting_.empty()) return nullptr;
    GstBuffer* buffer = waiting_.front().release();
    waiting_.pop_front();
    return buffer;
  }
  void clear() { waiting_.clear(); }

 private:
  std::deque<BufferPtr> waiting_;
};

// The optional sink pad of lfviewrequest, and the queue of relayed requests between sink pad and source pad.
// Thread-safe.
class RequestRelay {
 public:
  ~RequestRelay() { gst_clear_caps(&caps_); }

  // Borrows the pad; null: requests are generated.
  void set_sink(GstPad* sink);
  bool is_on() const;
  // Forward to the peer of the pad. Return false without a pad. push_upstream() takes the event.
  bool push_upstream(GstEvent* event);
  bool query_upstream(GstQuery* query);

  // Caps of relayed requests. take_caps() returns new caps once, owned by the caller, else null.
  void set_caps(GstCaps* caps);
  GstCaps* take_caps();

  // Queues a request and takes its reference. If more than kMost are queued, drops the oldest (live) or waits for room.
  // Returns GST_FLOW_FLUSHING while unlocked or flushing, GST_FLOW_EOS after the end.
  GstFlowReturn push(GstBuffer* request, bool live, bool* dropped);
  void end();
  // Waits for the next request, owned by the caller. Returns GST_FLOW_EOS after the last.
  GstFlowReturn pop(GstBuffer** request);

  void set_flushing(bool flushing);  // flush of the input: discards queued requests
  void set_unlocked(bool unlocked);
  void clear();

 private:
  static constexpr size_t kMost = 64;
  GstPad* hold_sink() const;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  GstPad* sink_ = nullptr;
  GstCaps* caps_ = nullptr;
  std::deque<BufferPtr> waiting_;
  bool flushing_ = false, unlocked_ = false, ended_ = false;
};

// State of lfviewrequest from start to stop: its files and the next request. Not thread-safe.
class RequestStream {
 public:
  // Reads the files. Throws Error.
  explicit RequestStream(const ViewRequestSettings& settings);

  RequestSchedule schedule;  // streaming thread
  uint32_t next_number = 0;  // number of the next request; streaming thread

  // Command generator for cameras without self access; null: cameras plan by themselves.
  const CameraAccess* access() const { return access_; }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }  // may be null
  uint64_t rig_hash() const { return rig_hash_; }
  const CameraSet& out_of_service() const { return out_of_service_; }
  bool from_file() const { return schedule.from_file(); }
  int default_width() const { return default_width_; }
  int default_height() const { return default_height_; }
  const Viewpoint& default_viewpoint() const { return default_viewpoint_; }

  // Replaces the rig (null: none). The view stays. Throws Error, without changes, if the rig lacks cameras of
  // `out_of_service`.
  void set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service);
  // Parses a list of camera ids; "" is empty, unlike in tools. Throws Error.
  void set_out_of_service(const std::string& list);

  // Returns the command that follows a request (property access); empty for self access. `rig`: rig() when the request
  // was created. Throws Error if the request does not fit the rig or the command is too long. Call from one thread;
  // other functions may run concurrently.
  std::vector<uint8_t> command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig);

 private:
  std::shared_ptr<const Rig> rig_;
  const CameraAccess* const access_;
  MeshCache mesh_;
  std::shared_ptr<const Rig> mesh_rig_;
  uint64_t rig_hash_ = 0;
  CameraSet out_of_service_;
  int default_width_ = ViewRequestSettings::kDefaultWidth, default_height_ = ViewRequestSettings::kDefaultHeight;
  Viewpoint default_viewpoint_;
};

}  // namespace lf
