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
// plan. `atlas`: where the task's images are. `values`: four of each texel. `boxes`: of each slot, see kCornerPerFrom.
void make_tables(const simd::SumTask& task, const ImageAtlas& atlas, std::vector<float>& values,
                 std::span<const int> boxes = {});
// The task's runs in `rect`, as run_shader-inl.h has them.
void make_runs(const simd::SumTask& task, const Rect& rect, std::vector<uint32_t>& values);

// What a program for all of a task's faces has to have; its output is to be set.
SumProgram program_of(const simd::SumTask& task);

// What a face's pixels are counted from: the middle of its rectangle.
Vec2 anchor_of(const FacePlan& face);

}  // namespace lf::gl
