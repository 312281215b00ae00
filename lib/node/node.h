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
#include "focus/exposure_compensation.h"
#include "node/camera_inputs.h"
#include "node/depth_tracker.h"
#include "node/frame_sources.h"
#include "node/frame_timing.h"
#include "node/request_renderer.h"
#include "render/sum_renderer.h"
#include "rig/mesh.h"
#include "wire/answer_codec.h"
#include "wire/command_codec.h"

namespace lf {

// Counters of a node, and durations of its processing steps. Thread-safe.
struct NodeStats {
  std::atomic<uint64_t> requests{0}, bad_requests{0}, rig_mismatches{0}, answers{0}, drawn{0}, together{0},
      gpu_frames{0}, fragments{0}, bytes{0}, skipped{0}, superseded{0}, missing_frames{0}, stale_frames{0},
      damaged_frames{0};
  std::atomic<uint64_t> max_skew_ns{0};

  // Durations of the steps of one answer, nanoseconds.
  struct Stages {
    uint64_t wait = 0;
    uint64_t decode = 0;
    uint64_t render = 0;  // includes planning
    uint64_t encode = 0;
  };
  void add(const Stages& stages);
  void set_gains(std::span<const Source> cameras, const ExposureCompensation& gains);
  // Returns all values by name. Each duration appears as the latest value and as percentiles over the latest answers,
  // in nanoseconds.
  std::vector<std::pair<std::string, uint64_t>> all() const;
  std::map<uint32_t, float> gains() const;

 private:
  mutable std::mutex mutex_;
  Stages latest_;
  std::map<uint32_t, float> gains_;
  Percentiles wait_, decode_, render_, encode_, total_;
};

// Predicts how long an answer will take, so that the node can skip requests with answers that would be too late. The
// prediction follows from the planned work, in pixels, and from the durations of earlier answers.
//
// Each skipped request lowers the prediction. Otherwise, a node that was slow for a minute would skip all requests
// forever, because only answers correct the prediction. Call done() and skipped() from one thread; nanoseconds() may be
// called from any thread.
class WorkEstimate {
 public:
  // The work that every answer needs regardless of its size (finding frames, planning, waking threads), as a number of
  // pixels.
  static constexpr double kAnyAnswer = 65536;

  // Returns the predicted duration of an answer with `work` pixels, or 0 before the first call of done().
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

// Answers view requests with the images of the cameras of one machine. An answer contains the weighted sum of these
// images, warped into the view. A compositor adds the answers of all nodes to a picture. Several threads may call
// answer() at the same time, one for each client.
class Node {
 public:
  NodeStats& stats() { return stats_; }
  CameraInputs& inputs() { return inputs_; }
  // Forgets the depths of the cameras. Call this when the cameras stop.
  void forget_depths() { depths_.clear(); }
  void set_node_id(uint32_t id) { node_id_ = id; }  // only while stopped

  // The state that the node keeps for each view of a client between requests, such as the mesh and the exposure gains.
  struct ClientState {
    std::shared_ptr<const Rig> rig;
    MeshCache mesh;
    SkewMonitor watch;
    RequestRenderer renderer;
    WorkEstimate estimate;
    std::shared_ptr<DepthTracker::TrackedView> tracked;
    CameraSet gone;              // cameras without a frame for the latest request; see make_plan()
    uint64_t warned_of = 0;      // hash of the rig that the client was last warned about
    uint64_t warned_behind = 0;  // time of the latest warning about late frames, now_ns(); 0: none yet
    // Several clients may share these two members. While *cancelled is true, answers do not wait (see cancel()).
    // `images` is reusable memory for processed images.
    std::shared_ptr<std::atomic<bool>> cancelled = std::make_shared<std::atomic<bool>>(false);
    std::shared_ptr<KeptImages> images = std::make_shared<KeptImages>();
  };
  // Stops or resumes waiting: while `cancelled` is true, answers to this client do not wait for frames, so that the
  // client can be stopped quickly. May be called from any thread.
  void cancel(ClientState& client, bool cancelled);
  struct Options {
    RenderOptions render;     // without colours; these come from the rig
    bool live = false;        // requests for live cameras, which never wait
    uint64_t base_time = 0;   // clock time of the pipeline's running time 0
    int64_t wall_offset = 0;  // time of day (used by live requests) minus clock time, nanoseconds
    uint64_t max_skew = 0;    // largest allowed capture-time error of a live frame, nanoseconds; 0: unlimited
  };
  struct Reply {
    RenderedAnswer answer;
    NodeStats::Stages stages;
    std::string warning;  // text for the user, or ""
  };
  // Answers requests of a client: waits for the frames of the requested time (see CameraFrames::find()), renders the
  // contributions of this node's cameras, and encodes the answers. Never throws. If the requests cannot be served, for
  // example because the client uses another rig file, the answers have no image, and Reply::warning has the reason.
  //
  // Several requests, for example for the two eyes of a stereo pair, get the same answers as with separate calls.
  // can_batch_requests() must be true for every two of these requests. The function calls `memory` once for each
  // answer, to get a buffer that the answer may overwrite.
  using AllocateMemory = std::function<ByteBuffer()>;
  std::vector<Reply> answer(std::span<const wire::AnyRequest* const> requests, ClientState& client,
                            const Options& options, const AllocateMemory& memory);
  // Returns true if both requests are views of the same set and have the same capture time, so that they use the same
  // images. The first request of a set may also measure the brightness of the cameras, but later requests may not.
  static bool can_batch_requests(const wire::AnyRequest& a, const wire::AnyRequest& b);

  // Returns an empty answer, for a client that no longer needs the picture.
  Reply skip(const wire::AnyRequest& request);

 private:
  using Array = CameraInputs::Array;
  wire::AnswerHeader header_of(const wire::AnyRequest& request, const Array& array) const;
  struct Planned {
    std::unique_ptr<const RequestPlan> plan;
    CameraSet gone;
    uint64_t ns = 0;  // nanoseconds
  };
  std::vector<Reply> render(std::span<const wire::AnyRequest* const> requests, const Array& array, ClientState& client,
                            const Options& options, std::span<const wire::AnswerHeader> headers,
                            const AllocateMemory& memory, uint64_t waited);
  static Planned make_plan(const ViewRequest& view, const Array& array, ClientState& client,
                           const std::vector<CameraIndex>& own, const ParallelFor& parallel, FrameLookup& frames);
  static std::vector<Planned> make_plans(std::span<const wire::AnyRequest* const> requests, const Array& array,
                                         ClientState& client, const std::vector<CameraIndex>& own, bool live,
                                         const ParallelFor& parallel, FrameLookup& frames);
  static std::vector<CameraIndex> cameras_of(const std::vector<Planned>& plans);
  static FrameSources sources_of(const std::vector<Planned>& plans, const Array& array, const RenderOptions& options,
                                 FrameLookup& frames);
  void decode(FrameSources& sources, const Array& array, PixelFamily family, const ParallelFor& parallel);
  uint64_t describe(const Planned& planned, const FrameSources& sources, const FrameLookup& frames,
                    const std::vector<CameraIndex>& own, const CameraSet& absent, wire::AnswerHeader& header);
  void add_measured(const Array& array, bool live, FrameLookup& frames, ClientState& client,
                    const ParallelFor& parallel, RequestRenderer::Work& work);
  std::string skew_warning(const Rig& rig, const std::optional<SkewMonitor::Report>& report, ClientState& client) const;

  NodeStats stats_;
  CameraInputs inputs_;
  DepthTracker depths_{inputs_};
  uint32_t node_id_ = 0;
};

// The states of all views of one client, which may show several views (for example, a stereo pair). Thread-safe, but
// all answers to one view must be made in the same thread.
class ClientStates {
 public:
  // Number of views that may be in use at the same time. The class keeps twice as many states, and deletes the least
  // recently used state if there are more.
  static constexpr size_t kMaxViews = 64;

  // All views share the cancellation flag and the image memory of `common`.
  explicit ClientStates(const Node::ClientState& common) : cancelled_(common.cancelled), images_(common.images) {}
  // Returns the state of a view. A new view starts with the exposure gains of the most recently used view. Keep the
  // pointer while answering, because another thread may delete the state of the view meanwhile.
  std::shared_ptr<Node::ClientState> of(uint32_t view_id);
  // Returns the predicted duration of an answer with this much planned work, or 0 if unknown.
  uint64_t nanoseconds(uint32_t view_id, double work) const;
  void clear();

 private:
  struct View {
    std::shared_ptr<Node::ClientState> client;
    uint64_t used = 0;
  };
  const std::shared_ptr<std::atomic<bool>> cancelled_;
  const std::shared_ptr<KeptImages> images_;
  mutable std::mutex mutex_;
  std::map<uint32_t, View> views_;
  uint64_t uses_ = 0;
};

}  // namespace lf
