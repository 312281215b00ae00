// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <vector>

#include "base/error.h"
#include "scene/trace.h"

namespace lf {
namespace {

using scene::V3;

// Gamma 2: exact, fast and near enough to what cameras do.
V3 encode(const V3& light) { return 255.0f * glm::sqrt(glm::clamp(light, 0.0f, 1.0f)); }

// Rays of one camera through one instant.
class Film {
 public:
  Film(const SceneCamera& camera, double time)
      : camera_(camera), objects_(scene::objects_at(time)), rotation_(camera.pose.rotation()) {}

  // Ray through the pixel position; `spacing`: pixels between samples. Black where the lens sees nothing.
  scene::Seen at(double x, double y, double spacing, scene::PixelShadows& shadows) const {
    const std::optional<Vec2> u = camera_.lens.unproject({x, y});
    if (!u) return {V3(0), UINT32_MAX};
    const Vec3 sight = rotation_ * Vec3(u->x, u->y, 1);
    const double length = glm::length(sight);
    const Vec3 d = sight / length;
    const auto across = [&](const Vec3& axis, double focal_length) {
      return V3((axis - d * glm::dot(axis, d)) * (spacing / (focal_length * length)));
    };
    return trace(objects_,
                 {V3(camera_.pose.position), V3(d), across(rotation_[0], camera_.lens.fx()),
                  across(rotation_[1], camera_.lens.fy())},
                 shadows);
  }

  V3 mean(int x, int y, int samples) const {
    V3 sum(0);
    scene::PixelShadows shadows;
    const double spacing = 1.0 / samples;
    for (int j = 0; j < samples; j++)
      for (int i = 0; i < samples; i++)
        sum += at(x - 0.5 + (i + 0.5) * spacing, y - 0.5 + (j + 0.5) * spacing, spacing, shadows).light;
    return sum / static_cast<float>(samples * samples);
  }

 private:
  const SceneCamera& camera_;
  scene::Objects objects_;
  Mat3 rotation_;
};

// One ray through the middle of each pixel.
struct Draft {
  int width, height;
  std::vector<V3> colour;  // encoded
  std::vector<uint32_t> object;

  bool differ(size_t a, size_t b) const {
    constexpr float kSameObject = 40, kOtherObject = 8;
    const V3 d = glm::abs(colour[a] - colour[b]);
    return std::max({d.x, d.y, d.z}) > (object[a] == object[b] ? kSameObject : kOtherObject);
  }
};

// Pixels that differ from one of their four neighbours.
std::vector<uint8_t> pixels_to_refine(const Draft& draft) {
  const size_t w = draft.width;
  std::vector<uint8_t> refine(draft.colour.size());
  const auto compare = [&](size_t a, size_t b) {
    if (draft.differ(a, b)) refine[a] = refine[b] = 1;
  };
  for (int y = 0; y < draft.height; y++)
    for (int x = 0; x < draft.width; x++) {
      const size_t i = y * w + x;
      if (x + 1 < draft.width) compare(i, i + 1);
      if (y + 1 < draft.height) compare(i, i + w);
    }
  return refine;
}

}  // namespace

Rgb scene_colour(const Vec3& origin, const Vec3& direction, double time) {
  scene::PixelShadows shadows;
  const V3 c = encode(trace(scene::objects_at(time), {V3(origin), V3(glm::normalize(direction))}, shadows).light);
  return {c.x, c.y, c.z};
}

Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere) {
  if (samples < 1) throw Error("samples: must be at least 1");
  const Film film(camera, time);
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
  Draft draft{camera.width, camera.height, std::vector<V3>(pixels), std::vector<uint32_t>(pixels)};
  const auto each_pixel = [&](auto&& visit) {
    for (int y = 0, i = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++, i++) visit(x, y, i);
  };
  const bool refine_all = everywhere && samples > 1;
  if (!refine_all)
    each_pixel([&](int x, int y, int i) {
      scene::PixelShadows shadows;
      const scene::Seen seen = film.at(x, y, 1, shadows);
      draft.colour[i] = encode(seen.light);
      draft.object[i] = seen.object;
    });
  if (samples > 1) {
    const std::vector<uint8_t> refine = refine_all ? std::vector<uint8_t>(pixels, 1) : pixels_to_refine(draft);
    each_pixel([&](int x, int y, int i) {
      if (refine[i]) draft.colour[i] = encode(film.mean(x, y, samples));
    });
  }
  Image image(PixelFamily::kRgb, camera.width, camera.height);
  each_pixel([&](int x, int y, int i) {
    for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(draft.colour[i][c] + 0.5f);
  });
  return image;
}

Rig scene_rig(int rows, int columns, int width, int height) {
  if (rows < 1 || columns < 1 || static_cast<int64_t>(rows) * columns > kMaxCameras)
    throw Error("an array of " + std::to_string(rows) + "x" + std::to_string(columns) + " cameras can't be made");
  if (width < 1 || height < 1 || width > kMaxImageSize || height > kMaxImageSize)
    throw Error("cameras of " + std::to_string(width) + "x" + std::to_string(height) + " pixels can't be made");
  Rig rig;
  rig.topology.type = Topology::Type::kGrid;
  rig.topology.rows = rows;
  rig.topology.columns = columns;
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) {
      Camera camera;
      camera.id = static_cast<uint32_t>(r * columns + c);
      char name[32];
      std::snprintf(name, sizeof name, "cam_%02d_%02d", r, c);
      camera.name = name;
      camera.width = width;
      camera.height = height;
      camera.lens = Lens(LensModel::kRadial, {1.25 * width, (width - 1) / 2.0, (height - 1) / 2.0, 0, 0});
      camera.pose.position = {(c - (columns - 1) / 2.0) * kScenePitch, (r - (rows - 1) / 2.0) * kScenePitch, 0};
      rig.cameras.push_back(camera);
    }
  return rig;
}

}  // namespace lf
