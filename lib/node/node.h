// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/byte_buffer.h"
#include "base/worker_pool.h"
#include "node/answer_maker.h"
#include "node/camera_inputs.h"
#include "node/found_frames.h"
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
    int64_t day_offset = 0;  // time of day, which live requests name, less clock time
    uint64_t max_skew = 0;   // nanoseconds that a live camera's frame may be from the target time; 0: any
  };
  struct Reply : AnswerMaker::Units {
    NodeStats::Stages stages;
    std::string warning;  // tells a user what is wrong; "": nothing
  };
  // Waits for the frames that belong to the request's time (see CameraFrames::find) and renders. Never throws; a
  // request that can't be served (another rig's) gets an answer without fragments. `memory` is recycled.
  Reply answer(const wire::AnyRequest& request, Requester& requester, const Options& options, ByteBuffer memory);
  // The same of several that may_go_together(): each gets the answer that it would get alone, of images that are made
  // once, and a card draws as many as it can in a pass. `memory`: to be recycled for one answer.
  using TakeMemory = std::function<ByteBuffer()>;
  std::vector<Reply> answer(std::span<const wire::AnyRequest* const> requests, Requester& requester,
                            const Options& options, const TakeMemory& memory);
  // Whether these two are of views of one moment and one set, which a card can draw, and neither asks how bright
  // cameras are, as the one that leads may.
  static bool may_go_together(const wire::AnyRequest& a, const wire::AnyRequest& b);

  // An answer without fragments, at once: nobody needs the picture.
  Reply skip(const wire::AnyRequest& request);

 private:
  using Array = CameraInputs::Array;
  wire::AnswerHeader header_of(const wire::AnyRequest& request, const Array& array) const;
  // What is to be done for a request.
  struct Plan {
    std::unique_ptr<const AnswerTask> task;
    CameraSet gone;   // left out, see make_plan()
    uint64_t ns = 0;  // that the task took to make, nanoseconds
  };
  std::vector<Reply> render(std::span<const wire::AnyRequest* const> requests, const Array& array, Requester& requester,
                            const Options& options, std::span<const wire::AnswerHeader> headers,
                            const TakeMemory& memory, uint64_t waited);
  static Plan make_plan(const ViewRequest& view, const Array& array, Requester& requester,
                        const std::vector<CameraIndex>& own, const ParallelFor& parallel, FoundFrames& frames);
  static std::vector<Plan> make_plans(std::span<const wire::AnyRequest* const> requests, const Array& array,
                                      Requester& requester, const std::vector<CameraIndex>& own, bool live,
                                      const ParallelFor& parallel, FoundFrames& frames);
  static bool has(const Plan& plan, CameraIndex camera);
  static std::vector<CameraIndex> cameras_of(const std::vector<Plan>& plans);
  uint64_t describe(const Plan& plan, const FrameSources& sources, const FoundFrames& frames,
                    const std::vector<CameraIndex>& own, const CameraSet& absent, wire::AnswerHeader& header);
  std::string skew_warning(const Rig& rig, const std::optional<SkewWatch::Report>& report, Requester& requester) const;

  NodeStats stats_;
  CameraInputs inputs_;
  uint32_t node_id_ = 0;
};

}  // namespace lf
