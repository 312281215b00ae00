// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/carry_over.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace lf {
namespace {

constexpr int kHole = -1;

// The nodes of `count` whose middles lie within `size` around `middle`, and the one that it lies in.
struct Span {
  Span(double middle, double size, int count) {
    // Of what is not negative, conversion is floor(): much faster without SSE 4.
    const auto floor_inside = [count](double v) {
      return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(count)));
    };
    const double begin = std::clamp(middle - size / 2 - 0.5, 0.0, static_cast<double>(count));
    const int whole = static_cast<int>(begin);
    first = std::min(whole + (whole < begin), floor_inside(middle));
    past = floor_inside(std::max(middle + size / 2 - 0.5, middle) + 1);
  }
  int first, past;
};

// Fills holes along a row from both sides. False if there is nothing to fill from.
bool fill_row(int* row, int columns) {
  const int* const end = row + columns;
  if (std::all_of(row, const_cast<int*>(end), [](int v) { return v == kHole; })) return false;
  for (int i = 0; i < columns;) {
    if (row[i] != kHole) {
      i++;
      continue;
    }
    int past = i;
    while (past < columns && row[past] == kHole) past++;
    const int before = i > 0 ? row[i - 1] : kHole, after = past < columns ? row[past] : kHole;
    const int level = before == kHole ? after : after == kHole ? before : std::min(before, after);
    std::fill(row + i, row + past, level);
    i = past;
  }
  return true;
}

}  // namespace

std::shared_ptr<const FocalMap> carry_over(const View& from, const View& to) {
  const std::shared_ptr<const FocalMap>& map = from.focus.map;
  if (from.pose == to.pose && from.lens == to.lens && from.width == to.width && from.height == to.height) return map;
  auto carried = std::make_shared<FocalMap>(*map);
  carried->columns = FocalMap::nodes(to.width, map->step);
  carried->rows = FocalMap::nodes(to.height, map->step);
  const size_t nodes = static_cast<size_t>(carried->columns) * static_cast<size_t>(carried->rows);
  std::vector<int> levels(nodes, kHole);

  const double step = map->step, per_step = 1 / step, middle = (step - 1) / 2;
  const Mat3 to_from_view = glm::transpose(to.pose.rotation()) * from.pose.rotation();
  const Vec3 offset = glm::transpose(to.pose.rotation()) * (from.pose.position - to.pose.position);
  const Vec3 normal = glm::transpose(from.pose.rotation()) * map->from.normal;
  const double zoom = to.lens.fx() / from.lens.fx();
  const double eye = map->from.signed_distance(from.pose.position);
  for (int j = 0; j < map->rows; j++)
    for (int i = 0; i < map->columns; i++) {
      const std::optional<Vec2> ray = from.lens.unproject({step * i + middle, step * j + middle});
      if (!ray) continue;
      const int level = map->levels[static_cast<size_t>(j) * map->columns + i];
      const double inverse = map->inverse_of(level);
      const Vec3 d(*ray, 1);
      // As in CameraProjection, so that infinity is a place like any other.
      const Vec3 x = (1 - inverse * eye) * (to_from_view * d) + inverse * glm::dot(normal, d) * offset;
      const std::optional<Vec2> pixel = to.lens.project(x);
      if (!pixel) continue;
      // As large as it is seen from there, so that what comes nearer has no holes.
      const double larger = zoom * (1 - inverse * eye) / x.z;
      const Span across((pixel->x + 0.5) * per_step, larger, carried->columns);
      const Span down((pixel->y + 0.5) * per_step, larger, carried->rows);
      for (int row = down.first; row < down.past; row++)
        for (int column = across.first; column < across.past; column++) {
          int& there = levels[static_cast<size_t>(row) * carried->columns + column];
          there = std::max(there, level);
        }
    }

  std::vector<int> filled(carried->rows);
  for (int j = 0; j < carried->rows; j++)
    filled[j] = fill_row(levels.data() + static_cast<size_t>(j) * carried->columns, carried->columns);
  for (int j = 0; j < carried->rows; j++) {
    if (filled[j]) continue;
    // The nearest row that has something; without any, everything is far.
    int nearest = kHole;
    for (int k = 0; k < carried->rows; k++)
      if (filled[k] && (nearest == kHole || std::abs(k - j) < std::abs(nearest - j))) nearest = k;
    const auto row = [&](int k) { return levels.begin() + static_cast<ptrdiff_t>(k) * carried->columns; };
    if (nearest == kHole)
      std::fill(row(j), row(j + 1), 0);
    else
      std::copy(row(nearest), row(nearest + 1), row(j));
  }
  carried->levels.assign(nodes, 0);
  std::transform(levels.begin(), levels.end(), carried->levels.begin(),
                 [](int level) { return static_cast<uint8_t>(level); });
  return carried;
}

}  // namespace lf
