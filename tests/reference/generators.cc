// SPDX-License-Identifier: LGPL-2.1-or-later
#include "reference/generators.h"

#include <algorithm>
#include <cmath>

namespace lf::reference {
namespace {

constexpr int kImageWidth = 64, kImageHeight = 48;

Rig jittered_grid(Random& random) {
  const int rows = random.integer(2, 4), columns = random.integer(2, 5);
  const double pitch = random.uniform(0.1, 0.5);
  Rig rig = planar_grid(rows, columns, pitch);
  const double jitter = random.one_in(3) ? 0 : random.uniform(0, 0.4) * pitch;
  const double depth = random.one_in(2) ? 0 : jitter;
  const double tilt = random.one_in(3) ? 0 : random.uniform(0, 0.5);
  for (Camera& camera : rig.cameras) {
    const Vec3 by = random.point_in_box(1);
    camera.pose.position += Vec3(by.x * jitter, by.y * jitter, by.z * depth);
    camera.pose.orientation = random.small_rotation(tilt);
    if (random.one_in(4)) camera.lens = random_lens(random, camera.width, camera.height);
  }
  return rig;
}

// rows x columns around an axis or a centre, all the way round or part of it.
Rig round_rig(Random& random, bool sphere) {
  const int rows = random.integer(2, 3), columns = random.integer(4, 9);
  const double radius = random.uniform(0.3, 1.2), outwards = random.one_in(2) ? 1 : -1;
  const double turn = random.one_in(2) ? 2 * M_PI : random.uniform(1, 5);
  Rig rig;
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++) {
      const double angle = turn * c / columns, height = (r - (rows - 1) / 2.0) * 0.5;
      const double up = sphere ? std::sin(height) : height, wide = sphere ? std::cos(height) : 1;
      const Vec3 out(wide * std::sin(angle), sphere ? up : 0, wide * std::cos(angle));
      const Vec3 position = radius * Vec3(wide * std::sin(angle), up, wide * std::cos(angle));
      const Vec3 forward = outwards * (random.one_in(3) ? glm::normalize(out + random.point_in_box(0.2)) : out);
      rig.cameras.push_back(make_camera(static_cast<uint32_t>(rig.cameras.size()), kImageWidth, kImageHeight,
                                        grid_lens(), look_at(position, position + forward, {0, 1, 0})));
    }
  if (turn == 2 * M_PI) {  // the last column is joined to the first
    rig.topology.type = Topology::Type::kTriangles;
    const auto at = [&](int r, int c) { return static_cast<CameraIndex>(r * columns + c % columns); };
    for (int r = 0; r + 1 < rows; r++)
      for (int c = 0; c < columns; c++) {
        rig.topology.triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c)});
        rig.topology.triangles.push_back({at(r, c + 1), at(r + 1, c + 1), at(r + 1, c)});
      }
  } else {
    rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  }
  return rig;
}

// Triangles between cameras anywhere, looking anywhere (mostly): folds, intersections, edges of any number of faces.
Rig soup(Random& random) {
  const int cameras = random.integer(3, 12), triangles = random.integer(1, 20);
  Rig rig;
  for (int i = 0; i < cameras; i++) {
    const Quat orientation = random.one_in(2) ? random.orientation() : random.small_rotation(1);
    rig.cameras.push_back(make_camera(static_cast<uint32_t>(i), kImageWidth, kImageHeight, grid_lens(),
                                      {random.point_in_box(1), orientation}));
  }
  rig.topology.type = Topology::Type::kTriangles;
  while (static_cast<int>(rig.topology.triangles.size()) < triangles) {
    const auto any = [&] { return static_cast<CameraIndex>(random.integer(0, cameras - 1)); };
    const std::array<CameraIndex, 3> t{any(), any(), any()};
    if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) rig.topology.triangles.push_back(t);
  }
  return rig;
}

}  // namespace

Vec3 Random::direction() {
  for (;;) {
    const Vec3 v = point_in_box(1);
    const double n = glm::length(v);
    if (n > 0.1 && n <= 1) return v / n;
  }
}

Quat Random::orientation() {
  const Vec3 axis = direction();
  const double half = uniform(0, M_PI);
  return glm::normalize(Quat(std::cos(half), std::sin(half) * axis));
}

Quat Random::small_rotation(double max_angle) {
  const Vec3 axis = direction();
  const double half = uniform(0, max_angle) / 2;
  return glm::normalize(Quat(std::cos(half), std::sin(half) * axis));
}

Camera make_camera(uint32_t id, int width, int height, const Lens& lens, const Pose& pose) {
  Camera camera;
  camera.id = id;
  camera.name = "cam_" + std::to_string(id);
  camera.width = width;
  camera.height = height;
  camera.lens = lens;
  camera.pose = pose;
  return camera;
}

Lens grid_lens() { return Lens::from_fov_y(60, kImageWidth, kImageHeight); }

Rig planar_grid(int rows, int columns, double pitch) {
  Rig rig;
  for (int r = 0; r < rows; r++)
    for (int c = 0; c < columns; c++)
      rig.cameras.push_back(
          make_camera(static_cast<uint32_t>(rig.cameras.size()), kImageWidth, kImageHeight, grid_lens(),
                      {Vec3(c - (columns - 1) / 2.0, r - (rows - 1) / 2.0, 0) * pitch, {1, 0, 0, 0}}));
  rig.topology = {Topology::Type::kGrid, rows, columns, {}};
  return rig;
}

Rig random_rig(Random& random) {
  switch (random.integer(0, 5)) {
    case 0: return jittered_grid(random);
    case 1: {
      Rig rig = jittered_grid(random);
      rig.topology = {};
      return rig;
    }
    case 2: return round_rig(random, false);
    case 3: return round_rig(random, true);
    case 4: {
      Rig rig = soup(random);
      rig.topology = {};
      return rig;
    }
    default: return soup(random);
  }
}

Lens random_lens(Random& random, int width, int height) {
  const double f = width * random.uniform(0.5, 1.5), cx = (width - 1) / 2.0 + random.uniform(-2, 2),
               cy = (height - 1) / 2.0 + random.uniform(-2, 2);
  const double k1 = random.uniform(-0.3, 0.2), k2 = random.uniform(-0.05, 0.1);
  switch (random.integer(0, 4)) {
    case 0: return Lens(LensModel::kSimplePinhole, {f, cx, cy});
    case 1: return Lens(LensModel::kPinhole, {f, f * random.uniform(0.9, 1.1), cx, cy});
    case 2: return Lens(LensModel::kSimpleRadial, {f, cx, cy, k1});
    case 3: return Lens(LensModel::kRadial, {f, cx, cy, k1, k2});
    default:
      return Lens(LensModel::kOpenCv, {f, f * random.uniform(0.9, 1.1), cx, cy, k1, k2, random.uniform(-0.01, 0.01),
                                       random.uniform(-0.01, 0.01)});
  }
}

View random_view(Random& random, const Rig& rig, int width, int height) {
  View view;
  view.width = width;
  view.height = height;
  view.lens =
      random.one_in(5) ? random_lens(random, width, height) : Lens::from_fov_y(random.uniform(10, 120), width, height);
  const Camera& near = rig.cameras[random.integer(0, static_cast<int>(rig.cameras.size()) - 1)];
  switch (random.integer(0, 4)) {
    case 0: view.pose = {random.point_in_box(2), random.orientation()}; break;
    case 1: view.pose = near.pose; break;
    case 2: view.pose = {near.pose.position + random.point_in_box(0.3), near.pose.orientation}; break;
    case 3: view.pose = {near.pose.position - random.uniform(0, 2) * near.pose.forward(), near.pose.orientation}; break;
    default: view.pose = {near.pose.position + random.point_in_box(0.5), random.orientation()};
  }
  if (random.one_in(2)) view.pose.orientation = glm::normalize(view.pose.orientation * random.small_rotation(0.5));
  const double distance = random.uniform(0.2, 5);
  const Vec3 point = random.point_in_box(4), normal = random.direction();
  view.focus.plane = random.one_in(3) ? plane_through(point, normal)
                                      : focal_plane_at(view.pose, random.one_in(10) ? -distance : distance);
  return view;
}

CameraSet random_out_of_service(Random& random, const Rig& rig) {
  CameraSet out;
  if (!random.one_in(3)) return out;
  for (CameraIndex i = 0; i < rig.cameras.size(); i++)
    if (random.one_in(5) && 3 * out.size() < rig.cameras.size()) out.push_back(i);
  return out;
}

Image white_image(int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  std::fill(image.data().begin(), image.data().end(), 255);
  return image;
}

Image noise_image(Random& random, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(random.integer(0, 255));
  return image;
}

Image smooth_image(Random& random, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int c = 0; c < 3; c++) {
    const double a = random.uniform(0.02, 0.06), b = random.uniform(0.02, 0.06), phase = random.uniform(0, 6);
    for (int y = 0; y < height; y++)
      for (int x = 0; x < width; x++)
        image.pixel(x, y)[c] = static_cast<uint8_t>(127.5 + 120 * std::sin(a * x + phase) * std::cos(b * y - phase));
  }
  return image;
}

std::vector<Image> images_of(const Rig& rig, Random& random, Image (*make)(Random&, int, int)) {
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(make(random, camera.width, camera.height));
  return images;
}

}  // namespace lf::reference
