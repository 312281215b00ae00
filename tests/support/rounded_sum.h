// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "composite/accumulator.h"

namespace lf::test {

// What has been added so far, in 8 bits; nothing if nothing was added.
inline std::optional<Fragment> rounded_sum(const Accumulator& accumulator) {
  const std::optional<ConstSumPlanes> sums = accumulator.sums();
  return sums ? std::optional(rounded_fragment(*sums)) : std::nullopt;
}

}  // namespace lf::test
