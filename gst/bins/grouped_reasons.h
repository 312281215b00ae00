// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <string>

namespace lf {

// Why cameras were lost, for a person to read. A reason is "PLACE: WHY", as lfcamsrc tells it, and its last part is the
// why. Reasons stand as they are, in their order, with `separator` between them; but those of more than kAlone cameras
// with one and the same why are told once, where the first of them is: "64 cameras: WHY (PLACE and others)".
std::string grouped_reasons(std::span<const std::string> reasons, const std::string& separator);

inline constexpr size_t kAlone = 3;

}  // namespace lf
