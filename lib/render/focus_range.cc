// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/focus_range.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/text.h"
#include "view/navigator.h"

namespace lf {
namespace {

constexpr size_t kNeighbours = 4;
constexpr int kBlock = 12, kStep = 2;  // side of a block and spacing of its samples, pixels
constexpr int kTriedPlanes = 96;
constexpr double kLargestDisparity = 0.25;  // relative to the image width, for the two most distant cameras
constexpr double kMinTexture = 8;           // mean absolute deviation of a block's luma, 0..255
// largest difference of the best plane, relative to the median over all planes
constexpr double kDistinct = 0.5;
constexpr size_t kMinBlocks = 8;

struct Grey {
  int width = 0, height = 0;
  std::vector<uint8_t> luma;
  // Returns the nearest pixel, or a negative value outside the image.
  int at(const Vec2& p) const {
    const double x = std::round(p.x), y = std::round(p.y);
    if (!(x >= 0 && y >= 0 && x < width && y < height)) return -1;
    return luma[static_cast<size_t>(y) * width + static_cast<size_t>(x)];
  }
};

Grey grey(const Image& image) {
  if (image.family() != PixelFamily::kRgb) throw Error("focus is estimated from RGB images; convert the images first");
  Grey out{image.width(), image.height(), {}};
  for (size_t i = 0; i < image.data().size(); i += 3)
    out.luma.push_back(
        static_cast<uint8_t>((image.data()[i] * 77 + image.data()[i + 1] * 150 + image.data()[i + 2] * 29) >> 8));
  return out;
}

std::vector<CameraIndex> neighbours(const Rig& rig, CameraIndex middle) {
  const Vec3 centre = rig.cameras[middle].pose.position;
  const auto distance = [&](CameraIndex i) { return glm::length(rig.cameras[i].pose.position - centre); };
  std::vector<CameraIndex> around;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (distance(i) > 0) around.push_back(i);
  std::stable_sort(around.begin(), around.end(),
                   [&](CameraIndex a, CameraIndex b) { return distance(a) < distance(b); });
  if (around.size() > kNeighbours) around.resize(kNeighbours);
  return around;
}

struct Sample {
  Vec3 ray;  // in world coordinates, with length 1 along the middle camera's axis
  int luma;
};

std::vector<Sample> block_samples(const Camera& camera, const Grey& image, int x0, int y0) {
  std::vector<Sample> samples;
  const Mat3 world_from_camera = camera.pose.rotation();
  for (int y = y0; y < y0 + kBlock; y += kStep)
    for (int x = x0; x < x0 + kBlock; x += kStep)
      if (const std::optional<Vec2> ray = camera.lens.unproject(Vec2(x, y)))
        samples.push_back({world_from_camera * Vec3(*ray, 1), image.at(Vec2(x, y))});
  return samples;
}

bool textured(const std::vector<Sample>& samples) {
  if (samples.empty()) return false;
  double mean = 0, deviation = 0;
  for (const Sample& s : samples) mean += s.luma / static_cast<double>(samples.size());
  for (const Sample& s : samples) deviation += std::abs(s.luma - mean) / static_cast<double>(samples.size());
  return deviation > kMinTexture;
}

}  // namespace

std::optional<FocusRange> estimate_focus_range(const Rig& rig, const CameraImages& images) {
  if (rig.cameras.empty()) return std::nullopt;
  const CameraIndex middle = middle_camera(rig);
  const Camera& camera = rig.cameras[middle];
  const std::vector<CameraIndex> around = neighbours(rig, middle);
  if (around.empty()) return std::nullopt;
  const Grey image = grey(images(middle));
  std::vector<Grey> others;
  for (const CameraIndex i : around) others.push_back(grey(images(i)));

  // Planes are equidistant in disparity.
  const double baseline = glm::length(rig.cameras[around.back()].pose.position - camera.pose.position);
  std::vector<double> distances;
  for (int k = 1; k <= kTriedPlanes; k++)
    distances.push_back(camera.lens.fx() * baseline / (k * kLargestDisparity * camera.width / kTriedPlanes));

  // Returns the mean difference from the cameras that see the point. Returns infinity if fewer than half of the samples
  // are seen.
  const auto difference = [&](const std::vector<Sample>& samples, double distance) {
    double sum = 0;
    size_t n = 0;
    for (size_t i = 0; i < around.size(); i++) {
      const Camera& other = rig.cameras[around[i]];
      for (const Sample& s : samples) {
        const std::optional<Vec2> pixel =
            other.lens.project(other.pose.camera_from_world(camera.pose.position + distance * s.ray));
        const int luma = pixel ? others[i].at(*pixel) : -1;
        if (luma < 0) continue;
        sum += std::abs(luma - s.luma);
        n++;
      }
    }
    return 2 * n < samples.size() * around.size() ? std::numeric_limits<double>::infinity()
                                                  : sum / static_cast<double>(n);
  };

  std::vector<double> found;
  for (int y0 = 0; y0 + kBlock <= camera.height; y0 += kBlock)
    for (int x0 = 0; x0 + kBlock <= camera.width; x0 += kBlock) {
      const std::vector<Sample> samples = block_samples(camera, image, x0, y0);
      if (!textured(samples)) continue;
      std::vector<double> differences;
      for (const double distance : distances) differences.push_back(difference(samples, distance));
      const auto best = std::min_element(differences.begin(), differences.end());
      const double least = *best, best_distance = distances[best - differences.begin()];
      std::nth_element(differences.begin(), differences.begin() + kTriedPlanes / 2, differences.end());
      if (least < kDistinct * differences[kTriedPlanes / 2]) found.push_back(best_distance);
    }
  if (found.size() < kMinBlocks) return std::nullopt;
  std::sort(found.begin(), found.end());
  return FocusRange{found[found.size() / 10], found[found.size() - 1 - found.size() / 10]};
}

}  // namespace lf
