// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/rect.h"
#include "render/gl/computed.h"
#include "render/gl/objects.h"
#include "render/gl/pass_numbers.h"
#include "render/gl/sum_drawer.h"
#include "render/gl/view_textures.h"

namespace lf::gl {

// Computes moments by a compute shader. All calls while the context is current.
class MomentSums {
 public:
  // Has the card begin with the moments in `rect`, which bounds the slots, of a view whose numbers those are and whose
  // textures are there. False with the reason in `why`.
  bool begin(const MomentTask& task, const Rect& rect, const PassNumbers& numbers, const ViewTextures& textures,
             Programs& programs, Stopwatch& stopwatch, std::string& why);
  // Waits for it. False if the card does not answer.
  bool read(DrawnMoments& out);

 private:
  void upload_surfaces(const MomentTask& task, const Rect& rect);

  PassNumbers::Buffers numbers_;
  Buffer surfaces_{Buffer::Use::kNumbers};
  Computed result_;
  std::vector<uint8_t> surface_memory_;
  size_t words_ = 0;  // of the result
};

}  // namespace lf::gl
