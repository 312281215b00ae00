// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "render/simd/band_data.h"

namespace lf::gl {

// The numbers that programs draw a task by, as sum_shader.h lays them out: texels of all faces of the plan, then of all
// slots, whose layers are their numbers; filled up to whole rows. `values`: four for each texel. Returns the texel of
// the first slot.
int make_tables(const simd::SumTask& task, std::vector<float>& values);

}  // namespace lf::gl
