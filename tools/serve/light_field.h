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

namespace lf::serve {

// The cameras, in one pipeline for all viewers. Routes requests of all views in, and answers out to the viewer of the
// view. Queues drop their oldest entries, so that no side blocks. All functions are thread-safe.
class LightField {
 public:
  static constexpr int64_t kSilence = 2000000;  // microseconds

  // Called on a streaming thread for each answer of the view; must not block. The buffer is borrowed.
  using OnAnswer = std::function<void(size_t node, GstBuffer* answer)>;

  // Uses cameras in this process, with lffragment's properties "resampling" and "renderer", or the hosts in `nodes`, if
  // any (CameraHosts, with `key_file`). Local cameras are recorded into the folder `record`; "": no recording.
  // `max_views` limits requests in flight. `trusted`: the rig may run any element (rig/source_security.h); an untrusted
  // rig with other elements is rejected, also on reload. Throws Error.
  LightField(const std::string& rig, const std::vector<NodeAddress>& nodes, const std::string& key_file,
             const std::string& resampling, const std::string& renderer, const std::string& record, int max_views,
             bool trusted);
  ~LightField();
  LightField(const LightField&) = delete;

  // Makes current and future calls of start() and restart() fail at once, for program exit.
  void cancel() { cancelled_ = true; }
  // Blocks until the cameras run. Throws Error. `on_error` is called on the main thread if the cameras fail later.
  void start(std::function<void(const std::string&)> on_error);

  // True if the cameras of `array`, a reloaded rig file, are the open cameras with the same sources.
  bool has_cameras_of(const ArrayInfo& array) const;
  // Switches to another rig of the same cameras, without a pause.
  void update_rig(std::shared_ptr<const ArrayInfo> array);
  // Closes the cameras and opens the cameras of another rig. Blocks until these run. Must not be called on the main
  // thread. Throws Error; then no cameras are open.
  void restart(std::shared_ptr<const ArrayInfo> array);

  // Viewer pipelines use the clock of the cameras.
  GstClock* clock() const { return clock_; }
  const std::string& rig() const { return rig_; }
  std::shared_ptr<const ArrayInfo> array() const;
  size_t nodes() const { return answers_.size(); }
  bool is_local() const { return local_; }

  // Thumbnails of local cameras as a JPEG file, and their state as JSON (cameras/mosaic.h). Throw Error if the cameras
  // are on other hosts.
  std::vector<uint8_t> mosaic_jpeg();
  std::string mosaic_state();

  // State of the local cameras at the last update_camera_states(); zero if they are on other hosts.
  CameraStates cameras() const { return states_; }
  void update_camera_states();

  void join(uint32_t view, OnAnswer on_answer);
  void leave(uint32_t view);         // after return, on_answer is not called any more
  void request(GstBuffer* request);  // takes a reference

  uint64_t answer_bytes() const { return bytes_; }
  // Returns the indices of hosts that have pending requests and have not answered for kSilence.
  std::vector<size_t> silent_nodes() const;
  const std::string& node_name(size_t node) const { return hosts_->hosts()[node].name; }

 private:
  struct Answers {
    LightField* field = nullptr;
    size_t node = 0;
    std::atomic<int64_t> heard = 0;  // g_get_monotonic_time() of the last answer
  };
  GstStateChangeReturn play();
  static GstFlowReturn take_answer(GstAppSink* sink, gpointer data);
  static void camera_added(GstBin* node, GstElement* child, gpointer self);
  std::shared_ptr<cameras::Mosaic> mosaic() const;
  static GstBusSyncReply bus_sync(GstBus* bus, GstMessage* message, gpointer data);
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);

  std::string rig_;
  std::shared_ptr<const ArrayInfo> array_;  // guarded by mutex_, like mosaic_
  std::shared_ptr<cameras::Mosaic> mosaic_;
  bool local_, trusted_;
  ElementPtr pipeline_;
  GstAppSrc* requests_ = nullptr;       // borrowed from the pipeline
  GstElement* node_ = nullptr;          // cameras in this process, or null; borrowed from the pipeline
  std::unique_ptr<CameraHosts> hosts_;  // null: the cameras are in this process
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
  std::atomic<CameraStates> states_ = CameraStates{};
  std::atomic<int64_t> last_request_ = 0, asked_since_ = 0;
};

}  // namespace lf::serve
