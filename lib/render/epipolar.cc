// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/epipolar.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "base/text.h"
#include "render/camera_projection.h"
#include "view/view.h"

namespace lf {
namespace {

struct Baseline {
  Vec3 middle;
  // Unit vectors. `along` is from the first camera to the last, and the second vector is the mean camera axis, made
  // perpendicular to `along`.
  Vec3 along, normal;
  Vec3 across;                 // third axis
  std::vector<double> places;  // position of each camera along the line, metres from the middle

  Baseline(const Rig& rig, const std::vector<CameraIndex>& line) {
    const Vec3 first = rig.cameras[line.front()].pose.position, last = rig.cameras[line.back()].pose.position;
    Vec3 forward(0), aside(0);
    for (const CameraIndex i : line) {
      forward += rig.cameras[i].pose.forward();
      aside += rig.cameras[i].pose.right() + rig.cameras[i].pose.down();
    }
    if (first == last)
      throw Error(
          "an epipolar-plane image needs cameras at different places, but the first and the last have the same "
          "position");
    middle = (first + last) / 2.0;
    along = glm::normalize(last - first);
    const Vec3 ahead = forward - along * glm::dot(along, forward);
    if (!(glm::length(ahead) > 1e-6 * static_cast<double>(line.size())))
      throw Error("an epipolar-plane image needs cameras that do not look along their line");
    normal = glm::normalize(ahead);
    across = glm::cross(normal, along);
    if (glm::dot(across, aside) < 0) across = -across;
    for (const CameraIndex i : line) places.push_back(glm::dot(rig.cameras[i].pose.position - middle, along));
  }

  size_t nearest(int y, int height) const {
    const double pitch = (places.back() - places.front()) / static_cast<double>(places.size() - 1);
    const double at = places.front() + pitch * ((y + 0.5) / height * static_cast<double>(places.size()) - 0.5);
    const auto off = [at](double place) { return std::abs(place - at); };
    return static_cast<size_t>(std::ranges::min_element(places, {}, off) - places.begin());
  }
};

std::vector<uint8_t> seen_line(const Camera& camera, const Image& image, const Vec3& middle, const Vec3& step,
                               int width) {
  std::vector<uint8_t> row(3 * static_cast<size_t>(width));
  for (int x = 0; x < width; x++) {
    const Vec3 point = camera.pose.camera_from_world(middle + (x - (width - 1) / 2.0) * step);
    const std::optional<Vec2> pixel = camera.lens.project(point);
    if (!pixel ||
        !(pixel->x >= -0.5 && pixel->x <= camera.width - 0.5 && pixel->y >= -0.5 && pixel->y <= camera.height - 0.5))
      continue;
    const plain::Sampler sampler(*pixel, image.width(), image.height());
    for (int c = 0; c < 3; c++)
      row[3 * static_cast<size_t>(x) + static_cast<size_t>(c)] =
          static_cast<uint8_t>(sampler.sample(image.data().data() + c, 3 * image.width(), 3) + 0.5f);
  }
  return row;
}

}  // namespace

Image epipolar_image(const Rig& rig, const std::vector<CameraIndex>& line, const CameraImages& images,
                     const EpipolarOptions& options) {
  if (line.size() < 2) throw Error("an epipolar-plane image needs at least two cameras; choose a longer row or column");
  if (!(options.distance > 0 && is_finite(options.distance))) throw Error("distance: must be positive");
  if (!is_finite(options.across)) throw Error("across: must be a number");
  validate_size("width", options.width);
  validate_size("height", options.height);
  const Baseline baseline(rig, line);
  const Vec3 middle = baseline.middle + options.distance * baseline.normal + options.across * baseline.across;
  const Vec3 step = options.distance / rig.cameras[line[line.size() / 2]].lens.fx() * baseline.along;

  std::vector<std::vector<uint8_t>> seen;
  for (const CameraIndex i : line) {
    const Camera& camera = rig.cameras[i];
    const Image& image = images(i);
    if (image.family() != PixelFamily::kRgb || image.width() != camera.width || image.height() != camera.height)
      throw Error("an epipolar-plane image needs RGB images of the rig's sizes");
    seen.push_back(seen_line(camera, image, middle, step, options.width));
  }
  Image picture(PixelFamily::kRgb, options.width, options.height);
  for (int y = 0; y < options.height; y++) {
    const std::vector<uint8_t>& row = seen[baseline.nearest(y, options.height)];
    std::memcpy(picture.pixel(0, y), row.data(), row.size());
  }
  return picture;
}

namespace {

void check_place(const Rig& rig, const char* what, int index, int count) {
  if (rig.topology.type != Topology::Type::kGrid) throw Error(std::string(what) + ": the rig is not a grid");
  if (index < 0 || index >= count)
    throw Error(std::string(what) + " " + std::to_string(index) + ": must be 0 to " + std::to_string(count - 1));
}

}  // namespace

std::vector<CameraIndex> row_of_cameras(const Rig& rig, int index) {
  check_place(rig, "row", index, rig.topology.rows);
  std::vector<CameraIndex> line;
  for (int i = 0; i < rig.topology.columns; i++)
    line.push_back(static_cast<CameraIndex>(index * rig.topology.columns + i));
  return line;
}

std::vector<CameraIndex> column_of_cameras(const Rig& rig, int index) {
  check_place(rig, "column", index, rig.topology.columns);
  std::vector<CameraIndex> line;
  for (int i = 0; i < rig.topology.rows; i++)
    line.push_back(static_cast<CameraIndex>(i * rig.topology.columns + index));
  return line;
}

}  // namespace lf
