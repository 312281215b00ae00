// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/text.h"
#include "scene/trace.h"

namespace lf {
namespace {

using scene::V3;

// Gamma 2 is exact, fast and close to real cameras.
V3 encode(const V3& light) { return 255.0f * glm::sqrt(glm::clamp(light, 0.0f, 1.0f)); }

class CameraRays {
 public:
  explicit CameraRays(const SceneCamera& camera) : camera_(camera), rotation_(camera.pose.rotation()) {}

  // Traces the ray through a pixel position. `spacing` is the number of pixels between samples. The result is black
  // outside the lens.
  scene::TraceResult trace(const scene::Objects& objects, double x, double y, double spacing,
                           scene::ShadowCache& shadows) const {
    const std::optional<Vec2> u = camera_.lens.unproject({x, y});
    if (!u) return {V3(0), UINT32_MAX, {}};
    const Vec3 sight = rotation_ * Vec3(u->x, u->y, 1);
    const double length = glm::length(sight);
    const Vec3 d = sight / length;
    const auto across = [&](const Vec3& axis, double focal_length) {
      return V3((axis - d * glm::dot(axis, d)) * (spacing / (focal_length * length)));
    };
    return scene::trace(objects,
                        {V3(camera_.pose.position), V3(d), across(rotation_[0], camera_.lens.fx()),
                         across(rotation_[1], camera_.lens.fy())},
                        shadows);
  }

  // Returns the mean light of samples x samples rays through a pixel. Calls met(k, sight) for each ray.
  template <typename Met>
  V3 mean(const scene::Objects& objects, int x, int y, int samples, const Met& met) const {
    V3 sum(0);
    scene::ShadowCache shadows;
    const double spacing = 1.0 / samples;
    for (int j = 0, k = 0; j < samples; j++)
      for (int i = 0; i < samples; i++, k++) {
        const scene::TraceResult seen =
            trace(objects, x - 0.5 + (i + 0.5) * spacing, y - 0.5 + (j + 0.5) * spacing, spacing, shadows);
        sum += seen.light;
        met(k, seen.sight);
      }
    return sum / static_cast<float>(samples * samples);
  }

 private:
  const SceneCamera& camera_;
  Mat3 rotation_;
};

// The draft takes one ray through the middle of each pixel.
struct FirstPass {
  int width, height;
  std::vector<V3> colour;  // encoded
  std::vector<uint32_t> object;

  bool differ(size_t a, size_t b) const {
    constexpr float kSameObject = 40, kOtherObject = 8;
    const V3 d = glm::abs(colour[a] - colour[b]);
    return std::max({d.x, d.y, d.z}) > (object[a] == object[b] ? kSameObject : kOtherObject);
  }
};

std::vector<uint8_t> pixels_to_refine(const FirstPass& draft) {
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
  scene::ShadowCache shadows;
  const V3 c = encode(trace(scene::objects_at(time), {V3(origin), V3(glm::normalize(direction))}, shadows).light);
  return {c.x, c.y, c.z};
}

// Keeps the previous picture to reuse unchanged pixels.
struct SceneRenderer::State {
  State(const SceneCamera& of, int samples_a_side) : camera(of), samples(samples_a_side), rays(camera) {
    if (samples < 1) throw Error("samples: must be at least 1");
    const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
    draft = {camera.width, camera.height, std::vector<V3>(pixels), std::vector<uint32_t>(pixels)};
  }

  Image at(double time, bool everywhere);
  void make_draft(const scene::Objects& objects, const scene::SceneChange* movement, int x, int y, size_t i);
  V3 mean(const scene::Objects& objects, const scene::SceneChange* movement, int x, int y, size_t i);
  bool is_unchanged(const scene::SceneChange& movement, const scene::HitPoint& sight) const {
    return scene::is_unchanged(movement, V3(camera.pose.position), sight);
  }

  struct Mean {
    V3 colour;        // number of the latest picture with this mean; 0: none
    int picture = 0;  // number of the latest picture with this mean; 0: none
  };

  const SceneCamera camera;
  const int samples;
  const CameraRays rays;
  int picture = 0;  // number of the latest; 0: none
  scene::Objects objects;
  FirstPass draft;
  // Hit points of the draft's rays and of the means' rays. They are empty if there is only one picture.
  std::vector<scene::HitPoint> draft_sights, mean_sights;
  std::vector<Mean> means;
};

void SceneRenderer::State::make_draft(const scene::Objects& now, const scene::SceneChange* movement, int x, int y,
                                      size_t i) {
  if (movement && is_unchanged(*movement, draft_sights[i])) return;
  scene::ShadowCache shadows;
  const scene::TraceResult seen = rays.trace(now, x, y, 1, shadows);
  draft.colour[i] = encode(seen.light);
  draft.object[i] = seen.object;
  if (!draft_sights.empty()) draft_sights[i] = seen.sight;
}

V3 SceneRenderer::State::mean(const scene::Objects& now, const scene::SceneChange* movement, int x, int y, size_t i) {
  const auto count = static_cast<size_t>(samples) * samples;
  if (means.empty()) return encode(rays.mean(now, x, y, samples, [](int, const scene::HitPoint&) {}));
  const std::span sights(&mean_sights[i * count], count);
  const bool is_kept = movement && means[i].picture == picture - 1 &&
                       std::ranges::all_of(sights, [&](const auto& s) { return is_unchanged(*movement, s); });
  if (!is_kept) means[i].colour = encode(rays.mean(now, x, y, samples, [&](int k, const auto& s) { sights[k] = s; }));
  means[i].picture = picture;
  return means[i].colour;
}

Image SceneRenderer::State::at(double time, bool everywhere) {
  scene::Objects now = scene::objects_at(time);
  std::optional<scene::SceneChange> moved;
  if (picture > 0) moved = scene::scene_change(objects, now);
  const scene::SceneChange* const movement = moved ? &*moved : nullptr;
  picture++;
  const auto each_pixel = [&](auto&& visit) {
    for (int y = 0, i = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++, i++) visit(x, y, static_cast<size_t>(i));
  };
  const bool refine_all = everywhere && samples > 1;
  if (!refine_all) each_pixel([&](int x, int y, size_t i) { make_draft(now, movement, x, y, i); });
  std::vector<V3> colours = draft.colour;
  if (samples > 1) {
    const std::vector<uint8_t> refine = refine_all ? std::vector<uint8_t>(colours.size(), 1) : pixels_to_refine(draft);
    each_pixel([&](int x, int y, size_t i) {
      if (refine[i]) colours[i] = mean(now, movement, x, y, i);
    });
  }
  objects = std::move(now);
  Image image(PixelFamily::kRgb, camera.width, camera.height);
  each_pixel([&](int x, int y, size_t i) {
    for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(colours[i][c] + 0.5f);
  });
  return image;
}

SceneRenderer::SceneRenderer(const SceneCamera& camera, int samples)
    : state_(std::make_unique<State>(camera, samples)) {
  constexpr int kMostSamples = 4;  // a side; with more samples, the hit points would take too much memory
  const size_t pixels = state_->draft.colour.size();
  state_->draft_sights.resize(pixels);
  if (samples < 2 || samples > kMostSamples) return;
  state_->means.resize(pixels);
  state_->mean_sights.resize(pixels * static_cast<size_t>(samples * samples));
}
SceneRenderer::~SceneRenderer() = default;
Image SceneRenderer::at(double time) { return state_->at(time, false); }

Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere) {
  return SceneRenderer::State(camera, samples).at(time, everywhere);
}

Rig scene_rig(int rows, int columns, int width, int height) {
  if (rows < 1 || columns < 1 || static_cast<int64_t>(rows) * columns > kMaxCameras)
    throw Error("an array of " + std::to_string(rows) + "x" + std::to_string(columns) +
                " cameras can't be made; choose fewer, but at least 1x1");
  if (width < 1 || height < 1 || width > kMaxImageSize || height > kMaxImageSize)
    throw Error("cameras of " + std::to_string(width) + "x" + std::to_string(height) +
                " pixels can't be made; choose a width and a height from 1 to 16384");
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
