// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "camera_frames.h"
#include "render/fragment_renderer.h"
#include "render/render_job.h"
#include "wire/answer.h"

namespace lf {

// The inside of lffragment without its pads: the cameras of a node and the answering of requests. Configured while the
// element is stopped; cameras may come and go at any time; answer() may run in several threads, one per requester.
class FragmentNode {
 public:
  struct Stats {
    std::atomic<uint64_t> requests{0}, bad_requests{0}, rig_mismatches{0}, answers{0}, fragments{0}, bytes{0},
        missing_frames{0};
    std::atomic<uint64_t> wait_ns{0}, render_ns{0};  // of the latest answer
    std::atomic<uint64_t> max_skew_ns{0};
  };

  Stats& stats() { return stats_; }

  void set_rig(std::shared_ptr<const Rig> rig);
  const std::shared_ptr<const Rig>& rig() const { return rig_; }
  void set_node_id(uint32_t id) { node_id_ = id; }

  // Inputs announced here and not yet known as a camera (or given up) are waited for by requests of files.
  void expect_input(std::shared_ptr<CameraFrames> frames);
  // False if another input has this camera already.
  bool add_camera(CameraIndex camera, std::shared_ptr<CameraFrames> frames);
  // The input has no camera (any more): its stream ended without a picture, or its pad is gone.
  void give_up(const std::shared_ptr<CameraFrames>& frames);
  // While false, answer() waits for nothing.
  void set_running(bool running);

  // The family of the first stream that came; all others are converted to it. kNone asks without offering.
  PixelFamily agree_on_family(PixelFamily offered);
  void forget_family();

  // One requester's caches.
  struct Requester {
    MeshCache mesh;
  };
  // Waits for the frames that belong to the request's time (see CameraFrames::find) and renders. `base_time`: of the
  // pipeline, turns absolute target times into running time. Never throws; a request that can't be served (another
  // rig's) gets an answer without fragments. `warning` receives a text for the user where something is wrong.
  wire::Answer answer(const ViewRequest& request, Requester& requester, uint64_t base_time, bool live_request,
                      std::string& warning);

 private:
  using Cameras = std::map<CameraIndex, std::shared_ptr<CameraFrames>>;
  Cameras cameras(bool wait_for_all);

  Stats stats_;
  std::shared_ptr<const Rig> rig_;
  uint64_t rig_hash_ = 0;
  uint32_t node_id_ = 0;
  std::unique_ptr<FragmentRenderer> renderer_ = make_scalar_renderer();
  std::mutex mutex_;  // of what follows
  std::condition_variable inputs_changed_;
  bool running_ = false;
  std::set<std::shared_ptr<CameraFrames>> expected_;
  Cameras cameras_;
  PixelFamily family_ = PixelFamily::kNone;
};

}  // namespace lf
