// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/app/app.h>
#include <gst/gst.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/text.h"
#include "bins/rtp_link.h"
#include "cameras/mosaic.h"
#include "common/gst_pointers.h"
#include "serve/array_info.h"
#include "serve/histogram.h"

namespace lf::serve {

// Runs the cameras in one pipeline for all viewers. Requests of all views go into the pipeline, and each answer (a
// camera host's part of a view) goes to the viewer of its view. Queues drop their oldest entries, so that a slow viewer
// blocks nothing. All functions are thread-safe.
class LightField {
 public:
  static constexpr int64_t kSilence = 2000000;  // microseconds without an answer until a host counts as silent

  // Receives each answer of the view, on a streaming thread. Must not block. The buffer is borrowed.
  using OnAnswer = std::function<void(size_t node, GstBuffer* answer)>;

  // Prepares the cameras of the file `rig`. If `nodes` is empty, the cameras run in this process. `resampling` and
  // `renderer` then have the values of lffragment's properties, and the cameras are recorded into the folder `record`,
  // unless it is empty. Otherwise the cameras run on the hosts in `nodes`, with packets encrypted by `key_file`
  // (CameraHosts).
  //
  // `max_views` limits the requests in flight. If `trusted` is false, rigs with potentially harmful elements in their
  // sources are rejected, also on reload (rig/source_security.h). Throws Error.
  LightField(const std::string& rig, const std::vector<NodeAddress>& nodes, const std::string& key_file,
             const std::string& resampling, const std::string& renderer, const std::string& record, int max_views,
             bool trusted);
  ~LightField();
  LightField(const LightField&) = delete;

  // Makes all current and future calls of start() and restart() fail at once. Call this when the program ends, so that
  // it need not wait for cameras.
  void cancel() { cancelled_ = true; }
  // Opens the cameras and blocks until they run. Throws Error. If the cameras fail later, `on_error` is called on the
  // main thread.
  void start(std::function<void(const std::string&)> on_error);

  // Returns true if a changed rig still has the open cameras with the same sources. update_rig() then suffices, and the
  // cameras need not be reopened.
  bool has_cameras_of(const ArrayInfo& array) const;
  // Replaces the rig without interrupting the cameras, for example after a calibration. The rig may come from another
  // file than before.
  void update_rig(std::shared_ptr<const ArrayInfo> array);
  // Closes the cameras and opens the cameras of another rig. Blocks until they run; must not be called on the main
  // thread. Throws Error; then no cameras are open.
  void restart(std::shared_ptr<const ArrayInfo> array);

  // The clock of the cameras, which all pipelines of viewers must use.
  GstClock* clock() const { return clock_; }
  std::string rig() const { return array()->path(); }
  std::shared_ptr<const ArrayInfo> array() const;
  size_t nodes() const { return answers_.size(); }
  bool is_local() const { return local_; }
  // Returns true if the images never change. Cameras of other hosts may always change.
  bool is_still() const { return local_ && array()->is_still(); }

  // Thumbnails of the cameras as a JPEG file, and their state as JSON (cameras/mosaic.h). Throw Error if the cameras
  // are on other hosts.
  std::vector<uint8_t> mosaic_jpeg();
  std::string mosaic_state();

  // State of the cameras at the last update_camera_states(); zero if the cameras are on other hosts.
  CameraStates cameras() const { return states_; }
  void update_camera_states();

  // Registers a viewer: `on_answer` receives all further answers to requests with this view id.
  void join(uint32_t view, OnAnswer on_answer);
  void leave(uint32_t view);         // When this function has returned, on_answer is not called any more.
  void request(GstBuffer* request);  // takes a reference

  uint64_t answer_bytes() const { return bytes_; }
  Histogram& picture_ages() { return picture_ages_; }
  // Returns the indices of camera hosts that do not answer: they have pending requests, but no answer has come for
  // kSilence.
  std::vector<size_t> silent_nodes() const;
  const std::string& node_name(size_t node) const { return hosts_->hosts()[node].name; }

 private:
  struct Answers {
    LightField* field = nullptr;
    size_t node = 0;
    std::atomic<int64_t> last_answer_time = 0;  // g_get_monotonic_time()
  };
  GstStateChangeReturn play();
  static GstFlowReturn take_answer(GstAppSink* sink, gpointer data);
  static void camera_added(GstBin* node, GstElement* child, gpointer self);
  std::shared_ptr<cameras::Mosaic> mosaic() const;
  static GstBusSyncReply bus_sync(GstBus* bus, GstMessage* message, gpointer data);
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);

  std::shared_ptr<const ArrayInfo> array_;  // guarded by mutex_, like mosaic_
  std::shared_ptr<cameras::Mosaic> mosaic_;
  bool local_, trusted_;
  ElementPtr pipeline_;
  GstAppSrc* requests_ = nullptr;       // borrowed from the pipeline
  GstElement* node_ = nullptr;          // null if the cameras are on other hosts; borrowed from the pipeline
  std::unique_ptr<CameraHosts> hosts_;  // null if the cameras are in this process
  GstClock* clock_ = nullptr;
  std::vector<std::unique_ptr<Answers>> answers_;
  guint watch_ = 0;
  std::function<void(const std::string&)> on_error_;
  std::atomic<bool> restarting_ = false, cancelled_ = false;
  mutable std::mutex mutex_;
  std::string problem_;
  std::mutex state_mutex_;
  std::string state_;
  double state_at_ = -1e9;
  std::map<uint32_t, OnAnswer> views_;
  std::atomic<uint64_t> bytes_ = 0;
  Histogram picture_ages_;
  std::atomic<CameraStates> states_ = CameraStates{};
  std::atomic<int64_t> last_request_ = 0, active_since_ = 0;
};

}  // namespace lf::serve
