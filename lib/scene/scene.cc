// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <memory>
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
    if (camera_.lens.distortion().fisheye) return trace_fisheye(objects, {x, y}, spacing, shadows);
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
  scene::TraceResult trace_fisheye(const scene::Objects& objects, const Vec2& pixel, double spacing,
                                   scene::ShadowCache& shadows) const {
    const std::optional<Vec3> d = camera_.lens.direction(pixel);
    if (!d) return {V3(0), UINT32_MAX, {}};
    const auto across = [&](const Vec2& step) {
      return V3(rotation_ * (camera_.lens.direction(pixel + spacing * step).value_or(*d) - *d));
    };
    return scene::trace(objects, {V3(camera_.pose.position), V3(rotation_ * *d), across({1, 0}), across({0, 1})},
                        shadows);
  }

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
  State(const SceneCamera& of, std::vector<double> instants, int samples_a_side)
      : camera(of), times(std::move(instants)), samples(samples_a_side), rays(camera) {
    if (samples < 1) throw Error("samples: must be at least 1");
    const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
    draft = {camera.width, camera.height, std::vector<V3>(pixels), std::vector<uint32_t>(pixels)};
    draft_valid_until.assign(pixels, kNever);
  }

  Image next(bool everywhere);
  void start_block();
  bool is_valid(int& valid_until, std::span<const scene::HitPoint> sights) const;
  void make_draft(int x, int y, size_t i);
  V3 mean(int x, int y, size_t i);
  const scene::Objects& now() const { return block[static_cast<size_t>(picture - block_begin) + 1]; }

  // Most pixels stay the same for many pictures, so a pixel is first tested for all pictures of a block at once.
  static constexpr int kBlock = 8;
  static constexpr int kNever = -1;
  struct Mean {
    V3 colour;
    int valid_until = kNever;
  };

  const SceneCamera camera;
  const std::vector<double> times;
  const int samples;
  const CameraRays rays;
  int picture = -1;                              // number of the latest
  int block_begin = 0;                           // number of the first picture of the block
  std::vector<scene::Objects> block;             // at the previous picture, then at the pictures of the block
  scene::SceneChange block_change, step_change;  // during the block; since the previous picture
  FirstPass draft;
  std::vector<int> draft_valid_until;  // numbers of the last pictures that are known to have the same draft
  // Hit points of the draft's rays and of the means' rays. They are empty if there is only one picture.
  std::vector<scene::HitPoint> draft_sights, mean_sights;
  std::vector<Mean> means;
};

void SceneRenderer::State::start_block() {
  const auto begin = static_cast<size_t>(picture), end = std::min(begin + kBlock, times.size());
  block = {scene::objects_at(times[begin > 0 ? begin - 1 : 0])};
  for (size_t n = begin; n < end; n++) block.push_back(scene::objects_at(times[n]));
  block_begin = picture;
  block_change = scene::scene_change(block);
}

// Returns true if the light of rays that hit `sights` is still valid in this picture. The light is valid until
// picture number `valid_until`, which the function updates.
bool SceneRenderer::State::is_valid(int& valid_until, std::span<const scene::HitPoint> sights) const {
  if (valid_until >= picture) return true;
  if (valid_until == kNever || valid_until < picture - 1) return false;
  const auto is_unchanged = [&](const scene::SceneChange& change) {
    return std::ranges::all_of(sights,
                               [&](const auto& s) { return scene::is_unchanged(change, V3(camera.pose.position), s); });
  };
  if (picture == block_begin && is_unchanged(block_change)) {
    valid_until = block_begin + static_cast<int>(block.size()) - 2;
    return true;
  }
  if (!is_unchanged(step_change)) return false;
  valid_until = picture;
  return true;
}

void SceneRenderer::State::make_draft(int x, int y, size_t i) {
  if (is_valid(draft_valid_until[i], {draft_sights.data() + i, 1})) return;
  scene::ShadowCache shadows;
  const scene::TraceResult seen = rays.trace(now(), x, y, 1, shadows);
  draft.colour[i] = encode(seen.light);
  draft.object[i] = seen.object;
  if (draft_sights.empty()) return;
  draft_sights[i] = seen.sight;
  draft_valid_until[i] = picture;
}

V3 SceneRenderer::State::mean(int x, int y, size_t i) {
  const auto count = static_cast<size_t>(samples) * samples;
  if (means.empty()) return encode(rays.mean(now(), x, y, samples, [](int, const scene::HitPoint&) {}));
  const std::span sights(&mean_sights[i * count], count);
  if (is_valid(means[i].valid_until, sights)) return means[i].colour;
  means[i] = {encode(rays.mean(now(), x, y, samples, [&](int k, const auto& s) { sights[k] = s; })), picture};
  return means[i].colour;
}

Image SceneRenderer::State::next(bool everywhere) {
  picture++;
  if (picture % kBlock == 0) start_block();
  step_change = scene::scene_change({&now() - 1, 2});
  const auto each_pixel = [&](auto&& visit) {
    for (int y = 0, i = 0; y < camera.height; y++)
      for (int x = 0; x < camera.width; x++, i++) visit(x, y, static_cast<size_t>(i));
  };
  const bool refine_all = everywhere && samples > 1;
  if (!refine_all) each_pixel([&](int x, int y, size_t i) { make_draft(x, y, i); });
  std::vector<V3> colours = draft.colour;
  if (samples > 1) {
    const std::vector<uint8_t> refine = refine_all ? std::vector<uint8_t>(colours.size(), 1) : pixels_to_refine(draft);
    each_pixel([&](int x, int y, size_t i) {
      if (refine[i]) colours[i] = mean(x, y, i);
    });
  }
  Image image(PixelFamily::kRgb, camera.width, camera.height);
  each_pixel([&](int x, int y, size_t i) {
    for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(colours[i][c] + 0.5f);
  });
  return image;
}

SceneRenderer::SceneRenderer(const SceneCamera& camera, std::vector<double> times, int samples)
    : state_(std::make_unique<State>(camera, std::move(times), samples)) {
  constexpr int kMaxSamples = 4;  // a side; with more samples, the hit points would take too much memory
  const size_t pixels = state_->draft.colour.size();
  state_->draft_sights.resize(pixels);
  if (samples < 2 || samples > kMaxSamples) return;
  state_->means.resize(pixels);
  state_->mean_sights.resize(pixels * static_cast<size_t>(samples * samples));
}
SceneRenderer::~SceneRenderer() = default;
Image SceneRenderer::next() { return state_->next(false); }

Image render_scene(const SceneCamera& camera, double time, int samples, bool everywhere) {
  return SceneRenderer::State(camera, {time}, samples).next(everywhere);
}

Rig scene_rig(int rows, int columns, int width, int height) {
  constexpr double kAnyView = 45;  // degrees
  Rig rig = make_grid_rig({rows, columns, kScenePitch, kAnyView, width, height});
  for (Camera& camera : rig.cameras)
    camera.lens = Lens(LensModel::kRadial, {1.25 * width, (width - 1) / 2.0, (height - 1) / 2.0, 0, 0});
  return rig;
}

}  // namespace lf
