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

// Returns the program that renders the task's faces. The caller sets its output.
SumProgram program_of(const simd::SumTask& task);
// Number of rows of face_texels() in the tables of the task: one per face of the plan, or one per slot if the view is
// blended by a WeightGrid.
size_t table_rows(const simd::SumTask& task);
// Upper bound of the number of words for the WeightGrid cells in `rect`.
size_t most_of_cells(const simd::SumTask& task, const Rect& rect);

// Input tables of the compute shaders for the views of a pass: the faces of pixels or the weights of cells, and the
// face tables that sum_shader.h defines.
class PassTables {
 public:
  // Makes the tables of views; `atlas` has laid out their images. Needs no context. `boxes`: for each slot of the only
  // view, see kCornerPerFrom.
  void make(std::span<const GlesView> views, const ImageAtlas& atlas, const ParallelFor& parallel,
            std::span<const int> boxes = {});
  // Sets the words of kViewResult: the location of the view's sum.
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

// Data of a pass that is prepared without the context.
struct Pass {
  ImageAtlas atlas;
  PassTables numbers;
};

// Pool of passes, so that their memory is reused.
class Passes {
 public:
  // Exclusive use of one pass during the lease's lifetime. Needs no context.
  class Lease {
   public:
    explicit Lease(Passes& from) : from_(from), pass_(from.take()) {}
    ~Lease() { from_.give_back(std::move(pass_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Pass* operator->() const { return pass_.get(); }

   private:
    Passes& from_;
    std::unique_ptr<Pass> pass_;
  };

 private:
  std::unique_ptr<Pass> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Pass>();
    auto pass = std::move(free_.back());
    free_.pop_back();
    return pass;
  }
  void give_back(std::unique_ptr<Pass> pass) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(pass));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Pass>> free_;
};

// The textures of a pass: levels of focal maps, lines of sight of distorted views, and camera images. The context must
// be current for all calls.
class ViewTextures {
 public:
  // Uploads and binds the textures for the views of a pass: one view, or several without a texture of lines of sight.
  // `atlas` is filled, and must live until the result has been read. Returns false, with the reason in `why`, if images
  // on the GPU are unavailable.
  bool upload(std::span<const GlesView> views, ImageAtlas& atlas, Programs& programs, std::string& why);
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
