// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/surface_codec.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr int kPlaneStep = 32;  // pixels between the nodes of an inclined plane

// Returns the inverse of the depth t along the optical axis, where the line of sight meets the surface with the inverse
// distance `inverse` from a plane. The distance from the plane is `offset` + t * `slope`.
double inverse_depth(double inverse, double offset, double slope) {
  const double inverse_of_depth = slope * inverse / (1 - offset * inverse);
  return std::isfinite(inverse_of_depth) ? std::max(inverse_of_depth, 0.0) : 0.0;
}

std::vector<double> inverse_depths(const View& view, const PictureSurface& grid) {
  const FocalMap* map = view.focus.map.get();
  const Mat3 rotation = view.pose.rotation();
  const Plane& from = map ? map->from : view.focus.plane;
  const double offset = from.signed_distance(view.pose.position);
  std::vector<double> out;
  out.reserve(static_cast<size_t>(grid.columns) * static_cast<size_t>(grid.rows));
  for (int j = 0; j < grid.rows; j++)
    for (int i = 0; i < grid.columns; i++) {
      const double x = (i + 0.5) * grid.step - 0.5, y = (j + 0.5) * grid.step - 0.5;
      const Vec3 sight = rotation * Vec3((x - grid.cx) / grid.fx, (y - grid.cy) / grid.fy, 1);
      const double slope = glm::dot(from.normal, sight);
      // On the plane itself, offset + t * slope is 0.
      out.push_back(map ? inverse_depth(map->inverse_of(map->levels[out.size()]), offset, slope)
                        : std::max(-slope / offset, 0.0));
      if (!std::isfinite(out.back())) out.back() = 0;
    }
  return out;
}

void set_levels(PictureSurface& surface, const std::vector<double>& inverses) {
  const auto [farthest, nearest] = std::ranges::minmax(inverses);
  surface.farthest = farthest;
  surface.nearest = nearest;
  const double scale = nearest > farthest ? FocalMap::kLevels / (nearest - farthest) : 0;
  surface.levels.clear();
  for (const double inverse : inverses)
    surface.levels.push_back(static_cast<uint8_t>(std::lround((inverse - farthest) * scale)));
}

// The predictor of lossless JPEG-LS: the median of the left node, the node above, and the plane through the neighbours.
// Beyond the border, nodes are 0.
uint8_t predicted(const uint8_t* node, int i, int j, int columns) {
  if (j == 0) return i == 0 ? 0 : node[-1];
  const int up = *(node - columns);
  if (i == 0) return static_cast<uint8_t>(up);
  const int left = node[-1], corner = *(node - columns - 1);
  return static_cast<uint8_t>(std::clamp(left + up - corner, std::min(left, up), std::max(left, up)));
}

template <typename Each>
void for_each_node(const PictureSurface& surface, Each each) {
  for (int j = 0; j < surface.rows; j++)
    for (int i = 0; i < surface.columns; i++) each(i, j, static_cast<size_t>(j * surface.columns + i));
}

void check(const PictureSurface& surface) {
  validate_size("width", surface.width);
  validate_size("height", surface.height);
  if (surface.view < 0 || surface.view >= PictureSurface::kMaxViews) throw Error("view: must be 0 or 1");
  if (surface.step < 1) throw Error("step: must be at least 1");
  const size_t nodes = static_cast<size_t>(surface.columns) * static_cast<size_t>(surface.rows);
  if (surface.columns != FocalMap::nodes(surface.width, surface.step) ||
      surface.rows != FocalMap::nodes(surface.height, surface.step) || nodes > PictureSurface::kMaxNodes)
    throw Error("grid: " + std::to_string(surface.columns) + " x " + std::to_string(surface.rows) +
                " nodes do not fit the picture");
  const double turn = glm::length(surface.pose.orientation);
  if (!is_finite(surface.pose.position) || !(std::abs(turn - 1) < 1e-6))
    throw Error("pose: must be finite and of unit length");
  if (!std::isfinite(surface.fx) || !std::isfinite(surface.fy) || surface.fx <= 0 || surface.fy <= 0 ||
      !std::isfinite(surface.cx) || !std::isfinite(surface.cy))
    throw Error("lens: must be finite, with positive focal lengths");
  if (!(surface.farthest >= 0) || !(surface.nearest >= surface.farthest) || !std::isfinite(surface.nearest))
    throw Error("depths: must be finite, at least 0, and in order");
}

// The fields after the first byte, which is the version.
template <typename Io, typename Surface>
void fields(Io& io, Surface& surface) {
  field<uint8_t>(io, surface.view);
  field<uint16_t>(io, surface.step);
  field<uint32_t>(io, surface.timestamp);
  for (auto* number : {&surface.width, &surface.height, &surface.columns, &surface.rows}) field<uint16_t>(io, *number);
  auto& [position, turn] = surface.pose;
  for (auto* number : {&position.x, &position.y, &position.z, &turn.w, &turn.x, &turn.y, &turn.z, &surface.fx,
                       &surface.fy, &surface.cx, &surface.cy, &surface.farthest, &surface.nearest})
    field<double>(io, *number);
}

PictureSurface read_surface(std::span<const uint8_t> bytes) {
  Reader in(bytes);
  if (const uint8_t version = in.get<uint8_t>(); version != PictureSurface::kVersion)
    throw Error("version: " + std::to_string(version) + " is not supported");
  PictureSurface surface;
  fields(in, surface);
  if (!in.ok()) throw Error("header: the message is too short");
  check(surface);
  surface.levels = inflate_exactly(in.get_bytes(in.left()),
                                   static_cast<size_t>(surface.columns) * static_cast<size_t>(surface.rows));
  for_each_node(surface, [&](int i, int j, size_t at) {
    uint8_t* node = surface.levels.data() + at;
    *node = static_cast<uint8_t>(*node + predicted(node, i, j, surface.columns));
  });
  return surface;
}

}  // namespace

std::optional<PictureSurface> picture_surface(const View& view, uint32_t timestamp) {
  if (view.lens.has_distortion()) return std::nullopt;
  const FocalMap* map = view.focus.map.get();
  PictureSurface surface{.timestamp = timestamp,
                         .width = view.width,
                         .height = view.height,
                         .pose = {view.pose.position, glm::normalize(view.pose.orientation)},
                         .fx = view.lens.fx(),
                         .fy = view.lens.fy(),
                         .cx = view.lens.cx(),
                         .cy = view.lens.cy()};
  const double facing = std::abs(glm::dot(view.focus.plane.normal, view.pose.forward()));
  constexpr double kParallel = 1e-9;
  surface.step = map ? map->step : facing > 1 - kParallel ? std::max(view.width, view.height) : kPlaneStep;
  const auto fit = [&] {
    surface.columns = FocalMap::nodes(view.width, surface.step);
    surface.rows = FocalMap::nodes(view.height, surface.step);
    return static_cast<size_t>(surface.columns) * static_cast<size_t>(surface.rows) <= PictureSurface::kMaxNodes;
  };
  while (!fit() && !map) surface.step *= 2;
  set_levels(surface, inverse_depths(view, surface));
  while (surface.levels.size() > PictureSurface::kMaxNodes && halve(surface)) {
  }
  if (surface.levels.size() > PictureSurface::kMaxNodes) return std::nullopt;
  return surface;
}

bool halve(PictureSurface& surface) {
  if (std::min(surface.columns, surface.rows) < 2 * PictureSurface::kMinNodes) return false;
  const int columns = FocalMap::nodes(surface.width, 2 * surface.step),
            rows = FocalMap::nodes(surface.height, 2 * surface.step);
  std::vector<uint8_t> levels;
  levels.reserve(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  const auto level = [&](int i, int j) {
    return surface.levels[static_cast<size_t>(std::min(j, surface.rows - 1) * surface.columns +
                                              std::min(i, surface.columns - 1))];
  };
  for (int j = 0; j < 2 * rows; j += 2)
    for (int i = 0; i < 2 * columns; i += 2) {
      std::array<uint8_t, 4> four = {level(i, j), level(i + 1, j), level(i, j + 1), level(i + 1, j + 1)};
      std::ranges::sort(four);
      levels.push_back(four[2]);
    }
  surface.step *= 2;
  surface.columns = columns;
  surface.rows = rows;
  surface.levels = std::move(levels);
  return true;
}

std::vector<uint8_t> encode_surface(const PictureSurface& surface) {
  std::vector<uint8_t> differences(surface.levels.size());
  for_each_node(surface, [&](int i, int j, size_t at) {
    const uint8_t* node = surface.levels.data() + at;
    differences[at] = static_cast<uint8_t>(*node - predicted(node, i, j, surface.columns));
  });
  const std::vector<uint8_t> deflated = deflate_all(differences);
  Writer out(PictureSurface::kHeaderBytes + deflated.size());
  out.put(PictureSurface::kVersion);
  fields(out, surface);
  out.put_bytes(deflated);
  return out.take();
}

std::optional<PictureSurface> decode_surface(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [bytes] { return read_surface(bytes); });
}

}  // namespace lf::wire
