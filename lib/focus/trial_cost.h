// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "focus/moments.h"

// What choose_surface() compares, in vectors. The same values, to the bit, with every instruction set.
namespace lf {

// For every trial and node the mean over `radius` nodes around of the deviations there are, farther ones with less
// weight (a tent: edges stay where they are better than in a box). Infinity where the node has none, or where its
// trial has clearly less weight than another: fewer cameras always agree better. `moments`: of one size, at least one.
std::vector<std::vector<float>> trial_costs(std::span<const Moments> moments, int radius);

// The upper one of the two in the middle of the finite ones, NaN if there are none. `values`: neither negative nor NaN.
double median_of_finite(std::span<const float> values);

// For each node the trial of the least cost, all but the first of which cost the node's `lead` more, the first of those
// that cost the same: its number, and the cost (with the lead).
void cheapest_trials(std::span<const std::vector<float>> costs, std::span<const float> lead, float* best,
                     uint8_t* chosen);

}  // namespace lf
