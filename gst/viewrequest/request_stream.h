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
#include "focus/focus_feedback.h"
#include "node/camera_access.h"
#include "rig/mesh.h"
#include "view/navigator.h"
#include "view/view_path.h"
#include "viewrequest/view_request_settings.h"

namespace lf {

// Waiting for the turn of a request: for a time, for a change of its view, and for the end of a seek. Thread-safe; one
// thread waits, and is told GST_FLOW_FLUSHING while unlocked.
class RequestTurn {
 public:
  void set_unlocked(bool unlocked);
  // The view is another one than it was in the latest request.
  void note_change();
  // The view that comes next is of now.
  void forget_change();
  // GstBaseSrc would wait after create(), with a request that is then a frame old: so the wait is here, before the view
  // is looked at. `or_change`: until the view is changed, if that is before.
  GstFlowReturn wait_until(GstClock* clock, GstClockTime time, bool or_change = false);

  // Holds requests back from the call with `held` to the one without, for the seek of this number: others are still to
  // take part in it (custom_events.h).
  void hold(guint32 seqnum, bool held);
  GstFlowReturn wait_for_seek();
  void forget_seek() { hold(GST_SEQNUM_INVALID, true); }

 private:
  std::mutex mutex_;
  std::condition_variable released_;
  GstClockID clock_id_ = nullptr;  // the clock's entry of the wait under way; null: none
  bool ends_with_change_ = false;  // the wait under way ends when the view is changed
  bool unlocked_ = false, changed_ = false;
  guint32 held_for_ = GST_SEQNUM_INVALID;  // the seek that is not over, during which nothing leaves
};

// Files in, files out: where somebody downstream finds the focus of a view, each request has what came of the one
// before. Streaming thread.
class FocusWait {
 public:
  // `src`: which the requests leave by.
  FocusWait(FocusFeedback& feedback, GstPad* src) : feedback_(feedback), src_(src) {}

  // Waits for what comes of the request that was sent last. GST_FLOW_FLUSHING while the feedback is unlocked.
  GstFlowReturn wait(guint view_id);
  // Whether the next request is a rehearsal, so that the stream's first picture is in focus already. After wait().
  bool rehearses();
  bool is_rehearsing() const { return rehearses_; }
  void sent(uint32_t sequence) { last_ = sequence; }
  // What is on its way is flushed: nothing comes of it, and what comes next is a first picture.
  void flush() { last_.reset(), rehearsals_ = 0, rehearses_ = false; }
  void clear() { flush(), awaits_.reset(); }

 private:
  FocusFeedback& feedback_;
  GstPad* const src_;
  std::optional<bool> awaits_;    // whether somebody finds the focus, once it has been asked
  std::optional<uint32_t> last_;  // number of the latest request
  unsigned rehearsals_ = 0;       // rehearsals made before the first picture
  bool rehearses_ = false;        // the latest request
};

// What leaves behind a request, buffer by buffer: GstBaseSrc 1.22 has a buffer list mistaken for a buffer where a live
// source is stopped just after it was made. Streaming thread.
class RequestOutbox {
 public:
  // Takes a buffer (null: nothing), which gets the time stamps of the request.
  void put(GstBuffer* buffer, GstBuffer* request) {
    if (!buffer) return;
    gst_buffer_copy_into(buffer, request, GST_BUFFER_COPY_TIMESTAMPS, 0, -1);
    waiting_.emplace_back(buffer);
  }
  // The next one, owned by the caller; null: a request is to be made.
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

// The sink pad of lfviewrequest, if it has one, and the requests of other viewers on their way from it to the source
// pad's thread. Thread-safe.
class RequestRelay {
 public:
  ~RequestRelay() { gst_clear_caps(&caps_); }

  // The pad, borrowed; null: requests are not relayed but made.
  void set_sink(GstPad* sink);
  bool is_on() const;
  // What the pad's peer says to these: false, too, without a pad. Takes the event.
  bool push_upstream(GstEvent* event);
  bool query_upstream(GstQuery* query);

  // Caps of what comes in, until they are taken: owned by the caller, null if there are no new ones.
  void set_caps(GstCaps* caps);
  GstCaps* take_caps();

  // Takes the buffer. Live, the oldest is dropped where more than kMost wait (false); else push() waits for room.
  // GST_FLOW_FLUSHING while unlocked or flushing, GST_FLOW_EOS after the end.
  GstFlowReturn push(GstBuffer* request, bool live, bool* dropped);
  void end();
  // The next request, owned by the caller; waits for it. GST_FLOW_EOS behind the last.
  GstFlowReturn pop(GstBuffer** request);

  void set_flushing(bool flushing);  // the stream that comes in is flushed: drops what waits
  void set_unlocked(bool unlocked);  // nobody waits
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

// What lfviewrequest has from start to stop: its files, and which request is next. Without locks.
class RequestStream {
 public:
  // Reads the files. Throws Error.
  explicit RequestStream(const ViewRequestSettings& settings);

  RequestSchedule schedule;  // streaming thread
  uint32_t next_number = 0;  // number of the next request; streaming thread

  // How the view's cameras have to be told of their parts; null: they find out themselves.
  const CameraAccess* access() const { return access_; }
  const std::shared_ptr<const Rig>& rig() const { return rig_; }  // may be null
  uint64_t rig_hash() const { return rig_hash_; }
  const CameraSet& out_of_service() const { return out_of_service_; }
  bool from_file() const { return schedule.from_file(); }
  int default_width() const { return default_width_; }
  int default_height() const { return default_height_; }
  const Viewpoint& default_viewpoint() const { return default_viewpoint_; }

  // Takes another rig, or none (null); the view stays where it is. Throws Error, and nothing has changed, where this
  // rig does not have the cameras of `out_of_service` (see below).
  void set_rig(std::shared_ptr<const Rig> rig, const std::string& out_of_service);
  // Ids of cameras of the rig; unlike in tools, "" is none. Throws Error.
  void set_out_of_service(const std::string& list);

  // The command that goes with a request, for cameras that have to be told (property access); empty where they have
  // not. Throws Error if the request does not fit the rig or the command is too long.
  // `rig`: rig() when the request was made. To be called by one thread, but whatever others do.
  std::vector<uint8_t> command_for(const ViewRequest& request, const std::shared_ptr<const Rig>& rig);

 private:
  std::shared_ptr<const Rig> rig_;
  const CameraAccess* const access_;
  MeshCache mesh_;
  std::shared_ptr<const Rig> mesh_rig_;  // the rig that mesh_ is of
  uint64_t rig_hash_ = 0;
  CameraSet out_of_service_;
  int default_width_ = ViewRequestSettings::kDefaultWidth, default_height_ = ViewRequestSettings::kDefaultHeight;
  Viewpoint default_viewpoint_;
};

}  // namespace lf
