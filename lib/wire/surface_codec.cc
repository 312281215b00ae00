// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/surface_codec.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "wire/range_coder.h"
#include "wire/unit.h"

namespace lf::wire {
namespace {

constexpr int kTop = static_cast<int>(FocalMap::kLevels);
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
  surface.farthest = static_cast<float>(farthest);
  surface.nearest = static_cast<float>(nearest);
  const double range = double{surface.nearest} - surface.farthest, scale = range > 0 ? FocalMap::kLevels / range : 0;
  surface.levels.clear();
  for (const double inverse : inverses)
    surface.levels.push_back(
        static_cast<uint8_t>(std::clamp(std::lround((inverse - surface.farthest) * scale), 0L, long{kTop})));
}

// The predictor of lossless JPEG-LS: the median of the left node, the node above, and the plane through the neighbours.
// Nodes beyond the border are 0.
int predicted(const uint8_t* node, int i, int j, int columns) {
  if (j == 0) return i == 0 ? 0 : node[-1];
  const int up = *(node - columns);
  if (i == 0) return up;
  const int left = node[-1], corner = *(node - columns - 1);
  return std::clamp(left + up - corner, std::min(left, up), std::max(left, up));
}

// Codes the difference of a level from its prediction, in units of 2 tolerance + 1 levels: whether there is a
// difference, its sign, and its size as an adaptive Exp-Golomb code.
class DifferenceModel {
 public:
  // `around` is the sum of the neighbouring sizes.
  template <typename Coder>
  int code(Coder& coder, int around, int difference) {
    const size_t kind = static_cast<size_t>(std::min(around, static_cast<int>(kKinds) - 1));
    if (!coder.code(differs_[kind], difference != 0)) return 0;
    const bool is_negative = coder.code(is_negative_, difference < 0);
    const unsigned size = static_cast<unsigned>(std::abs(difference));
    size_t bits = 0;  // the number of bits after the most significant bit
    while (bits < kMostBits && coder.code(is_longer_[kind][bits], size >> (bits + 1) != 0)) bits++;
    unsigned coded = 1;
    for (size_t k = bits; k-- > 0;) coded = 2 * coded + coder.code(bits_[bits][k + 1 == bits], (size >> k & 1) != 0);
    return is_negative ? -static_cast<int>(coded) : static_cast<int>(coded);
  }

 private:
  static constexpr size_t kKinds = 4, kMostBits = 7;
  std::array<AdaptiveBit, kKinds> differs_;
  AdaptiveBit is_negative_;
  std::array<std::array<AdaptiveBit, kMostBits>, kKinds> is_longer_;
  std::array<std::array<AdaptiveBit, 2>, kMostBits + 1> bits_;
};

// Encodes or decodes the levels. The encoder also replaces the levels by the values that the decoder will get.
template <typename Coder>
void code_levels(Coder& coder, PictureSurface& surface) {
  DifferenceModel model;
  const int unit = 2 * surface.tolerance + 1;
  std::vector<int> above(static_cast<size_t>(surface.columns));
  uint8_t* node = surface.levels.data();
  for (int j = 0; j < surface.rows; j++) {
    int left = 0;
    for (int i = 0; i < surface.columns; i++, node++) {
      int& up = above[static_cast<size_t>(i)];
      const int expected = predicted(node, i, j, surface.columns), difference = *node - expected;
      const int units = (std::abs(difference) + surface.tolerance) / unit;
      const int coded = model.code(coder, left + up, difference < 0 ? -units : units);
      *node = static_cast<uint8_t>(std::clamp(expected + coded * unit, 0, kTop));
      left = up = std::abs(coded);
    }
  }
}

void check(const PictureSurface& surface) {
  validate_size("width", surface.width);
  validate_size("height", surface.height);
  if (surface.view < 0 || surface.view >= PictureSurface::kMaxViews) throw Error("view: must be 0 or 1");
  if (surface.tolerance < 0 || surface.tolerance > PictureSurface::kMaxTolerance)
    throw Error("tolerance: " + std::to_string(surface.tolerance) + " levels are too many");
  const size_t nodes = static_cast<size_t>(surface.columns) * static_cast<size_t>(surface.rows);
  if (nodes > PictureSurface::kMaxNodes)
    throw Error("step: " + std::to_string(surface.columns) + " x " + std::to_string(surface.rows) +
                " nodes are too many");
  const double turn = glm::length(surface.pose.orientation);
  if (!is_finite(surface.pose.position) || !(std::abs(turn - 1) < 1e-6))
    throw Error("pose: must be finite and of unit length");
  if (!std::isfinite(surface.fx) || !std::isfinite(surface.fy) || surface.fx <= 0 || surface.fy <= 0 ||
      !std::isfinite(surface.cx) || !std::isfinite(surface.cy))
    throw Error("lens: must be finite, with positive focal lengths");
  if (!(surface.farthest >= 0) || !(surface.nearest >= surface.farthest) || !std::isfinite(surface.nearest))
    throw Error("depths: must be finite, at least 0, and in order");
}

template <typename Number>
void single(Reader& in, Number& value) {
  value = std::bit_cast<float>(in.get<uint32_t>());
}
void single(Writer& out, double value) { out.put(std::bit_cast<uint32_t>(static_cast<float>(value))); }

// The fields after the first byte, which is the version.
template <typename Io, typename Surface>
void fields(Io& io, Surface& surface) {
  field<uint8_t>(io, surface.view);
  field<uint16_t>(io, surface.step);
  field<uint32_t>(io, surface.timestamp);
  for (auto* number : {&surface.width, &surface.height}) field<uint16_t>(io, *number);
  field<uint8_t>(io, surface.tolerance);
  auto& [position, turn] = surface.pose;
  for (auto* number : {&position.x, &position.y, &position.z}) field<double>(io, *number);
  for (auto* number : {&turn.w, &turn.x, &turn.y, &turn.z}) single(io, *number);
  for (auto* number : {&surface.fx, &surface.fy, &surface.cx, &surface.cy, &surface.farthest, &surface.nearest})
    single(io, *number);
}

PictureSurface read_surface(std::span<const uint8_t> bytes) {
  Reader in(bytes);
  if (const uint8_t version = in.get<uint8_t>(); version != PictureSurface::kVersion)
    throw Error("version: " + std::to_string(version) + " is not supported");
  PictureSurface surface;
  fields(in, surface);
  if (!in.ok()) throw Error("header: the message is too short");
  if (surface.step < 1) throw Error("step: must be at least 1");
  surface.columns = FocalMap::nodes(surface.width, surface.step);
  surface.rows = FocalMap::nodes(surface.height, surface.step);
  check(surface);
  surface.levels.resize(static_cast<size_t>(surface.columns) * static_cast<size_t>(surface.rows));
  RangeDecoder coder(in.get_bytes(in.left()));
  code_levels(coder, surface);
  if (!coder.is_complete()) throw Error("levels: the message has a wrong length");
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
                         .fx = static_cast<float>(view.lens.fx()),
                         .fy = static_cast<float>(view.lens.fy()),
                         .cx = static_cast<float>(view.lens.cx()),
                         .cy = static_cast<float>(view.lens.cy())};
  for (double* number : {&surface.pose.orientation.w, &surface.pose.orientation.x, &surface.pose.orientation.y,
                         &surface.pose.orientation.z})
    *number = static_cast<float>(*number);
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

void smooth(PictureSurface& surface) {
  // A network of comparisons moves the median of nine values to the middle.
  constexpr std::pair<size_t, size_t> kComparisons[] = {{1, 2}, {4, 5}, {7, 8}, {0, 1}, {3, 4}, {6, 7}, {1, 2},
                                                        {4, 5}, {7, 8}, {0, 3}, {5, 8}, {4, 7}, {3, 6}, {1, 4},
                                                        {2, 5}, {4, 7}, {4, 2}, {6, 4}, {4, 2}};
  const size_t columns = static_cast<size_t>(surface.columns), rows = static_cast<size_t>(surface.rows);
  std::array<std::vector<uint8_t>, 9> around;  // rows of neighbours
  const std::vector<uint8_t> before = surface.levels;
  for (size_t j = 0; j < rows; j++) {
    for (size_t k = 0; k < around.size(); k++) {
      const size_t y = std::clamp(j + k / 3, size_t{1}, rows) - 1;
      around[k].resize(columns);
      for (size_t i = 0; i < columns; i++)
        around[k][i] = before[y * columns + std::clamp(i + k % 3, size_t{1}, columns) - 1];
    }
    for (const auto& [a, b] : kComparisons)
      for (size_t i = 0; i < columns; i++) {
        const uint8_t low = std::min(around[a][i], around[b][i]);
        around[b][i] = std::max(around[a][i], around[b][i]);
        around[a][i] = low;
      }
    std::ranges::copy(around[4], surface.levels.begin() + static_cast<std::ptrdiff_t>(j * columns));
  }
}

std::vector<uint8_t> encode_surface(const PictureSurface& surface) {
  PictureSurface coded = surface;
  RangeEncoder coder;
  code_levels(coder, coded);
  const std::vector<uint8_t> levels = coder.finish();
  Writer out(PictureSurface::kHeaderBytes + levels.size());
  out.put(PictureSurface::kVersion);
  fields(out, surface);
  out.put_bytes(levels);
  return out.take();
}

std::optional<PictureSurface> decode_surface(std::span<const uint8_t> bytes, std::string* reason) {
  return catch_reason(reason, [bytes] { return read_surface(bytes); });
}

}  // namespace lf::wire
