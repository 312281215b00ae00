// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/text.h"
#include "rig/source_security.h"

namespace lf {
namespace {

// FNV-1a, 64 bits (Fowler, Noll, Vo; draft-eastlake-fnv).
class Fnv1a {
 public:
  void add(uint64_t value) {
    for (int i = 0; i < 8; i++) hash_ = (hash_ ^ ((value >> (8 * i)) & 0xff)) * 0x100000001b3;
  }
  void add(double value) { add(std::bit_cast<uint64_t>(value + 0.0)); }  // + 0.0 turns -0 into 0
  void add(const Vec3& v) {
    for (int i = 0; i < 3; i++) add(v[i]);
  }
  uint64_t hash() const { return hash_; }

 private:
  uint64_t hash_ = 0xcbf29ce484222325;
};

// True if `indices` are the full product of some rows and columns of the grid, in ascending row-major order.
bool find_sub_grid(const Topology& grid, const std::vector<CameraIndex>& indices, int* rows, int* columns) {
  const CameraIndex stride = grid.columns;
  size_t width = 0;
  while (width < indices.size() && indices[width] / stride == indices[0] / stride) width++;
  if (width == 0 || indices.size() % width != 0) return false;
  for (size_t i = 0; i < indices.size(); i++) {
    const CameraIndex row = indices[i] / stride, column = indices[i] % stride;
    if (row != indices[i - i % width] / stride || column != indices[i % width] % stride) return false;
    if (i > 0 && indices[i] <= indices[i - 1]) return false;
  }
  *rows = static_cast<int>(indices.size() / width);
  *columns = static_cast<int>(width);
  return true;
}

void require_length(const char* what, double value) {
  if (!(value > 0 && is_finite(value))) throw Error(std::string(what) + ": must be positive");
}

template <typename Place>
Rig row_of(int cameras, double fov_y_deg, int width, int height, Place place) {
  Rig rig = make_grid_rig({1, cameras, 1, fov_y_deg, width, height});
  for (int i = 0; i < cameras; i++) {
    Camera& camera = rig.cameras[static_cast<size_t>(i)];
    camera.name = format_text("cam_%02d", i);
    camera.pose = place(i);
  }
  return rig;
}

}  // namespace

std::string Camera::label() const { return "camera " + std::to_string(id) + (name.empty() ? "" : " (" + name + ")"); }

uint64_t Rig::hash() const {
  Fnv1a fnv;
  fnv.add(uint64_t{cameras.size()});
  for (const Camera& camera : cameras) {
    fnv.add(static_cast<uint64_t>(camera.width));
    fnv.add(static_cast<uint64_t>(camera.height));
    fnv.add(static_cast<uint64_t>(camera.lens.model()));
    for (int i = 0; i < camera.lens.num_params(); i++) fnv.add(camera.lens.params()[i]);
    fnv.add(camera.pose.position);
    const Quat& q = camera.pose.orientation;
    fnv.add(q.w);
    fnv.add(Vec3(q.x, q.y, q.z));
  }
  fnv.add(static_cast<uint64_t>(topology.type));
  if (topology.type == Topology::Type::kGrid) {
    fnv.add(static_cast<uint64_t>(topology.rows));
    fnv.add(static_cast<uint64_t>(topology.columns));
  } else if (topology.type == Topology::Type::kTriangles) {
    fnv.add(uint64_t{topology.triangles.size()});
    for (const auto& triangle : topology.triangles)
      for (const CameraIndex corner : triangle) fnv.add(uint64_t{corner});
  }
  return fnv.hash() == 0 ? 1 : fnv.hash();
}

std::optional<CameraIndex> Rig::index_of_id(uint32_t id) const {
  for (size_t i = 0; i < cameras.size(); i++)
    if (cameras[i].id == id) return static_cast<CameraIndex>(i);
  return std::nullopt;
}

bool Rig::has_colour() const {
  return std::ranges::any_of(cameras, [](const Camera& camera) { return camera.colour.has_value(); });
}

std::string Rig::resolve(const std::string& path) const {
  if (path.empty() || directory.empty() || is_uri(path)) return path;
  return (std::filesystem::path(directory) / path).string();
}

bool is_uri(const std::string& path) {
  const auto is_alpha = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  size_t n = 0;
  while (n < path.size() && (is_alpha(path[n]) || (n > 0 && ((path[n] >= '0' && path[n] <= '9') || path[n] == '+' ||
                                                             path[n] == '-' || path[n] == '.'))))
    n++;
  if (n < 2) return false;
  // Two characters are not enough, because a colon alone is common in file names: "cam-12:30:05.mkv".
  const std::string_view scheme = std::string_view(path).substr(0, n), rest = std::string_view(path).substr(n);
  return rest.starts_with("://") || (scheme == "file" && rest.starts_with(":/")) ||
         ((scheme == "data" || scheme == "testbin") && rest.starts_with(":"));
}

void rebase_paths(Rig& rig, const std::string& directory) {
  namespace fs = std::filesystem;
  const auto canonical = [](const fs::path& path) {
    std::error_code error;
    const fs::path found = fs::weakly_canonical(path, error);
    if (error) throw Error(path.string() + ": " + error.message());
    return found;
  };
  const fs::path to = canonical(directory.empty() ? "." : directory);
  const auto rewrite = [&](std::string& path) {
    if (path.empty() || is_uri(path) || fs::path(path).is_absolute()) return;
    // Resolves symbolic links in the folder, because ".." does not go back through a link. The file itself may be a
    // link.
    const fs::path from = fs::path(rig.directory.empty() ? "." : rig.directory) / path;
    path = (canonical(from.parent_path()) / from.filename()).lexically_relative(to).string();
  };
  for (Camera& camera : rig.cameras) {
    rewrite(camera.image);
    if (!is_launch_line(rig, camera.source)) rewrite(camera.source);
  }
  rig.directory = directory;
}

Rig rig_subset(const Rig& rig, const std::vector<CameraIndex>& indices) {
  if (indices.empty()) throw Error("a rig needs at least one camera, but the selection is empty");
  Rig sub;
  sub.directory = rig.directory;
  std::vector<bool> taken(rig.cameras.size());
  for (const CameraIndex index : indices) {
    if (index >= rig.cameras.size())
      throw Error("camera index " + std::to_string(index) + ": does not exist, because the rig has only " +
                  std::to_string(rig.cameras.size()) + " cameras");
    if (taken[index])
      throw Error("camera index " + std::to_string(index) +
                  ": listed twice, but a rig can contain each camera only once");
    taken[index] = true;
    sub.cameras.push_back(rig.cameras[index]);
  }
  sub.focus_distance = rig.focus_distance;
  const bool whole = indices.size() == rig.cameras.size() && std::is_sorted(indices.begin(), indices.end());
  if (whole) {
    sub.topology = rig.topology;
  } else if (rig.topology.type == Topology::Type::kGrid &&
             find_sub_grid(rig.topology, indices, &sub.topology.rows, &sub.topology.columns)) {
    sub.topology.type = Topology::Type::kGrid;
  }
  return sub;
}

Rig subsample_grid(const Rig& rig, int n) {
  if (rig.topology.type != Topology::Type::kGrid)
    throw Error("every: the rig's topology is not a grid, so there are no rows and columns to select");
  if (n < 1) throw Error("every: must be at least 1, but is " + std::to_string(n));
  std::vector<CameraIndex> indices;
  for (int64_t row = 0; row < rig.topology.rows; row += n)
    for (int64_t column = 0; column < rig.topology.columns; column += n)
      indices.push_back(static_cast<CameraIndex>(row * rig.topology.columns + column));
  return rig_subset(rig, indices);
}

std::vector<CameraIndex> parse_camera_list(const Rig& rig, const std::string& list) {
  std::unordered_map<uint32_t, CameraIndex> index_of;
  for (size_t i = 0; i < rig.cameras.size(); i++) index_of.emplace(rig.cameras[i].id, static_cast<CameraIndex>(i));
  std::vector<bool> wanted(rig.cameras.size(), list.empty());

  for (size_t begin = 0; !list.empty() && begin <= list.size();) {
    const size_t end = std::min(list.find(',', begin), list.size());
    const std::string part = list.substr(begin, end - begin);
    begin = end + 1;

    const auto fail = [&](const std::string& what) {
      throw Error("camera list \"" + list + "\": \"" + part + "\": " + what);
    };
    const char* at = part.data();
    const char* const stop = at + part.size();
    const auto number = [&] {
      uint32_t id = 0;
      const auto [next, error] = std::from_chars(at, stop, id);
      if (error != std::errc()) fail("must be a camera id such as 7, or a range such as 0-3");
      at = next;
      return id;
    };
    const uint32_t first = number();
    uint32_t last = first;
    if (at != stop && *at == '-') {
      at++;
      last = number();
    }
    if (at != stop) fail("must be a camera id such as 7, or a range such as 0-3");
    if (last < first) fail("the end of the range is below its start; write the smaller id first");
    for (uint64_t id = first; id <= last; id++) {
      const auto found = index_of.find(static_cast<uint32_t>(id));
      if (found == index_of.end()) fail("the rig has no camera with id " + std::to_string(id));
      wanted[found->second] = true;
    }
  }

  std::vector<CameraIndex> indices;
  for (size_t i = 0; i < wanted.size(); i++)
    if (wanted[i]) indices.push_back(static_cast<CameraIndex>(i));
  return indices;
}

CameraRanges::CameraRanges(std::span<const CameraIndex> cameras) {
  for (const CameraIndex camera : cameras) {
    if (!ranges_.empty() && ranges_.back().last + 1 == camera)
      ranges_.back().last = camera;
    else
      ranges_.push_back({camera, camera});
  }
}

bool CameraRanges::append(const CameraRange& range) {
  if (range.first > range.last) return false;
  if (!ranges_.empty() && range.first <= ranges_.back().last + 1) return false;
  ranges_.push_back(range);
  return true;
}

void CameraRanges::add(const CameraRanges& other) {
  std::vector<CameraRange> all;
  std::ranges::merge(ranges_, other.ranges_, std::back_inserter(all), {}, &CameraRange::first, &CameraRange::first);
  ranges_.clear();
  for (const CameraRange& range : all) {
    if (!ranges_.empty() && range.first <= ranges_.back().last + 1)
      ranges_.back().last = std::max(ranges_.back().last, range.last);
    else
      ranges_.push_back(range);
  }
}

void CameraRanges::remove(const CameraRanges& other) {
  std::vector<CameraRange> left;
  auto hole = other.ranges_.begin();
  for (CameraRange range : ranges_) {
    while (hole != other.ranges_.end() && hole->last < range.first) ++hole;
    bool any_left = true;
    for (auto h = hole; h != other.ranges_.end() && h->first <= range.last; ++h) {
      if (h->first > range.first) left.push_back({range.first, h->first - 1});
      any_left = h->last < range.last;
      if (!any_left) break;
      range.first = h->last + 1;
    }
    if (any_left) left.push_back(range);
  }
  ranges_ = std::move(left);
}

bool CameraRanges::contains(CameraIndex camera) const {
  const auto after = std::ranges::upper_bound(ranges_, camera, {}, &CameraRange::first);
  return after != ranges_.begin() && camera <= std::prev(after)->last;
}

bool CameraRanges::contains(const CameraRanges& other) const {
  return std::ranges::all_of(other.ranges_, [this](const CameraRange& range) {
    const auto after = std::ranges::upper_bound(ranges_, range.first, {}, &CameraRange::first);
    return after != ranges_.begin() && range.last <= std::prev(after)->last;
  });
}

bool CameraRanges::intersects(const CameraRanges& other) const {
  for (auto a = ranges_.begin(), b = other.ranges_.begin(); a != ranges_.end() && b != other.ranges_.end();) {
    if (a->last < b->first)
      ++a;
    else if (b->last < a->first)
      ++b;
    else
      return true;
  }
  return false;
}

size_t CameraRanges::size() const {
  size_t count = 0;
  for (const CameraRange& range : ranges_) count += range.last - range.first + 1;
  return count;
}

CameraSet CameraRanges::cameras() const {
  CameraSet all;
  all.reserve(size());
  for (const CameraRange& range : ranges_)
    for (CameraIndex camera = range.first; camera <= range.last; camera++) all.push_back(camera);
  return all;
}

std::pair<Vec3, Vec3> bounding_box(const Rig& rig) {
  Vec3 least(std::numeric_limits<double>::infinity()), most(-std::numeric_limits<double>::infinity());
  for (const Camera& camera : rig.cameras) {
    least = glm::min(least, camera.pose.position);
    most = glm::max(most, camera.pose.position);
  }
  return {least, most};
}

int widest_axis(const Rig& rig) {
  const auto [least, most] = bounding_box(rig);
  const Vec3 size = most - least;
  return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// Two cameras are at most as far apart as the sum of their distances from the centre. Tries pairs from the outside in,
// until these sums are no larger than the distance found.
double largest_distance(const Rig& rig) {
  if (rig.cameras.size() < 2) return 0;
  const auto [least, most] = bounding_box(rig);
  const Vec3 centre = 0.5 * (least + most);
  std::vector<std::pair<double, Vec3>> places;
  for (const Camera& camera : rig.cameras)
    places.emplace_back(glm::distance(camera.pose.position, centre), camera.pose.position);
  std::ranges::sort(places, [](const auto& a, const auto& b) { return a.first > b.first; });
  double largest = 0;
  Vec3 from = places[0].second;
  for (int i = 0; i < 3; i++) {
    Vec3 farthest = from;
    for (const auto& [radius, place] : places)
      if (glm::distance(from, place) > glm::distance(from, farthest)) farthest = place;
    largest = std::max(largest, glm::distance(from, farthest));
    from = farthest;
  }
  constexpr double kExact = 1 + 1e-9;
  for (size_t i = 0; i < places.size() && 2 * places[i].first > largest * kExact; i++)
    for (size_t j = i + 1; j < places.size() && places[i].first + places[j].first > largest * kExact; j++)
      largest = std::max(largest, glm::distance(places[i].second, places[j].second));
  return largest;
}

// Searches in both directions along the widest axis, until the distance along this axis exceeds the nearest distance
// found.
double mean_nearest_distance(const Rig& rig) {
  if (rig.cameras.size() < 2) return 0;
  const int axis = widest_axis(rig);
  std::vector<Vec3> places;
  for (const Camera& camera : rig.cameras) places.push_back(camera.pose.position);
  std::ranges::sort(places, [axis](const Vec3& a, const Vec3& b) { return a[axis] < b[axis]; });
  double sum = 0;
  for (size_t i = 0; i < places.size(); i++) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = i + 1; j < places.size() && places[j][axis] - places[i][axis] < nearest; j++)
      nearest = std::min(nearest, glm::distance(places[i], places[j]));
    for (size_t j = i; j-- > 0 && places[i][axis] - places[j][axis] < nearest;)
      nearest = std::min(nearest, glm::distance(places[i], places[j]));
    sum += nearest;
  }
  return sum / static_cast<double>(places.size());
}

Rig make_grid_rig(const GridRigOptions& options) {
  const auto require_range = [](const char* what, int value, int most) {
    if (value < 1 || value > most)
      throw Error(std::string(what) + ": must be 1 to " + std::to_string(most) + ", but is " + std::to_string(value));
  };
  require_range("rows", options.rows, kMaxCameras);
  require_range("columns", options.columns, kMaxCameras);
  if (static_cast<int64_t>(options.rows) * options.columns > kMaxCameras)
    throw Error("rows x columns: a rig has at most " + std::to_string(kMaxCameras) + " cameras");
  require_range("width", options.width, kMaxImageSize);
  require_range("height", options.height, kMaxImageSize);
  require_length("pitch", options.pitch);
  const Lens pinhole = Lens::from_fov_y(options.fov_y_deg, options.width, options.height);
  const Lens lens(LensModel::kRadial, {pinhole.fx(), pinhole.cx(), pinhole.cy(), 0, 0});

  Rig rig;
  rig.topology = {Topology::Type::kGrid, options.rows, options.columns, {}};
  for (int row = 0; row < options.rows; row++)
    for (int column = 0; column < options.columns; column++) {
      Camera camera;
      camera.id = static_cast<uint32_t>(rig.cameras.size());
      camera.name = format_text("cam_%02d_%02d", row, column);
      camera.width = options.width;
      camera.height = options.height;
      camera.lens = lens;
      camera.pose.position =
          Vec3(column - (options.columns - 1) / 2.0, row - (options.rows - 1) / 2.0, 0) * options.pitch;
      rig.cameras.push_back(camera);
    }
  return rig;
}

Rig make_arc_rig(const ArcRigOptions& options) {
  require_length("pitch", options.pitch);
  require_length("radius", options.radius);
  const double step = 2 * std::asin(std::min(1.0, options.pitch / (2 * options.radius)));
  if (step * (options.cameras - 1) >= std::numbers::pi || options.pitch > 2 * options.radius)
    throw Error("radius: " + std::to_string(options.cameras) +
                " cameras at this pitch go around half the circle or more, which is too much for an arc; increase the "
                "radius, or make several rigs");
  return row_of(options.cameras, options.fov_y_deg, options.width, options.height, [&](int i) {
    const double angle = step * (i - (options.cameras - 1) / 2.0);
    Pose pose;
    pose.position = options.radius * Vec3(std::sin(angle), 0, 1 - std::cos(angle));
    pose.orientation = Quat(std::cos(angle / 2), 0, -std::sin(angle / 2), 0);
    return pose;
  });
}

Rig make_ring_rig(const RingRigOptions& options) {
  require_length("radius", options.radius);
  if (options.cameras < 3)
    throw Error("ring: needs at least 3 cameras to form a circle, but has " + std::to_string(options.cameras));
  Rig rig = row_of(options.cameras, options.fov_y_deg, options.width, options.height, [&](int i) {
    const double angle = 2 * std::numbers::pi * i / options.cameras;
    Pose pose;
    pose.position = options.radius * Vec3(std::sin(angle), -std::cos(angle), 0);
    return pose;
  });
  rig.topology = {};
  return rig;
}

Rig make_cylinder_rig(const CylinderRigOptions& options) {
  require_length("pitch", options.pitch);
  require_length("radius", options.radius);
  if (options.rows < 2) throw Error("rows: a cylinder needs at least 2 rows, but has " + std::to_string(options.rows));
  if (options.columns < 3)
    throw Error("columns: a cylinder needs at least 3 columns, but has " + std::to_string(options.columns));
  Rig rig =
      make_grid_rig({options.rows, options.columns, options.pitch, options.fov_y_deg, options.width, options.height});
  const double side = options.inward ? -1 : 1;
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i % options.columns) / options.columns;
    Pose& pose = rig.cameras[i].pose;
    pose.position.x = options.radius * std::sin(angle);
    pose.position.z = options.radius * (side * std::cos(angle) + (options.inward ? 1 : 0));
    pose.orientation = Quat(std::cos(angle / 2), 0, side * std::sin(angle / 2), 0);
  }
  rig.topology = {.type = Topology::Type::kTriangles};
  const CameraIndex columns = static_cast<CameraIndex>(options.columns);
  for (CameraIndex row = 0; row + 1 < static_cast<CameraIndex>(options.rows); row++)
    for (CameraIndex column = 0; column < columns; column++) {
      const CameraIndex a = row * columns + column, b = row * columns + (column + 1) % columns;
      rig.topology.triangles.push_back({a, b, a + columns});
      rig.topology.triangles.push_back({b, b + columns, a + columns});
    }
  return rig;
}

}  // namespace lf
