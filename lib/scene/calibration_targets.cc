// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/calibration_targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "image/colour_correction.h"

namespace lf {
namespace {

constexpr double kOptics = 0.8;   // sigma of the blur of a lens, pixels
constexpr double kReach = 5;      // drawn radius of a light's image, in sigmas
constexpr double kLateral = 0.7;  // fraction of the field of view that the middle of the bar reaches
constexpr double kWindow = 1.3;   // depth of the window, relative to the farthest position of the lights
constexpr size_t kNoises = 1 << 16;

// A table of random numbers, because drawing normal numbers would dominate the run time.
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

// SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t bits() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  double between(double least, double most) {
    return least + (most - least) * static_cast<double>(bits() >> 11) / 9007199254740992.0;
  }
  // Approximates a normal distribution by the sum of four uniform distributions.
  double normal() {
    const uint64_t b = bits();
    double sum = 0;
    for (int i = 0; i < 4; i++) sum += static_cast<double>((b >> (16 * i)) & 0xffff) / 65535.0 - 0.5;
    return sum * std::sqrt(3.0);
  }

 private:
  uint64_t state_;
};

Pose middle_of(const Rig& rig) {
  Vec3 position(0), forward(0), down(0);
  for (const Camera& camera : rig.cameras)
    position += camera.pose.position, forward += camera.pose.forward(), down += camera.pose.down();
  const auto n = static_cast<double>(rig.cameras.size());
  // Cameras that look at each other have no mean direction, so camera 0 is used.
  if (glm::length(forward) < 0.3 * n) forward = rig.cameras[0].pose.forward();
  forward = glm::normalize(forward);
  down -= glm::dot(down, forward) * forward;
  if (glm::length(down) < 1e-3) down = rig.cameras[0].pose.down();
  return look_at(position / n, position / n + forward, down);
}

}  // namespace

LightTrajectory::LightTrajectory(const Rig& rig, const MovingLightOptions& options) : options_(options) {
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

// The path covers the whole volume without repeating.
Vec3 LightTrajectory::middle(double phase) const {
  const double t = (1 + std::sin(0.618 * phase + 0.5)) / 2;
  const double z = 1 / (t / options_.near + (1 - t) / options_.far);
  const double reach_x = std::max(0.2 * half_width_ * z, kLateral * half_width_ * z - options_.bar / 4);
  const double reach_y = std::max(0.2 * half_height_ * z, kLateral * half_height_ * z - options_.bar / 4);
  return {reach_x * std::sin(1.0 * phase), reach_y * std::sin(1.325 * phase + 1), z};
}

Vec3 LightTrajectory::direction(double phase) const {
  const double around = 0.43 * phase, away = 0.6 * std::sin(0.37 * phase + 2);
  return {std::cos(around) * std::cos(away), std::sin(around) * std::cos(away), std::sin(away)};
}

std::array<Vec3, 2> LightTrajectory::lights_at(double phase) const {
  const Vec3 at = middle(phase), half = direction(phase) * (options_.bar / 2);
  return {array_.world_from_camera(at - half), array_.world_from_camera(at + half)};
}

std::array<Vec3, 2> LightTrajectory::lights(double time) const { return lights_at(rate_ * time); }

// The image of a light: positions of its centre during the exposure, each with a normal distribution of the same size.
struct MovingLightCamera::LightSpot {
  std::vector<Vec2> places;
  double sigma = 1;  // pixels
  double light = 0;  // light of a pixel in the centre, at rest

  std::optional<Vec2> mean() const {
    if (places.empty()) return std::nullopt;
    Vec2 sum(0);
    for (const Vec2& place : places) sum += place;
    return sum / static_cast<double>(places.size());
  }
};

MovingLightCamera::MovingLightCamera(const LightTrajectory& path, const SceneCamera& camera)
    : path_(path), camera_(camera) {
  const double ambient = path.options().ambient;
  room_.assign(static_cast<size_t>(camera.width) * camera.height, 0);
  if (!(ambient > 0)) return;
  const Image scene = render_scene(camera, 0, 1);
  for (size_t i = 0; i < room_.size(); i++) {
    const double encoded = (scene.data()[3 * i] + scene.data()[3 * i + 1] + scene.data()[3 * i + 2]) / 3.0 / 255;
    room_[i] = static_cast<float>(ambient * encoded * encoded);
  }
}

std::vector<MovingLightCamera::LightSpot> MovingLightCamera::spots(double time) const {
  const MovingLightOptions& o = path_.options();
  const auto project = [&](const Vec3& point) { return camera_.lens.project(camera_.pose.camera_from_world(point)); };
  std::vector<LightSpot> spots;
  for (const bool reflected : {false, true}) {
    if (reflected && !(o.reflection > 0)) continue;
    for (int light = 0; light < path_.num_lights(); light++) {
      const auto at = [&](double t) {
        const Vec3 point = path_.lights(t)[light];
        return reflected ? path_.mirrored(point) : point;
      };
      LightSpot& spot = spots.emplace_back();
      const double z = camera_.pose.camera_from_world(at(time)).z;
      const auto first = project(at(time - o.exposure / 2)), last = project(at(time + o.exposure / 2));
      if (!first || !last || !(z > 0.05)) continue;
      const double disc = o.radius * camera_.lens.fx() / z / 2;  // sigma of a disc along each axis
      spot.sigma = std::sqrt(kOptics * kOptics + disc * disc);
      // The same light on a larger image, or from farther away, is weaker in each pixel.
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

std::vector<std::optional<Vec2>> MovingLightCamera::places(double time) const {
  std::vector<std::optional<Vec2>> list;
  for (const LightSpot& spot : spots(time)) {
    auto& place = list.emplace_back(spot.mean());
    if (place &&
        (place->x < -0.5 || place->y < -0.5 || place->x > camera_.width - 0.5 || place->y > camera_.height - 0.5))
      place.reset();
  }
  return list;
}

Image MovingLightCamera::picture(double time, uint64_t seed) const {
  const MovingLightOptions& o = path_.options();
  const int width = camera_.width, height = camera_.height;
  std::vector<float> light = room_;
  std::vector<double> across, down;
  for (const LightSpot& spot : spots(time))
    for (const Vec2& place : spot.places) {
      const int left = std::max(0, static_cast<int>(place.x - kReach * spot.sigma));
      const int right = std::min(width - 1, static_cast<int>(place.x + kReach * spot.sigma) + 1);
      const int top = std::max(0, static_cast<int>(place.y - kReach * spot.sigma));
      const int bottom = std::min(height - 1, static_cast<int>(place.y + kReach * spot.sigma) + 1);
      if (left > right || top > bottom) continue;
      // Integrates over the area of each pixel, like a sensor.
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
    size_t at = Random(seed * 65536 + static_cast<uint64_t>(y)).bits() % kNoises;
    for (int x = 0; x < width; x++, at = (at + 1) % kNoises) {
      const float value = 255 * std::sqrt(std::min(1.0f, light[static_cast<size_t>(y) * width + x])) +
                          static_cast<float>(o.noise) * table[at];
      std::fill_n(image.pixel(x, y), 3, static_cast<uint8_t>(std::clamp(value, 0.0f, 255.0f) + 0.5f));
    }
  }
  return image;
}

namespace {

using Light = std::array<double, 3>;

double srgb_light(int level) {
  const double v = level / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double lamp(const Vec3& place) {
  return 0.86 / (1 + 0.08 * glm::dot(place - Vec3(-0.6, -0.8, 0.6), place - Vec3(-0.6, -0.8, 0.6)));
}

class Board {
 public:
  explicit Board(const ChartPose& chart)
      : chart_(chart), chart_from_world_(glm::transpose(chart.world_from_chart.rotation())) {
    for (int i = 0; i < checker::kPatches; i++)
      for (size_t c = 0; c < 3; c++) patch_[i][c] = srgb_light(checker::kSrgb[i][c]);
    unit_ = chart.width / checker::kWidth;
  }

  // Returns true if the ray hits the front of the board, and sets `out` to the light from there.
  bool see(const Vec3& origin, const Vec3& direction, Light& out) const {
    const Vec3 from = chart_from_world_ * (origin - chart_.world_from_chart.position),
               d = chart_from_world_ * direction;
    if (!(d.z > 1e-9)) return false;  // its back
    const double t = -from.z / d.z;
    if (!(t > 0)) return false;
    const double x = (from.x + t * d.x) / unit_ + checker::kWidth / 2,
                 y = (from.y + t * d.y) / unit_ + checker::kHeight / 2;
    if (x < 0 || y < 0 || x >= checker::kWidth || y >= checker::kHeight) return false;
    const double lit = lamp(origin + t * direction);
    constexpr double kStep = checker::kSide + checker::kGap;
    const int column = std::min(static_cast<int>(x / kStep), checker::kColumns - 1);
    const int row = std::min(static_cast<int>(y / kStep), checker::kRows - 1);
    const bool on_patch = x - column * kStep >= checker::kGap && y - row * kStep >= checker::kGap;
    for (size_t c = 0; c < 3; c++)
      out[c] = lit * (on_patch && x < checker::kWidth - checker::kGap && y < checker::kHeight - checker::kGap
                          ? patch_[row * checker::kColumns + column][c]
                          : 0.012);
    return true;
  }

 private:
  const ChartPose& chart_;
  Mat3 chart_from_world_;
  std::array<Light, checker::kPatches> patch_;
  double unit_;
};

}  // namespace

std::vector<ChartPose> colour_chart_poses(const Rig& rig, int count) {
  if (rig.cameras.empty()) throw Error("chart: the rig has no camera");
  if (count < 1) throw Error("chart: count must be at least 1");
  Vec3 middle(0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / static_cast<double>(rig.cameras.size());
  const Camera& nearest = *std::ranges::min_element(
      rig.cameras, {}, [&](const Camera& camera) { return glm::length(camera.pose.position - middle); });
  double extent = 0;
  for (const Camera& camera : rig.cameras) extent = std::max(extent, glm::length(camera.pose.position - middle));
  // This is far enough to be visible to all cameras.
  const double distance = std::max(0.8, 4 * extent);
  const Mat3 rotation = nearest.pose.rotation();
  std::vector<ChartPose> poses;
  for (int i = 0; i < count; i++) {
    // These positions cover the image evenly for any `count` (Roberts's sequence of the plastic number).
    const double u = std::fmod(0.5 + 0.7548776662466927 * i, 1.0), v = std::fmod(0.5 + 0.5698402909980532 * i, 1.0);
    const double width = nearest.width, height = nearest.height;
    const Vec2 pixel((0.5 + 0.62 * (u - 0.5)) * width, (0.5 + 0.62 * (v - 0.5)) * height);
    const Vec2 ray((pixel.x - nearest.lens.cx()) / nearest.lens.fx(),
                   (pixel.y - nearest.lens.cy()) / nearest.lens.fy());
    ChartPose chart;
    chart.world_from_chart.position = nearest.pose.position + rotation * (distance * Vec3(ray, 1));
    const double roll = 0.12 * std::sin(2.1 * i), pan = 0.2 * std::sin(1.3 * i + 1), tilt = 0.15 * std::cos(1.7 * i);
    chart.world_from_chart.orientation = nearest.pose.orientation * glm::angleAxis(roll, Vec3(0, 0, 1)) *
                                         glm::angleAxis(pan, Vec3(0, 1, 0)) * glm::angleAxis(tilt, Vec3(1, 0, 0));
    chart.width = 0.48 * width * distance / nearest.lens.fx();
    poses.push_back(chart);
  }
  return poses;
}

Image render_chart(const SceneCamera& camera, const ChartPose& chart) {
  constexpr int kSamples = 3;  // samples per pixel along each axis
  const Board board(chart);
  const Mat3 rotation = camera.pose.rotation();
  // There is a grey wall 1 m behind the chart.
  const double wall = chart.world_from_chart.position.z + 1.0;
  Image out(PixelFamily::kRgb, camera.width, camera.height);
  for (int y = 0; y < camera.height; y++)
    for (int x = 0; x < camera.width; x++) {
      Light sum{};
      for (int k = 0; k < kSamples * kSamples; k++) {
        const Vec2 at(x - 0.5 + (k % kSamples + 0.5) / kSamples, y - 0.5 + (k / kSamples + 0.5) / kSamples);
        const std::optional<Vec2> ray = camera.lens.unproject(at);
        if (!ray) continue;
        const Vec3 d = rotation * Vec3(*ray, 1);
        Light light;
        if (!board.see(camera.pose.position, d, light)) {
          const double t = d.z > 1e-9 ? (wall - camera.pose.position.z) / d.z : 0;
          light.fill(0.4 * lamp(camera.pose.position + t * d));
        }
        for (size_t c = 0; c < 3; c++) sum[c] += light[c];
      }
      for (size_t c = 0; c < 3; c++)
        out.pixel(x, y)[c] =
            static_cast<uint8_t>(255 * std::sqrt(std::clamp(sum[c] / (kSamples * kSamples), 0.0, 1.0)) + 0.5);
    }
  return out;
}

namespace {

constexpr double kSceneGamma = 2;

}  // namespace

std::vector<ColourFault> random_faults(size_t cameras, uint32_t seed, const ColourFaultOptions& options) {
  Random random(seed * 0x9e3779b97f4a7c15 + 1);
  const auto around = [&random](double most) { return random.between(-most, most); };
  std::vector<ColourFault> faults(cameras);
  for (ColourFault& fault : faults) {
    fault.gain = 1 + around(options.gain);
    for (int c = 0; c < 3; c++) fault.balance[c] = 1 + around(options.balance);
    for (int c = 0; c < 3; c++) fault.black[c] = options.black + around(options.black);
    fault.gamma = kSceneGamma * (1 + around(options.gamma));
    for (size_t row = 0; row < 3; row++) {
      double others = 0;
      for (size_t column = 0; column < 3; column++)
        if (column != row) others += fault.crosstalk[3 * row + column] = random.between(0, options.crosstalk);
      fault.crosstalk[3 * row + row] = 1 - others;
    }
    const double loss = random.between(options.vignetting / 2, options.vignetting);
    fault.vignetting = {-0.8 * loss, -0.2 * loss};
    fault.noise = options.noise;
  }
  return faults;
}

Image apply_fault(const Image& rgb, const ColourFault& fault, const Vec2& principal_point, uint64_t seed) {
  const VignettingField field(rgb.width(), rgb.height(), principal_point);
  const ColourModel lens{.vignetting = fault.vignetting};
  double light[256];
  for (int v = 0; v < 256; v++) light[v] = std::pow(v / 255.0, kSceneGamma);
  Random random(seed);
  Image out(PixelFamily::kRgb, rgb.width(), rgb.height());
  for (int y = 0; y < rgb.height(); y++)
    for (int x = 0; x < rgb.width(); x++) {
      const uint8_t* const in = rgb.pixel(x, y);
      const double share = vignetting_factor(lens, field.square(x, y));
      for (int c = 0; c < 3; c++) {
        const double* const row = &fault.crosstalk[static_cast<size_t>(3 * c)];
        const double seen = share * (row[0] * light[in[0]] + row[1] * light[in[1]] + row[2] * light[in[2]]);
        const double level = fault.gain * fault.balance[c] * std::pow(seen, 1 / fault.gamma);
        const double value = fault.black[c] + (255 - fault.black[c]) * level + fault.noise * random.normal();
        out.pixel(x, y)[c] = static_cast<uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
      }
    }
  return out;
}

std::string faults_to_json(const Rig& rig, const std::vector<ColourFault>& faults) {
  nlohmann::ordered_json cameras = nlohmann::ordered_json::array();
  for (size_t i = 0; i < faults.size(); i++) {
    const ColourFault& f = faults[i];
    cameras.push_back({{"id", rig.cameras[i].id},
                       {"gain", f.gain},
                       {"balance", {f.balance.x, f.balance.y, f.balance.z}},
                       {"black", {f.black.x, f.black.y, f.black.z}},
                       {"gamma", f.gamma},
                       {"crosstalk", f.crosstalk},
                       {"vignetting", f.vignetting},
                       {"noise", f.noise}});
  }
  const nlohmann::ordered_json file = {
      {"format", "lightfield-colour-faults"}, {"version", 1}, {"cameras", std::move(cameras)}};
  return file.dump(1) + "\n";
}

}  // namespace lf
