// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/gl/computed.h"
#include "render/gl/objects.h"
#include "render/gl/sum_drawer.h"
#include "render/gl/view_textures.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// A sum as block_shader-inl.h leaves it on the card. All calls while the context is current.
struct BlockSum {
  // Where the parts of it are, 32-bit words. In front of them the draws that have lost weight in each row of blocks,
  // and those that have left something open.
  struct Parts {
    uint32_t pixels = 0, chroma = 0, lost = 0, end = 0;
  };

  PixelFamily family = PixelFamily::kNone;
  Rect rect;  // of the view
  Parts parts;
  uint32_t draw = 0;  // number of the draw that it is of: rows with another have lost nothing
  Computed words;

  // Waits for it and has all of it in `out`, whose family and rectangle are the sum's. False if the card does not
  // answer.
  bool read(DrawnSum& out);
  // The same, but has only those rows of it in `out`, as lost_rect says, in which something is open that the CPU has to
  // mend. `any_lost`: whether weight is lost anywhere.
  bool read_open(DrawnSum& out, bool& any_lost);
  // Replaces the rows of lost_rect by what they are now.
  void write_back(const DrawnSum& from);

 private:
  template <class Visit>
  bool visit_rows(int y0, int y1, const Visit& visit) const;
  Rect find_rows(std::span<const uint32_t> draws) const;
  void point_to(uint32_t* memory, DrawnSum& out) const;
};

// Computes sums by a compute shader, two by two pixels an invocation: what hardware is best at. (Of an H100 or H200
// only 4 of 132 multiprocessors take fragment shaders.) All calls while the context is current.
class BlockSums {
 public:
  // Has the card begin with the sum of a task in `rect`, whose view's textures are there. False with the reason in
  // `why`.
  bool begin(const simd::SumTask& task, const ViewTextures& view, Programs& programs, const Rect& rect,
             Stopwatch& stopwatch, std::string& why);
  // What was begun last; as long as somebody holds it nothing else is drawn there.
  std::shared_ptr<BlockSum> latest() const { return latest_; }

 private:
  BlockSum& next();

  Buffer runs_{Buffer::Use::kNumbers}, tables_{Buffer::Use::kNumbers};
  std::vector<uint32_t> run_memory_;
  std::vector<float> table_memory_;
  std::vector<std::shared_ptr<BlockSum>> sums_;  // that somebody holds or held
  std::shared_ptr<BlockSum> latest_;
  uint32_t draw_ = 0;  // number of the latest
};

}  // namespace lf::gl
