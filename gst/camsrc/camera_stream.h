// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <gst/gst.h>

#include "camsrc/camera_chain.h"
#include "camsrc/camera_lifecycle.h"
#include "camsrc/lfcamsrc.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "rig/rig.h"

namespace lf {

// Prepares the pictures of a coded stream, such as H.264, for a recording. Pictures before the first key frame cannot
// be decoded, so the class leaves them out. It keeps pictures until their capture times can be computed, and corrects
// capture times that go backwards. Pictures arrive in decoding order, which can differ from the display order. Not
// thread-safe.
class PendingCodedFrames {
 public:
  struct Picture {
    BufferPtr buffer;
    GstClockTime taken;
  };
  // Maximum number of pictures that wait() keeps. If there are more, all are dropped, and recording starts at the next
  // key frame.
  static constexpr size_t kMaxPending = 300;
  // A capture time that goes back by less than this is jitter and is corrected. A larger step means that the clock was
  // set back, so the capture time is kept.
  static constexpr GstClockTime kMaxReorder = GST_SECOND;

  // Returns true if the picture can be recorded, which excludes pictures before the first key frame.
  bool admits(GstBuffer* picture);
  // Discards all pending pictures. Recording restarts at the next key frame.
  void begin_again();
  // wait() keeps a picture until its capture time can be computed, and take_waiting() returns all kept pictures. The
  // capture time of a live picture can only be computed in PLAYING. `taken` is the running time (live) or the position
  // in the film.
  void wait(GstBuffer* picture, GstClockTime taken);
  std::vector<Picture> take_waiting();
  // Returns the capture time `captured` of a picture, corrected if necessary, so that a picture with a later
  // presentation time `taken` has a later capture time.
  GstClockTime in_order(GstClockTime taken, GstClockTime captured);

 private:
  bool has_key_ = false;
  std::vector<Picture> waiting_;
  GstClockTime newest_taken_ = 0, newest_captured_ = 0;
};

// The properties of one camera's stream, from the rig file and from the properties of lfcamsrc.
struct StreamOptions {
  guint serial = 0;  // LfCamSrc::serial
  CameraIndex camera = 0;
  uint64_t rig_hash = 0;
  int width = 0, height = 0;
  double time_offset = 0;  // seconds, added to capture times
  gint64 num_buffers = -1;  // -1: unlimited
  bool seek_to_loop = false;
  bool has_end = true;       // false: an end before `num_buffers` frames is an error
  bool may_be_lost = false;  // errors end the stream with LF_CAMERA_LOST instead of EOS
  // Drops the first frames of a reopened film, until the film has caught up with the other cameras.
  bool skips_late = false;
  GstClockTime round = 0;  // duration of one loop of the file, nanoseconds; 0: unknown
  // Frames are ready before their time, because a live stream is played from a file.
  bool paced = false;
  GstClockTime begin = 0;  // running time that corresponds to source time 0, nanoseconds
  std::shared_ptr<LoadShedder> shedder;
  // Coded video, such as H.264, is taken in front of the decoder, picture by picture. This includes pictures that are
  // dropped behind the decoder, because other pictures may need these pictures for decoding. All other video is taken
  // as the frames that the stream delivers. The stream owns buffer and caps. Empty if nothing is recorded.
  RecordingTap tap;
  std::string place;  // prefix of errors: "rig.json: camera 5 (cam_00_05): cam_00_05.mkv"
};

inline GstEvent* camera_lost_event() {
  return gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(LF_CAMERA_LOST));
}

// Turns decoded pictures into the stream that lfcamsrc delivers. The class works by probes on the pads of a chain
// (camera_chain.h). It checks the frame size, announces the camera with LF_CAMERA_EVENT, and attaches the capture time
// to each frame. It also repeats a film without a jump of the running time, and ends the stream after `num_buffers`
// frames.
class CameraStream : public std::enable_shared_from_this<CameraStream> {
 public:
  // `owner` must exist as long as data flows. It provides base time and clock, and is told about errors, the first
  // frame and the end.
  CameraStream(LfCamSrc* owner, const CameraChain& chain, const StreamOptions& options);
  ~CameraStream();
  CameraStream(const CameraStream&) = delete;

  // Installs the probes on the pads of the chain. Call before data flows.
  void watch();
  // Call for each element of the chain when it is created. Installs a probe on the input of a decoder (for recording,
  // and to find damaged JPEG pictures) or parser (for the length of a looping film).
  void watch_element(GstElement* element);
  // Call before data flows if frames arrive in real time, so that capture times are clock times.
  void set_live() { live_ = true; }
  // Stamps the pictures of a multipartdemux (JPEG over HTTP), which have no timestamps, with their arrival time. Call
  // before data flows in the chain.
  void stamp_arrivals(GstElement* multipartdemux);
  bool stamps_arrivals() const { return stamps_arrival_; }
  // Ends the stream with EOS at the next frame.
  void end() { ending_ = true; }
  // Stops loops. Call before data flow stops, because demuxers cannot handle a seek during a change to READY. Does not
  // touch the chain, which belongs to the streaming threads.
  void stop();
  // Marks the stream as failed. Returns true only in the first call, because later errors are consequences of the first
  // error and must not be reported.
  bool first_error() { return !failed_.exchange(true); }
  bool has_failed() const { return failed_; }
  bool is_opening() const { return !failed_ && !has_ended_ && frames_out_ == 0; }
  const std::string& place() const { return options_.place; }
  uint64_t frames_out() const { return static_cast<uint64_t>(frames_out_); }
  uint64_t frames_seen() const { return frames_out() + skipped_frames_; }
  // Returns the running time of the next frame of a film that is played live. Until then, silence is normal and does
  // not mean that the camera is lost, for example at the end of a truncated film.
  GstClockTime due() const { return due_; }
  GstClockTime ends_at() const { return stream_end_; }
  // Duration of one loop of the film, nanoseconds; 0: unknown. Call when no data flows.
  GstClockTime round() const { return round_; }

 private:
  void watch_pad(GstPad* pad, int type, GstPadProbeReturn (CameraStream::*method)(GstPad*, GstPadProbeInfo*));
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
  void require_size(int width, int height);
  void check_size(GstCaps* caps);
  void check_jpeg(GstBuffer* buffer);
  GstPadProbeReturn on_tags(GstPadProbeInfo* info);
  void count_time(GstPadProbeInfo* info);
  void check_format(const GstSegment& segment);
  GstBuffer* stamp(GstBuffer* buffer) const;
  GstBuffer* stamp_arrival(GstPad* pad, GstBuffer* buffer) const;
  GstClockTime running_time_now() const;
  bool begin_again(bool flush);
  void seek_to_start(guint32 seqnum, bool flush);
  void delay_segment(GstPadProbeInfo* info) const;
  GstClockTime clock_time(GstClockTime stamp) const;
  GstClockTime capture_time(GstClockTime taken) const;
  GstBuffer* complete_capture_time(GstBuffer* buffer) const;
  void announce(GstPad* pad);

  LfCamSrc* const camera_;
  GstElement* const owner_;  // the same object
  const CameraChain chain_;  // holds references to the pads, because probes may outlive the elements
  const StreamOptions options_;
  std::atomic<bool> live_ = false, stamps_arrival_ = false;
  std::atomic<bool> ending_ = false, stopping_ = false, failed_ = false, has_ended_ = false;
  std::atomic<gint64> frames_out_ = 0;
  std::atomic<uint64_t> skipped_frames_ = 0;
  std::atomic<GstClockTime> due_ = 0;
  std::mutex seeking_;
  std::atomic<guint32> loop_seqnum_ = GST_SEQNUM_INVALID;
  std::atomic<bool> external_seek_pending_ = false;  // an external seek has arrived since the latest segment
  // Stream times of the last coded picture (in presentation order) of this loop: begin, and end if the file states a
  // duration. NONE: unknown.
  std::atomic<GstClockTime> segment_begin_ = GST_CLOCK_TIME_NONE, segment_end_ = GST_CLOCK_TIME_NONE;

  // Used by the streaming thread only:
  GstSegment segment_;
  guint64 pictures_ = 0;
  GstClockTime position_ = 0;
  GstClockTime stream_end_ = 0;
  GstClockTime round_start_ = 0;
  GstClockTime round_ = 0;
  GstClockTime film_end_ = 0;    // film time of the end of the newest frame, across loops
  GstClockTime film_start_ = 0;  // film time of the start of this loop; after a seek, later than the start of the loop
  guint64 checked_frames_ = 0;
  GstClockTime latency_ = 0;
  guint64 round_frames_ = 0;
  gint fps_n_ = 0, fps_d_ = 1;
  bool counts_time_ = false, has_no_time_ = false;
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
  uint64_t dropped_before_ = 0;  // number of frames that had been dropped at the start of this loop
};

}  // namespace lf
