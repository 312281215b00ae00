// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "bench/render/row.h"

namespace lf::bench {

// The ratios that are promised of the default settings, beside their goals, as far as `rows` tell.
void print_acceptance(const std::vector<Row>& rows);

}  // namespace lf::bench
