// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/one_camera_moments.h"

#include <algorithm>

#include "base/error.h"

namespace lf::wire {
namespace {

// What one camera sees: its weight, and for each trial a luma, or that it sees nothing. Other moments follow from that.
struct SeenByOne {
  std::vector<uint16_t> weight;            // of each node of the rectangle
  std::vector<uint16_t> blind;             // bit t: sees nothing in trial t
  std::vector<std::vector<uint8_t>> luma;  // of each trial
};

// The luma with which a camera of this weight adds so much to both sums; -1: there is none.
int luma_that_adds(uint16_t weight, uint16_t luma, uint16_t square) {
  if (weight == 0) return luma == 0 && square == 0 ? 0 : -1;
  const int first = std::max((256 * luma - 128 + weight - 1) / weight, 0);
  for (int value = first; value <= 255 && Moments::luma_of(weight, value) == luma; value++)
    if (Moments::square_of(luma, value) == square) return value;
  return -1;
}

// Nothing where several cameras are in the sums.
std::optional<SeenByOne> seen_by_one(std::span<const Moments> trials, const Rect& rect) {
  const size_t nodes = static_cast<size_t>(rect.width()) * static_cast<size_t>(rect.height());
  SeenByOne seen{std::vector<uint16_t>(nodes), std::vector<uint16_t>(nodes),
                 std::vector(trials.size(), std::vector<uint8_t>(nodes))};
  size_t i = 0;
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++, i++) {
      const size_t node = static_cast<size_t>(y) * trials[0].columns + x;
      for (const Moments& moments : trials) seen.weight[i] = std::max(seen.weight[i], moments.weight[node]);
      for (size_t t = 0; t < trials.size(); t++) {
        const uint16_t weight = trials[t].weight[node];
        const int value = luma_that_adds(weight, trials[t].luma[node], trials[t].square[node]);
        if (value < 0 || (weight != 0 && weight != seen.weight[i])) return std::nullopt;
        if (weight != seen.weight[i]) seen.blind[i] |= static_cast<uint16_t>(1 << t);
        seen.luma[t][i] = static_cast<uint8_t>(value);
      }
    }
  return seen;
}

// From the luma to the left, above, and between these.
int predicted(const std::vector<uint8_t>& luma, size_t i, size_t width) {
  const int left = i % width > 0 ? luma[i - 1] : 0, above = i >= width ? luma[i - width] : left;
  if (i < width || i % width == 0) return above;
  const int between = luma[i - width - 1];
  if (between >= std::max(left, above)) return std::min(left, above);
  if (between <= std::min(left, above)) return std::max(left, above);
  return left + above - between;
}

// By how much a weight is not on a line with the two to the left of it.
uint16_t bend(const std::vector<uint16_t>& weight, size_t i, size_t width) {
  const size_t x = i % width;
  return static_cast<uint16_t>((x > 0 ? 2 * weight[i - 1] : 0) - (x > 1 ? weight[i - 2] : 0));
}

std::vector<uint8_t> pack(const SeenByOne& seen, size_t width) {
  const size_t nodes = seen.weight.size();
  std::vector<uint8_t> out(packed_bytes(nodes, seen.luma.size()));
  for (size_t i = 0; i < nodes; i++) {
    const auto off = static_cast<uint16_t>(seen.weight[i] - bend(seen.weight, i, width));
    out[i] = static_cast<uint8_t>(off >> 8);
    out[nodes + i] = static_cast<uint8_t>(off);
    out[2 * nodes + i] = static_cast<uint8_t>(seen.blind[i] >> 8);
    out[3 * nodes + i] = static_cast<uint8_t>(seen.blind[i]);
    for (size_t t = 0; t < seen.luma.size(); t++)
      out[(4 + t) * nodes + i] = static_cast<uint8_t>(seen.luma[t][i] - predicted(seen.luma[t], i, width));
  }
  return out;
}

}  // namespace

std::optional<std::vector<uint8_t>> pack_one_camera(std::span<const Moments> trials, const Rect& rect) {
  const std::optional<SeenByOne> seen = seen_by_one(trials, rect);
  if (!seen) return std::nullopt;
  return pack(*seen, static_cast<size_t>(rect.width()));
}

void unpack_one_camera(std::span<const uint8_t> packed, std::span<Moments> trials) {
  const auto width = static_cast<size_t>(trials[0].columns), nodes = trials[0].weight.size();
  SeenByOne seen{std::vector<uint16_t>(nodes), std::vector<uint16_t>(nodes),
                 std::vector(trials.size(), std::vector<uint8_t>(nodes))};
  for (size_t i = 0; i < nodes; i++) {
    seen.weight[i] = static_cast<uint16_t>(bend(seen.weight, i, width) + (packed[i] << 8 | packed[nodes + i]));
    seen.blind[i] = static_cast<uint16_t>(packed[2 * nodes + i] << 8 | packed[3 * nodes + i]);
    if (seen.weight[i] > Moments::kWeightOne) throw Error("weight: more than 1");
    if (seen.blind[i] >> trials.size() != 0) throw Error("trials: more than there are");
    for (size_t t = 0; t < trials.size(); t++) {
      std::vector<uint8_t>& luma = seen.luma[t];
      luma[i] = static_cast<uint8_t>(packed[(4 + t) * nodes + i] + predicted(luma, i, width));
      if (seen.blind[i] >> t & 1) continue;
      trials[t].weight[i] = seen.weight[i];
      trials[t].luma[i] = Moments::luma_of(seen.weight[i], luma[i]);
      trials[t].square[i] = Moments::square_of(trials[t].luma[i], luma[i]);
    }
  }
}

}  // namespace lf::wire
