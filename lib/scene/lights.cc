// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/lights.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "base/error.h"

namespace lf {
namespace {

constexpr double kOptics = 0.8;   // pixels: what a lens makes of a point, one sigma
constexpr double kReach = 5;      // sigmas of a light's image that are drawn
constexpr double kLateral = 0.7;  // share of the field of view that the middle of the bar comes to
constexpr double kWindow = 1.3;   // depth of the window, over the farthest place of the lights
constexpr size_t kNoises = 1 << 16;

// Normal numbers in a table: drawn anew they would take longer than all the rest.
const std::vector<float>& noises() {
  static const std::vector<float> table = [] {
    std::mt19937 random(7);
    std::normal_distribution<float> normal;
    std::vector<float> values(kNoises);
    for (float& value : values) value = normal(random);
    return values;
  }();
  return table;
}

// What `n` is known by, spread over all bits (splitmix64).
uint64_t scattered(uint64_t n) {
  n += 0x9e3779b97f4a7c15;
  n = (n ^ (n >> 30)) * 0xbf58476d1ce4e5b9;
  n = (n ^ (n >> 27)) * 0x94d049bb133111eb;
  return n ^ (n >> 31);
}

Pose middle_of(const Rig& rig) {
  Vec3 position(0), forward(0), down(0);
  for (const Camera& camera : rig.cameras)
    position += camera.pose.position, forward += camera.pose.forward(), down += camera.pose.down();
  const auto n = static_cast<double>(rig.cameras.size());
  // Cameras that look at each other see each other's lights amid them.
  if (glm::length(forward) < 0.3 * n) forward = rig.cameras[0].pose.forward();
  forward = glm::normalize(forward);
  down -= glm::dot(down, forward) * forward;
  if (glm::length(down) < 1e-3) down = rig.cameras[0].pose.down();
  return look_at(position / n, position / n + forward, down);
}

}  // namespace

LightsPath::LightsPath(const Rig& rig, const LightsOptions& options) : options_(options) {
  const auto require = [](bool good, const char* what) {
    if (!good) throw Error(what);
  };
  require(!rig.cameras.empty(), "the rig has no cameras");
  require(options.near > 0, "near: must be positive");
  require(options.far > options.near, "far: must be more than near");
  require(options.bar >= 0, "bar: must not be negative");
  require(options.speed > 0, "speed: must be positive");
  require(options.exposure >= 0, "exposure: must not be negative");
  require(options.noise >= 0, "noise: must not be negative");
  array_ = middle_of(rig);
  half_width_ = half_height_ = 1e9;
  for (const Camera& camera : rig.cameras) {
    half_width_ = std::min(half_width_, camera.width / 2.0 / camera.lens.fx());
    half_height_ = std::min(half_height_, camera.height / 2.0 / camera.lens.fy());
  }
  const Vec3 towards = glm::normalize(array_.rotation() * Vec3(0.1, 0.06, -1));
  window_ = plane_through(array_.world_from_camera({0, 0, kWindow * options.far}), towards);
  double sum = 0;
  constexpr int kSteps = 4000;
  constexpr double kStep = 0.01;
  for (int i = 0; i < kSteps; i++)
    for (int light = 0; light < 2; light++) {
      const Vec3 way = lights_at((i + 1) * kStep)[light] - lights_at(i * kStep)[light];
      sum += glm::dot(way, way) / (kStep * kStep);
    }
  rate_ = options.speed / std::sqrt(sum / (2 * kSteps));
}

// Through the whole volume, never the same way twice.
Vec3 LightsPath::middle(double phase) const {
  const double t = (1 + std::sin(0.618 * phase + 0.5)) / 2;
  const double z = 1 / (t / options_.near + (1 - t) / options_.far);
  const double reach_x = std::max(0.2 * half_width_ * z, kLateral * half_width_ * z - options_.bar / 4);
  const double reach_y = std::max(0.2 * half_height_ * z, kLateral * half_height_ * z - options_.bar / 4);
  return {reach_x * std::sin(1.0 * phase), reach_y * std::sin(1.325 * phase + 1), z};
}

Vec3 LightsPath::direction(double phase) const {
  const double around = 0.43 * phase, away = 0.6 * std::sin(0.37 * phase + 2);
  return {std::cos(around) * std::cos(away), std::sin(around) * std::cos(away), std::sin(away)};
}

std::array<Vec3, 2> LightsPath::lights_at(double phase) const {
  const Vec3 at = middle(phase), half = direction(phase) * (options_.bar / 2);
  return {array_.world_from_camera(at - half), array_.world_from_camera(at + half)};
}

std::array<Vec3, 2> LightsPath::lights(double time) const { return lights_at(rate_ * time); }

// A light's image: the places of its middle in parts of the exposure, each a normal distribution of the same size.
struct LightsCamera::Spot {
  std::vector<Vec2> places;
  double sigma = 1;  // pixels
  double light = 0;  // of a pixel amid it if it were at rest

  std::optional<Vec2> mean() const {
    if (places.empty()) return std::nullopt;
    Vec2 sum(0);
    for (const Vec2& place : places) sum += place;
    return sum / static_cast<double>(places.size());
  }
};

LightsCamera::LightsCamera(const LightsPath& path, const SceneCamera& camera) : path_(path), camera_(camera) {
  const double ambient = path.options().ambient;
  room_.assign(static_cast<size_t>(camera.width) * camera.height, 0);
  if (!(ambient > 0)) return;
  const Image scene = render_scene(camera, 0, 1);
  for (size_t i = 0; i < room_.size(); i++) {
    const double encoded = (scene.data()[3 * i] + scene.data()[3 * i + 1] + scene.data()[3 * i + 2]) / 3.0 / 255;
    room_[i] = static_cast<float>(ambient * encoded * encoded);
  }
}

std::vector<LightsCamera::Spot> LightsCamera::spots(double time) const {
  const LightsOptions& o = path_.options();
  const auto project = [&](const Vec3& point) { return camera_.lens.project(camera_.pose.camera_from_world(point)); };
  std::vector<Spot> spots;
  for (const bool reflected : {false, true}) {
    if (reflected && !(o.reflection > 0)) continue;
    for (int light = 0; light < path_.num_lights(); light++) {
      const auto at = [&](double t) {
        const Vec3 point = path_.lights(t)[light];
        return reflected ? path_.mirrored(point) : point;
      };
      Spot& spot = spots.emplace_back();
      const double z = camera_.pose.camera_from_world(at(time)).z;
      const auto first = project(at(time - o.exposure / 2)), last = project(at(time + o.exposure / 2));
      if (!first || !last || !(z > 0.05)) continue;
      const double disc = o.radius * camera_.lens.fx() / z / 2;  // one sigma of a disc's sides
      spot.sigma = std::sqrt(kOptics * kOptics + disc * disc);
      // The same light over a larger image, or from farther away, is less in each pixel.
      spot.light = o.power * (reflected ? o.reflection : 1) * (kOptics * kOptics + disc * disc * z * z) /
                   (spot.sigma * spot.sigma * z * z);
      const int parts =
          o.exposure > 0 ? 1 + static_cast<int>(std::ceil(2 * glm::length(*last - *first) / spot.sigma)) : 1;
      for (int i = 0; i < parts; i++)
        if (const auto place = project(at(time + o.exposure * ((i + 0.5) / parts - 0.5))))
          spot.places.push_back(*place);
    }
  }
  return spots;
}

std::vector<std::optional<Vec2>> LightsCamera::places(double time) const {
  std::vector<std::optional<Vec2>> list;
  for (const Spot& spot : spots(time)) {
    auto& place = list.emplace_back(spot.mean());
    if (place &&
        (place->x < -0.5 || place->y < -0.5 || place->x > camera_.width - 0.5 || place->y > camera_.height - 0.5))
      place.reset();
  }
  return list;
}

Image LightsCamera::picture(double time, uint64_t seed) const {
  const LightsOptions& o = path_.options();
  const int width = camera_.width, height = camera_.height;
  std::vector<float> light = room_;
  std::vector<double> across, down;
  for (const Spot& spot : spots(time))
    for (const Vec2& place : spot.places) {
      const int left = std::max(0, static_cast<int>(place.x - kReach * spot.sigma));
      const int right = std::min(width - 1, static_cast<int>(place.x + kReach * spot.sigma) + 1);
      const int top = std::max(0, static_cast<int>(place.y - kReach * spot.sigma));
      const int bottom = std::min(height - 1, static_cast<int>(place.y + kReach * spot.sigma) + 1);
      if (left > right || top > bottom) continue;
      // Over each pixel's square, as a sensor gathers it.
      const auto shares = [&](int from, int to, double at, std::vector<double>& list) {
        const auto below = [&](double x) { return std::erf((x - at) / spot.sigma / std::numbers::sqrt2) / 2; };
        list.clear();
        for (int i = from; i <= to; i++) list.push_back(below(i + 0.5) - below(i - 0.5));
      };
      shares(left, right, place.x, across);
      shares(top, bottom, place.y, down);
      const double all =
          spot.light * 2 * std::numbers::pi * spot.sigma * spot.sigma / static_cast<double>(spot.places.size());
      for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++)
          light[static_cast<size_t>(y) * width + x] += static_cast<float>(all * across[x - left] * down[y - top]);
    }
  Image image(PixelFamily::kRgb, width, height);
  const std::vector<float>& table = noises();
  for (int y = 0; y < height; y++) {
    size_t at = scattered(seed * 65536 + static_cast<uint64_t>(y)) % kNoises;
    for (int x = 0; x < width; x++, at = (at + 1) % kNoises) {
      const float value = 255 * std::sqrt(std::min(1.0f, light[static_cast<size_t>(y) * width + x])) +
                          static_cast<float>(o.noise) * table[at];
      std::fill_n(image.pixel(x, y), 3, static_cast<uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f));
    }
  }
  return image;
}

}  // namespace lf
