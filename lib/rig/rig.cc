// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <string_view>
#include <unordered_map>

#include "base/error.h"
#include "rig/bin_description.h"

namespace lf {

namespace {

// FNV-1a, 64 bits (Fowler, Noll, Vo; draft-eastlake-fnv).
class Fnv1a {
 public:
  void add(uint64_t value) {
    for (int i = 0; i < 8; i++) hash_ = (hash_ ^ ((value >> (8 * i)) & 0xff)) * 0x100000001b3;
  }
  void add(double value) { add(std::bit_cast<uint64_t>(value + 0.0)); }  // -0 and 0 make the same picture
  void add(const Vec3& v) {
    for (int i = 0; i < 3; i++) add(v[i]);
  }
  uint64_t hash() const { return hash_; }

 private:
  uint64_t hash_ = 0xcbf29ce484222325;
};

// The columns and rows of a grid that `indices` are the full product of, in ascending row-major order.
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

}  // namespace

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
  return (std::filesystem::path(directory) / path).string();  // an absolute `path` replaces `directory`
}

bool is_uri(const std::string& path) {
  const auto is_alpha = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  size_t n = 0;
  while (n < path.size() && (is_alpha(path[n]) || (n > 0 && ((path[n] >= '0' && path[n] <= '9') || path[n] == '+' ||
                                                             path[n] == '-' || path[n] == '.'))))
    n++;
  if (n < 2) return false;
  // A colon alone is common in names of files: "cam-12:30:05.mkv".
  const std::string_view scheme = std::string_view(path).substr(0, n), rest = std::string_view(path).substr(n);
  return rest.starts_with("://") || (scheme == "file" && rest.starts_with(":/")) ||
         ((scheme == "data" || scheme == "testbin") && rest.starts_with(":"));
}

void relocate(Rig& rig, const std::string& directory) {
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
    // Folders may be links, which ".." does not go back through; what the file itself is does not matter.
    const fs::path from = fs::path(rig.directory.empty() ? "." : rig.directory) / path;
    path = (canonical(from.parent_path()) / from.filename()).lexically_relative(to).string();
  };
  for (Camera& camera : rig.cameras) {
    rewrite(camera.image);
    if (!describes_elements(rig, camera.source)) rewrite(camera.source);
  }
  rig.directory = directory;
}

Rig sub_rig(const Rig& rig, const std::vector<CameraIndex>& indices) {
  if (indices.empty()) throw Error("a rig needs at least one camera");
  Rig sub;
  sub.directory = rig.directory;
  std::vector<bool> taken(rig.cameras.size());
  for (const CameraIndex index : indices) {
    if (index >= rig.cameras.size())
      throw Error("camera index " + std::to_string(index) + ": the rig has " + std::to_string(rig.cameras.size()) +
                  " cameras");
    if (taken[index]) throw Error("camera index " + std::to_string(index) + ": named twice");
    taken[index] = true;
    sub.cameras.push_back(rig.cameras[index]);
  }
  const bool whole = indices.size() == rig.cameras.size() && std::is_sorted(indices.begin(), indices.end());
  if (whole) {
    sub.topology = rig.topology;
  } else if (rig.topology.type == Topology::Type::kGrid &&
             find_sub_grid(rig.topology, indices, &sub.topology.rows, &sub.topology.columns)) {
    sub.topology.type = Topology::Type::kGrid;
  }
  return sub;
}

Rig every_nth(const Rig& rig, int n) {
  if (rig.topology.type != Topology::Type::kGrid) throw Error("every: the rig's topology is not a grid");
  if (n < 1) throw Error("every: must be at least 1, is " + std::to_string(n));
  std::vector<CameraIndex> indices;
  for (int64_t row = 0; row < rig.topology.rows; row += n)
    for (int64_t column = 0; column < rig.topology.columns; column += n)
      indices.push_back(static_cast<CameraIndex>(row * rig.topology.columns + column));
  return sub_rig(rig, indices);
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
      if (error != std::errc()) fail("must be a camera id or a range of them like 0-3");
      at = next;
      return id;
    };
    const uint32_t first = number();
    uint32_t last = first;
    if (at != stop && *at == '-') {
      at++;
      last = number();
    }
    if (at != stop) fail("must be a camera id or a range of them like 0-3");
    if (last < first) fail("the range runs backwards");
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

Rig make_grid_rig(const GridRigOptions& options) {
  const auto require_range = [](const char* what, int value, int most) {
    if (value < 1 || value > most)
      throw Error(std::string(what) + ": must be 1 to " + std::to_string(most) + ", is " + std::to_string(value));
  };
  require_range("rows", options.rows, kMaxCameras);
  require_range("columns", options.columns, kMaxCameras);
  if (static_cast<int64_t>(options.rows) * options.columns > kMaxCameras)
    throw Error("rows x columns: at most " + std::to_string(kMaxCameras) + " cameras");
  require_range("width", options.width, kMaxImageSize);
  require_range("height", options.height, kMaxImageSize);
  if (!(options.pitch > 0 && is_finite(options.pitch))) throw Error("pitch: must be positive");
  const Lens pinhole = Lens::from_fov_y(options.fov_y_deg, options.width, options.height);
  const Lens lens(LensModel::kRadial, {pinhole.fx(), pinhole.cx(), pinhole.cy(), 0, 0});

  Rig rig;
  rig.topology = {Topology::Type::kGrid, options.rows, options.columns, {}};
  for (int row = 0; row < options.rows; row++)
    for (int column = 0; column < options.columns; column++) {
      char name[40];
      std::snprintf(name, sizeof(name), "cam_%02d_%02d", row, column);
      Camera camera;
      camera.id = static_cast<uint32_t>(rig.cameras.size());
      camera.name = name;
      camera.width = options.width;
      camera.height = options.height;
      camera.lens = lens;
      camera.pose.position =
          Vec3(column - (options.columns - 1) / 2.0, row - (options.rows - 1) / 2.0, 0) * options.pitch;
      rig.cameras.push_back(camera);
    }
  return rig;
}

}  // namespace lf
