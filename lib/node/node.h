// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "node/answer_maker.h"
#include "node/camera_inputs.h"
#include "node/frame_sources.h"
#include "node/node_stats.h"
#include "node/skew_watch.h"
#include "node/work_estimate.h"
#include "rig/mesh.h"
#include "wire/answer.h"
#include "wire/commands.h"

namespace lf {

// The cameras of a node, and the answering of requests. answer() may run in several threads, one per requester.
class Node {
 public:
  NodeStats& stats() { return stats_; }
  CameraInputs& inputs() { return inputs_; }
  void set_node_id(uint32_t id) { node_id_ = id; }  // while stopped

  // What is kept of one requester.
  struct Requester {
    std::shared_ptr<const Rig> rig;  // the rig that everything else here is about
    MeshCache mesh;
    SkewWatch watch;
    AnswerMaker maker;
    WorkEstimate estimate;       // of its answers, for whoever asks for them
    CameraSet gone;              // of the rig, had no frame for the latest request: see make_plan()
    uint64_t warned_of = 0;      // hash of another rig that a person has been told of
    uint64_t warned_behind = 0;  // when one was told that frames come late, now_ns()
    // Several requesters may share what follows. While *cancelled nothing is waited for, see cancel(); `images` is the
    // memory for what is made of images.
    std::shared_ptr<std::atomic<bool>> cancelled = std::make_shared<std::atomic<bool>>(false);
    std::shared_ptr<KeptImages> images = std::make_shared<KeptImages>();
  };
  // While `cancelled` an answer that is made for this requester waits for nothing. Any thread.
  void cancel(Requester& requester, bool cancelled);
  // How requests are to be answered.
  struct Options : AnswerMaker::Options {
    bool live = false;       // the request is live: nothing is waited for
    uint64_t base_time = 0;  // clock time of the pipeline's running time 0
    uint64_t max_skew = 0;   // nanoseconds that a live camera's frame may be from the target time; 0: any
  };
  struct Reply : AnswerMaker::Units {
    NodeStats::Stages stages;
    std::string warning;  // tells a user what is wrong; "": nothing
  };
  // Waits for the frames that belong to the request's time (see CameraFrames::find) and renders. Never throws; a
  // request that can't be served (another rig's) gets an answer without fragments. `memory` is recycled.
  Reply answer(const wire::AnyRequest& request, Requester& requester, const Options& options, ByteBuffer memory);

  // An answer without fragments, at once: nobody needs the picture.
  Reply skip(const wire::AnyRequest& request);

 private:
  using Array = CameraInputs::Array;
  wire::AnswerHeader header_of(const wire::AnyRequest& request, const Array& array) const;
  Reply render(const wire::AnyRequest& request, const Array& array, Requester& requester, const Options& options,
               wire::AnswerHeader header, ByteBuffer memory, uint64_t waited);
  // What is to be done for a request, and the frames of its task's cameras.
  struct Plan {
    std::unique_ptr<const AnswerTask> task;
    std::vector<std::optional<CameraFrame>> frames;
    CameraSet gone;   // left out, see make_plan()
    uint64_t ns = 0;  // that the task took to make, nanoseconds
  };
  using FindFrame = std::function<std::optional<CameraFrame>(CameraIndex)>;
  // Live, a compositor takes cameras that are missing out of service, after some pictures. Pictures of files must not
  // depend on when: there a node that has all of the array leaves cameras without a frame out of the mesh at once, so
  // that their neighbours close the gap (see out_of_mesh()).
  static Plan make_plan(const wire::AnyRequest& any, const Array& array, Requester& requester,
                        const std::vector<CameraIndex>& own, bool live, const FindFrame& find);
  std::string skew_warning(const Rig& rig, const std::optional<SkewWatch::Report>& report, Requester& requester) const;

  NodeStats stats_;
  CameraInputs inputs_;
  uint32_t node_id_ = 0;
};

}  // namespace lf
