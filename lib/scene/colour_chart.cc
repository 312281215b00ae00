// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/colour_chart.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "base/error.h"
#include "image/colour_checker.h"

namespace lf {
namespace {

using Light = std::array<double, 3>;

double srgb_light(int level) {
  const double v = level / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

// A lamp from the upper left: brightest there.
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

  // Whether the ray meets the board, and what is seen there.
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

std::vector<ChartPose> chart_poses(const Rig& rig, int count) {
  if (rig.cameras.empty()) throw Error("chart: the rig has no camera");
  if (count < 1) throw Error("chart: must be at one place at least");
  Vec3 middle(0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / static_cast<double>(rig.cameras.size());
  const Camera& nearest = *std::ranges::min_element(
      rig.cameras, {}, [&](const Camera& camera) { return glm::length(camera.pose.position - middle); });
  double extent = 0;
  for (const Camera& camera : rig.cameras) extent = std::max(extent, glm::length(camera.pose.position - middle));
  // So far away that all of an array has it in view.
  const double distance = std::max(0.8, 4 * extent);
  const Mat3 rotation = nearest.pose.rotation();
  std::vector<ChartPose> poses;
  for (int i = 0; i < count; i++) {
    // Places that fill the image evenly, whatever their number (Roberts's sequence of the plastic number).
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
  constexpr int kSamples = 3;  // along a row and a column of a pixel
  const Board board(chart);
  const Mat3 rotation = camera.pose.rotation();
  // The wall is behind all that the array can be shown.
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

}  // namespace lf
