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
#include "camsrc/camera_service.h"
#include "common/gst_pointers.h"
#include "rig/rig.h"

namespace lf {

// Tracks one stream of coded pictures for recording: the first picture that can be decoded, and the display order.
// Not thread-safe.
class CodedPictures {
 public:
  struct Picture {
    BufferPtr buffer;
    GstClockTime taken;  // running time, or time in the film
  };
  // So many may wait for a first frame to be sent, more than a decoder holds back; then it has failed.
  static constexpr size_t kMostWaiting = 300;
  // What a capture time may go back by without the clock having been set back: its sender has just told what it is.
  static constexpr GstClockTime kMostBack = GST_SECOND;

  // Whether a picture may be kept: nothing before the first key frame can.
  bool admits(GstBuffer* picture);
  // Those before are not kept, so that it begins with a key frame again.
  void begin_again();
  // Keeps a reference.
  void wait(GstBuffer* picture, GstClockTime taken);
  std::vector<Picture> take_waiting();
  // The capture time of a picture. One that is seen later than all before it was taken later, whatever its time says.
  GstClockTime in_order(GstClockTime taken, GstClockTime captured);

 private:
  bool has_key_ = false;
  std::vector<Picture> waiting_;
  GstClockTime newest_taken_ = 0, newest_captured_ = 0;  // of those passed on; 0: none was
};

// What is said of a camera's stream, and what becomes of it.
struct StreamOptions {
  CameraIndex camera = 0;
  uint64_t rig_hash = 0;
  int width = 0, height = 0;  // pixels
  double time_offset = 0;     // seconds, of the true capture time
  gint64 num_frames = -1;     // -1: all
  bool seek_to_loop = false;  // where the source ends it is sought back to its beginning
  bool has_end = true;        // false: an end of the source, but for `num_frames`, is an error
  bool may_be_lost = false;   // an error ends the stream with the event LF_CAMERA_LOST, not with EOS
  bool catches_up = false;    // frames are left out until one is not late, see CameraStream::is_too_late()
  GstClockTime round = 0;     // how long a round of a film that loops has been found to be; 0: not known
  bool paced = false;         // frames are ready before their time, and wait for it
  GstClockTime begin = 0;     // running time of what has the source's time 0
  std::shared_ptr<CameraShedder> shedder;
  std::string place;  // begins the text of each error: "rig.json: camera 5 (cam_00_05): cam_00_05.mkv"
};

// What a camera's stream tells, from any of its threads.
struct StreamListener {
  // An error; called once at most.
  std::function<void(GQuark domain, gint code, const std::string& text)> on_error;
  std::function<void()> on_first_frame;
  std::function<void()> on_end;  // the stream has ended as it should; not called after an error
  // Frames are dropped before they are decoded, as they come late by so much.
  std::function<void(GstClockTimeDiff late)> on_overload;
  // A film that loops ended after `lasted`, and `missing` before the end that it says to have. Called once at most.
  std::function<void(GstClockTime lasted, GstClockTime missing)> on_cut_off;
  // Something to be kept of the camera, which stays the stream's, with its true capture time: a coded picture, which
  // may need the ones before it, as it comes to the decoder, whether that has the time for it or not; else, where no
  // file could take it so, a frame as it is sent. Empty where nobody keeps anything.
  std::function<void(GstBuffer* buffer, GstCaps* caps, GstClockTime captured)> on_keepsake;
};

// Watches the pads of a chain from one start to the next stop and makes of what passes a camera's stream: of the rig's
// size, named by the sticky event LF_CAMERA_EVENT, with the true capture time on each frame, going on where a file
// begins again, and ending after `num_frames`.
class CameraStream : public std::enable_shared_from_this<CameraStream> {
 public:
  // `owner`: the element whose base time counts; it outlives the stream's data flow.
  CameraStream(GstElement* owner, const CameraChain& chain, const StreamOptions& options,
               const StreamListener& listener);
  ~CameraStream();
  CameraStream(const CameraStream&) = delete;

  // Call once, before data flows.
  void watch();
  // The same for elements inside of the chain, as they are made: what comes to a decoder, or to a parser before it.
  void watch_element(GstElement* element);
  // Frames come at their time on a clock, which their capture times are to be of. Before data flows.
  void set_live() { live_ = true; }
  // Pictures come over HTTP one behind another, without stamps, from a multipartdemux: each gets the time at which it
  // arrives. Before data flows in the chain.
  void stamp_arrivals(GstElement* multipartdemux);
  bool stamps_arrivals() const { return stamps_arrival_; }
  // The next frame is no more sent; the stream ends. Any thread.
  void end() { ending_ = true; }
  // Call before data flow is shut down: demuxers don't take a seek and a change to READY at the same time. Afterwards
  // the chain is not touched by threads other than those that stream.
  void stop();
  // True the first time: an error follows from the one before it and is not worth telling.
  bool first_error() { return !failed_.exchange(true); }
  bool has_failed() const { return failed_; }
  // It has neither sent a frame nor ended nor failed.
  bool is_opening() const { return !failed_ && !has_ended_ && frames_out_ == 0; }
  const std::string& place() const { return options_.place; }
  // Frames sent so far.
  uint64_t frames_out() const { return static_cast<uint64_t>(frames_out_); }
  // The same with those that were left out to catch up.
  uint64_t frames_seen() const { return frames_out() + left_out_; }
  // Of a live film, whose frames are ready before their time, the running time of the next one: it may pause, and does
  // where its end is cut off.
  GstClockTime due() const { return due_; }
  // Running time at which the newest frame ends. Call when nothing flows.
  GstClockTime ends_at() const { return stream_end_; }
  // How long a round of a film that loops is; 0: it has had none yet. Call when nothing flows.
  GstClockTime round() const { return round_; }

 private:
  // Probes of the chain's pads: each takes what passes and says what becomes of it.
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
  void end_round_as_told();
  std::optional<GstClockTime> taken_at(GstSegment segment, GstClockTime stamp) const;
  void keep_waiting();
  void keep_frame(GstPad* pad, GstBuffer* frame) const;
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
  const CameraChain chain_;  // holds references to its pads, as probes may be under way when the elements are gone
  const StreamOptions options_;
  const StreamListener listener_;
  std::atomic<bool> live_ = false, stamps_arrival_ = false;
  std::atomic<bool> ending_ = false, stopping_ = false, failed_ = false, has_ended_ = false;
  std::atomic<gint64> frames_out_ = 0;
  std::atomic<uint64_t> left_out_ = 0;
  std::atomic<GstClockTime> due_ = 0;
  std::mutex seeking_;
  std::atomic<guint32> loop_seqnum_ = GST_SEQNUM_INVALID;  // number of the seek back to the beginning
  std::atomic<bool> sought_ = false;                       // somebody else has sought since the latest segment
  // Stream times at which the coded picture of this round begins that is seen last, and ends by what its file says;
  // none: there is no such picture, or nothing is said.
  std::atomic<GstClockTime> told_begin_ = GST_CLOCK_TIME_NONE, told_end_ = GST_CLOCK_TIME_NONE;

  // What follows belongs to the streaming thread.
  GstSegment segment_;            // the latest segment on the frames pad
  guint64 pictures_ = 0;          // pictures decoded so far
  GstClockTime position_ = 0;     // stream time, that of the source, at which the newest frame ends
  GstClockTime stream_end_ = 0;   // running time at which the newest frame ends
  GstClockTime round_start_ = 0;  // running time at which this round of a loop began
  GstClockTime round_ = 0;        // how long the latest whole round was
  GstClockTime film_end_ = 0;     // time in the film, over all rounds, at which the newest frame ends
  GstClockTime film_start_ = 0;   // time in the film at which this round began: later than its beginning after a seek
  guint64 judged_ = 0;            // frames whose lateness was looked at
  GstClockTime latency_ = 0;      // latency that the source states
  guint64 round_frames_ = 0;      // frames since round_start_
  gint fps_n_ = 0, fps_d_ = 1;
  bool counts_time_ = false;      // frames have no stamps, and a rate
  bool is_known_jpeg_ = false;    // a picture's header has been read
  bool jpegs_have_ends_ = false;  // a JPEG picture had its end marker before the decoder
  bool is_jpeg_ = false, size_is_wrong_ = false, announced_ = false, eos_sent_ = false;
  bool is_on_time_ = false;        // a stream that catches up has done so
  GstClockTime nearly_since_ = 0;  // running time since when it has been late by a second at most; 0: it is not yet
  bool is_cut_off_ = false;        // more could have been sent when the source came to its end
  bool told_cut_off_ = false;
  mutable std::mutex keeping_;   // guards the next two: a decoder may send frames by a thread of its own
  GstPad* coded_pad_ = nullptr;  // a reference: where pictures come to the decoder that are kept as they are; or null
  CodedPictures coded_;
  uint64_t dropped_before_ = 0;  // frames that the shedder had dropped when this round began
};

}  // namespace lf
