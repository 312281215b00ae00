// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string_view>

namespace lf {

// Whether `a` comes before `b` when runs of digits compare as numbers: "cam2" before "cam10". A strict weak order;
// names that differ only in leading zeros compare as plain text. Use for file and camera names everywhere.
bool natural_less(std::string_view a, std::string_view b);

}  // namespace lf
