// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/maths.h"
#include "base/worker_pool.h"
#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"
#include "render/gl/sum_shader.h"
#include "render/simd/sum_task.h"

namespace lf::gl {

// Returns the properties of the shader program that can render the task. The caller must set its output.
SumProgram program_of(const simd::SumTask& task);
// Returns the number of rows in the tables of the task; see FaceTexel. There is one row for each face of the plan and,
// if the view has a WeightGrid, another row for each slot.
size_t table_rows(const simd::SumTask& task);
// Returns an upper bound of the number of 32-bit words for the WeightGrid cells in `rect`; see make_cells().
size_t most_of_cells(const simd::SumTask& task, const Rect& rect);

// Makes the tables that the compute shaders read for the views of a pass (sum_shader.h). They contain the face that
// owns each pixel, the weights of WeightGrid cells, and the geometry of each face and its cameras.
class PassTables {
 public:
  // Makes the tables. `atlas` must have laid out the images of the views. `boxes` are for photo-consistency sums of a
  // single view; see kCornerPerFrom. There is one for each slot of the view. Needs no context.
  void make(std::span<const GlesView> views, const ImageAtlas& atlas, const ParallelFor& parallel,
            std::span<const int> boxes = {});
  // Sets the words of kViewResult, which contain the location of the view's sum.
  void set_result(size_t view, const std::array<uint32_t, 6>& words);

  struct Buffers {
    Buffer runs{Buffer::Use::kTables}, tables{Buffer::Use::kTables};
  };
  // Uploads the tables and binds the buffers. The context must be current.
  void send(Buffers& to) const;

 private:
  struct View {
    std::vector<uint32_t> runs, cells;
    std::vector<float> tables;
  };
  std::vector<uint32_t> heads_;  // kViewWords for each view
  std::vector<View> views_;
};

// The CPU memory of one pass: the images and tables of the views that the GPU renders together.
struct Pass {
  ImageAtlas atlas;
  PassTables numbers;
};

// A pool of passes, so that their memory is reused. Thread-safe.
class Passes {
 public:
  // Returns a pass in exclusive use. This object must outlive the result. Needs no context.
  std::shared_ptr<Pass> take() {
    const std::lock_guard lock(mutex_);
    auto pass = free_.empty() ? std::make_unique<Pass>() : std::move(free_.back());
    if (!free_.empty()) free_.pop_back();
    return {pass.release(), [this](Pass* used) {
              const std::lock_guard giving_back(mutex_);
              free_.emplace_back(used);
            }};
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Pass>> free_;
};

// The textures of a pass: levels of focal maps, lines of sight of distorted views, and camera images. The context must
// be current for all calls.
class ViewTextures {
 public:
  // Uploads and binds the textures for the views of a pass. There can be several views only if no view has a texture of
  // lines of sight. `atlas` must be filled, and must live until the result has been read. Throws Error if images on the
  // GPU are unavailable.
  void upload(std::span<const GlesView> views, ImageAtlas& atlas, Programs& programs);
  // Sets the uniforms of the chroma offsets in the atlas, for the program in use.
  void describe_images(const Program& program) const;

 private:
  void upload_levels(std::span<const GlesView> views);
  void upload_rays(const Rays& rays, const Rect& rect, bool centres);

  const ImageAtlas* atlas_ = nullptr;
  TextureStager pieces_;
  UploadTexture levels_;
  Texture rays_, centre_rays_;
  std::vector<float> ray_memory_;
};

}  // namespace lf::gl
