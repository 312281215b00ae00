// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "camsrc/camera_lifecycle.h"
#include "common/gst_pointers.h"
#include "rig/rig.h"

namespace lf {

// Tracks one coded stream for recording: the first decodable picture, and the display order. Not thread-safe.
class PendingCodedFrames {
 public:
  struct Picture {
    BufferPtr buffer;
    GstClockTime taken;  // running time, or time in the film
  };
  // Pending pictures before the first output frame, more than a decoder holds back. Beyond this number the decoder has
  // failed.
  static constexpr size_t kMaxPending = 300;
  // Largest backward step of capture times that is ignored. Larger steps mean that the clock was set back.
  static constexpr GstClockTime kMaxReorder = GST_SECOND;

  // True if the picture can be recorded: not before the first key frame.
  bool admits(GstBuffer* picture);
  // Discards all pending pictures. Recording restarts at the next key frame.
  void begin_again();
  // Keeps a reference.
  void wait(GstBuffer* picture, GstClockTime taken);
  std::vector<Picture> take_waiting();
  // Returns the capture time of a picture, corrected so that a picture with a later presentation time also has a later
  // capture time.
  GstClockTime in_order(GstClockTime taken, GstClockTime captured);

 private:
  bool has_key_ = false;
  std::vector<Picture> waiting_;
  GstClockTime newest_taken_ = 0, newest_captured_ = 0;  // newest recorded picture; 0: none yet
};

struct StreamOptions {
  CameraIndex camera = 0;
  uint64_t rig_hash = 0;
  int width = 0, height = 0;  // pixels
  double time_offset = 0;     // seconds, added to capture times
  gint64 num_frames = -1;     // -1: unlimited
  bool seek_to_loop = false;  // loop by seeking to the start
  bool has_end = true;        // false: an end before `num_frames` is an error
  bool may_be_lost = false;   // errors end the stream with LF_CAMERA_LOST instead of EOS
  bool skips_late = false;
  GstClockTime round = 0;  // duration of one loop of the file, nanoseconds; 0: unknown
  bool paced = false;      // frames are ready before their time
  GstClockTime begin = 0;  // running time of source time 0, nanoseconds
  std::shared_ptr<LoadShedder> shedder;
  std::string place;  // prefix of errors: "rig.json: camera 5 (cam_00_05): cam_00_05.mkv"
};

// Callbacks of a stream, from any of its threads.
struct StreamListener {
  // Called at most once.
  std::function<void(GQuark domain, gint code, const std::string& text)> on_error;
  std::function<void()> on_first_frame;
  std::function<void()> on_end;
  // Frames are dropped before decoding because they are late by `late`.
  std::function<void(GstClockTimeDiff late)> on_overload;
  // A looping film ended after `lasted`, `missing` before its stated end. Called at most once.
  std::function<void(GstClockTime lasted, GstClockTime missing)> on_truncated;
  // Data to record, owned by the stream, with its capture time. For coded video: each picture as it enters the decoder,
  // even if the decoder drops it later; it may depend on previous pictures. For other video: each output frame. Empty
  // if nothing is recorded.
  std::function<void(GstBuffer* buffer, GstCaps* caps, GstClockTime captured)> on_recordable;
};

// Watches the pads of a chain from start to stop and turns the data into a camera stream. Checks the frame size, sends
// LF_CAMERA_EVENT, attaches capture times, continues across loops, and ends after `num_frames`.
class CameraStream : public std::enable_shared_from_this<CameraStream> {
 public:
  // `owner`: provides base time and clock; outlives the data flow.
  CameraStream(GstElement* owner, const CameraChain& chain, const StreamOptions& options,
               const StreamListener& listener);
  ~CameraStream();
  CameraStream(const CameraStream&) = delete;

  // Call once, before data flows.
  void watch();
  // Watches an element of the chain when it is created: the input of a decoder or parser.
  void watch_element(GstElement* element);
  // Frames arrive in real time, and capture times are clock times. Call before data flows.
  void set_live() { live_ = true; }
  // Stamps unstamped pictures of a multipartdemux (JPEG over HTTP) with their arrival time. Call before data flows in
  // the chain.
  void stamp_arrivals(GstElement* multipartdemux);
  bool stamps_arrivals() const { return stamps_arrival_; }
  // Ends the stream at the next frame. Thread-safe.
  void end() { ending_ = true; }
  // Call before data flow stops, because demuxers cannot handle a seek during a change to READY. Only
  // streaming threads use the chain.
  void stop();
  // Returns true at the first call only. Later errors are consequences of the first error.
  bool first_error() { return !failed_.exchange(true); }
  bool has_failed() const { return failed_; }
  bool is_opening() const { return !failed_ && !has_ended_ && frames_out_ == 0; }
  const std::string& place() const { return options_.place; }
  uint64_t frames_out() const { return static_cast<uint64_t>(frames_out_); }
  uint64_t frames_seen() const { return frames_out() + left_out_; }
  // Running time of the next frame of a live file. The source may pause until then, for example where the film is
  // truncated.
  GstClockTime due() const { return due_; }
  // Running time of the end of the newest frame. Call when no data flows.
  GstClockTime ends_at() const { return stream_end_; }
  // Duration of one loop of the film, nanoseconds; 0: unknown. Call when no data flows.
  GstClockTime round() const { return round_; }

 private:
  GstPadProbeReturn on_decoded(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_frame(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_output(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_output_event(GstPad* pad, GstEvent* event);
  GstPadProbeReturn on_seek(GstPadProbeInfo* info);
  GstPadProbeReturn on_output_end(GstPad* pad);
  GstPadProbeReturn on_coded(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_jpeg(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_parsed(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_arrival(GstPad* pad, GstPadProbeInfo* info);
  void finish_loop_segment();
  std::optional<GstClockTime> taken_at(GstSegment segment, GstClockTime stamp) const;
  void record_pending();
  void record_frame(GstPad* pad, GstBuffer* frame) const;
  bool is_shed(GstPad* pad, GstBuffer* buffer, GstClockTime stamp);
  void count_dropped();
  bool is_too_late(GstBuffer* buffer);
  void pass_rounds();
  GstClockTime missing_at_end() const;
  void note_position(GstClockTime end);

  void fail(GstStreamError code, const std::string& text);
  void check_size(GstCaps* caps);
  void check_jpeg(GstBuffer* buffer);
  GstPadProbeReturn on_tags(GstPadProbeInfo* info);
  GstEvent* time_segment(GstEvent* event);
  GstBuffer* stamp(GstBuffer* buffer) const;
  GstBuffer* stamp_arrival(GstPad* pad, GstBuffer* buffer) const;
  GstClockTime running_time_now() const;
  bool begin_again(bool flush);
  void seek_to_start(guint32 seqnum, bool flush);
  GstEvent* later_segment(GstEvent* event) const;
  GstClockTime clock_time(GstClockTime stamp) const;
  GstClockTime capture_time(GstClockTime taken) const;
  GstBuffer* complete_capture_time(GstBuffer* buffer) const;
  void announce(GstPad* pad);

  GstElement* const owner_;
  const CameraChain chain_;  // holds references to its pads, because probes may outlive the elements
  const StreamOptions options_;
  const StreamListener listener_;
  std::atomic<bool> live_ = false, stamps_arrival_ = false;
  std::atomic<bool> ending_ = false, stopping_ = false, failed_ = false, has_ended_ = false;
  std::atomic<gint64> frames_out_ = 0;
  std::atomic<uint64_t> left_out_ = 0;
  std::atomic<GstClockTime> due_ = 0;
  std::mutex seeking_;
  std::atomic<guint32> loop_seqnum_ = GST_SEQNUM_INVALID;
  std::atomic<bool> sought_ = false;  // an external seek has arrived since the latest segment
  // Stream times of the last coded picture (in presentation order) of this loop: begin, and end if the file states a
  // duration. NONE: unknown.
  std::atomic<GstClockTime> segment_begin_ = GST_CLOCK_TIME_NONE, segment_end_ = GST_CLOCK_TIME_NONE;

  // Used by the streaming thread only:
  GstSegment segment_;  // latest segment on the frames pad
  guint64 pictures_ = 0;
  GstClockTime position_ = 0;     // stream time of the end of the newest frame
  GstClockTime stream_end_ = 0;   // running time of the end of the newest frame
  GstClockTime round_start_ = 0;  // running time of the start of this loop
  GstClockTime round_ = 0;
  GstClockTime film_end_ = 0;    // film time of the end of the newest frame, across loops
  GstClockTime film_start_ = 0;  // film time of the start of this loop; after a seek, later than the start of the loop
  guint64 checked_frames_ = 0;
  GstClockTime latency_ = 0;
  guint64 round_frames_ = 0;
  gint fps_n_ = 0, fps_d_ = 1;
  bool counts_time_ = false;  // frames have a rate but no timestamps
  bool is_known_jpeg_ = false;
  bool jpegs_have_ends_ = false;  // a JPEG picture with an end marker has been seen
  bool is_jpeg_ = false, size_is_wrong_ = false, announced_ = false, eos_sent_ = false;
  bool is_on_time_ = false;
  GstClockTime nearly_since_ = 0;  // running time since when the stream is late by at most one second; 0: not yet
  bool is_truncated_ = false;      // the source ended although more frames were wanted
  bool cut_off_reported_ = false;
  mutable std::mutex recording_mutex_;  // guards the next two members: a decoder may output frames in another thread
  GstPad* coded_pad_ = nullptr;         // owned; sink pad of the decoder with recorded pictures; or null
  PendingCodedFrames coded_;
  uint64_t dropped_before_ = 0;  // the shedder's drop count at the start of this loop
};

}  // namespace lf
