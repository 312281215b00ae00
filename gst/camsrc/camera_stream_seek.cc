// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Where a camera that is read from files is in its film: seeks, rounds, and stamps where a source has none, so that
// capture times stay those of the film, whatever the source is.
#include <algorithm>
#include <string>
#include <utility>

#include "camsrc/camera_stream.h"
#include "camsrc/chain_links.h"
#include "common/common.h"

namespace lf {

GstPadProbeReturn CameraStream::on_seek(GstPadProbeInfo* info) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  gdouble rate = 0;
  GstFormat format = GST_FORMAT_UNDEFINED;
  GstSeekFlags flags{};
  GstSeekType start_type{}, stop_type{};
  gint64 start = 0, stop = 0;
  gst_event_parse_seek(event, &rate, &format, &flags, &start_type, &start, &stop_type, &stop);
  if (live_ || rate <= 0 || format != GST_FORMAT_TIME || start_type != GST_SEEK_TYPE_SET || start < 0)
    return GST_PAD_PROBE_OK;
  const guint32 seqnum = gst_event_get_seqnum(event);
  const std::lock_guard lock(seeking_);
  if (failed_ || stopping_) return GST_PAD_PROBE_DROP;  // nothing comes any more
  sought_ = true;
  if (!options_.seek_to_loop) return GST_PAD_PROBE_OK;
  // What is in a later round of a film that loops is come to from the beginning.
  gint64 duration = 0;
  if (gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) && start >= duration) start = 0;
  GstEvent* there = gst_event_new_seek(rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum(there, seqnum);
  // Here, because it and the one back to the beginning have to follow each other, and that is not done once it is.
  return gst_pad_push_event(chain_.decoded, there) ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
}

// Behind the end of a segment the stream goes on without a flush. Only behind EOS, which ends what has begun without a
// seek, there has to be one.
void CameraStream::seek_to_start(guint32 seqnum, bool flush) {
  std::lock_guard lock(seeking_);
  if (stopping_ || loop_seqnum_ != seqnum) return;
  const int flags = GST_SEEK_FLAG_SEGMENT | (flush ? GST_SEEK_FLAG_FLUSH : 0);
  GstEvent* seek =
      gst_event_new_seek(1.0, GST_FORMAT_TIME, GstSeekFlags(flags), GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_NONE, -1);
  gst_event_set_seqnum(seek, seqnum);
  if (!gst_pad_push_event(chain_.decoded, seek))
    fail(GST_STREAM_ERROR_FAILED, "can't begin again: there is no seeking in it");
}

// A film that loops and is opened again begins in the round that it would be in, not in the first of all: after hours
// nobody could decode what there has been since. Rounds are as long as they were found to be, so that it stays in step.
void CameraStream::pass_rounds() {
  gint64 duration = static_cast<gint64>(round_);
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  if (!options_.seek_to_loop || !GST_CLOCK_TIME_IS_VALID(now)) return;
  if (duration == 0) gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration);
  if (duration > 0) round_start_ = stream_end_ = now - now % static_cast<guint64>(duration);
}

// How much earlier than at the end that it says to have the film has ended; 0 for what is no more than a frame or two.
GstClockTime CameraStream::missing_at_end() const {
  gint64 duration = 0;
  if (!gst_pad_peer_query_duration(chain_.decoded, GST_FORMAT_TIME, &duration) || duration <= 0) return 0;
  const GstClockTime period = round_frames_ > 0 ? (stream_end_ - round_start_) / round_frames_ : 0;
  const auto said = static_cast<GstClockTime>(duration);
  const bool is_shorter = said > position_ + 2 * period + GST_SECOND / 50;
  return is_shorter && !has_sound(GST_BIN(owner_)) ? said - position_ : 0;  // which may be longer
}

// The last frame lasts until the end that its file tells, so that all cameras of a recording have rounds of one length.
void CameraStream::end_round_as_told() {
  told_begin_ = GST_CLOCK_TIME_NONE;
  const GstClockTime told = told_end_.exchange(GST_CLOCK_TIME_NONE);
  if (!GST_CLOCK_TIME_IS_VALID(told)) return;
  const GstClockTimeDiff later = GST_CLOCK_DIFF(position_, told);
  stream_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(stream_end_) + later);
  film_end_ = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(film_end_) + later);
  position_ = told;
}

// At the end of the file, or of a segment: true if it is to begin again.
bool CameraStream::begin_again(bool flush) {
  // Nobody wants more frames, or the file has none: no reason to turn round and round.
  if (!options_.seek_to_loop || !is_cut_off_ || failed_ || round_frames_ == 0) return false;
  if (stamps_arrival_ || live_latency(chain_.decoded)) return false;  // no beginning to seek back to

  // A film that is cut off, or whose last frames were dropped, has none for the rest of its round, so that those after
  // it are in step with the others'.
  end_round_as_told();
  const GstClockTime missing = missing_at_end();
  const bool dropped = options_.shedder->dropped() != std::exchange(dropped_before_, options_.shedder->dropped());
  if (missing > 0 && !dropped && !std::exchange(told_cut_off_, true)) listener_.on_cut_off(position_, missing);
  stream_end_ += missing;
  film_end_ += missing;
  if (options_.paced || options_.catches_up) due_ = stream_end_;
  round_ = stream_end_ - round_start_;
  round_start_ = stream_end_;
  film_start_ = film_end_;
  round_frames_ = 0;
  loop_seqnum_ = gst_util_seqnum_next();

  // On another thread: a seek waits until this one has let go.
  struct Task {
    std::shared_ptr<CameraStream> stream;
    guint32 seqnum;
    bool flush;
    GstPad* pad;  // so that it is still there, if not in use any more
  };
  gst_element_call_async(
      owner_,
      [](GstElement* owner, gpointer data) {
        const auto* task = static_cast<Task*>(data);
        guarded(owner, 0, [task] { return task->stream->seek_to_start(task->seqnum, task->flush), 0; });
      },
      new Task{shared_from_this(), loop_seqnum_, flush, GST_PAD(gst_object_ref(chain_.decoded))},
      [](gpointer data) {
        auto* task = static_cast<Task*>(data);
        gst_object_unref(task->pad);
        delete task;
      });
  return true;
}

// The same segment, `round_start_` later: running time goes on where the last round ended. Takes and gives a reference.
GstEvent* CameraStream::later_segment(GstEvent* event) const {
  GstSegment segment;
  gst_event_copy_segment(event, &segment);
  segment.base = round_start_;
  segment.flags = GstSegmentFlags(segment.flags & ~GST_SEGMENT_FLAG_RESET);
  GstEvent* later = gst_event_new_segment(&segment);
  gst_event_set_seqnum(later, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return later;
}

// JPEG files that elements read one by one (multifilesrc) are stretches of bytes without times. Takes and gives a
// reference.
GstEvent* CameraStream::time_segment(GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  counts_time_ = segment->format != GST_FORMAT_TIME && fps_n_ > 0;
  if (!counts_time_) return event;
  GstSegment time;
  gst_segment_init(&time, GST_FORMAT_TIME);
  GstEvent* timed = gst_event_new_segment(&time);
  gst_event_set_seqnum(timed, gst_event_get_seqnum(event));
  gst_event_unref(event);
  return timed;
}

// The running time now; 0 before PLAYING, while a first frame waits there.
GstClockTime CameraStream::running_time_now() const {
  const GstClockTime now = gst_element_get_current_running_time(owner_);
  return GST_CLOCK_TIME_IS_VALID(now) ? now : 0;
}

// Gives a picture that has no stamp the time at which it arrives. Takes and gives a reference.
GstBuffer* CameraStream::stamp_arrival(GstPad* pad, GstBuffer* buffer) const {
  g_autoptr(GstEvent) event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  const GstSegment* segment = nullptr;
  if (event) gst_event_parse_segment(event, &segment);
  if (!segment || segment->format != GST_FORMAT_TIME) return buffer;
  buffer = gst_buffer_make_writable(buffer);
  GST_BUFFER_PTS(buffer) = gst_segment_position_from_running_time(segment, GST_FORMAT_TIME, running_time_now());
  GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
  return buffer;
}

GstBuffer* CameraStream::stamp(GstBuffer* buffer) const {
  buffer = gst_buffer_make_writable(buffer);
  const auto time = [this](guint64 n) {
    return gst_util_uint64_scale(n, GST_SECOND * static_cast<guint64>(fps_d_), static_cast<guint64>(fps_n_));
  };
  GST_BUFFER_PTS(buffer) = time(pictures_);
  GST_BUFFER_DTS(buffer) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(buffer) = time(pictures_ + 1) - time(pictures_);
  return buffer;
}

}  // namespace lf
