// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/rect.h"
#include "render/gl/image_atlas.h"
#include "render/gl/sum_shader.h"
#include "render/simd/band_data.h"

namespace lf::gl {

// The numbers that programs draw a task by, as sum_shader.h lays them out: a row of face_texels() for each face of the
// plan. `places`: of the images of the task's slots. `values`: four of each texel. `boxes`: of each slot, see
// kCornerPerFrom.
void make_tables(const simd::SumTask& task, std::span<const ImageAtlas::Offset> places, std::vector<float>& values,
                 std::span<const int> boxes = {});
// The task's runs in `rect`, as run_shader-inl.h has them.
void make_runs(const simd::SumTask& task, const Rect& rect, std::vector<uint32_t>& values);

// How far apart a focal map's nodes are, pixels; the inverse distance of level 0 and of a level more; the eye's
// distance from where distances are counted. Without a map none of it means anything.
struct MapScale {
  float step = 0, farthest = 0, of_level = 0, eye_distance = 0;
};
MapScale scale_of(const ViewPlan& plan);

// What a program for all of a task's faces has to have; its output is to be set.
SumProgram program_of(const simd::SumTask& task);

// What a face's pixels are counted from: the middle of its rectangle.
Vec2 anchor_of(const FacePlan& face);

}  // namespace lf::gl
