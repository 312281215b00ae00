// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/rect.h"
#include "base/worker_pool.h"
#include "render/gl/image_atlas.h"
#include "render/gl/sum_shader.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// The numbers that programs draw a task by, as sum_shader.h lays them out: table_rows() of face_texels(), one for each
// face of the plan, or of a view that is not blended by its mesh for each slot. `places`: of the images of the task's
// slots. `values`: four of each texel. `boxes`: of each slot, see kCornerPerFrom.
void make_tables(const simd::SumTask& task, std::span<const ImageAtlas::Offset> places, std::vector<float>& values,
                 std::span<const int> boxes = {});
size_t table_rows(const simd::SumTask& task);
// The task's runs in `rect`, as run_shader-inl.h has them.
void make_runs(const simd::SumTask& task, const Rect& rect, std::vector<uint32_t>& values);
// Of a view that is not blended by its mesh: of each of the BlendGrid's cells that has pixels in `rect`, row by row, the
// first of its cameras, and the end of the last one's; then kCellWords of each camera. Else nothing.
void make_cells(const simd::SumTask& task, const Rect& rect, const ParallelFor& parallel,
                std::vector<uint32_t>& values);
// How many numbers that is at the most.
size_t most_of_cells(const simd::SumTask& task, const Rect& rect);

// How far apart a focal map's nodes are, pixels; the inverse distance of level 0 and of a level more; the eye's
// distance from where distances are counted. Without a map none of it means anything.
struct MapScale {
  float step = 0, farthest = 0, of_level = 0, eye_distance = 0;
};
MapScale scale_of(const ViewPlan& plan);

// What a program for all of a task's faces has to have; its output is to be set.
SumProgram program_of(const simd::SumTask& task);

// What pixels of a rectangle are counted from: its middle.
Vec2 anchor_of(const Rect& rect);

}  // namespace lf::gl
