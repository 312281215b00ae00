// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "render/gl/context.h"
#include "render/simd/sum_task.h"
#include "render/sum_planes.h"
#include "render/sum_renderer.h"

namespace lf::gl {

struct BlockSum;
class Buffer;
class GpuSum;
struct GlesView;
class ImageAtlas;
class Programs;
struct SumReadback;

// A sum that has been read back from the GPU, in 16-bit samples as in SumPlanes.
struct ReadbackBuffer {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  int pitch = 0;               // pixels from one row to the next
  uint16_t* pixels = nullptr;  // layout as in SumPlanes; kRgb: R, G, B, 0 for each pixel; kI420: Y
  uint16_t* chroma = nullptr;  // kI420: Cb, Cr of each 2x2 block, without gaps between rows
  Rect missing_rect;           // all missing weight is inside
  int missing_pitch = 0;
  uint16_t* lost = nullptr;
  std::shared_ptr<void> memory;  // owns all the arrays; the renderer must outlive it

  // Copies rows [y0, y1) in the same way as SumRenderer::render_rows(). Returns true if any weight is missing in these
  // rows.
  bool copy_rows(int y0, int y1, const SumPlanes& out) const;
};

// Input and result of rendering one sum, for GlesRenderer::draw().
struct GlesJob {
  // `rect` is the part of the view to render. It contains the rectangles of all slots (cameras of the task). For kI420,
  // or if `keep_on_gpu`, its edges are even, except at the view's right and lower edge. `sources` are the images that
  // the task was made from.
  const simd::SumTask* task = nullptr;
  std::span<const Source> sources;
  Rect rect;
  bool keep_on_gpu = false;  // keep the sum on the GPU; a shared_ptr must then own the renderer

  ReadbackBuffer drawn;              // result if not `keep_on_gpu`
  std::shared_ptr<GpuSum> kept_sum;  // result if `keep_on_gpu`
  std::string why_not;             // reason for failure; empty on success
};

// Input of GlesRenderer::draw_consistency(): the depth hypotheses to test, and the view. The results are
// photo-consistency sums (focus/photo_consistency.h), which show how well the cameras agree about the depths. The view
// has a focal map and one pixel for each node of the map.
struct ConsistencyTask {
  const simd::SumTask& sums;                       // always blended by the mesh
  std::span<const std::vector<uint8_t>> surfaces;  // for each hypothesis, the level of each node
  // for each slot, the side of the box over which luma is averaged; even, pixels
  std::span<const int> boxes;
};

// Photo-consistency sums of the nodes in `rect`, read back from the GPU.
struct ConsistencyReadback {
  Rect rect;
  int pitch = 0;  // nodes from one row to the next
  const uint16_t* values = nullptr;
  std::shared_ptr<void> memory;  // owns `values`; the renderer must outlive it

  // Returns row y, from rect.x0 on, of one of the sums for a surface: weight (kind 0), luma (1) or squared luma (2).
  const uint16_t* row(size_t surface, int kind, int y) const {
    return values + ((3 * surface + kind) * rect.height() + static_cast<size_t>(y - rect.y0)) * pitch;
  }
};

// Renders sums on a GPU with compute shaders. Positions, weights and samples are computed in float, and each sum is
// rounded once. The CPU helps in double precision where float is not precise enough, so that every view has the error
// bounds of SumRenderer. The CPU determines which face of the mesh owns each pixel. It also renders a pixel if float
// cannot locate a sample accurately, or cannot decide whether the camera sees the point.
class GlesRenderer : public std::enable_shared_from_this<GlesRenderer> {
 public:
  // Creates a renderer on the best GPU of this machine. If no GPU is suitable (or no driver at all, with
  // Drivers::kAny), returns null and sets `why` to the reason.
  static std::unique_ptr<GlesRenderer> create(Context::Drivers drivers, std::string& why);
  // Creates a renderer in an OpenGL context of the application. If the context is unsuitable, returns null and sets
  // `why` to the reason.
  static std::unique_ptr<GlesRenderer> create_in(Context::External foreign, Context::Drivers drivers, std::string& why);
  ~GlesRenderer();

  const std::string& device() const { return context_->device(); }
  bool is_software() const { return context_->is_software(); }

  // Renders sums. If the GPU cannot render a sum, because a size is beyond its limits or the context is lost, sets the
  // sum's why_not.
  //
  // Successive sums share a pass if the same program and texture can render these sums. Their images must fit in one
  // atlas and have the same family. All or none of the views must have focal maps, their cameras must be of the same
  // kinds, and no view may be distorted. An image that several sums need is uploaded once. The result of a sum does not
  // depend on its pass.
  //
  // Thread-safe, also inside the `parallel` jobs of another draw(). Images are copied while other sums are rendered,
  // but only one pass is rendered at a time.
  void draw(std::span<GlesJob> orders, const ParallelFor& parallel);

  // Adds several sums that are on the GPU; see BlockSums::add(). Throws Error like work().
  std::shared_ptr<BlockSum> add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view);

  // Computes the photo-consistency sums of a task into `out`. `part` returns the region of a source's image that is
  // sampled. The result is bit-identical to the CPU's, with these exceptions. Float rounding can move a position to the
  // next 1/256 pixel, or a weight to the next step of PhotoConsistency (at most one level of luma). Also, float may be
  // unable to decide whether a camera sees a node. If the GPU cannot compute the sums, returns false and sets `why` to
  // the reason. Threads are as for draw().
  bool draw_consistency(const ConsistencyTask& task, std::span<const Source> sources,
                        const std::function<Rect(const Source&)>& part, const ParallelFor& parallel,
                        ConsistencyReadback& out, std::string& why);

  // Returns the group of contexts that share textures with this renderer's context, or 0.
  ShareGroup group() const { return context_->group(); }
  // Runs a job on the GPU's objects while the context is current. The job has exclusive use of `scratch`. Throws Error
  // if the context is lost, if OpenGL reports an error, or if the job does. After a GpuTimeout, the GPU is never used
  // again. Thread-safe.
  void work(const std::function<void(Programs& programs, Buffer& scratch)>& job);

  // Returns true if the GPU is lost, so that no draw() will succeed again.
  bool is_lost() const { return lost_; }
  // Simulates that the driver loses the context, for tests. Thread-safe.
  void lose() { context_->lose(); }
  // Returns the GPU time of the latest draw() or draw_consistency() without transfers, in nanoseconds. Returns 0 if the
  // driver cannot measure it, because GL_EXT_disjoint_timer_query is missing.
  uint64_t drawn_ns() const { return drawn_ns_; }
  // Returns the number of pixels and chroma samples that the latest draw() left to the CPU.
  size_t fixed_up() const { return fixed_up_; }
  size_t passes() const { return passes_; }

 private:
  struct Objects;
  explicit GlesRenderer(std::unique_ptr<Context> context);
  static std::unique_ptr<GlesRenderer> create_on(std::unique_ptr<Context> context, std::string& why);
  void in_context(const std::function<void()>& job);
  size_t together(std::span<const GlesJob> orders) const;
  void draw_pass(std::span<GlesJob> orders, const ParallelFor& parallel);
  void check_size(std::span<const GlesView> views) const;
  void finish(std::span<GlesJob> orders, std::span<SumReadback> readings, const ParallelFor& parallel);
  void draw_now(std::span<const GlesView> views, ImageAtlas& atlas, const ParallelFor& parallel,
                const std::function<void()>& begin, const std::function<void()>& read);

  std::unique_ptr<Context> context_;
  std::unique_ptr<Objects> objects_;  // its objects belong to the context
  std::atomic<bool> lost_ = false;
  std::atomic<size_t> fixed_up_ = 0, passes_ = 0;
  std::atomic<uint64_t> drawn_ns_ = 0;
};

// Completes a sum that was read back: computes in double precision the samples that the GPU left undecided, because
// float could not tell whether a camera sees the point. The GPU marks such pixels with the missing weight kUndecided,
// and such chroma samples with kChromaUndecided. Returns the number of these samples. `sources` are the images that the
// task was made from; images on the GPU are downloaded when needed.
size_t cpu_fixup(const simd::SumTask& task, std::span<const Source> sources, ReadbackBuffer& sum);

// Returns the number of samples that cpu_fixup() would compute.
size_t undecided_samples(const ReadbackBuffer& sum);

}  // namespace lf::gl
