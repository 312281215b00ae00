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

// The cameras, in one pipeline for all viewers: requests of any view go in, answers come out to the viewer of their
// view. Nobody is waited for: where one side is behind, its oldest are dropped. All functions are thread-safe.
class LightField {
 public:
  static constexpr int64_t kSilence = 2000000;  // microseconds

  // Called for each answer of the view, in a streaming thread; must not wait. The buffer is the caller's.
  using OnAnswer = std::function<void(size_t node, GstBuffer* answer)>;

  // Cameras in this process, sampled and rendered as lffragment's properties "resampling" and "renderer" say, or, where
  // `nodes` has any, on those hosts (CameraHosts, with `key_file`). Cameras in this process are recorded into the
  // folder `record` ("": not). `max_views` bounds what is in flight. `trusted`: the rig may run any element
  // (rig/source_security.h); other rigs are refused, also when they come later. Throws Error.
  LightField(const std::string& rig, const std::vector<NodeAddress>& nodes, const std::string& key_file,
             const std::string& resampling, const std::string& renderer, const std::string& record, int max_views,
             bool trusted);
  ~LightField();
  LightField(const LightField&) = delete;

  // Makes start() and restart(), now and later, fail instead of waiting for cameras: the program ends.
  void cancel() { cancelled_ = true; }
  // Blocks until the cameras run. Throws Error. `on_error` is called on the main thread, when they have failed later.
  void start(std::function<void(const std::string&)> on_error);

  // Whether the cameras of `array`, a rig file that has been read again, are those that are open, with the same
  // sources.
  bool has_cameras_of(const ArrayInfo& array) const;
  // Goes on with another rig of the same cameras, at once.
  void take_rig(std::shared_ptr<const ArrayInfo> array);
  // Opens the cameras of another rig and closes those there were: blocks until they run. Not on the main thread. Throws
  // Error; then there are none.
  void restart(std::shared_ptr<const ArrayInfo> array);

  // Pipelines of viewers run under the clock of the cameras.
  GstClock* clock() const { return clock_; }
  const std::string& rig() const { return rig_; }
  std::shared_ptr<const ArrayInfo> array() const;
  size_t nodes() const { return answers_.size(); }
  bool is_local() const { return local_; }  // the cameras are in this process

  // Small pictures of the cameras in this process (cameras/mosaic.h): a JPEG file, and what it shows, as JSON. Throw
  // Error where the cameras are on other hosts.
  std::vector<uint8_t> mosaic_jpeg();
  std::string mosaic_state();

  // How the cameras in this process are: none of them where they are on other hosts. As they were when they were looked
  // at last.
  CameraStates cameras() const { return states_; }
  void look_at_cameras();

  void join(uint32_t view, OnAnswer on_answer);
  void leave(uint32_t view);         // when it returns, on_answer is not called any more
  void request(GstBuffer* request);  // takes a reference

  uint64_t answer_bytes() const { return bytes_; }
  // Numbers of the hosts, in the order in which they were named, that are asked and have not answered for kSilence.
  std::vector<size_t> silent_nodes() const;
  // "HOST:PORT" of a host.
  const std::string& node_name(size_t node) const { return hosts_->hosts()[node].name; }

 private:
  struct Answers {
    LightField* field = nullptr;
    size_t node = 0;
    std::atomic<int64_t> heard = 0;  // g_get_monotonic_time() of the last
  };
  GstStateChangeReturn play();
  static GstFlowReturn take_answer(GstAppSink* sink, gpointer data);
  static void camera_added(GstBin* node, GstElement* child, gpointer self);
  std::shared_ptr<cameras::Mosaic> mosaic() const;
  static GstBusSyncReply bus_sync(GstBus* bus, GstMessage* message, gpointer data);
  static gboolean bus_message(GstBus* bus, GstMessage* message, gpointer data);

  std::string rig_;
  std::shared_ptr<const ArrayInfo> array_;  // under the mutex, as is what follows
  std::shared_ptr<cameras::Mosaic> mosaic_;
  bool local_, trusted_;
  ElementPtr pipeline_;
  GstAppSrc* requests_ = nullptr;       // borrowed from the pipeline
  GstElement* node_ = nullptr;          // the cameras in this process, or null; borrowed from the pipeline
  std::unique_ptr<CameraHosts> hosts_;  // null where the cameras are in this process
  GstClock* clock_ = nullptr;
  std::vector<std::unique_ptr<Answers>> answers_;
  guint watch_ = 0;
  std::function<void(const std::string&)> on_error_;
  std::atomic<bool> restarting_ = false, cancelled_ = false;
  mutable std::mutex mutex_;
  std::string problem_;  // why the latest restart failed
  std::mutex state_mutex_;
  std::string state_;  // what mosaic_state() told at `state_at_`
  double state_at_ = -1e9;
  std::map<uint32_t, OnAnswer> views_;
  std::atomic<uint64_t> bytes_ = 0;
  std::atomic<CameraStates> states_ = CameraStates{};
  std::atomic<int64_t> asked_ = 0, asked_since_ = 0;  // the last request, and the first since there was a pause
};

}  // namespace lf::serve
