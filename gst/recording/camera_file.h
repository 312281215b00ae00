// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>
#include <gst/gst.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/codecs.h"
#include "rig/rig.h"

namespace lf {

// Writes the file of one camera in a recording, in Matroska format. Timestamps are capture times relative to the start
// of the recording, and each frame lasts until the next. JPEG and coded video (common/codecs.h) are stored
// unchanged; raw video is encoded as JPEG. Coded video starts with a key frame, and restarts with a key frame after a
// dropped frame.
//
// The elements that write the file are in a separate bin, so that their errors do not stop the pipeline of the cameras.
// Thread-safe. close() is the only function that waits for the disk.
class CameraFile {
 public:
  struct Counts {
    uint64_t frames = 0;
    uint64_t dropped = 0;  // frames that are missing in the file; see AddResult and note_dropped()
  };
  enum class AddResult {
    kTaken,
    kBehind,      // disk or encoder is too slow
    kOtherCodec,  // the codec differs from the codec of the file
    kNotLater,    // the timestamp is not later than the previous frame
    kNoKeyFrame,  // the frame depends on a frame that is not in the file
    kFailed,
  };
  struct Problem {
    std::string text;
    bool disk_is_full = false;
  };

  // Prepares the file at `path`; it is created with the first frame. `most_bytes` limits the data that waits for the
  // disk, except that four frames may always wait.
  CameraFile(const Camera& camera, const std::string& path, guint64 most_bytes);
  ~CameraFile();
  CameraFile(const CameraFile&) = delete;
  CameraFile& operator=(const CameraFile&) = delete;

  // Adds a frame. `time` is its capture time since the start of the recording, and becomes its timestamp. `begins` is
  // the time of day of this start, as text, which the file stores. The caller keeps its reference.
  AddResult add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);
  // Returns true if the queue has no room for a frame of this size, because disk or encoder is too slow.
  bool is_behind(size_t bytes) const;
  // Counts a frame that the caller has not added. Coded video then continues with the next key frame.
  void note_dropped();
  // Returns the end of the newest frame, if its duration is the same as the duration of the previous frame.
  GstClockTime ends_at() const;
  // Ends the file: the newest frame lasts until `time`, so that the files of all cameras have the same length. Later
  // frames are ignored.
  void end(GstClockTime time);
  // Call this after end(). Waits until the file is complete, but at most until `deadline` (as g_get_monotonic_time()).
  // After the deadline, the file is closed in the background.
  void close(gint64 deadline);

  Counts counts() const;
  std::optional<Problem> problem() const;

 private:
  // Messages of the bin; may outlive the CameraFile.
  struct WriterState {
    ~WriterState() { g_clear_error(&error); }
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false;
    std::atomic<bool> has_key = false;  // coded video: a key frame has reached the muxer
    std::atomic<GstClockTime> last = GST_CLOCK_TIME_NONE;
    std::atomic<GstClockTime> end = 0;
    GError* error = nullptr;
  };
  static GstBusSyncReply on_message(GstBus* bus, GstMessage* message, gpointer outcome);
  static GstPadProbeReturn on_coded(GstPad* pad, GstPadProbeInfo* info, gpointer outcome);
  void build(GstCaps* caps, const std::string& begins);
  GstElement* add_element(const char* factory);
  GstElement* add_source(GstCaps* caps);
  GstElement* add_jpeg_encoder(GstElement* source);
  GstElement* add_parser(GstElement* source);
  bool has_room(size_t bytes) const;
  bool is_no_later(GstBuffer* frame, GstClockTime time) const;
  void push_held(GstClockTime until);
  AddResult added(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);

  const int width_, height_;
  const std::string path_;
  const guint64 most_bytes_;
  const std::shared_ptr<WriterState> writer_state_ = std::make_shared<WriterState>();
  mutable std::mutex mutex_;
  GstElement* bin_ = nullptr;
  GstAppSrc* source_ = nullptr;  // borrowed from the bin, as is mux_
  GstElement* mux_ = nullptr;
  std::string kind_;
  const CodedVideo* coded_ = nullptr;  // null if each frame is independent
  bool waits_for_key_ = true, ended_ = false;
  // The newest frame, which waits for its duration until the next frame arrives. Coded video can also have later
  // pictures with earlier timestamps.
  std::vector<GstBuffer*> held_;
  GstClockTime period_ = 0;
  Counts counts_;
};

}  // namespace lf
