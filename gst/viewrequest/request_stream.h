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

// Makes the streaming thread of a live lfviewrequest wait until it is time for the next request, until the user moves
// the view, or until a seek is complete. While unlocked (see GstBaseSrcClass::unlock), all waits return
// GST_FLOW_FLUSHING at once. Thread-safe, but only one thread may wait.
class RequestPacer {
 public:
  void set_unlocked(bool unlocked);
  void note_change();
  void forget_change();
  // Waits until the clock time `time`. If `or_change` is true, the wait also ends when note_change() is called. The
  // element waits here, before it reads the view, instead of in GstBaseSrc: GstBaseSrc waits after create(), so each
  // request would contain a viewpoint that is one frame old.
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

// Makes the focus of file playback independent of the speed of the machine. If a compositor estimates depths, each
// request waits until the compositor has sent the depths of the previous request. Use from the streaming thread.
class FocusWait {
 public:
  FocusWait(DepthFeedback& feedback, GstPad* src) : feedback_(feedback), src_(src) {}

  // Waits for the feedback to the latest request. Returns GST_FLOW_FLUSHING while the element is unlocked.
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
  std::optional<bool> has_focus_search_;  // a compositor estimates depths; empty: not queried yet
  std::optional<uint32_t> last_;
  unsigned warm_ups_ = 0;
  bool warming_up_ = false;
};

// Queue of the buffers that must follow a request, for example commands for cameras without the rig. The buffers are
// pushed one by one and not as a buffer list, because of a bug: GstBaseSrc 1.22 treats a list as a buffer if a live
// source is stopped right after creating the list. Use from the streaming thread.
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

// The queue behind the optional sink pad of lfviewrequest. If this pad exists, the element does not create requests. It
// relays the requests of another viewer, and adds the depths that its compositor has found. Thread-safe.
class RequestRelay {
 public:
  ~RequestRelay() { gst_clear_caps(&caps_); }

  // Sets the sink pad, which the caller owns. Null means that the element creates requests itself.
  void set_sink(GstPad* sink);
  bool is_on() const;
  // Send an event or query upstream through the sink pad. Return false if there is no sink pad. push_upstream() takes
  // the event.
  bool push_upstream(GstEvent* event);
  bool query_upstream(GstQuery* query);

  // Store the caps of the relayed requests, and fetch them for the source pad. take_caps() returns the caps once after
  // each change, and otherwise null. The caller owns the result.
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

// The part of lfviewrequest that exists between start and stop: the schedule of the requests (from a views file or a
// frame rate), the rig, and the number of the next request. Not thread-safe.
class RequestStream {
 public:
  explicit RequestStream(const ViewRequestSettings& settings);

  RequestSchedule schedule;  // streaming thread
  uint32_t next_number = 0;  // number of the next request; streaming thread

  // Makes the commands for cameras that do not have the rig; null if all cameras have the rig and only need the
  // requests (access=self).
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

  // Returns the encoded command that must follow a request if cameras do not have the rig (property `access`). Returns
  // an empty vector for access=self. `rig` must be the result of rig() at the time when the request was created. Throws
  // Error if the request does not fit the rig or the command is too long. Call this from one thread. Other functions of
  // the class may run concurrently.
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
