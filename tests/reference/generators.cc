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

// rows x columns cameras on a cylinder or sphere, full or partial.
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
  if (turn == 2 * M_PI) {  // the last column connects to the first
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

// Triangles between cameras at random poses: folds, intersections, edges shared by any number of faces.
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
  const double fy = f * random.uniform(0.9, 1.1);
  const auto small = [&] { return random.uniform(-0.01, 0.01); };
  switch (random.integer(0, 9)) {
    case 5: return Lens(LensModel::kOpenCvFisheye, {f / 2, fy / 2, cx, cy, k1 / 4, k2 / 4, small(), small()});
    case 6:
      return Lens(LensModel::kFullOpenCv,
                  {f, fy, cx, cy, k1 + 0.3, k2 + 0.1, small(), small(), small(), 0.3, 0.1, small()});
    case 7:
      return Lens(LensModel::kThinPrismFisheye,
                  {f / 2, fy / 2, cx, cy, k1 / 4, k2 / 4, small(), small(), small(), small(), small(), small()});
    case 8: return Lens(LensModel::kSimpleRadialFisheye, {f / 2, cx, cy, k1 / 4});
    case 9: return Lens(LensModel::kRadialFisheye, {f / 2, cx, cy, k1 / 4, k2 / 4});
    case 0: return Lens(LensModel::kSimplePinhole, {f, cx, cy});
    case 1: return Lens(LensModel::kPinhole, {f, fy, cx, cy});
    case 2: return Lens(LensModel::kSimpleRadial, {f, cx, cy, k1});
    case 3: return Lens(LensModel::kRadial, {f, cx, cy, k1, k2});
    default: return Lens(LensModel::kOpenCv, {f, fy, cx, cy, k1, k2, small(), small()});
  }
}

View random_view(Random& random, const Rig& rig, int width, int height) {
  View view;
  view.blending.extrapolates = false;  // the reference renders only the mesh
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
    std::vector<double> wave;  // along a row
    for (int x = 0; x < width; x++) wave.push_back(120 * std::sin(a * x + phase));
    for (int y = 0; y < height; y++) {
      const double factor = std::cos(b * y - phase);
      for (int x = 0; x < width; x++) image.pixel(x, y)[c] = static_cast<uint8_t>(127.5 + wave[x] * factor);
    }
  }
  return image;
}

std::vector<Image> images_of(const Rig& rig, Random& random, Image (*make)(Random&, int, int)) {
  std::vector<Image> images;
  for (const Camera& camera : rig.cameras) images.push_back(make(random, camera.width, camera.height));
  return images;
}

namespace {

constexpr int kWidth = 48, kHeight = 36;

Quat about_y(double angle) { return {std::cos(angle / 2), 0, std::sin(angle / 2), 0}; }

std::pair<Rig, View> turned(const Rig& rig, const View& view, Random& random) {
  return moved(rig, view, {0, 0, 0}, random.orientation());
}

Rig triangles(const std::vector<Vec3>& centres, const std::vector<std::array<CameraIndex, 3>>& faces) {
  Rig rig;
  for (const Vec3& centre : centres)
    rig.cameras.push_back(
        make_camera(static_cast<uint32_t>(rig.cameras.size()), 64, 48, grid_lens(), {centre, {1, 0, 0, 0}}));
  if (!faces.empty()) rig.topology = {Topology::Type::kTriangles, 0, 0, faces};
  return rig;
}

struct More {
  int trials = 8;
  double least_owned = 0.2;
};
const More kPlain{};

Lens enlarged(const Lens& lens, int times) {
  std::array<double, Lens::kMaxParams> params = lens.params();
  const int focal = lens_model_num_focal(lens.model());
  for (int i = 0; i < focal; i++) params[i] *= times;
  for (int i = focal; i < focal + 2; i++) params[i] = (params[i] + 0.5) * times - 0.5;
  return Lens(lens.model(), params);
}

}  // namespace

View view_at(const Vec3& eye, const Quat& orientation, double fov_y, double focus) {
  View view;
  view.blending.extrapolates = false;  // the reference renders only the mesh
  view.width = kWidth;
  view.height = kHeight;
  view.lens = Lens::from_fov_y(fov_y, kWidth, kHeight);
  view.pose = {eye, glm::normalize(orientation)};
  view.focus.plane = plane_through({0, 0, focus}, {0, 0, -1});
  return view;
}

Rig array() { return planar_grid(4, 4, 0.5); }

std::pair<Rig, View> moved(Rig rig, View view, const Vec3& by, const Quat& turn) {
  const auto move = [&](Pose& pose) {
    pose.position = glm::mat3_cast(turn) * pose.position + by;
    pose.orientation = glm::normalize(turn * pose.orientation);
  };
  const Plane plane = view.focus.plane;
  const Vec3 normal = glm::normalize(glm::mat3_cast(turn) * plane.normal);
  view.focus.plane = {normal, plane.d - glm::dot(normal, by)};
  if (view.focus.map) {
    auto map = std::make_shared<FocalMap>(*view.focus.map);
    map->from.normal = glm::normalize(glm::mat3_cast(turn) * map->from.normal);
    map->from.d -= glm::dot(map->from.normal, by);
    view.focus.map = std::move(map);
  }
  for (Camera& camera : rig.cameras) move(camera.pose);
  move(view.pose);
  return {rig, view};
}

HardCase enlarged(const HardCase& hard, int times) {
  HardCase large = hard;
  large.trials = 2;
  large.least_owned /= 4;  // fewer trials
  large.make = [=](Random& random) {
    auto [rig, view] = hard.make(random);
    for (Camera& camera : rig.cameras) {
      camera.lens = enlarged(camera.lens, times);
      camera.width *= times;
      camera.height *= times;
    }
    view.lens = enlarged(view.lens, times);
    view.width *= times;
    view.height *= times;
    if (view.focus.map) {
      auto map = std::make_shared<FocalMap>(*view.focus.map);
      map->step *= times;
      view.focus.map = std::move(map);
    }
    return std::pair(rig, view);
  };
  return large;
}

namespace {

// A focal map of 12 x 9 nodes with distances from the array's plane; level(i) returns the level of node i.
template <typename Level>
std::pair<Rig, View> turned_with_map(const Rig& rig, View view, double farthest, double nearest, Level level,
                                     Random& random) {
  auto map = std::make_shared<FocalMap>(FocalMap::for_view(view.width, view.height));
  map->from = {{0, 0, 1}, 0};
  map->farthest = farthest;
  map->nearest = nearest;
  for (int i = 0; i < map->columns * map->rows; i++) map->levels.push_back(static_cast<uint8_t>(level(i)));
  view.focus.map = std::move(map);
  return turned(rig, view, random);
}

}  // namespace

std::vector<HardCase> hard_cases() {
  std::vector<HardCase> all;
  const auto add = [&](const char* name, auto make, More more = kPlain) {
    all.push_back({name, make, more.trials, more.least_owned});
  };

  add("eye at a camera", [](Random& r) { return turned(array(), view_at({-0.25, 0.25, 0}), r); });
  add("eye at a corner of the array", [](Random& r) { return turned(array(), view_at({0.75, 0.75, 0}), r); });
  add("eye one ulp from a camera",
      [](Random& r) {
        auto [rig, view] = turned(array(), view_at({-0.25, 0.25, 0}), r);
        for (int k = 0; k < 3; k++) {
          double& x = view.pose.position[k];
          const int step = r.integer(-1, 1);
          if (step != 0) x = std::nextafter(x, step * 10.0);
        }
        return std::pair(rig, view);
      },
      {.trials = 100});
  add("eye 1e-17 to 1e-13 m from a camera",
      [](Random& r) {
        return turned(array(), view_at(Vec3(-0.25, 0.25, 0) + std::pow(10, r.uniform(-17, -13)) * r.direction()), r);
      },
      {.trials = 100});
  add("eye 1e-12 from a camera",
      [](Random& r) { return turned(array(), view_at(Vec3(-0.25, 0.25, 0) + 1e-12 * r.direction()), r); });
  add("eye 1e-9 from a camera",
      [](Random& r) { return turned(array(), view_at(Vec3(-0.25, 0.25, 0) + 1e-9 * r.direction()), r); });
  add("eye on an edge", [](Random& r) { return turned(array(), view_at({r.uniform(-0.25, 0.25), 0.25, 0}), r); });
  add("eye on the array's border", [](Random&) { return std::pair(array(), view_at({0.5, 0.75, 0})); });
  add("eye 1e-12 from an edge", [](Random& r) {
    return turned(array(), view_at(Vec3(r.uniform(-0.25, 0.25), 0.25, 0) + 1e-12 * r.direction()), r);
  });
  add("eye in the array's plane", [](Random& r) {
    return turned(array(), view_at({r.uniform(-0.7, 0.7), r.uniform(-0.7, 0.7), 0}), r);
  });
  add("eye 1e-12 from the plane", [](Random& r) {
    return turned(array(), view_at({r.uniform(-0.7, 0.7), r.uniform(-0.7, 0.7), r.uniform(-1e-12, 1e-12)}), r);
  });
  add("array behind the eye", [](Random& r) { return turned(array(), view_at({0.1, 0.2, r.uniform(0.3, 1)}), r); });
  add("almost parallel to the array", [](Random& r) {
    return turned(array(), view_at({0.1, 0.1, r.uniform(-1e-6, 1e-6)}, about_y(M_PI / 2 - r.uniform(0, 1e-3)), 60), r);
  });
  add("one row of pixels parallel", [](Random& r) {
    return std::pair(array(), view_at({0.1, 0.1, -r.uniform(0, 0.01)}, Quat(std::sqrt(0.5), std::sqrt(0.5), 0, 0), 61));
  });
  add("almost parallel to the focal plane", [](Random& r) {
    View view = view_at({0.1, 0.1, -0.4});
    const double angle = r.uniform(0, 1e-6);
    view.focus.plane = plane_through({0, 2, 0}, {0, -std::cos(angle), std::sin(angle)});
    return turned(array(), view, r);
  });
  add("focal plane through a camera", [](Random& r) {
    View view = view_at({0.1, 0.1, -0.6});
    view.focus.plane =
        plane_through({0.25, 0.25, 0}, glm::normalize(Vec3(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), -1)));
    return turned(array(), view, r);
  });
  add("focal plane is the array's plane", [](Random& r) {
    View view = view_at({0.1, 0.1, -0.6});
    view.focus.plane = {{0, 0, -1}, 0};
    return turned(array(), view, r);
  });
  add("focal plane behind the cameras", [](Random& r) {
    return turned(array(), view_at({0.1, 0.1, -0.6}, {1, 0, 0, 0}, 60, -0.2), r);
  });
  add("focal plane through the eye",
      [](Random&) {
        View view = view_at({0.125, 0.25, -0.5});
        view.focus.plane = {{0, 1, 0}, -0.25};
        return std::pair(array(), view);
      },
      {.least_owned = 0});
  add("focal plane 1e-12 from the eye",
      [](Random& r) {
        View view = view_at({0.125, 0.25, -0.5});
        view.focus.plane = plane_through({0.125, 0.25, -0.5 + 1e-12}, {0, 0, -1});
        return turned(array(), view, r);
      },
      {.least_owned = 0});
  add("focal plane behind the eye",
      [](Random& r) {
        return turned(array(), view_at({0, 0, -1}, {1, 0, 0, 0}, 60, -2), r);
      },
      {.least_owned = 0});
  add("focal map: steps of depth", [](Random& r) {
    return turned_with_map(
        array(), view_at({0.1, 0.1, -0.6}), 0.2, 2, [&](int) { return r.integer(0, 255); }, r);
  });
  add("focal map: slopes up to infinity", [](Random& r) {
    return turned_with_map(
        array(), view_at({0.1, 0.1, r.uniform(-0.6, 0)}), 0, 1, [](int i) { return i * 7 % 256; }, r);
  });
  add("focal map: one plane", [](Random& r) {
    const int level = r.integer(1, 255);
    return turned_with_map(
        array(), view_at({0.1, 0.1, -0.6}), 0.1, 1, [=](int) { return level; }, r);
  });
  add("focal map: parts behind the eye", [](Random& r) {
    return turned_with_map(
        array(), view_at({0.1, 0.1, 0.6}), 0.5, 4, [](int i) { return i % 12 < 6 ? 0 : 255; }, r);
  });
  add("triangles straddle the eye's plane", [](Random& r) {
    const Rig rig = triangles({{-1, -1, -1}, {1, -1, 1}, {1, 1, 1.2}, {-1, 1, -0.8}}, {{0, 1, 2}, {0, 2, 3}});
    return turned(rig, view_at(r.point_in_box(0.1), r.small_rotation(1), 100, 3), r);
  });
  add("folded mesh, oblique", [](Random& r) {
    Rig rig = planar_grid(3, 5, 0.5);
    for (Camera& camera : rig.cameras) {
      camera.pose.position.z = std::abs(camera.pose.position.x);  // a V
      camera.lens = Lens::pinhole(12, 31.5, 23.5);
    }
    return turned(rig, view_at({2.5, r.uniform(-0.3, 0.3), -0.2}, about_y(r.uniform(-1.4, -1.1)), 50), r);
  });
  add("folded soup", [](Random& r) {
    std::vector<Vec3> centres;
    std::vector<std::array<CameraIndex, 3>> faces;
    for (CameraIndex i = 0; i < 8; i++) centres.push_back(r.point_in_box(1));
    for (CameraIndex i = 0; i < 8; i++) faces.push_back({i, (i + 1) % 8, (i + 3) % 8});
    return turned(triangles(centres, faces), view_at(r.point_in_box(1), r.small_rotation(1), 80, 3), r);
  });
  add("a million metres away", [](Random& r) {
    return moved(array(), view_at({0.1, 0.2, -0.4}), Vec3(1e6, -2e6, 3e6), r.orientation());
  });
  add("baselines of 1e-6 m", [](Random& r) {
    return turned(planar_grid(4, 4, 1e-6), view_at({1e-7, 2e-7, -1e-6}), r);
  });
  add("baselines of 1e-6 m, eye 1 m behind", [](Random& r) {
    View view = view_at({0, 0, -1}, {1, 0, 0, 0}, 1.5e-4);
    return turned(planar_grid(4, 4, 1e-6), view, r);
  });
  add("baselines of 1e6 m", [](Random& r) {
    return turned(planar_grid(4, 4, 1e6), view_at({1e5, 2e5, -7e5}, {1, 0, 0, 0}, 60, 1e7), r);
  });
  add("slivers", [](Random& r) {
    const double thin = std::pow(10, -r.integer(3, 9));
    const Rig rig = triangles({{-1, 0, 0}, {1, 0, 0}, {0, thin, 0}, {0, 1, 0}, {0, -1, 0}},
                              {{0, 1, 2}, {0, 2, 3}, {1, 3, 2}, {0, 4, 1}});
    return turned(rig, view_at({0.1, 0.1, -0.8}), r);
  });
  add("collinear cameras in a triangle", [](Random& r) {
    const Rig rig = triangles({{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}},
                              {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {0, 4, 2}});
    return turned(rig, view_at({0.1, 0.1, -0.8}), r);
  });
  add("eye in line with a triangle of no area",
      [](Random& r) {
        // A zero-area triangle, as Delaunay leaves at the border of a regular grid: first in the mesh, next to a camera
        // at the viewpoint.
        const double p = r.uniform(0.1, 0.5);
        const Rig rig = triangles({{-2 * p, -p / 2, 0},
                                   {-p, -p / 2, 0},
                                   {0, -p / 2, 0},
                                   {2 * p, -p / 2, 0},
                                   {2 * p, p / 2, 0},
                                   {0, p / 2, 0}},
                                  {{0, 2, 1}, {2, 3, 5}, {3, 4, 5}});
        return std::pair(rig, view_at({2 * p, -p / 2, 0}, r.small_rotation(1)));
      },
      {.trials = 100});
  add("collinear rig", [](Random& r) {
    return turned(triangles({{-1, 0, 0}, {0, 0, 0}, {1, 0, 0}, {1.5, 0, 0}}, {}), view_at({0.3, 0.1, -0.8}), r);
  });
  add("one camera", [](Random& r) { return turned(triangles({{0.1, 0.2, 0}}, {}), view_at({0.3, 0.1, -0.8}), r); });
  add("two cameras", [](Random& r) {
    return turned(triangles({{-0.5, 0.2, 0}, {0.7, 0, 0.1}}, {}), view_at({0.3, 0.1, -0.8}), r);
  });
  add("three cameras", [](Random& r) {
    return turned(triangles({{-0.5, 0.4, 0}, {0.7, 0.3, 0.1}, {0, -0.6, 0}}, {}), view_at({0, 0.1, -0.6}), r);
  });
  add("duplicate cameras", [](Random& r) {
    return turned(
        triangles({{-0.5, 0.4, 0}, {0.7, 0.3, 0}, {0, -0.6, 0}, {0.7, 0.3, 0}, {-0.5, 0.4, 0}, {0, 0.9, 0}}, {}),
        view_at({0, 0.1, -0.6}), r);
  });
  add("triangles of duplicate cameras", [](Random& r) {
    const Rig rig =
        triangles({{-0.5, 0.4, 0}, {0.7, 0.3, 0}, {0, -0.6, 0}, {0.7, 0.3, 0}}, {{0, 1, 3}, {0, 1, 2}, {3, 2, 0}});
    return turned(rig, view_at({0, 0.1, -0.6}), r);
  });
  add("lens that folds, in the view", [](Random& r) {
    View view = view_at({0.1, 0.2, -0.4});
    view.lens = Lens(LensModel::kSimpleRadial, {20, 23.5, 17.5, -0.25});
    return turned(array(), view, r);
  });
  add("lens that folds, in the cameras", [](Random& r) {
    Rig rig = array();
    for (Camera& camera : rig.cameras) camera.lens = Lens(LensModel::kRadial, {40, 31.5, 23.5, -0.4, 0.02});
    return turned(rig, view_at({0.1, 0.2, -0.4}), r);
  });
  add("fisheye of 180 degrees, in the view", [](Random& r) {
    View view = view_at({0.1, 0.2, -0.4});
    view.lens = Lens(LensModel::kOpenCvFisheye, {12, 12, 23.5, 17.5, 0, 0, 0, 0});
    return turned(array(), view, r);
  });
  add("fisheye of 180 degrees, in the cameras", [](Random& r) {
    Rig rig = array();
    for (Camera& camera : rig.cameras)
      camera.lens = Lens(LensModel::kOpenCvFisheye, {15, 15, 31.5, 23.5, 0.02, 0, 0, 0});
    return turned(rig, view_at({0.1, 0.2, -0.4}), r);
  });
  // Adjacent cameras look to opposite sides, so that half of what the view shows is behind their planes Z = 0.
  add("fisheye of 190 degrees, in cameras that look aside", [](Random& r) {
    Rig rig = array();
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      rig.cameras[i].lens = Lens(LensModel::kOpenCvFisheye, {14, 14, 31.5, 23.5, 0.02, 0, 0, 0});
      rig.cameras[i].pose.orientation = glm::angleAxis((i % 2 ? 1.4 : -1.4) + r.uniform(-0.2, 0.2), Vec3(0, 1, 0));
    }
    return turned(rig, view_at({0.1, 0.2, -0.4}), r);
  });
  add("rational lens, in the cameras", [](Random& r) {
    Rig rig = array();
    for (Camera& camera : rig.cameras)
      camera.lens = Lens(LensModel::kFullOpenCv, {40, 41, 31.5, 23.5, 0.5, -0.1, 1e-3, -2e-3, 0.02, 0.4, 0.05, 0.01});
    return turned(rig, view_at({0.1, 0.2, -0.4}), r);
  });
  add("orientations 1e-6 off unit norm", [](Random& r) {
    auto [rig, view] = turned(array(), view_at({0.1, 0.2, -0.4}), r);
    for (Camera& camera : rig.cameras) camera.pose.orientation *= 1 + r.uniform(-0.9e-6, 0.9e-6);
    view.pose.orientation *= 1 + 0.9e-6;
    return std::pair(rig, view);
  });
  add("view of one pixel", [](Random& r) {
    View view = view_at({0.1, 0.2, -0.4});
    view.width = view.height = 1;
    view.lens = Lens::from_fov_y(60, 1, 1);
    return turned(array(), view, r);
  });
  return all;
}

}  // namespace lf::reference
