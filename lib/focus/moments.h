// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lf {

// What cameras that look through one trial surface have in common: the sums, over the cameras, of weight, weight x luma
// and weight x luma squared, a value for each node of the focal map. They add like colour, through any number of
// partial sums, and their variance tells how far the cameras disagree: the "moment" statistics of space-time stereo,
// here without any camera's image leaving it.
//
// In 16 bits: of weights that sum to 1 none overflows; sums that do (of cameras counted twice) saturate. What a camera
// adds is found in integers from its rounded weight, so that weight and luma tell all of it.
struct Moments {
  static constexpr int kWeightOne = 32768;  // weight 1
  static constexpr int kLumaOne = 128;      // weight 1 x luma 1 of 255
  int columns = 0, rows = 0;
  std::vector<uint16_t> weight, luma, square;  // row-major; square: 1 = weight 1 x luma 1 squared

  // What a camera of this weight (kWeightOne = 1) and luma (0..255) adds to `luma`, and with that to `square`.
  static uint16_t luma_of(uint16_t weight, int value) { return static_cast<uint16_t>((weight * value + 128) >> 8); }
  static uint16_t square_of(uint16_t luma, int value) { return static_cast<uint16_t>((luma * value + 64) >> 7); }

  void reset(int columns, int rows);
  void add(const Moments& other);  // adds moments of the same size
  // Adds moments of a rectangle of nodes, whose first one is at (column, row) of these.
  void add(const Moments& part, int column, int row);
  // How far the cameras disagree at a node: the standard deviation of their luma, 0..127.5; NaN where less than half
  // of the weight is there.
  float deviation(size_t node) const;
};

// How much light a surface has lost or made up. What is out of focus is spread over its surroundings, and none of it is
// lost: through the right surface a large part of the picture is as bright as through any plane. Cameras that agree
// because all of them look past a thing show none of it, and only this tells.
//
// The squared difference of the mean luma, mean over the quarters of the picture, levels squared; of nodes that all
// weight sees both ways, in quarters with a hundred of them, and 0 without such. `chosen`: the trial of each node that
// makes up the surface. `plane`: which of the trials is the plane.
double moved_light(std::span<const Moments> trials, std::span<const uint8_t> chosen, size_t plane);

// What choose_surface() compares, in SIMD vectors: the same values, to the bit, with every instruction set.

// For every trial and node the mean of the deviations of the nodes within `radius` that have one, farther ones with
// less weight (a tent: edges stay where they are better than in a box). Infinity where the node has none, or where its
// trial has clearly less weight than another: fewer cameras always agree better. `moments`: of one size, at least one.
std::vector<std::vector<float>> trial_costs(std::span<const Moments> moments, int radius);

// The median of the finite values, the upper one of the two in the middle; NaN if there are none. `values`: neither
// negative nor NaN.
double median_of_finite(std::span<const float> values);

// For each node the trial of the least cost, all but the first of which cost the node's `lead` more, the first of those
// that cost the same: its number, and the cost (with the lead).
void cheapest_trials(std::span<const std::vector<float>> costs, std::span<const float> lead, float* best,
                     uint8_t* chosen);

}  // namespace lf
