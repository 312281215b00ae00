// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lf {

// Photo-consistency sums for a depth hypothesis: sums over the cameras of weight, weight x luma and weight x luma
// squared, for each node of the focal map. They add like colour, through any number of partial sums. Their variance is
// the disagreement of the cameras: the "moment" statistics of space-time stereo, without transmitting images.
//
// The sums have 16 bits. Weights that sum to 1 cannot overflow; larger sums (of cameras counted twice) saturate. A
// camera's contribution is computed in integers from its rounded weight, so weight and luma determine it completely.
struct PhotoConsistency {
  static constexpr int kWeightOne = 32768;  // weight 1
  static constexpr int kLumaOne = 128;      // weight 1 x luma 1 of 255
  int columns = 0, rows = 0;
  std::vector<uint16_t> weight, luma, square;  // row-major; square: 1 = weight 1 x luma 1 squared

  // Contribution of a camera with this weight (kWeightOne = 1) and luma (0..255) to `luma`, and from that to `square`.
  static uint16_t luma_of(uint16_t weight, int value) { return static_cast<uint16_t>((weight * value + 128) >> 8); }
  static uint16_t square_of(uint16_t luma, int value) { return static_cast<uint16_t>((luma * value + 64) >> 7); }

  void reset(int columns, int rows);
  void add(const PhotoConsistency& other);  // adds sums of the same size
  // Adds the sums of a rectangle of nodes; its first node is at (column, row).
  void add(const PhotoConsistency& part, int column, int row);
  // Returns the disagreement of the cameras at a node: the standard deviation of their luma, 0..127.5. NaN if less than
  // half of the weight is present.
  float deviation(size_t node) const;
};

// Returns the light that a surface loses or adds relative to a plane: the squared difference of the mean luma, averaged
// over the quarters of the picture, levels squared. Defocus spreads light but loses none: through the right surface, a
// large part of the picture is as bright as through any plane. If cameras agree because all of them look past an
// object, its light is missing, and only this measure shows that.
//
// Uses nodes that all cameras see both ways, in quarters with at least a hundred such nodes; 0 without such quarters.
// `chosen`: hypothesis of each node of the surface. `plane`: index of the plane's hypothesis.
double moved_light(std::span<const PhotoConsistency> hypotheses, std::span<const uint8_t> chosen, size_t plane,
                   std::span<const uint8_t> counted = {});

// Comparisons for select_depths(), in SIMD: bit-identical with every instruction set.

// Returns, for each hypothesis and node, the mean deviation of the visible nodes within `radius`. Its weights are a
// tent, which preserves edges better than a box. Infinity if the node is not visible, or if another hypothesis has
// clearly more weight there, because fewer cameras always agree better. `moments`: at least one, all of the same size.
std::vector<std::vector<float>> hypothesis_costs(std::span<const PhotoConsistency> moments, int radius);

// Returns the median of the finite values, the upper one of two; NaN if there are none. `values`: neither negative nor
// NaN.
double median_of_finite(std::span<const float> values);

// Finds the hypothesis with the least cost at each node. All but the first cost `lead` more; the first wins a tie.
// Writes its index to `chosen` and its cost (with the lead) to `best`.
void cheapest_hypotheses(std::span<const std::vector<float>> costs, std::span<const float> lead, float* best,
                         uint8_t* chosen);

}  // namespace lf
