// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/view_plan.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <mutex>
#include <string>

#include "base/text.h"
#include "render/camera_projection.h"
#include "render/camera_weights.h"
#include "render/extrapolation.h"
#include "render/ownership.h"

namespace lf {

namespace {

// A cache of the ray tables of distorted lenses. Thread-safe.
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
      if (pixels > kMaxPixels) break;
      kept++;
    }
    entries_.resize(kept);
  }

 private:
  static constexpr size_t kMaxPixels = size_t{1} << 22;
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

constexpr int kTileSize = 16;
constexpr int kBlockTiles = 8;  // tiles per block and direction
// relative to a half-plane's largest value in the view: far above rounding, far below a pixel
constexpr double kSlack = 1e-9;
constexpr double kPixelSlack = 1e-6;

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

// Returns false only if the tile is completely outside a half-space. It is enough to test the corner of the tile's
// bounds with the largest value of the linear function.
bool RegionBounds::Tile::may_contain(std::span<const Vec3> half_planes) const {
  return std::ranges::all_of(half_planes, [this](const Vec3& h) {
    const double u = h.x > 0 ? high.x : low.x, v = h.y > 0 ? high.y : low.y;
    const double slack = kSlack * (std::abs(h.x * u) + std::abs(h.y * v) + std::abs(h.z));
    return value(h, {u, v}) >= -slack;
  });
}

// Never rejects a block with a tile that may contain a pixel, because rounding is monotonic, and the block has at least
// the slack of its tiles.
bool RegionBounds::Block::may_contain(std::span<const Vec3> half_planes) const {
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

// Clips the view's outline in normalised coordinates (Sutherland & Hodgman 1974).
Rect RegionBounds::bound_polygon(std::span<const Vec3> half_planes) const {
  const double u0 = (-0.5 - cx_) / fx_, u1 = (width_ - 0.5 - cx_) / fx_;
  const double v0 = (-0.5 - cy_) / fy_, v1 = (height_ - 0.5 - cy_) / fy_;
  constexpr size_t kMaxVertices = 16;  // 4 corners, plus one for each half-plane
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
      if (!std::isfinite(va - vb)) return {0, 0, width_, height_};  // position of the zero is unknown
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
  // If the principal point is far away, rounding is larger than the slack.
  const double rounding = 8 * std::numeric_limits<double>::epsilon() * std::max(std::abs(cx_), std::abs(cy_));
  if (rounding > kPixelSlack || std::isnan(left + right) || std::isnan(top + bottom)) return {0, 0, width_, height_};
  // Clamp before the conversion to int.
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
    if (!adds(block.whole) || !block.may_contain(half_planes)) continue;
    for (size_t i = block.first; i < block.past; i++)
      if (adds(tiles_[i]) && tiles_[i].may_contain(half_planes)) rect = unite(rect, tiles_[i].rect);
  }
  return rect;
}

namespace {

// Cameras as seen by a view. Rotates only differences of world positions, so that arrays at 1e6 m keep their precision.
class CamerasInView {
 public:
  CamerasInView(const Rig& rig, const Pose& world_from_view)
      : rig_(rig), view_from_world_(glm::transpose(world_from_view.rotation())), eye_(world_from_view.position) {}

  Vec3 forward(CameraIndex i) const { return view_from_world_ * rig_.cameras[i].pose.forward(); }

  // Returns e_ij = d . ((C_i - E) x (C_j - E)). It is computed as (C_n - E) x (C_j - C_i), with n the camera nearer to
  // the eye, so that the rounding error is relative to the distance of the nearer camera. All edges that meet in a
  // camera then agree about the side of an arbitrarily close eye, and are exactly 0 at the camera. The canonical order
  // makes e_ij = -e_ji exact.
  Vec3 edge(CameraIndex i, CameraIndex j) const {
    if (i > j) return -edge(j, i);
    const Vec3 a = position(i) - eye_, b = position(j) - eye_;
    return normal_of_sight(glm::dot(a, a) <= glm::dot(b, b) ? a : b, position(j) - position(i), i);
  }
  // Does the same for the end of a strip, which is a line along `extent` through camera i.
  Vec3 strip_edge(CameraIndex i, const Vec3& extent) const { return normal_of_sight(position(i) - eye_, extent, i); }

 private:
  // Returns the normal, in view coordinates, of the plane through the eye and a line through camera i. Returns 0 if the
  // eye is on the line within the precision of positions. Otherwise a normal made of rounding errors could hide half a
  // view from an eye on the array's border, or let a triangle without area contain pixels. Zeros only enlarge faces, so
  // they cause no cracks.
  Vec3 normal_of_sight(const Vec3& to_line, const Vec3& along, CameraIndex i) const {
    // relative to the length of a position
    constexpr double kPositionRounding = 8 * std::numeric_limits<double>::epsilon();
    const Vec3 normal = glm::cross(to_line, along);
    const double tolerance = kPositionRounding * (glm::length(position(i)) + glm::length(eye_)) * glm::length(along);
    return glm::dot(normal, normal) <= tolerance * tolerance ? Vec3(0) : view_from_world_ * normal;
  }

  const Vec3& position(CameraIndex i) const { return rig_.cameras[i].pose.position; }

  const Rig& rig_;
  Mat3 view_from_world_;
  Vec3 eye_;
};

FacePlan plan_face(const CamerasInView& cameras, const MeshFace& face, uint32_t number) {
  FacePlan plan;
  plan.face = number;
  plan.camera = face.camera;
  plan.facing = Vec3(0);
  for (int k = 0; k < face.corners(); k++) plan.facing += cameras.forward(face.camera[k]);
  for (Vec3& edge : plan.edge) edge = Vec3(0);
  const auto& [a, b, c] = face.camera;
  switch (face.corners()) {
    case 3:
      plan.edge[0] = cameras.edge(b, c);
      plan.edge[1] = cameras.edge(c, a);
      plan.edge[2] = cameras.edge(a, b);
      break;
    case 2:
      // A strip between two cameras is the limit of a triangle with its third corner infinitely far away, in both
      // directions of `extent`.
      plan.edge[0] = -cameras.strip_edge(b, face.extent);
      plan.edge[1] = cameras.strip_edge(a, face.extent);
      break;
    default: plan.edge[0] = plan.facing;  // any function will do, because the only corner has weight e / e = 1
  }
  return plan;
}

}  // namespace

ViewPlan::ViewPlan(const Rig& rig, const Mesh& mesh, const View& view, const ParallelFor& parallel)
    : view_(view), rays_(view.lens, view.width, view.height, parallel), camera_rects_(rig.cameras.size()) {
  const Plane& plane = view.focus.map ? view.focus.map->from : view.focus.plane;
  focal_normal_ = glm::transpose(view.pose.rotation()) * plane.normal;
  focal_offset_ = -plane.signed_distance(view.pose.position);
  if (view.focus.map) {
    eye_distance_ = -focal_offset_;
    focal_offset_ = 1;  // every line of sight along the normal meets the map; surfaces behind the eye count as missing
  }
  if (focal_offset_ == 0) return;  // the eye is in the focal plane, so no line of sight meets the plane at t > 0
  const Vec3 in_front = focal_offset_ > 0 ? focal_normal_ : -focal_normal_;

  const Rect whole{0, 0, view.width, view.height};
  if (!view.blending.is_mesh()) {
    add_grid(make_weight_grid(rig, mesh, *this, parallel), whole);
    return;
  }

  const CamerasInView cameras(rig, view.pose);
  const RegionBounds bounds(rays_, view.lens, view.width, view.height, parallel);
  for (uint32_t i = 0; i < mesh.faces.size(); i++) {
    FacePlan face = plan_face(cameras, mesh.faces[i], i);
    if (face.edge[0] + face.edge[1] + face.edge[2] == Vec3(0)) continue;  // no area, so it never contains a pixel
    for (const double sign : {1.0, -1.0}) {
      const Vec3 half_planes[5] = {sign * face.edge[0], sign * face.edge[1], sign * face.edge[2], face.facing,
                                   in_front};
      face.rect = unite(face.rect, bounds.bound(half_planes));
    }
    if (face.rect.empty()) continue;
    bound_corners(face);
    faces_.push_back(face);
  }
  if (!view.blending.extrapolates) return;
  if (auto grid = extrapolated_weights(rig, mesh, *this, FaceRuns(*this, whole, parallel), parallel))
    add_grid(std::move(grid), whole);
}

// Adds a face without corners for everything in front that no other face owns.
void ViewPlan::add_grid(std::shared_ptr<const WeightGrid> grid, const Rect& rect) {
  FacePlan face;
  face.face = faces_.empty() ? 0 : faces_.back().face + 1;
  face.camera.fill(MeshFace::kNone);
  face.edge[0] = face.facing = focal_offset_ > 0 ? focal_normal_ : -focal_normal_;
  face.edge[1] = face.edge[2] = Vec3(0);
  face.rect = rect;
  faces_.push_back(face);
  blend_ = std::move(grid);
  for (CameraIndex i = 0; i < camera_rects_.size(); i++)
    camera_rects_[i] = unite(camera_rects_[i], blend_->camera_rect(i));
}

ViewPlan::ViewPlan(const ViewWarp& warp, size_t num_cameras, const ParallelFor& parallel)
    : rays_(warp.lens, warp.width, warp.height, parallel),
      faces_(warp.faces),
      camera_rects_(num_cameras),
      focal_normal_(warp.in_front),
      focal_offset_(1) {
  view_.width = warp.width;
  view_.height = warp.height;
  view_.lens = warp.lens;
  for (const ViewWarp::Projection& camera : warp.cameras) {
    if (camera.camera >= num_cameras)
      throw Error("camera " + std::to_string(camera.camera) + " is not one of the " + std::to_string(num_cameras) +
                  " of the rig");
    homographies_.emplace_back(camera.camera, camera.camera_from_ray);
  }
  for (const FacePlan& face : faces_) bound_corners(face);
}

void ViewPlan::bound_corners(const FacePlan& face) {
  for (const CameraIndex camera : face.camera)
    if (camera != MeshFace::kNone) camera_rects_[camera] = unite(camera_rects_[camera], face.rect);
}

const Mat3* ViewPlan::explicit_homography(CameraIndex camera) const {
  const auto found = std::ranges::lower_bound(homographies_, camera, {}, &std::pair<CameraIndex, Mat3>::first);
  return found != homographies_.end() && found->first == camera ? &found->second : nullptr;
}

std::vector<CameraIndex> ViewPlan::contributors() const {
  std::vector<CameraIndex> cameras;
  for (CameraIndex i = 0; i < camera_rects_.size(); i++)
    if (!camera_rects_[i].empty()) cameras.push_back(i);
  return cameras;
}

Rect chroma_aligned(const Rect& rect, const View& view) {
  return {rect.x0 & ~1, rect.y0 & ~1, std::min((rect.x1 + 1) & ~1, view.width),
          std::min((rect.y1 + 1) & ~1, view.height)};
}

namespace {

bool is_finite(const Mat3& m) { return lf::is_finite(m[0]) && lf::is_finite(m[1]) && lf::is_finite(m[2]); }

void validate_face(const FacePlan& face, const Rect& view) {
  const auto& [a, b, c] = face.camera;
  const bool two = b != MeshFace::kNone, three = c != MeshFace::kNone;
  if (a == MeshFace::kNone || (three && !two) || (two && a == b) || (three && (a == c || b == c)))
    throw Error("corners: must be one, two or three different cameras");
  if (face.rect.empty() || intersect(face.rect, view) != face.rect) throw Error("rectangle: is not inside the view");
  if (!std::ranges::all_of(face.edge, [](const Vec3& edge) { return lf::is_finite(edge); }))
    throw Error("edges: must be finite numbers");
  if (!lf::is_finite(face.facing)) throw Error("facing: must be finite numbers");
}

}  // namespace

ViewWarp view_warp(const Rig& rig, const ViewPlan& plan) {
  const View& view = plan.view();
  ViewWarp warp{.width = view.width, .height = view.height, .lens = view.lens, .faces = plan.faces()};
  warp.in_front = plan.focal_offset() > 0 ? plan.focal_normal() : -plan.focal_normal();
  for (size_t i = 0; i < warp.faces.size(); i++) warp.faces[i].face = static_cast<uint32_t>(i);
  for (const CameraIndex camera : plan.contributors())
    warp.cameras.push_back({camera, CameraProjection(plan, camera, rig.cameras[camera]).camera_from_ray()});
  return warp;
}

void validate(const ViewWarp& warp) {
  validate_size("width", warp.width);
  validate_size("height", warp.height);
  if (!lf::is_finite(warp.in_front)) throw Error("in_front: must be finite numbers");
  std::vector<CameraIndex> corners;
  for (size_t i = 0; i < warp.faces.size(); i++) {
    try {
      validate_face(warp.faces[i], {0, 0, warp.width, warp.height});
    } catch (const Error& error) {
      throw Error("triangles[" + std::to_string(i) + "]." + error.what());
    }
    for (const CameraIndex camera : warp.faces[i].camera)
      if (camera != MeshFace::kNone) corners.push_back(camera);
  }
  std::ranges::sort(corners);
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  if (!std::ranges::equal(corners, warp.cameras, {}, {}, &ViewWarp::Projection::camera))
    throw Error("cameras: must be the triangles' corners, ascending");
  for (size_t i = 0; i < warp.cameras.size(); i++)
    if (!is_finite(warp.cameras[i].camera_from_ray))
      throw Error("cameras[" + std::to_string(i) + "].matrix: must be finite numbers");
}

}  // namespace lf
