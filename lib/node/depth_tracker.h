// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

#include "base/worker_pool.h"
#include "depth/array_depth.h"
#include "node/camera_inputs.h"
#include "view/view.h"

namespace lf {

// Measures the surfaces of views with the depth maps of a node's cameras, for arrays with wide baselines (see kMeasured
// in DepthHypothesis). Thread-safe.
class DepthTracker {
 public:
  // Depth maps are estimated for this number of cameras of each view, and in total. These are the kNearest cameras
  // around the viewpoint, those that contribute to the picture, and others around the viewpoint. A live view starts
  // without the others, and with quick depths for the kNearest cameras only, so that sharp pictures begin sooner.
  static constexpr size_t kCamerasOfView = 16, kNearest = 8, kMaxTrackedCameras = 48;
  // The work for a live view ends this long after its last call of surface(), nanoseconds.
  static constexpr uint64_t kTimeout = 10'000'000'000;
  // Live views that are tracked at the same time. Further views get no surface.
  static constexpr size_t kMaxViews = 32;
  // Views with more nodes get no surface.
  static constexpr size_t kMaxNodes = size_t{1} << 18;

  // A live view whose surface is measured. The members are private to the tracker.
  struct TrackedView {
    View wanted;
    std::vector<CameraIndex> contributing;  // in descending order of their parts of the picture
    uint64_t used = 0;                      // now_ns() of the last call of surface()
    std::optional<View> found;              // its map is the measured surface
    bool is_new = true;                     // `wanted` or the depths have changed since `found`
  };

  // `inputs` must outlive this object. `timeout` replaces kTimeout.
  explicit DepthTracker(CameraInputs& inputs, uint64_t timeout = kTimeout) : inputs_(inputs), timeout_(timeout) {}
  ~DepthTracker();

  // Returns a view of the same live viewer, a moment before, with the surface that the cameras have measured. Its map
  // is like ArrayDepth::surface(). Returns nothing if there is none yet. Never waits. `view` must have a map.
  // `contributing` are the node's cameras that contribute to the picture, in descending order of their parts of it.
  // `tracked` is the state of this viewer, initially null.
  //
  // A thread estimates depths, and another one measures the surfaces. After the first depths, both have low priority
  // and work at most half of the time. While the images do not change, they are only compared.
  std::optional<View> surface(std::shared_ptr<TrackedView>& tracked, const View& view,
                              const std::vector<CameraIndex>& contributing);
  // Returns the depths that the latest surface came from, or nothing if there is none yet. Never waits.
  std::optional<ArrayDepth> depths() const;
  // Measures the surface of a view of films or stills, from the frames that `find` returns, and returns the view with
  // this surface, and the depths that it comes from. It takes as long as necessary, so that the pictures of films do
  // not depend on the speed of the machine: some 20 ms for each camera of 320x240 pixels, and several times as long for
  // the first view. Returns nothing if there are no frames, or if `cancelled` becomes true.
  using FindFrame = std::function<std::optional<CameraFrame>(CameraIndex)>;
  struct Measured {
    View view;
    ArrayDepth depths;
  };
  std::optional<Measured> measure(const CameraInputs::Array& array, const View& view,
                                  const std::vector<CameraIndex>& contributing, const FindFrame& find,
                                  const std::atomic<bool>& cancelled, const ParallelFor& parallel);
  // Forgets all views and depths. Does not wait for work in progress, and drops its result.
  void clear();

 private:
  using Views = std::vector<std::shared_ptr<TrackedView>>;

  void run(const std::stop_token& stop);
  void work(const std::stop_token& stop);
  bool wait_for_views(const std::stop_token& stop);
  CameraSet cameras_of_views(const CameraInputs::Array& array);
  CameraSet nearest_to_views(const CameraInputs::Array& array);
  bool update_depths(const CameraInputs::Array& array, const CameraSet& cameras, const CameraSet* first,
                     const FindFrame& find, const ParallelFor& parallel, const std::function<void()>& show_step);
  void forget_if_cleared();
  void forget_if_outdated(const CameraInputs::Array& array);
  bool is_unchanged(CameraIndex camera, const CameraFrame& frame) const;
  void publish_depths();
  void run_surfaces(const std::stop_token& stop);
  void pause(std::unique_lock<std::mutex>& lock, const std::stop_token& stop, uint64_t worked);

  CameraInputs& inputs_;
  const uint64_t timeout_;

  std::mutex work_mutex_;  // held during estimates; guards the members up to next_update_
  std::optional<ArrayDepth> depths_;
  std::shared_ptr<const Rig> rig_;                                      // of depths_
  std::map<CameraIndex, std::weak_ptr<const CameraPicture>> pictures_;  // the images behind depths_
  uint64_t generation_of_depths_ = 0;
  uint64_t next_update_ = 0;  // now_ns()
  bool was_idle_ = false;     // used by thread_ only; see forget_if_outdated()

  mutable std::mutex mutex_;  // locked after work_mutex_; guards the members up to generation_
  std::condition_variable_any changed_;
  Views views_;
  std::optional<ArrayDepth> latest_;  // the depths behind the latest surfaces
  uint64_t generation_ = 0;           // increases if the depths must be forgotten

  WorkerPool workers_;   // for thread_
  std::jthread thread_, surface_thread_;  // started by the first call of surface()
};

}  // namespace lf
