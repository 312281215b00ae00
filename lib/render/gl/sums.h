// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/maths.h"
#include "render/gl/gles_renderer.h"
#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/gl/passes.h"

namespace lf::gl {

// A sum in GPU memory, in the layout that the shader kBlocks of sum_shader-inl.h writes. The context must be current
// for all calls.
struct BlockSum {
  // The offsets of the parts of the sum in `words`, in 32-bit words. The parts missing_rows and undecided_rows have one
  // word for each row of 2x2 blocks, so that a reader can skip rows without missing weight or undecided samples. A row
  // with missing weight or undecided samples, respectively, is marked with the number of the draw. All further parts
  // are samples.
  struct Parts {
    uint32_t missing_rows = 0, undecided_rows = 0, pixels = 0, chroma = 0, lost = 0, end = 0;
  };

  PixelFamily family = PixelFamily::kNone;
  Rect rect;
  Parts parts;
  // number of the draw; rows that are marked with another number have no missing weight
  uint32_t draw = 0;
  std::shared_ptr<ComputeBuffer> words;  // shared by all sums of the pass

  // Copies the rows of missing_rect back to the GPU.
  void write_back(const ReadbackBuffer& from);
};

struct SumReadback {
  BlockSum* sum = nullptr;
  // Receives the sum. The caller sets family and rect to the sum's values.
  ReadbackBuffer* out = nullptr;
  // If true, reads only the rows with undecided samples, and sets missing_rect accordingly.
  bool only_undecided = false;
  bool any_missing = false;  // result
};
// Waits for the sums of one pass and copies them to memory. Throws GpuTimeout. The context must be current.
void read_sums(std::span<SumReadback> sums);

// Renders sums on the GPU, with one shader invocation for each block of 2x2 pixels, because these share a chroma
// sample. The context must be current for all calls except fits().
class BlockSums {
 public:
  BlockSums() : most_words_(ComputeBuffer::most_words()) {}
  // Returns true if shaders can write the sums of these views and read their tables, given the limits of the driver.
  bool fits(std::span<const GlesView> views) const;
  // Starts the sums of views that share one program. `numbers` and `textures` contain their input. Throws Error if the
  // GPU cannot render the sums.
  void begin(std::span<const GlesView> views, PassTables& numbers, const ViewTextures& textures, Programs& programs,
             GpuTimer& stopwatch);
  // Starts adding sums of the same family and view into a sum of the whole view, with saturation. Pixels outside all
  // sums become 0. Sums may come from another renderer in the same share group, once they are complete. The caller must
  // hold the sums until the GPU has finished. Throws Error if the GPU cannot add these sums.
  std::shared_ptr<BlockSum> add(std::span<const std::shared_ptr<BlockSum>> sums, const Rect& view, Programs& programs);
  // Returns the sums that were started last. The memory of a sum is not reused while a caller holds the sum.
  std::span<const std::shared_ptr<BlockSum>> latest() const { return latest_; }

 private:
  std::shared_ptr<ComputeBuffer> next();

  const size_t most_words_;
  PassTables::Buffers numbers_;
  std::vector<std::shared_ptr<ComputeBuffer>> words_;  // in use, or free for reuse
  std::vector<std::shared_ptr<BlockSum>> latest_;
  uint32_t draw_ = 0;
};

// Computes photo-consistency sums (focus/photo_consistency.h) with a compute shader. The context must be current for
// all calls.
class ConsistencySums {
 public:
  // Starts the sums in `rect`, which contains the rectangles of all slots. `numbers` and `textures` contain the view's
  // input. Throws Error if the GPU cannot render the sums.
  void begin(const ConsistencyTask& task, const Rect& rect, const PassTables& numbers, const ViewTextures& textures,
             Programs& programs, GpuTimer& stopwatch);
  // Waits for the result and copies the sums. Throws GpuTimeout.
  void read(ConsistencyReadback& out);

 private:
  void upload_surfaces(const ConsistencyTask& task, const Rect& rect);

  PassTables::Buffers numbers_;
  Buffer surfaces_{Buffer::Use::kTables};
  ComputeBuffer result_;
  std::vector<uint8_t> surface_memory_;
  size_t words_ = 0;
};

}  // namespace lf::gl
