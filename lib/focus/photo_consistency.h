// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lf {

// The photo-consistency sums of a depth hypothesis, which show how well the cameras agree about the depth. At each node
// of the focal map, they are the sums over the cameras of weight, weight x luma, and weight x luma squared. Their
// variance is the disagreement of the cameras: it is small if the depth is right. Sums of several hosts can be added
// like colours, so depths can be tested without transmitting images. The sums correspond to the "moment" statistics of
// space-time stereo.
//
// The sums have 16 bits. Weights that add up to 1 cannot overflow. Larger sums, of cameras that are counted twice,
// saturate. A camera's contribution is computed in integers from its rounded weight, so all machines get the same sums.
struct PhotoConsistency {
  static constexpr int kWeightOne = 32768;  // weight 1
  static constexpr int kLumaOne = 128;      // weight 1 x luma 1 of 255
  int columns = 0, rows = 0;
  std::vector<uint16_t> weight, luma, square;  // row-major; square: 1 = weight 1 x luma 1 squared

  // Returns the contribution of a camera to `luma`, from its weight in units of 1 / kWeightOne and its luma `value`, 0
  // to 255. square_of() returns its contribution to `square`, from the result of luma_of().
  static uint16_t luma_of(uint16_t weight, int value) { return static_cast<uint16_t>((weight * value + 128) >> 8); }
  static uint16_t square_of(uint16_t luma, int value) { return static_cast<uint16_t>((luma * value + 64) >> 7); }

  void reset(int columns, int rows);
  // Adds the sums of a rectangle of nodes; its first node is at (column, row).
  void add(const PhotoConsistency& part, int column = 0, int row = 0);
  // Replaces the sums of the nodes of a rectangle where the weights of `part` are larger. This merges the surfaces that
  // several hosts have measured (see DepthHypothesis::Kind::kMeasured).
  void take_heavier(const PhotoConsistency& part, int column, int row);
  // Returns the disagreement of the cameras at a node: the standard deviation of their luma, 0 to 127.5. Returns NaN if
  // less than half of the weight is present.
  float deviation(size_t node) const;
};

// Returns how much light the picture through a surface loses or gains, compared with the picture through a plane. The
// result is the squared difference of the mean luma, averaged over the quarters of the picture, in squared luma levels.
// Defocus spreads light but loses none, so a large part of the picture is as bright through the right surface as
// through any plane. If all cameras agree because they look past an object, the light of the object is missing. No
// other measure detects such a surface.
//
// The measure uses nodes that all cameras see both ways, in quarters with at least a hundred such nodes. It is 0 if
// there are no such quarters. `chosen` is the index of each node's hypothesis, which together form the surface. `plane`
// is the index of the plane's hypothesis. If `counted` is not empty, only nodes with a value of 1 count.
double moved_light(std::span<const PhotoConsistency> hypotheses, std::span<const uint8_t> chosen, size_t plane,
                   std::span<const uint8_t> counted = {});

// The functions below compare hypotheses for select_depths(). They use SIMD and give the same bits with every
// instruction set.

// Returns the cost of each hypothesis at each node: the mean deviation of the visible nodes within `radius` nodes.
// Nearer nodes have more weight (a tent filter), which preserves edges better than a box. The cost is infinite if the
// node is not visible. It is also infinite if another hypothesis has clearly more weight at the node, because fewer
// cameras always agree better. `moments` contains at least one element, and all have the same size.
std::vector<std::vector<float>> hypothesis_costs(std::span<const PhotoConsistency> moments, int radius);

// Returns the median of the finite values, or the upper one of two medians. Returns NaN if there are no finite values.
// `values` must be neither negative nor NaN.
double median_of_finite(std::span<const float> values);

// Finds the hypothesis with the least cost at each node. The first hypothesis has an advantage: `lead` is added to the
// cost of all other hypotheses. The first hypothesis also wins a tie. Writes the index of the winner to `chosen`, and
// its cost with the lead to `best`.
void cheapest_hypotheses(std::span<const std::vector<float>> costs, std::span<const float> lead, float* best,
                         uint8_t* chosen);

}  // namespace lf
