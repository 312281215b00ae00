// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/surface/worlds.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "base/error.h"
#include "scene/scene.h"

namespace lf::focus {
namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr double kWall = 3;  // metres

struct Ray {
  Vec3 origin, direction;
  // Where it meets a plane z = `z`.
  Vec3 at(double z) const { return origin + (z - origin.z) / direction.z * direction; }
};

double hash(int x, int y, int seed) {
  uint32_t h = static_cast<uint32_t>(x) * 374761393u + static_cast<uint32_t>(y) * 668265263u +
               static_cast<uint32_t>(seed) * 2246822519u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return static_cast<double>((h ^ (h >> 16)) & 0xffff) / 65535;
}

// Smooth noise, 0..1, of cells of 1 x 1.
double noise(double x, double y, int seed) {
  const double x0 = std::floor(x), y0 = std::floor(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double u = smooth(x - x0), v = smooth(y - y0);
  const auto at = [&](int i, int j) { return hash(static_cast<int>(x0) + i, static_cast<int>(y0) + j, seed); };
  return std::lerp(std::lerp(at(0, 0), at(1, 0), u), std::lerp(at(0, 1), at(1, 1), u), v);
}

// Four octaves, the finest of 25 mm: some five pixels of a camera at 2 m.
Vec3 texture(double x, double y, int seed) {
  Vec3 colour(0);
  double amplitude = 0.5, cells = 5;
  for (int octave = 0; octave < 4; octave++, amplitude /= 1.6, cells *= 2)
    for (int c = 0; c < 3; c++)
      colour[c] += amplitude * (noise(cells * x, cells * y, 16 * seed + 4 * c + octave) - 0.5);
  return glm::clamp(Vec3(128) + 170.0 * colour, 0.0, 255.0);
}

Vec3 wall(const Ray& ray) {
  const Vec3 at = ray.at(kWall);
  return texture(at.x, at.y, 1);
}

// Where a ray meets a ball, if it does.
std::optional<Vec3> ball(const Ray& ray, const Vec3& centre, double radius) {
  const Vec3 d = glm::normalize(ray.direction), to = centre - ray.origin;
  const double along = glm::dot(to, d), left = radius * radius - (glm::dot(to, to) - along * along);
  if (left < 0) return std::nullopt;
  return ray.origin + (along - std::sqrt(left)) * d;
}

Vec3 flat(const Ray& ray) {
  const Vec3 at = ray.at(2.2);
  return texture(at.x, at.y, 2);
}

Vec3 untextured(const Ray& ray) {
  const Vec3 centre(0.1, 0, 1.8);
  if (const std::optional<Vec3> at = ball(ray, centre, 0.25)) {
    const Vec3 normal = (*at - centre) / 0.25;
    return Vec3(190, 80, 70) * (0.6 + 0.4 * std::max(0.0, glm::dot(normal, Vec3(-0.6, -0.64, -0.48))));
  }
  const Vec3 at = ray.at(kWall);
  return Vec3(150, 160, 170) + Vec3(8 * at.x + 5 * at.y);
}

// It shows a wall behind the cameras, which is where 5.4 m would be.
Vec3 mirror(const Ray& ray) {
  const Vec3 at = ray.at(2.2);
  if (std::abs(at.x) > 0.45 || std::abs(at.y) > 0.3) return wall(ray);
  if (std::abs(at.x) > 0.41 || std::abs(at.y) > 0.26) return {90, 60, 40};
  const Vec3 behind = Ray{at, {ray.direction.x, ray.direction.y, -ray.direction.z}}.at(-1);
  return 0.9 * texture(behind.x, behind.y, 3);
}

Vec3 highlight(const Ray& ray) {
  const Vec3 centre(0, 0, 1.9);
  const std::optional<Vec3> at = ball(ray, centre, 0.4);
  if (!at) return wall(ray);
  const Vec3 normal = (*at - centre) / 0.4, light = glm::normalize(Vec3(-0.4, -0.5, -0.75));
  const Vec3 mirrored = glm::reflect(glm::normalize(ray.direction), normal);
  const double gloss = std::pow(std::max(0.0, glm::dot(mirrored, light)), 60);
  const Vec3 paint = texture(2 * normal.x, 2 * normal.y, 4) * (0.4 + 0.6 * std::max(0.0, glm::dot(normal, light)));
  return glm::min(paint + Vec3(255 * gloss), Vec3(255));
}

Vec3 wires(const Ray& ray) {
  const Vec3 at = ray.at(1.5);
  for (const double slope : {0.0, 0.35}) {
    const double across = at.x + slope * at.y + (slope > 0 ? 0.03 : 0), pitch = 0.16;
    if (std::abs(across - pitch * std::round(across / pitch)) < 0.004) return slope > 0 ? Vec3(30) : Vec3(220, 200, 90);
  }
  return wall(ray);
}

Vec3 fence(const Ray& ray) {
  const Vec3 at = ray.at(1.4);
  constexpr double kPitch = 0.08, kSlat = 0.025;
  if (std::abs(at.x - kPitch * std::round(at.x / kPitch)) < kSlat / 2) return 0.8 * texture(at.x, at.y, 5);
  return wall(ray);
}

struct World {
  const char* name;
  Vec3 (*colour)(const Ray&);
};
constexpr World kWorlds[] = {{"flat", flat},           {"untextured", untextured}, {"mirror", mirror},
                             {"highlight", highlight}, {"wires", wires},           {"fence", fence}};

Image film(const World& world, const Lens& lens, const Pose& pose, int width, int height) {
  constexpr int kRays = 2;
  Image image(PixelFamily::kRgb, width, height);
  const Mat3 rotation = pose.rotation();
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      Vec3 sum(0);
      for (int k = 0; k < kRays * kRays; k++) {
        const Vec2 pixel(x + (k % kRays + 0.5) / kRays - 0.5, y + (k / kRays + 0.5) / kRays - 0.5);
        sum += world.colour({pose.position, rotation * Vec3(*lens.unproject(pixel), 1)});
      }
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(sum[c] / (kRays * kRays)));
    }
  return image;
}

const World& world_of(const std::string& name) {
  const auto* const world = std::ranges::find(kWorlds, name, &World::name);
  if (world == std::end(kWorlds)) throw Error(name + ": no scene of this name");
  return *world;
}

}  // namespace

Image film_world(const std::string& name, const Lens& lens, const Pose& pose, int width, int height) {
  return film(world_of(name), lens, pose, width, height);
}

std::vector<std::string> world_names() {
  std::vector<std::string> names;
  for (const World& world : kWorlds) names.push_back(world.name);
  return names;
}

Case world_case(const std::string& name, int views) {
  const World* const world = &world_of(name);
  Case c = scene_case();
  c.name = name;
  c.views.resize(std::min<size_t>(views, c.views.size()));
  const auto kept = std::make_shared<std::map<CameraIndex, Image>>();
  const auto rig = std::make_shared<Rig>(c.rig);
  c.image = [kept, rig, world](CameraIndex camera, size_t) -> const Image& {
    auto found = kept->find(camera);
    if (found == kept->end()) {
      const Camera& at = rig->cameras[camera];
      found = kept->emplace(camera, film(*world, at.lens, at.pose, at.width, at.height)).first;
    }
    return found->second;
  };
  const auto seen = std::make_shared<std::vector<NamedView>>(c.views);
  c.truth = [seen, world](size_t view) {
    const View& v = (*seen)[view].view;
    return film(*world, v.lens, v.pose, kWidth, kHeight);
  };
  return c;
}

}  // namespace lf::focus
