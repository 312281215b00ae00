// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render/gl/computed.h"
#include "render/gl/objects.h"
#include "render/gl/sum_drawer.h"
#include "render/gl/view_textures.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// Computes sums by a compute shader, two by two pixels an invocation: what hardware is best at. (Of an H100 or H200
// only 4 of 132 multiprocessors take fragment shaders.) All calls while the context is current.
class BlockSums {
 public:
  // Has the card begin with the sum of a task in `rect`, whose view's textures are there. False with the reason in
  // `why`.
  bool begin(const simd::SumTask& task, const ViewTextures& view, Programs& programs, const Rect& rect,
             Stopwatch& stopwatch, std::string& why);
  // Waits for it. False if the card does not answer.
  bool read(DrawnSum& out);

 private:
  // Where the parts of the result are, 32-bit words.
  struct Parts {
    uint32_t pixels = 0, chroma = 0, lost = 0, end = 0;
  };

  Buffer runs_{Buffer::Use::kNumbers}, tables_{Buffer::Use::kNumbers};
  Computed result_;
  std::vector<uint32_t> run_memory_;
  std::vector<float> table_memory_;
  Parts parts_;
  uint32_t draw_ = 0;  // number of the latest
};

}  // namespace lf::gl
