// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "render/simd/band_data.h"

namespace lf::gl {

// A corner of a triangle.
struct CoverCorner {
  float x, y;     // pixels of the view
  uint32_t face;  // index into the plan's
};

// Triangles, three corners each, that together hold all pixels of a rectangle that faces with cameras of the task's
// own: each pixel in one of each such face, and others as well, as owners are looked up.
struct FaceCover {
  // kI420: of blocks of two by two pixels, those in whose middle is in a triangle.
  struct Triangles {
    std::vector<CoverCorner> pixels, blocks;
  };
  Triangles calm;     // no sample is lost, float is good enough in all of them, see SumProgram::careful
  Triangles careful;  // the others
  Rect careful_rect;  // bounds those; whole blocks in kI420, but for the view's end
};
FaceCover cover_faces(const simd::SumTask& task, const Rect& rect);

// Whether all of a face's cameras that are ours see all that its part of the view inside `part` has in focus, and well
// inside of their images, so that numbers in float can't err about it. Lines of sight are linear in the pixel.
bool is_calm(const simd::SumTask& task, const FacePlan& face, uint8_t ours, const Rect& part);

}  // namespace lf::gl
