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

// Makes the streaming thread of a live source wait: for the time of a request, a change of its view, or the end of a
// seek. Waits return GST_FLOW_FLUSHING while unlocked. Thread-safe, with one waiting thread.
class RequestPacer {
 public:
  void set_unlocked(bool unlocked);
  void note_change();
  void forget_change();
  // Waits for `time`, and if `or_change` is set, at most until the view changes. The wait comes before the view is
  // read. GstBaseSrc would wait after create(), so a request would be a frame old when it is sent.
  GstFlowReturn wait_until(GstClock* clock, GstClockTime time, bool or_change = false);

  // Blocks requests between hold(seqnum, true) and hold(seqnum, false), while other elements take part in a seek
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
  guint32 held_for_ = GST_SEQNUM_INVALID;  // the seek that blocks requests
};

// Delays each request of a stream from files until the feedback of the previous request has arrived, if a compositor
// finds the focus. Otherwise pictures would depend on the speed of the machine. Streaming thread.
class FocusWait {
 public:
  FocusWait(DepthFeedback& feedback, GstPad* src) : feedback_(feedback), src_(src) {}

  // Returns GST_FLOW_FLUSHING while the feedback is unlocked.
  GstFlowReturn wait(guint view_id);
  // Returns true if the next request is a warm-up, which only measures depths so that the first picture is in focus.
  // Call after wait().
  bool is_warm_up_next();
  bool is_warming_up() const { return warming_up_; }
  void sent(uint32_t sequence) { last_ = sequence; }
  // Call after a flush. The next request starts with warm-ups again.
  void flush() { last_.reset(), warm_ups_ = 0, warming_up_ = false; }
  void clear() { flush(), has_focus_search_.reset(); }

 private:
  DepthFeedback& feedback_;
  GstPad* const src_;
  std::optional<bool> has_focus_search_;  // true if a compositor finds the focus; empty: not queried yet
  std::optional<uint32_t> last_;
  unsigned warm_ups_ = 0;
  bool warming_up_ = false;
};

// Queue of the buffers that follow a request, for example commands for simple cameras. They are pushed one by one,
// because GstBaseSrc 1.22 treats a buffer list as a buffer if a live source is stopped right after creating the list.
// Streaming thread.
class RequestOutbox {
 public:
  // Takes a buffer (null: nothing) and gives it the timestamps of the request.
  void put(GstBuffer* buffer, GstBuffer* request) {
    if (!buffer) return;
    gst_buffer_copy_into(buffer, request, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    waiting_.emplace_back(buffer);
  }
  // Returns the next buffer, owned by the caller. Null means that the next request must be created.
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

// The optional sink pad of lfviewrequest, which makes the element a relay, and the queue of relayed requests.
// Thread-safe.
class RequestRelay {
 public:
  ~RequestRelay() { gst_clear_caps(&caps_); }

  // Borrows the pad; null means that the element generates its own requests.
  void set_sink(GstPad* sink);
  bool is_on() const;
  // Forward an event or query to the peer of the pad. Return false without a pad. push_upstream() takes the event.
  bool push_upstream(GstEvent* event);
  bool query_upstream(GstQuery* query);

  // The caps of relayed requests. take_caps() returns new caps once, owned by the caller, and otherwise null.
  void set_caps(GstCaps* caps);
  GstCaps* take_caps();

  // Queues a request and takes its reference. If more than kMost are queued, a live stream drops the oldest, and other
  // streams wait for room. Returns GST_FLOW_FLUSHING while unlocked or flushing, GST_FLOW_EOS after the end.
  GstFlowReturn push(GstBuffer* request, bool live, bool* dropped);
  void end();
  // Waits for the next request, owned by the caller. Returns GST_FLOW_EOS at the end.
  GstFlowReturn pop(GstBuffer** request);

  void set_flushing(bool flushing);  // Call at a flush of the input. Discards queued requests.
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

// Creates the view requests of lfviewrequest, from start to stop: holds its views file, its rig and the next request.
// Not thread-safe.
class RequestStream {
 public:
  explicit RequestStream(const ViewRequestSettings& settings);

  RequestSchedule schedule;  // streaming thread
  uint32_t next_number = 0;  // number of the next request; streaming thread

  // Generates commands for cameras without self access; null if the cameras plan by themselves.
  const CameraAccess* access() const { return access_; }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }
  uint64_t rig_hash() const { return rig_hash_; }
  const CameraSet& out_of_service() const { return out_of_service_; }
  bool from_file() const { return schedule.from_file(); }
  int default_width() const { return default_width_; }
  int default_height() const { return default_height_; }
  const Viewpoint& default_viewpoint() const { return default_viewpoint_; }

  // Replaces the rig (null: none) and keeps the view. Throws Error, without changes, if the rig lacks cameras of
  // `out_of_service`.
  void set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service);
  // Parses a list of camera ids. Unlike in tools, "" is an empty list. Throws Error.
  void set_out_of_service(const std::string& list);

  // Returns the command that follows a request (property access), or nothing for self access. `rig` must be rig() at
  // the time when the request was created. Throws Error if the request does not fit the rig or the command is too long.
  // Call from one thread; other functions may run concurrently.
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
