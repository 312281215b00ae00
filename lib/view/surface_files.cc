// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/surface_files.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/text.h"
#include "image/image_file.h"

namespace lf {

void save_depth_pfm(const DepthImage& image, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  AtomicFileWriter file(path);
  file.write("Pf\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n-1\n");  // little-endian
  for (int y = image.height - 1; y >= 0; y--)
    file.write({reinterpret_cast<const char*>(image.depths.data() + static_cast<size_t>(y) * image.width),
                static_cast<size_t>(image.width) * sizeof(float)});
  file.commit();
}

void save_depth_png(const DepthImage& image, const std::string& path) {
  constexpr float kMillimetres = 1000;
  std::vector<uint16_t> pixels(image.depths.size());
  std::ranges::transform(image.depths, pixels.begin(), [](float depth) {
    return static_cast<uint16_t>(std::lround(std::min(depth * kMillimetres, 65535.0f)));
  });
  save_grey_png(pixels, image.width, image.height, path);
}

void save_confidence_png(const FocalMap* confidence, int width, int height, const std::string& path) {
  std::vector<uint8_t> pixels(static_cast<size_t>(width) * static_cast<size_t>(height));
  std::vector<float> row(static_cast<size_t>(width));
  for (int y = 0; confidence && y < height; y++) {
    confidence->inverse_row(0, 1, y, width, row.data());
    std::ranges::transform(row, pixels.begin() + ptrdiff_t{y} * width,
                           [](float value) { return static_cast<uint8_t>(std::lround(255 * value)); });
  }
  save_grey_png(pixels, width, height, path);
}

namespace {

// Returns true if the depths of a pixel and its neighbours belong to one surface. Requires known and finite depths.
bool is_inside(const DepthImage& image, int x, int y) {
  constexpr float kEdge = 0.05f;
  const auto at = [&](int column, int row) { return image.depths[static_cast<size_t>(row) * image.width + column]; };
  const float depth = at(x, y);
  const auto is_near = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= image.width || row >= image.height) return true;
    return std::abs(at(column, row) - depth) <= kEdge * depth;
  };
  return depth > 0 && std::isfinite(depth) && is_near(x - 1, y) && is_near(x + 1, y) && is_near(x, y - 1) &&
         is_near(x, y + 1);
}

}  // namespace

std::vector<ColouredPoint> point_cloud(const View& view, const DepthImage& depths, const ImageView& rgb) {
  const Mat3 world_from_view = view.pose.rotation();
  std::vector<ColouredPoint> points;
  for (int y = 0; y < depths.height; y++)
    for (int x = 0; x < depths.width; x++) {
      if (!is_inside(depths, x, y)) continue;
      const std::optional<Vec2> ray = view.lens.unproject({x, y});
      if (!ray) continue;
      const double depth = depths.depths[static_cast<size_t>(y) * depths.width + x];
      const Vec3 point = view.pose.position + world_from_view * (depth * Vec3(*ray, 1));
      const uint8_t* const pixel = rgb.plane[0] + y * rgb.stride[0] + ptrdiff_t{x} * rgb.layout.pixel_stride;
      points.push_back({static_cast<float>(point.x), static_cast<float>(point.y), static_cast<float>(point.z),
                        pixel[rgb.layout.r], pixel[rgb.layout.g], pixel[rgb.layout.b]});
    }
  return points;
}

void save_ply(const std::vector<ColouredPoint>& points, const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  constexpr size_t kPosition = 3 * sizeof(float), kVertex = kPosition + 3;
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                      "property uchar green\nproperty uchar blue\nend_header\n";
  const size_t header = bytes.size();
  bytes.resize(header + kVertex * points.size());
  char* to = bytes.data() + header;
  for (const ColouredPoint& point : points) {
    std::memcpy(to, &point.x, kPosition);
    std::memcpy(to + kPosition, &point.red, 3);
    to += kVertex;
  }
  AtomicFileWriter file(path);
  file.write(bytes);
  file.commit();
}

namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Adds the two triangles of a square of vertices, without those that cross an edge of an object.
void add_square(const std::array<uint32_t, 4>& corners, const std::vector<float>& depths, SurfaceMesh& mesh) {
  constexpr float kEdge = 0.1f;
  // top left, top right, bottom left, bottom right
  for (const auto& [a, b, c] : {std::array{0, 2, 1}, {1, 2, 3}}) {
    const std::array<uint32_t, 3> triangle{corners[static_cast<size_t>(a)], corners[static_cast<size_t>(b)],
                                           corners[static_cast<size_t>(c)]};
    if (std::ranges::find(triangle, kNone) != triangle.end()) continue;
    const auto [near, far] = std::minmax({depths[triangle[0]], depths[triangle[1]], depths[triangle[2]]});
    if (far - near <= kEdge * near) mesh.triangles.insert(mesh.triangles.end(), triangle.begin(), triangle.end());
  }
}

template <typename Item>
std::string_view bytes_of(const std::vector<Item>& items) {
  return {reinterpret_cast<const char*>(items.data()), items.size() * sizeof(Item)};
}

// The binary part of the file. Each part starts at a multiple of four bytes.
struct Parts {
  std::string bytes;
  nlohmann::ordered_json views = nlohmann::ordered_json::array();

  void add(std::string_view part, int target = 0) {
    nlohmann::ordered_json view = {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", part.size()}};
    if (target != 0) view["target"] = target;
    views.push_back(std::move(view));
    bytes += part;
    bytes.resize((bytes.size() + 3) / 4 * 4);
  }
};

void append(std::string& to, uint32_t number) {
  static_assert(std::endian::native == std::endian::little);
  to.append(reinterpret_cast<const char*>(&number), sizeof number);
}

nlohmann::ordered_json accessors_of(const std::vector<std::array<float, 3>>& positions, const SurfaceMesh& mesh) {
  using Json = nlohmann::ordered_json;
  constexpr int kFloat = 5126, kUint = 5125;
  std::array<float, 3> low{}, high{};
  if (!positions.empty()) low = high = positions[0];
  for (const auto& position : positions)
    for (size_t i = 0; i < 3; i++) {
      low[i] = std::min(low[i], position[i]);
      high[i] = std::max(high[i], position[i]);
    }
  const auto accessor = [](int view, int component, size_t count, const char* type) {
    return Json{{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}};
  };
  Json of_positions = accessor(0, kFloat, positions.size(), "VEC3");
  of_positions["min"] = low;
  of_positions["max"] = high;
  return Json::array({of_positions, accessor(1, kFloat, mesh.places.size(), "VEC2"),
                      accessor(2, kUint, mesh.triangles.size(), "SCALAR")});
}

}  // namespace

SurfaceMesh surface_mesh(const View& view, std::span<const float> coverage) {
  const int step = view.focus.map ? view.focus.map->step : FocalMap::kMinStep;
  const int columns = FocalMap::nodes(view.width, step), rows = FocalMap::nodes(view.height, step);
  const Mat3 world_from_view = view.pose.rotation();
  SurfaceMesh mesh;
  std::vector<uint32_t> vertex(static_cast<size_t>(columns) * rows, kNone);
  std::vector<float> depths;
  for (int j = 0; j < rows; j++)
    for (int i = 0; i < columns; i++) {
      const Vec2 at((i + 0.5) * step - 0.5, (j + 0.5) * step - 0.5);
      const auto pixel = static_cast<size_t>(std::min<double>(at.y, view.height - 1)) * view.width +
                         static_cast<size_t>(std::min<double>(at.x, view.width - 1));
      const float depth = depth_at(view, at);
      if (!(depth > 0) || std::isinf(depth) || (!coverage.empty() && !(coverage[pixel] > 0))) continue;
      const Vec3 point =
          view.pose.position + world_from_view * (static_cast<double>(depth) * Vec3(*view.lens.unproject(at), 1));
      vertex[static_cast<size_t>(j) * columns + i] = static_cast<uint32_t>(mesh.positions.size());
      mesh.positions.push_back({static_cast<float>(point.x), static_cast<float>(point.y), static_cast<float>(point.z)});
      mesh.places.push_back(
          {static_cast<float>((at.x + 0.5) / view.width), static_cast<float>((at.y + 0.5) / view.height)});
      depths.push_back(depth);
    }
  for (int j = 0; j + 1 < rows; j++)
    for (int i = 0; i + 1 < columns; i++) {
      const uint32_t* const top = &vertex[static_cast<size_t>(j) * columns + i];
      add_square({top[0], top[1], top[columns], top[columns + 1]}, depths, mesh);
    }
  return mesh;
}

void save_gltf(const View& view, const SurfaceMesh& mesh, const Image& rgb, const std::string& path) {
  constexpr int kQuality = 95, kArray = 34962, kElements = 34963, kClamp = 33071;
  std::vector<std::array<float, 3>> positions = mesh.positions;
  for (auto& [x, y, z] : positions) y = -y, z = -z;
  Parts parts;
  parts.add(bytes_of(positions), kArray);
  parts.add(bytes_of(mesh.places), kArray);
  parts.add(bytes_of(mesh.triangles), kElements);
  parts.add(bytes_of(encode_jpeg(rgb, kQuality)));
  const Vec3& eye = view.pose.position;
  const Quat& q = view.pose.orientation;
  using Json = nlohmann::ordered_json;
  const auto one = [](Json item) { return Json::array({std::move(item)}); };
  Json json;
  json["asset"] = {{"version", "2.0"}, {"generator", "gst-lightfield"}};
  json["extensionsUsed"] = one("KHR_materials_unlit");
  json["scene"] = 0;
  json["scenes"] = one({{"nodes", {0, 1}}});
  // Turning the axes by half a turn about x changes the signs of y and z, in positions and in rotations.
  const Json camera = {{"camera", 0}, {"translation", {eye.x, -eye.y, -eye.z}}, {"rotation", {q.x, -q.y, -q.z, q.w}}};
  json["nodes"] = Json::array({Json{{"mesh", 0}}, camera});
  const Json perspective = {{"yfov", 2 * std::atan(view.height / 2.0 / view.lens.fy())},
                            {"aspectRatio", static_cast<double>(view.width) / view.height},
                            {"znear", 0.01}};
  json["cameras"] = one({{"type", "perspective"}, {"perspective", perspective}});
  const Json primitive = {{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}};
  json["meshes"] = one({{"primitives", one(primitive)}});
  json["materials"] = one({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}},
                           {"doubleSided", true},
                           {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  json["textures"] = one({{"source", 0}, {"sampler", 0}});
  json["samplers"] = one({{"wrapS", kClamp}, {"wrapT", kClamp}});
  json["images"] = one({{"bufferView", 3}, {"mimeType", "image/jpeg"}});
  json["accessors"] = accessors_of(positions, mesh);
  json["bufferViews"] = parts.views;
  json["buffers"] = one({{"byteLength", parts.bytes.size()}});
  std::string text = json.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string header("glTF");
  append(header, 2);
  append(header, static_cast<uint32_t>(12 + 8 + text.size() + 8 + parts.bytes.size()));
  append(header, static_cast<uint32_t>(text.size()));
  header += "JSON" + text;
  append(header, static_cast<uint32_t>(parts.bytes.size()));
  header.append("BIN\0", 4);
  AtomicFileWriter file(path);
  file.write(header);
  file.write(parts.bytes);
  file.commit();
}

}  // namespace lf
