// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/surface_files.h"

#include <cstring>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "image/image_file.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr int kWidth = 61, kHeight = 35;

// A view whose map is near in the left half and far in the right half.
class GltfTest : public testing::Test {
 protected:
  GltfTest() : picture_(PixelFamily::kRgb, kWidth, kHeight) {
    for (size_t i = 0; i < picture_.data().size(); i++) picture_.data()[i] = static_cast<uint8_t>(i / 30);
    FocalMap map = FocalMap::for_view(kWidth, kHeight);
    map.from = plane_through({0, 0, 0}, {0, 0, 1});
    map.nearest = 1;
    columns_ = static_cast<size_t>(map.columns);
    rows_ = static_cast<size_t>(map.rows);
    for (size_t i = 0; i < columns_ * rows_; i++)
      map.levels.push_back(i % columns_ < columns_ / 2 ? uint8_t{200} : uint8_t{100});
    view_.focus.map = std::make_shared<const FocalMap>(map);
  }

  View view_{kWidth,
             kHeight,
             Lens(LensModel::kRadial, {70, 29, 18, -0.1, 0.01}),
             {{0.3, -0.2, -0.5}, glm::normalize(Quat(1, 0.1, -0.2, 0.05))},
             {plane_through({0, 0, 2}, glm::normalize(Vec3(0.2, 0.1, 1)))}};
  size_t columns_ = 0, rows_ = 0;
  Image picture_;
};

TEST_F(GltfTest, VerticesProjectToTheirPlaces) {
  for (const bool has_map : {true, false}) {
    if (!has_map) view_.focus.map = nullptr;
    const SurfaceMesh mesh = surface_mesh(view_);
    ASSERT_EQ(mesh.positions.size(), columns_ * rows_);
    ASSERT_EQ(mesh.places.size(), mesh.positions.size());
    for (size_t i = 0; i < mesh.positions.size(); i++) {
      const auto& [x, y, z] = mesh.positions[i];
      const Vec3 seen = glm::transpose(view_.pose.rotation()) * (Vec3(x, y, z) - view_.pose.position);
      const std::optional<Vec2> pixel = view_.lens.project(seen);
      ASSERT_TRUE(pixel);
      EXPECT_NEAR((pixel->x + 0.5) / kWidth, mesh.places[i][0], 1e-5);
      EXPECT_NEAR((pixel->y + 0.5) / kHeight, mesh.places[i][1], 1e-5);
      const double expected = has_map ? 1 / view_.focus.map->inverse_of(i % columns_ < columns_ / 2 ? 200 : 100) : 0;
      EXPECT_NEAR(has_map ? z : view_.focus.plane.signed_distance({x, y, z}), expected, 1e-5);
    }
    // The squares at the edge are missing. Triangles turn counter-clockwise in the picture; its y axis points down.
    EXPECT_EQ(mesh.triangles.size(), 6 * (columns_ - (has_map ? 2 : 1)) * (rows_ - 1));
    for (size_t i = 0; i < mesh.triangles.size(); i += 3) {
      const auto at = [&](size_t k) {
        return Vec2(mesh.places.at(mesh.triangles[i + k])[0], mesh.places.at(mesh.triangles[i + k])[1]);
      };
      const Vec2 a = at(1) - at(0), b = at(2) - at(0);
      ASSERT_LT(a.x * b.y - a.y * b.x, 0);
    }
  }
}

TEST_F(GltfTest, UnknownDepthsHaveNoVertices) {
  std::vector<float> coverage(size_t{kWidth} * kHeight, 1);
  std::fill_n(coverage.begin(), size_t{kWidth} * 8, 0.f);  // two rows of nodes
  EXPECT_EQ(surface_mesh(view_, coverage).positions.size(), columns_ * (rows_ - 2));
  FocalMap far = *view_.focus.map;
  far.levels[0] = 0;
  view_.focus.map = std::make_shared<const FocalMap>(far);
  EXPECT_EQ(surface_mesh(view_).positions.size(), columns_ * rows_ - 1) << "infinity";
}

// Reads a number of the file, which is little-endian.
template <typename Number>
Number number_at(const std::string& bytes, size_t at) {
  Number number;
  EXPECT_LE(at + sizeof number, bytes.size());
  if (at + sizeof number > bytes.size()) return {};
  std::memcpy(&number, &bytes[at], sizeof number);
  return number;
}

TEST_F(GltfTest, FilesAreBinaryGltf) {
  const TempDir folder;
  const SurfaceMesh mesh = surface_mesh(view_);
  save_gltf(view_, mesh, picture_, folder / "view.glb");
  const std::string bytes = read_file(folder / "view.glb");
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(number_at<uint32_t>(bytes, 4), 2u);
  EXPECT_EQ(number_at<uint32_t>(bytes, 8), bytes.size());
  const size_t length = number_at<uint32_t>(bytes, 12);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  EXPECT_EQ(length % 4, 0u);
  const nlohmann::json json = nlohmann::json::parse(bytes.substr(20, length));
  EXPECT_EQ(bytes.substr(24 + length, 4), std::string("BIN\0", 4));
  const std::string binary = bytes.substr(28 + length);
  EXPECT_EQ(number_at<uint32_t>(bytes, 20 + length), binary.size());
  EXPECT_EQ(json.at("/buffers/0/byteLength"_json_pointer), binary.size());
  EXPECT_EQ(json.at("/asset/version"_json_pointer), "2.0");

  const nlohmann::json& primitive = json.at("/meshes/0/primitives/0"_json_pointer);
  const auto check = [&](const nlohmann::json& index, const char* type, int component, size_t count) {
    const nlohmann::json& accessor = json.at("accessors").at(index.get<size_t>());
    EXPECT_EQ(accessor.at("type"), type);
    EXPECT_EQ(accessor.at("componentType"), component);
    EXPECT_EQ(accessor.at("count"), count);
    const nlohmann::json& view = json.at("bufferViews").at(accessor.at("bufferView").get<size_t>());
    EXPECT_EQ(view.at("byteOffset").get<size_t>() % 4, 0u);
    return view.at("byteOffset").get<size_t>();
  };
  const size_t positions = check(primitive.at("/attributes/POSITION"_json_pointer), "VEC3", 5126, mesh.places.size());
  const size_t places = check(primitive.at("/attributes/TEXCOORD_0"_json_pointer), "VEC2", 5126, mesh.places.size());
  const size_t triangles = check(primitive.at("indices"), "SCALAR", 5125, mesh.triangles.size());
  const nlohmann::json &low = json.at("/accessors/0/min"_json_pointer),
                       &high = json.at("/accessors/0/max"_json_pointer);
  for (size_t i = 0; i < mesh.positions.size(); i++)
    for (size_t k = 0; k < 3; k++) {
      const auto value = number_at<float>(binary, positions + 12 * i + 4 * k);
      EXPECT_EQ(value, k == 0 ? mesh.positions[i][k] : -mesh.positions[i][k]) << "y is up, and z backward";
      EXPECT_TRUE(low[k].get<float>() <= value && value <= high[k].get<float>());
    }
  for (size_t i = 0; i < mesh.places.size(); i++)
    for (size_t k = 0; k < 2; k++) {
      EXPECT_EQ(number_at<float>(binary, places + 8 * i + 4 * k), mesh.places[i][k]);
    }
  for (size_t i = 0; i < mesh.triangles.size(); i++)
    EXPECT_EQ(number_at<uint32_t>(binary, triangles + 4 * i), mesh.triangles[i]);

  const nlohmann::json& image = json.at("bufferViews").at(json.at("/images/0/bufferView"_json_pointer).get<size_t>());
  const std::string jpeg = binary.substr(image.at("byteOffset"), image.at("byteLength"));
  write_text_file(jpeg, folder / "texture.jpg");
  const Image texture = load_image(folder / "texture.jpg");
  EXPECT_EQ(texture.width(), kWidth);
  EXPECT_EQ(texture.height(), kHeight);
}

// The camera of the file is at the view: it looks along -z of its node, with y up.
TEST_F(GltfTest, TheCameraIsAtTheView) {
  const TempDir folder;
  save_gltf(view_, surface_mesh(view_), picture_, folder / "view.glb");
  const std::string bytes = read_file(folder / "view.glb");
  const nlohmann::json json = nlohmann::json::parse(bytes.substr(20, number_at<uint32_t>(bytes, 12)));
  const nlohmann::json& node = json.at("nodes").at(1);
  const auto at = [&](const char* field, size_t i) { return node.at(field).at(i).get<double>(); };
  const Quat turn(at("rotation", 3), at("rotation", 0), at("rotation", 1), at("rotation", 2));
  for (const Vec3 direction : {Vec3(0, 0, 1), Vec3(1, 0, 0), Vec3(0, 1, 0)}) {
    const auto turned = [](const Vec3& v) { return Vec3(v.x, -v.y, -v.z); };
    const Vec3 in_file = turn * turned(direction), expected = turned(view_.pose.orientation * direction);
    EXPECT_NEAR(glm::distance(in_file, expected), 0, 1e-9);
  }
  EXPECT_EQ(Vec3(at("translation", 0), at("translation", 1), at("translation", 2)), Vec3(0.3, 0.2, 0.5));
  EXPECT_NEAR(json.at("/cameras/0/perspective/yfov"_json_pointer), 2 * std::atan(kHeight / 2.0 / 70), 1e-12);
  EXPECT_ERROR(save_gltf(view_, surface_mesh(view_), picture_, folder / "missing/view.glb"), "missing/view.glb");
}

}  // namespace
}  // namespace lf
