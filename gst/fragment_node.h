// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "base/parallel.h"
#include "camera_frames.h"
#include "frame_sources.h"
#include "node/answer_task.h"
#include "node/skew_watch.h"
#include "node_stats.h"
#include "render/render_job.h"
#include "wire/answer.h"
#include "wire/commands.h"

namespace lf {

// The inside of lffragment without its pads: the cameras of a node and the answering of requests. Configured while the
// element is stopped; cameras may come and go at any time; answer() may run in several threads, one per requester.
class FragmentNode {
 public:
  NodeStats& stats() { return stats_; }

  void set_rig(std::shared_ptr<const Rig> rig);
  const std::shared_ptr<const Rig>& rig() const { return rig_; }
  void set_node_id(uint32_t id) { node_id_ = id; }

  // Until it is known of an input which camera it is and what its pixels are, requests of files wait.
  void add_input(std::shared_ptr<CameraFrames> frames);
  // False if another input has this camera already.
  bool set_camera(const std::shared_ptr<CameraFrames>& frames, CameraIndex camera);
  void set_family(const std::shared_ptr<CameraFrames>& frames, PixelFamily family);
  // Its stream ended: what is not known will never be.
  void give_up(const std::shared_ptr<CameraFrames>& frames);
  void remove_input(const std::shared_ptr<CameraFrames>& frames);
  // While false, answer() waits for nothing.
  void set_running(bool running);

  // Of all answers; chosen for the first one, kNone before: RGB if an input has it then, else I420. Requests of files
  // wait until all inputs are known, so that it is not a matter of who comes first. Frames of the other family are
  // converted.
  PixelFamily family() const { return family_; }
  void forget_family() { family_ = PixelFamily::kNone; }

  // What is kept of one requester.
  struct Requester {
    MeshCache mesh;
    SkewWatch watch;
  };
  // How requests are to be answered.
  struct Manner : AnswerTask::Manner {
    bool live = false;       // the request is: nothing is waited for
    uint64_t base_time = 0;  // of the pipeline: clock time of running time 0
    uint64_t max_skew = 0;   // of a live camera's frame; what is farther from the target is none; 0: any
    ParallelFor parallel = serial_for;
  };
  struct Reply {
    ByteBuffer bytes;  // the answer, always whole
    size_t fragments = 0;
    NodeStats::Stages stages;
    std::string warning;  // for the user, where something is wrong
  };
  // Waits for the frames that belong to the request's time (see CameraFrames::find) and renders. Never throws; a
  // request that can't be served (another rig's) gets an answer without fragments. `memory` is recycled.
  Reply answer(const wire::AnyRequest& request, Requester& requester, const Manner& manner, ByteBuffer memory);

 private:
  struct Input {
    std::optional<CameraIndex> camera;
    PixelFamily family = PixelFamily::kNone;
    bool given_up = false;
    bool is_known() const { return given_up || (camera && family != PixelFamily::kNone); }
  };
  using Cameras = std::map<CameraIndex, std::shared_ptr<CameraFrames>>;
  PixelFamily choose_family();
  Cameras cameras(bool wait_for_all);
  // What the request comes to, given the node's cameras.
  using MakeTask = std::function<std::unique_ptr<AnswerTask>(std::span<const CameraIndex> own)>;
  MakeTask task_maker(const wire::AnyRequest& request, Requester& requester) const;
  Reply render(const RequestHead& request, const MakeTask& make_task, Requester& requester, const Manner& manner,
               wire::AnswerHeader header, ByteBuffer memory);

  std::string skew_warning(const std::optional<SkewWatch::Report>& report) const;

  NodeStats stats_;
  std::shared_ptr<const Rig> rig_;
  uint64_t rig_hash_ = 0;
  uint32_t node_id_ = 0;
  std::atomic<PixelFamily> family_ = PixelFamily::kNone;
  std::mutex mutex_;  // of what follows
  std::condition_variable inputs_changed_;
  bool running_ = false;
  std::map<std::shared_ptr<CameraFrames>, Input> inputs_;
  Cameras cameras_;  // of inputs_
};

}  // namespace lf
