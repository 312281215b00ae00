// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "bench/render/row.h"

namespace lf::bench {

// Throws Error, saying what to install, if there is no gnuplot.
void require_gnuplot();

// time-error.png, bytes-error.png and scaling.png in `folder`, each with the script that draws it beside it. What the
// rows don't tell (a sweep of one value) is left out.
void write_plots(const std::vector<Row>& rows, const std::string& folder);

}  // namespace lf::bench
