// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/maths.h"
#include "base/memory.h"
#include "base/worker_pool.h"
#include "focus/camera_gains.h"
#include "node/camera_inputs.h"
#include "node/frame_sources.h"
#include "node/frame_timing.h"
#include "node/request_renderer.h"
#include "render/sum_renderer.h"
#include "rig/mesh.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"

namespace lf {

// What a node has done and how long its stages took. Thread-safe.
struct NodeStats {
  std::atomic<uint64_t> requests{0}, bad_requests{0}, rig_mismatches{0}, answers{0}, drawn{0}, together{0},
      card_frames{0}, fragments{0}, bytes{0}, skipped{0}, superseded{0}, missing_frames{0}, stale_frames{0},
      damaged_frames{0};
  std::atomic<uint64_t> max_skew_ns{0};

  // How long an answer took from the request's arrival to the answer's departure, nanoseconds.
  struct Stages {
    uint64_t wait = 0;    // waiting for frames that belong to the request's time
    uint64_t decode = 0;  // decoding regions of JPEG frames
    uint64_t render = 0;  // rendering, with planning
    uint64_t encode = 0;
  };
  void add(const Stages& stages);
  // What the cameras of a request were divided by.
  void set_gains(std::span<const Source> cameras, const CameraGains& gains);
  // All numbers by name; stages, nanoseconds, as the latest answer's and as percentiles over the latest answers.
  std::vector<std::pair<std::string, uint64_t>> all() const;
  // The gains that images were divided by, by the camera's id.
  std::map<uint32_t, float> gains() const;

 private:
  mutable std::mutex mutex_;
  Stages latest_;
  std::map<uint32_t, float> gains_;  // gains by the camera's id
  Percentiles wait_, decode_, render_, encode_, total_;
};

// How long an answer takes, by what those before it have taken for their planned work. What it knows fades with each
// answer that was not made because of it, so that a slow minute does not end all answers. done() and skipped() from one
// thread, nanoseconds() from any.
class WorkEstimate {
 public:
  // Of work whose unit is a pixel's: what any answer takes beside, to look for frames, to plan and to wake threads.
  // With it what few pixels took tells little of many.
  static constexpr double kAnyAnswer = 65536;

  // Nanoseconds that an answer will take; 0: nothing is known.
  uint64_t nanoseconds(double work) const { return static_cast<uint64_t>(per_work_ * work); }
  void done(double work, uint64_t took) {
    if (work <= 0) return;
    const double now = static_cast<double>(took) / work;
    const double before = per_work_;
    per_work_ = before > 0 ? before + kShare * (now - before) : now;
  }
  void skipped() { per_work_ = per_work_ * (1 - kShare); }

 private:
  static constexpr double kShare = 1.0 / 8;
  std::atomic<double> per_work_ = 0;
};

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
    RequestRenderer renderer;
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
  struct Options {
    RenderOptions render;    // without colours, which the cameras' rig has
    bool live = false;       // the request is live: nothing is waited for
    uint64_t base_time = 0;  // clock time of the pipeline's running time 0
    int64_t day_offset = 0;  // time of day, which live requests name, less clock time
    uint64_t max_skew = 0;   // nanoseconds that a live camera's frame may be from the target time; 0: any
  };
  struct Reply {
    RenderedAnswer answer;
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
  struct Planned {
    std::unique_ptr<const RequestPlan> plan;
    CameraSet gone;   // left out, see make_plan()
    uint64_t ns = 0;  // nanoseconds that planning took
  };
  std::vector<Reply> render(std::span<const wire::AnyRequest* const> requests, const Array& array, Requester& requester,
                            const Options& options, std::span<const wire::AnswerHeader> headers,
                            const TakeMemory& memory, uint64_t waited);
  static Planned make_plan(const ViewRequest& view, const Array& array, Requester& requester,
                           const std::vector<CameraIndex>& own, const ParallelFor& parallel, FoundFrames& frames);
  static std::vector<Planned> make_plans(std::span<const wire::AnyRequest* const> requests, const Array& array,
                                         Requester& requester, const std::vector<CameraIndex>& own, bool live,
                                         const ParallelFor& parallel, FoundFrames& frames);
  static std::vector<CameraIndex> cameras_of(const std::vector<Planned>& plans);
  static FrameSources sources_of(const std::vector<Planned>& plans, const Array& array, const RenderOptions& options,
                                 FoundFrames& frames);
  void decode(FrameSources& sources, const Array& array, PixelFamily family, const ParallelFor& parallel);
  uint64_t describe(const Planned& planned, const FrameSources& sources, const FoundFrames& frames,
                    const std::vector<CameraIndex>& own, const CameraSet& absent, wire::AnswerHeader& header);
  std::string skew_warning(const Rig& rig, const std::optional<SkewWatch::Report>& report, Requester& requester) const;

  NodeStats stats_;
  CameraInputs inputs_;
  uint32_t node_id_ = 0;
};

// What a node keeps of each view that one requester asks for. Of a view that nothing is known of yet nothing is
// expected: what others take tells nothing of it, as they may look where there is nothing to be seen. Thread-safe; a
// view's answers are made in one thread.
class ViewRequesters {
 public:
  // So many views may be in use at once; of as many more the one that was asked for longest ago is forgotten.
  static constexpr size_t kMostViews = 64;

  // What these views have in common is that of `common`.
  explicit ViewRequesters(const Node::Requester& common) : cancelled_(common.cancelled), images_(common.images) {}
  // What is kept of a view. A new one begins with what was learned of the view that was asked for last. Who makes an
  // answer of it holds it: the view may be forgotten meanwhile.
  std::shared_ptr<Node::Requester> of(uint32_t view_id);
  // How many nanoseconds its answer will take that has so much planned work.
  uint64_t nanoseconds(uint32_t view_id, double work) const;
  void clear();

 private:
  struct View {
    std::shared_ptr<Node::Requester> requester;
    uint64_t used = 0;
  };
  const std::shared_ptr<std::atomic<bool>> cancelled_;
  const std::shared_ptr<KeptImages> images_;
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
  uint64_t uses_ = 0;
};

}  // namespace lf
