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

#include "common/coded_video.h"
#include "rig/rig.h"

namespace lf {

// The Matroska file of one camera in a recording. Each frame has the time at which it was taken, counted from the
// recording's beginning, and lasts until the next one. JPEG and coded video (common/coded_video.h) are in it as they
// came, the latter from a key frame on, and from the next one on where a frame was dropped; raw video is encoded as
// JPEG. A bin of its own writes it, whose troubles are nobody else's. Thread-safe; nothing but close() waits for the
// disk.
class CameraFile {
 public:
  struct Counts {
    uint64_t frames = 0;   // given to the file
    uint64_t dropped = 0;  // not, for one of the reasons that Added has, or left out
  };
  // What became of a frame.
  enum class Added {
    kTaken,
    kBehind,     // the disk, or the encoder, is
    kOtherKind,  // of video than the file is of
    kNoLater,    // than one before, though it should be
    kNoKey,      // it needs a frame that is not in the file
    kFailed,     // nothing more can be written, see problem()
  };
  // What has ended the file before its time.
  struct Problem {
    std::string text;
    bool disk_is_full = false;
  };

  // `most_bytes`: what may wait for the disk; four frames always may.
  CameraFile(const Camera& camera, const std::string& path, guint64 most_bytes);
  ~CameraFile();
  CameraFile(const CameraFile&) = delete;
  CameraFile& operator=(const CameraFile&) = delete;

  // A frame, which stays the caller's, of JPEG, raw or coded video. `begins`: in words, when the recording began.
  Added add(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);
  // Whether a frame of so many bytes would be left out now, as the disk or the encoder is behind.
  bool is_behind(size_t bytes) const;
  // A frame is dropped that was never for the file.
  void leave_out();
  // Where the newest frame would end that lasts as long as the one before it; 0 without frames.
  GstClockTime ends_at() const;
  // The newest frame lasts until `time`, and none follows.
  void end(GstClockTime time);
  // Behind end(): waits until all is in the file, up to `deadline` of g_get_monotonic_time(); what is not then goes on
  // by itself for as long as it takes.
  void close(gint64 deadline);

  Counts counts() const;
  std::optional<Problem> problem() const;

 private:
  // What the bin says; it may outlive this.
  struct Outcome {
    ~Outcome() { g_clear_error(&error); }
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false;                                     // written, or failed
    std::atomic<bool> has_key = false;                     // of coded video: a key frame has come to the muxer
    std::atomic<GstClockTime> last = GST_CLOCK_TIME_NONE;  // stamp of the coded picture that is seen last
    std::atomic<GstClockTime> end = 0;                     // until when that picture lasts
    GError* error = nullptr;                               // what failed first
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
  Added added(GstBuffer* frame, GstCaps* caps, GstClockTime time, const std::string& begins);

  const int width_, height_;
  const std::string path_;
  const guint64 most_bytes_;
  const std::shared_ptr<Outcome> outcome_ = std::make_shared<Outcome>();
  mutable std::mutex mutex_;
  GstElement* bin_ = nullptr;    // null before the first frame
  GstAppSrc* source_ = nullptr;  // borrowed from it, as is the muxer
  GstElement* mux_ = nullptr;
  std::string kind_;                   // of video: the name of its caps
  const CodedVideo* coded_ = nullptr;  // what is known of it; null: each frame is whole
  bool waits_for_key_ = true, ended_ = false;
  // The newest frame, which lasts until the next one, and of coded video those behind it that are seen before it.
  std::vector<GstBuffer*> held_;
  GstClockTime period_ = 0;  // between the latest two
  Counts counts_;
};

}  // namespace lf
