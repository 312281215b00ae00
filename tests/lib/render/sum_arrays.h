// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "lib/render/production.h"
#include "reference/generators.h"
#include "render/gl/gles_renderer.h"
#include "render/sum_renderer.h"

namespace lf::test {

struct Sum {
  Sum(PixelFamily family, const Rect& rect) {
    planes.family = family;
    planes.rect = rect;
    for (int c = 0; c < 3; c++) {
      const bool half = family == PixelFamily::kI420 && c > 0;
      const int w = half ? chroma_size(rect.width()) : rect.width(),
                h = half ? chroma_size(rect.height()) : rect.height();
      memory[c].assign(static_cast<size_t>(w) * h, 12345);
      planes.plane[c] = memory[c].data();
      planes.stride[c] = w;
    }
    lost.assign(static_cast<size_t>(rect.width()) * rect.height(), 12345);
    planes.lost = lost.data();
    planes.missing_stride = rect.width();
  }
  double missing_weight(int x, int y) const {
    return planes.lost[(y - planes.rect.y0) * planes.missing_stride + (x - planes.rect.x0)] / double{kMissingOne};
  }
  bool operator==(const Sum& o) const {
    return memory[0] == o.memory[0] && memory[1] == o.memory[1] && memory[2] == o.memory[2] && lost == o.lost;
  }
  std::vector<int16_t> memory[3];
  std::vector<uint16_t> lost;
  SumPlanes planes;
};

inline std::vector<Source> sources_of(const Rig& rig, const ViewPlan& plan, const std::vector<Image>& images) {
  std::vector<Source> sources;
  for (const CameraIndex i : plan.contributors()) sources.push_back({i, &rig.cameras[i], images[i].view()});
  return sources;
}

inline Rig jittered_array(reference::Random& random, int side, int width, int height, double k1, double pitch = 0.1) {
  Rig rig;
  for (int i = 0; i < side * side; i++) {
    const double focal = 1.25 * width * random.uniform(0.98, 1.02);
    const Lens lens(LensModel::kRadial, {focal, (width - 1) / 2.0, (height - 1) / 2.0, k1, -k1 / 5});
    const Vec3 place(i % side + random.uniform(-0.05, 0.05), i / side + random.uniform(-0.05, 0.05), 0);
    rig.cameras.push_back(
        reference::make_camera(i, width, height, lens, {pitch * place, random.small_rotation(0.0175)}));
  }
  rig.topology = {Topology::Type::kGrid, side, side, {}};
  return rig;
}

// One lens of each model beyond OPENCV; one fisheye image is larger than its field of view of 190 degrees.
inline std::vector<Lens> lenses_beyond_opencv(int width, int height) {
  using enum LensModel;
  const double w = width, cx = (width - 1) / 2.0 + 1.5, cy = (height - 1) / 2.0 - 2.25;
  return {Lens(kFullOpenCv, {w, 1.01 * w, cx, cy, 0.5, -0.1, 1e-3, -2e-3, 0.02, 0.4, 0.05, 0.01}),
          Lens(kFullOpenCv, {w, w, cx, cy, -0.2, 0.1, 0, 0, -0.03, 0, 0, 0}),
          Lens(kOpenCvFisheye, {0.45 * w, 0.44 * w, cx, cy, 0.02, -0.01, 0.003, -3e-4}),
          Lens(kOpenCvFisheye, {0.25 * w, 0.25 * w, cx, cy, 0, 0, 0, 0}),
          Lens(kSimpleRadialFisheye, {0.4 * w, cx, cy, -0.05}),
          Lens(kRadialFisheye, {0.4 * w, cx, cy, 0.05, -0.01}),
          Lens(kThinPrismFisheye, {0.4 * w, 0.41 * w, cx, cy, 0.02, -0.01, 2e-3, -1e-3, 3e-3, 1e-4, 5e-3, -4e-3})};
}

inline View view_into(int side, int width, int height, const Quat& turn) {
  View view;
  view.width = width;
  view.height = height;
  const double f = 1.25 * width;
  view.lens = Lens::pinhole(f, (width - 1) / 2.0, (height - 1) / 2.0);
  const double middle = 0.1 * (side - 1) / 2;
  view.pose = {Vec3(middle + 0.01, middle - 0.02, -0.9 * middle * 2 * 1.25), turn};
  view.focus.plane = plane_through({0, 0, 2}, glm::normalize(Vec3(0.1, 0.2, -1)));
  view.blending.extrapolates = false;
  return view;
}

// Depths with slopes and steps; with `rough`, random from node to node.
inline std::shared_ptr<const FocalMap> depths(reference::Random& random, const View& view, int step, bool rough) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.step = step;
  map.columns = FocalMap::nodes(view.width, step);
  map.rows = FocalMap::nodes(view.height, step);
  map.from = plane_through({0, 0, 0}, {0, 0, 1});
  map.farthest = 1 / 6.0;
  map.nearest = 1 / 1.3;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const bool nearer = (i * 5 / map.columns + j * 4 / map.rows) % 2;
      const int slope = 60 * i / map.columns + 90 * j / map.rows;
      map.levels.push_back(static_cast<uint8_t>(rough ? random.integer(0, 255) : slope + (nearer ? 100 : 0)));
    }
  return std::make_shared<FocalMap>(std::move(map));
}

// A jittered array with this lens, and a pinhole view into it.
inline std::pair<Rig, View> array_with_lens(const Lens& lens, reference::Random& random, bool mapped) {
  constexpr int kSide = 3, kWidth = 320, kHeight = 240;
  Rig rig = jittered_array(random, kSide, kWidth, kHeight, 0);
  for (Camera& camera : rig.cameras) camera.lens = lens.shifted({random.uniform(-3, 3), random.uniform(-3, 3)});
  View view = view_into(kSide, kWidth, kHeight, random.small_rotation(0.2));
  if (mapped) view.focus.map = depths(random, view, FocalMap::kMinStep, false);
  return {rig, view};
}

inline Image checkerboard(reference::Random& /*random*/, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = (x + y) % 2 ? 255 : 0;
  return image;
}

inline std::vector<Image> in_family(PixelFamily family, std::vector<Image> rgb) {
  return family == PixelFamily::kI420 ? i420_of(rgb) : rgb;
}

inline const char* name_of(PixelFamily family) { return family == PixelFamily::kI420 ? "I420" : "RGB"; }

// Returns one of four arrays of 9 to 36 cameras, and a view into the array. `mapped`: with a focal surface.
inline std::pair<Rig, View> array_and_view(int trial, reference::Random& random, bool mapped) {
  const int side = 3 + trial, width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
  const Rig rig = jittered_array(random, side, width, height, trial % 3 == 0 ? 0 : -0.25);
  View view = view_into(side, width, height, random.small_rotation(0.2));
  if (mapped) view.focus.map = depths(random, view, trial == 1 ? 7 : FocalMap::kMinStep, trial == 2);
  return {rig, view};
}

// Returns the number of views that a random test renders: LF_SCALES in the environment, or `otherwise`.
inline int number_of_views(int otherwise) {
  const char* const number = std::getenv("LF_SCALES");
  return number ? std::atoi(number) : otherwise;
}

// Accepts any driver. setup.sh installs a software renderer.
inline std::unique_ptr<gl::GlesRenderer> new_gpu() {
  std::string why;
  auto gpu = gl::GlesRenderer::create(gl::Context::Drivers::kAny, why);
  if (!gpu) throw std::runtime_error("no OpenGL ES 3.1: " + why);
  return gpu;
}

struct Eye {
  Eye(const Rig& rig, const Mesh& mesh, const View& view, const std::vector<Image>& images, PixelFamily family)
      : production(rig, mesh, view), sources(sources_of(rig, production.plan, images)), family(family) {}
  std::unique_ptr<SumRenderer> renderer(gl::GlesRenderer* gpu = nullptr, bool keep_on_gpu = false) const {
    return std::make_unique<SumRenderer>(production.plan, production.owners.runs(), sources, family,
                                         Coordinates::kExact, gpu, serial_for, keep_on_gpu);
  }
  Sum sum_of(const SumRenderer& renderer) const {
    const View& view = production.plan.view();
    Sum sum(family, whole(view));
    renderer.render_rows(0, view.height, sum.planes);
    return sum;
  }

  Production production;
  std::vector<Source> sources;
  PixelFamily family;
};

// Maximum differences between two sums of a view: of samples, in levels of 255, and of missing weight.
struct SumDifference {
  double level = 0, lost = 0;
  void add(const SumDifference& other) {
    level = std::max(level, other.level);
    lost = std::max(lost, other.lost);
  }
};
inline SumDifference difference_of(const Sum& a, const Sum& b) {
  SumDifference worst;
  for (int c = 0; c < 3; c++)
    for (size_t i = 0; i < a.memory[c].size(); i++)
      worst.level = std::max(worst.level, std::abs(a.memory[c][i] - b.memory[c][i]) / 128.0);
  for (size_t i = 0; i < a.lost.size(); i++)
    worst.lost = std::max(worst.lost, std::abs(a.lost[i] - b.lost[i]) / double{kMissingOne});
  return worst;
}

}  // namespace lf::test
