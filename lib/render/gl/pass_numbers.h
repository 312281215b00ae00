// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/worker_pool.h"
#include "render/gl/image_atlas.h"
#include "render/gl/objects.h"

namespace lf::gl {

// The numbers that compute shaders draw the views of a pass by: owners of pixels, or weights of
// cells, and of each face what sum_shader.h lays out.
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

}  // namespace lf::gl
