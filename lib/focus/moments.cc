// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/moments.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lf {
namespace {

void add_saturated(uint16_t* sum, const uint16_t* values, size_t count) {
  for (size_t i = 0; i < count; i++) sum[i] = static_cast<uint16_t>(std::min(sum[i] + values[i], 65535));
}

}  // namespace

void Moments::reset(int new_columns, int new_rows) {
  columns = new_columns;
  rows = new_rows;
  const size_t nodes = static_cast<size_t>(columns) * static_cast<size_t>(rows);
  for (std::vector<uint16_t>* sum : {&weight, &luma, &square}) sum->assign(nodes, 0);
}

void Moments::add(const Moments& other) {
  add_saturated(weight.data(), other.weight.data(), weight.size());
  add_saturated(luma.data(), other.luma.data(), luma.size());
  add_saturated(square.data(), other.square.data(), square.size());
}

void Moments::add(const Moments& part, int column, int row) {
  const auto width = static_cast<size_t>(part.columns);
  for (size_t y = 0; y < static_cast<size_t>(part.rows); y++) {
    const size_t to = (static_cast<size_t>(row) + y) * static_cast<size_t>(columns) + static_cast<size_t>(column);
    add_saturated(&weight[to], &part.weight[y * width], width);
    add_saturated(&luma[to], &part.luma[y * width], width);
    add_saturated(&square[to], &part.square[y * width], width);
  }
}

float Moments::deviation(size_t node) const {
  const float w = static_cast<float>(weight[node]) / kWeightOne;
  if (!(w >= 0.5f)) return std::numeric_limits<float>::quiet_NaN();
  const float mean = static_cast<float>(luma[node]) / kLumaOne / w;
  return std::sqrt(std::max(static_cast<float>(square[node]) / w - mean * mean, 0.f));
}

}  // namespace lf
