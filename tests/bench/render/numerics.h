// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::bench {

// The table of the hard cases of numerical stability: what they leave of every renderer, beside its bounds. False if
// one is broken: it is marked in the table.
bool print_numerics();

}  // namespace lf::bench
