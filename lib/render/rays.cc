// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/rays.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <mutex>

namespace lf {

namespace {

// The tables of distorted lenses that were used last. A view keeps its lens from picture to picture, and a node and a
// compositor in one process need the same table. Thread-safe.
class RayTables {
 public:
  using Table = std::shared_ptr<const Vec2[]>;

  Table find(const Lens& lens, int width, int height) {
    const std::lock_guard lock(mutex_);
    for (const Entry& entry : entries_)
      if (entry.width == width && entry.height == height && entry.lens == lens) return entry.table;
    return nullptr;
  }
  void keep(const Lens& lens, int width, int height, const Table& table) {
    const std::lock_guard lock(mutex_);
    entries_.push_front({lens, width, height, table});
    size_t pixels = 0, kept = 0;
    for (const Entry& entry : entries_) {
      pixels += static_cast<size_t>(entry.width) * static_cast<size_t>(entry.height);
      if (pixels > kMostPixels) break;
      kept++;
    }
    entries_.resize(kept);
  }

 private:
  static constexpr size_t kMostPixels = size_t{1} << 22;  // 64 MiB
  struct Entry {
    Lens lens;
    int width, height;
    Table table;
  };
  std::mutex mutex_;
  std::deque<Entry> entries_;
};

RayTables& ray_tables() {
  static RayTables tables;
  return tables;
}

}  // namespace

Rays::Rays(const Lens& lens, int width, int height, const ParallelFor& parallel)
    : width_(width), height_(height), cx_(lens.cx()), cy_(lens.cy()), inv_fx_(1 / lens.fx()), inv_fy_(1 / lens.fy()) {
  if (!lens.has_distortion()) return;
  table_ = ray_tables().find(lens, width, height);
  if (table_) return;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto table = std::make_shared_for_overwrite<Vec2[]>(static_cast<size_t>(width) * static_cast<size_t>(height));
  const auto make_row = [&](size_t y) {
    Vec2* const row = &table[y * static_cast<size_t>(width)];
    for (int x = 0; x < width; x++)
      row[x] = lens.unproject(Vec2(x, static_cast<double>(y))).value_or(Vec2(kNone, kNone));
  };
  parallel(static_cast<size_t>(height), make_row);
  table_ = table;
  ray_tables().keep(lens, width, height, table_);
}

Vec2 Rays::at_centre_of_four(int x, int y) const {
  const int x1 = std::min(x + 1, width_ - 1), y1 = std::min(y + 1, height_ - 1);
  if (separable()) return {((x + x1) / 2.0 - cx_) * inv_fx_, ((y + y1) / 2.0 - cy_) * inv_fy_};
  return (at(x, y) + at(x1, y) + at(x, y1) + at(x1, y1)) / 4.0;
}

namespace {

constexpr int kTileSize = 16;    // pixels
constexpr int kBlockTiles = 8;   // tiles of a block in each direction
constexpr double kSlack = 1e-9;  // of a half-plane's largest value in the view: far above rounding, far below a pixel
constexpr double kPixelSlack = 1e-6;  // pixels

double value(const Vec3& h, const Vec2& ray) { return h.x * ray.x + h.y * ray.y + h.z; }

}  // namespace

RegionBounds::RegionBounds(const Rays& rays, const Lens& lens, int width, int height, const ParallelFor& parallel)
    : width_(width), height_(height), fx_(lens.fx()), fy_(lens.fy()), cx_(lens.cx()), cy_(lens.cy()) {
  if (rays.separable()) return;
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr int kBlockSize = kTileSize * kBlockTiles;
  const auto tile_of = [&](const Rect& rect) {
    Tile tile{rect, Vec2(kInf, kInf), Vec2(-kInf, -kInf)};
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++) {
        const Vec2 ray = rays.at(x, y);
        if (std::isnan(ray.x)) continue;
        tile.low = {std::min(tile.low.x, ray.x), std::min(tile.low.y, ray.y)};
        tile.high = {std::max(tile.high.x, ray.x), std::max(tile.high.y, ray.y)};
      }
    return tile;
  };
  const int columns = (width + kBlockSize - 1) / kBlockSize, rows = (height + kBlockSize - 1) / kBlockSize;
  std::vector<std::vector<Tile>> tiles(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  parallel(tiles.size(), [&](size_t i) {
    const int left = static_cast<int>(i) % columns * kBlockSize, top = static_cast<int>(i) / columns * kBlockSize;
    const Rect block = intersect({left, top, left + kBlockSize, top + kBlockSize}, {0, 0, width, height});
    for (int y0 = block.y0; y0 < block.y1; y0 += kTileSize)
      for (int x0 = block.x0; x0 < block.x1; x0 += kTileSize) {
        const Tile tile = tile_of(intersect({x0, y0, x0 + kTileSize, y0 + kTileSize}, block));
        if (tile.low.x <= tile.high.x) tiles[i].push_back(tile);
      }
  });
  for (const std::vector<Tile>& of_block : tiles) {
    if (of_block.empty()) continue;
    Block block{of_block.front(), tiles_.size(), tiles_.size() + of_block.size()};
    for (const Tile& tile : of_block) block.whole.add(tile);
    tiles_.insert(tiles_.end(), of_block.begin(), of_block.end());
    blocks_.push_back(block);
  }
}

void RegionBounds::Tile::add(const Tile& other) {
  rect = unite(rect, other.rect);
  low = {std::min(low.x, other.low.x), std::min(low.y, other.low.y)};
  high = {std::max(high.x, other.high.x), std::max(high.y, other.high.y)};
}

// The largest value of a linear function over a box is at a corner.
bool RegionBounds::Tile::may_hold(std::span<const Vec3> half_planes) const {
  return std::ranges::all_of(half_planes, [this](const Vec3& h) {
    const double u = h.x > 0 ? high.x : low.x, v = h.y > 0 ? high.y : low.y;
    const double slack = kSlack * (std::abs(h.x * u) + std::abs(h.y * v) + std::abs(h.z));
    return value(h, {u, v}) >= -slack;
  });
}

// Rounding is monotonic, and the slack of a block is at least that of each of its tiles: a block never says no where
// one of its tiles says yes.
bool RegionBounds::Block::may_hold(std::span<const Vec3> half_planes) const {
  const Vec2 &low = whole.low, &high = whole.high;
  const double u = std::max(std::abs(low.x), std::abs(high.x)), v = std::max(std::abs(low.y), std::abs(high.y));
  return std::ranges::none_of(half_planes, [&](const Vec3& h) {
    const double slack = kSlack * (std::abs(h.x) * u + std::abs(h.y) * v + std::abs(h.z));
    return value(h, {h.x > 0 ? high.x : low.x, h.y > 0 ? high.y : low.y}) < -slack;
  });
}

Rect RegionBounds::bound(std::span<const Vec3> half_planes) const {
  return tiles_.empty() ? bound_polygon(half_planes) : bound_tiles(half_planes);
}

// Sutherland-Hodgman clipping of the view's outline (Sutherland & Hodgman 1974), in normalised coordinates.
Rect RegionBounds::bound_polygon(std::span<const Vec3> half_planes) const {
  const double u0 = (-0.5 - cx_) / fx_, u1 = (width_ - 0.5 - cx_) / fx_;
  const double v0 = (-0.5 - cy_) / fy_, v1 = (height_ - 0.5 - cy_) / fy_;
  constexpr size_t kMaxVertices = 16;  // 4 corners and one more for each half-plane
  Vec2 polygon[kMaxVertices] = {{u0, v0}, {u1, v0}, {u1, v1}, {u0, v1}}, clipped[kMaxVertices];
  const Vec2 corners[4] = {polygon[0], polygon[1], polygon[2], polygon[3]};
  size_t n = 4;
  for (const Vec3& h : half_planes) {
    double largest = 0;
    for (const Vec2& corner : corners)
      largest = std::max(largest, std::abs(h.x * corner.x) + std::abs(h.y * corner.y) + std::abs(h.z));
    const double slack = kSlack * largest;
    size_t m = 0;
    for (size_t i = 0; i < n; i++) {
      const Vec2 &a = polygon[i], &b = polygon[(i + 1) % n];
      const double va = value(h, a) + slack, vb = value(h, b) + slack;
      if (!std::isfinite(va - vb)) return {0, 0, width_, height_};  // nothing is known of where it is 0
      if (va >= 0) clipped[m++] = a;
      if ((va >= 0) != (vb >= 0)) clipped[m++] = a + (b - a) * (va / (va - vb));
    }
    n = m;
    if (n == 0) return {};
    std::copy_n(clipped, n, polygon);
  }
  Vec2 low = polygon[0], high = polygon[0];
  for (size_t i = 1; i < n; i++) {
    low = {std::min(low.x, polygon[i].x), std::min(low.y, polygon[i].y)};
    high = {std::max(high.x, polygon[i].x), std::max(high.y, polygon[i].y)};
  }
  const double left = low.x * fx_ + cx_, top = low.y * fy_ + cy_, right = high.x * fx_ + cx_,
               bottom = high.y * fy_ + cy_;
  // Where the principal point is so far away that positions lose more than the slack, nothing is known.
  const double rounding = 8 * std::numeric_limits<double>::epsilon() * std::max(std::abs(cx_), std::abs(cy_));
  if (rounding > kPixelSlack || std::isnan(left + right) || std::isnan(top + bottom)) return {0, 0, width_, height_};
  // Integers only of what is in the view or next to it.
  const auto first = [](double v, int size) {
    return static_cast<int>(std::ceil(std::clamp(v, -1.0, size + 1.0) - kPixelSlack));
  };
  const auto past = [](double v, int size) {
    return static_cast<int>(std::floor(std::clamp(v, -2.0, size + 1.0) + kPixelSlack)) + 1;
  };
  const Rect rect{first(left, width_), first(top, height_), past(right, width_), past(bottom, height_)};
  return intersect(rect, {0, 0, width_, height_});
}

Rect RegionBounds::bound_tiles(std::span<const Vec3> half_planes) const {
  Rect rect;
  const auto adds = [&rect](const Tile& tile) { return intersect(rect, tile.rect) != tile.rect; };
  for (const Block& block : blocks_) {
    if (!adds(block.whole) || !block.may_hold(half_planes)) continue;
    for (size_t i = block.first; i < block.past; i++)
      if (adds(tiles_[i]) && tiles_[i].may_hold(half_planes)) rect = unite(rect, tiles_[i].rect);
  }
  return rect;
}

}  // namespace lf
