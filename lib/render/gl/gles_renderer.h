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

struct ReadbackBuffer {
  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  int pitch = 0;               // pixels from one row to the next
  uint16_t* pixels = nullptr;  // layout as in SumPlanes; kRgb: R, G, B, 0 for each pixel; kI420: Y
  uint16_t* chroma = nullptr;  // kI420: Cb, Cr of each 2x2 block; rows are contiguous
  Rect missing_rect;           // region that may have missing weight
  int missing_pitch = 0;
  uint16_t* lost = nullptr;      // missing weight in missing_rect
  std::shared_ptr<void> memory;  // owns all the arrays; the renderer must outlive it

  // Copies rows [y0, y1), with the contract of SumRenderer::render_rows(). Returns true if any weight is missing in
  // these rows.
  bool copy_rows(int y0, int y1, const SumPlanes& out) const;
};

struct GlesJob {
  // `rect` bounds the task's slots. Its edges are even for kI420 or `stays`, except at the view's right and lower edge.
  // `sources` are the images that the task was made from.
  const simd::SumTask* task = nullptr;
  std::span<const Source> sources;
  Rect rect;
  bool stays = false;  // keep the sum on the GPU; a shared_ptr must own the renderer

  ReadbackBuffer drawn;            // result unless `stays`
  std::shared_ptr<GpuSum> stayed;  // result if `stays`
  std::string why_not;             // reason for failure; empty: success
};

// Input of the photo-consistency sums (focus/photo_consistency.h). The view has a focal map and one pixel for each map
// node. Its cameras are sampled through several surfaces.
struct ConsistencyTask {
  const simd::SumTask& sums;                       // always blended by the mesh
  std::span<const std::vector<uint8_t>> surfaces;  // inverse-distance levels of the map nodes, for each surface
  // for each slot: side of the box over which luma is averaged, in pixels; even
  std::span<const int> boxes;
};

// Photo-consistency sums that were read back from the GPU, for the nodes in `rect`.
struct ConsistencyReadback {
  Rect rect;
  int pitch = 0;  // nodes from one row to the next
  const uint16_t* values = nullptr;
  std::shared_ptr<void> memory;  // owns `values`; the renderer must outlive it

  // Returns row y, from rect.x0 on, of the surface's weight (kind 0), luma (1) or squared luma (2) sums.
  const uint16_t* row(size_t surface, int kind, int y) const {
    return values + ((3 * surface + kind) * rect.height() + static_cast<size_t>(y - rect.y0)) * pitch;
  }
};

// Renders sums on a GPU with compute shaders. Positions, weights and samples are computed in float, and sums are
// rounded once. The CPU determines the face of each pixel in double. It also renders the pixels with samples that float
// cannot decide to be missing or not, or cannot locate accurately. Every view has the error bounds of SumRenderer.
class GlesRenderer : public std::enable_shared_from_this<GlesRenderer> {
 public:
  // Returns null, with the reason in `why`, if no GPU is suitable (Drivers::kAny: no driver at all).
  static std::unique_ptr<GlesRenderer> create(Context::Drivers drivers, std::string& why);
  // Creates a renderer in an external context. Returns null, with the reason in `why`, if the context is unsuitable.
  static std::unique_ptr<GlesRenderer> create_in(Context::External foreign, Context::Drivers drivers, std::string& why);
  ~GlesRenderer();

  const std::string& device() const { return context_->device(); }
  bool is_software() const { return context_->is_software(); }

  // Renders sums, or sets their why_not if the GPU cannot render them (sizes beyond its limits, lost context).
  //
  // Successive sums share a pass if their images fit in one atlas, they have the same family, all or none have focal
  // maps, their cameras are of the same kinds, and no view is distorted. An image that several sums need is uploaded
  // once. A sum's result does not depend on its pass.
  //
  // Thread-safe; may be called from inside the `parallel` jobs of another draw(). Images are copied concurrently with
  // the rendering of other sums. Rendering is serialized.
  void draw(std::span<GlesJob> orders, const ParallelFor& parallel);

  // Adds sums that are on the GPU, see BlockSums::add(). Returns null, with the reason in `why`, on failure.
  std::shared_ptr<BlockSum> add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view, std::string& why);

  // Computes the photo-consistency sums of a task's slots into `out`. `part` returns the region of a source's image
  // that is sampled. The result is bit-identical to the CPU's, with these exceptions: float rounding can move a
  // position to the next 1/256 pixel or a weight to the next step of PhotoConsistency (at most one level of luma), and
  // float may be unable to decide whether a camera sees a node. Threading and errors are as for draw().
  bool draw_consistency(const ConsistencyTask& task, std::span<const Source> sources,
                        const std::function<Rect(const Source&)>& part, const ParallelFor& parallel,
                        ConsistencyReadback& out, std::string& why);

  // Contexts that share textures with this renderer's context; 0: none.
  ShareGroup group() const { return context_->group(); }
  // Runs a job on the GPU's objects, with the context current and exclusive use of `scratch`. Returns false if the job
  // returns false, the context is lost, or OpenGL reports an error. Thread-safe.
  bool work(const std::function<bool(Programs& programs, Buffer& scratch)>& job);

  // Call from such a job when the GPU has timed out. The GPU is then never used again.
  void mark_lost() { lost_ = true; }

  // True if the GPU is lost: no draw() will succeed again.
  bool is_lost() const { return lost_; }
  // Simulates the loss of the context by its driver. Thread-safe.
  void lose() { context_->lose(); }
  // GPU time of the latest draw() or draw_consistency() without transfers, in nanoseconds; 0: not measured
  // (GL_EXT_disjoint_timer_query is missing).
  uint64_t drawn_ns() const { return drawn_ns_; }
  // Number of pixels and chroma samples that the latest draw() left to the CPU.
  size_t fixed_up() const { return fixed_up_; }
  size_t passes() const { return passes_; }

 private:
  struct Objects;
  explicit GlesRenderer(std::unique_ptr<Context> context);
  static std::unique_ptr<GlesRenderer> create_on(std::unique_ptr<Context> context, std::string& why);
  bool prepare(std::string& why);
  size_t together(std::span<const GlesJob> orders) const;
  void draw_pass(std::span<GlesJob> orders, const ParallelFor& parallel);
  bool fits(std::span<const GlesView> views, std::string& why) const;
  bool finish(std::span<GlesJob> orders, std::span<SumReadback> readings, const ParallelFor& parallel,
              std::string& why);
  template <class Begin, class Read>
  bool draw_now(std::span<const GlesView> views, ImageAtlas& atlas, const ParallelFor& parallel, const Begin& begin,
                const Read& read, std::string& why);

  std::unique_ptr<Context> context_;
  std::unique_ptr<Objects> objects_;  // owned by the context
  std::atomic<bool> lost_ = false;
  std::atomic<size_t> fixed_up_ = 0, passes_ = 0;
  std::atomic<uint64_t> drawn_ns_ = 0;
};

// Computes in double the samples that the GPU left undecided: pixels with missing weight kUndecided and chroma samples
// kChromaUndecided. Returns their number. Downloads images from the GPU when needed. `sources` are the images that the
// task was made from.
size_t cpu_fixup(const simd::SumTask& task, std::span<const Source> sources, ReadbackBuffer& sum);

size_t undecided_samples(const ReadbackBuffer& sum);

}  // namespace lf::gl
