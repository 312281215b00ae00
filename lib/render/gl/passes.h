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

// What a program for all of a task's faces has to have; its output is to be set.
SumProgram program_of(const simd::SumTask& task);
// How many rows of face_texels() it draws a task by: one for each face of the plan, or of a view that is not blended by
// its mesh for each slot.
size_t table_rows(const simd::SumTask& task);
// How many numbers at the most it draws the cells of a BlendGrid in `rect` by.
size_t most_of_cells(const simd::SumTask& task, const Rect& rect);

// The numbers that compute shaders draw the views of a pass by: owners of pixels, or weights of cells, and of
// each face what sum_shader.h lays out.
class PassNumbers {
 public:
  // Makes those of views whose images have their places in `atlas`, without any context. `boxes`: of each slot of the
  // only view, see kCornerPerFrom.
  void make(std::span<const DrawnView> views, const ImageAtlas& atlas, const ParallelFor& parallel,
            std::span<const int> boxes = {});
  // Where the sum of a view is: what kViewResult has.
  void set_result(size_t view, const std::array<uint32_t, 6>& words);

  // The buffers that a context keeps for them.
  struct Buffers {
    Buffer runs{Buffer::Use::kNumbers}, tables{Buffer::Use::kNumbers};
  };
  // Sends all of them, and binds the buffers. While the context is current.
  void send(Buffers& to) const;

 private:
  struct View {
    std::vector<uint32_t> runs, cells;
    std::vector<float> tables;
  };
  std::vector<uint32_t> heads_;  // kViewWords of each view
  std::vector<View> views_;
};

// What a pass needs before it has the context.
struct Pass {
  ImageAtlas atlas;
  PassNumbers numbers;
};

// The memory of as many passes as are being made at once.
class Passes {
 public:
  // One that nobody else has, for as long as this lives. Without a context.
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

// The textures of a pass: levels of focal maps, lines of sight of distorted views, and the cameras' images. All calls
// while the context is current.
class ViewTextures {
 public:
  // Sends and binds what the views of a pass need: one view, or several whose lines of sight are not looked up.
  // `atlas` is filled with their images, and stays until what is drawn has been read. False with the reason in `why` if
  // images that are on the card can't be had there.
  bool upload(std::span<const DrawnView> views, ImageAtlas& atlas, Programs& programs, std::string& why);
  // Sets the uniforms with the places of the images, for the program in use.
  void describe_images(const Program& program) const;

 private:
  void upload_levels(std::span<const DrawnView> views);
  void upload_rays(const Rays& rays, const Rect& rect, bool centres);

  const ImageAtlas* atlas_ = nullptr;
  CardPieces pieces_;
  SentTexture levels_;
  Texture rays_, centre_rays_;
  std::vector<float> ray_memory_;
};

}  // namespace lf::gl
