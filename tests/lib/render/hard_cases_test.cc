// SPDX-License-Identifier: LGPL-2.1-or-later
// The hard cases of numerical stability, each beside the reference in 80-bit reals: a table of what was measured and of
// what is allowed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>

#include "base/error.h"
#include "lib/render/production.h"
#include "reference/generators.h"
#include "reference/renderer.h"

namespace lf {
namespace {

using reference::Pixel;
using reference::Random;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kWidth = 48, kHeight = 36;

struct Bounds {
  double weight = 1e-6;      // of any camera in any pixel, of all valid and of all lost weight
  double colour = 2e-3;      // of 255, in float, where at least 1 % of the weight is valid
  double least_owned = 0.2;  // fraction of pixels that some face owns: the case is about something
  int trials = 8;
};

struct Measured {
  double weight = 0, colour = 0;
  int64_t owned = 0, pixels = 0;
};

void measure(const Rig& rig, const View& view, const std::vector<Image>& images, Measured& m) {
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  const auto hats = production.hats();
  const auto sums = production.sums(images);
  const reference::Picture expected = reference::render(rig, mesh, view, images);
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const Pixel& pixel = expected.at(x, y);
      const size_t p = static_cast<size_t>(y) * view.width + x;
      double weight = 0, colour = 0, sum = 0;
      for (const auto& hat : hats) {
        ASSERT_FALSE(std::isnan(hat.weight[p]));
        weight = std::max(weight, std::abs(hat.weight[p] - expected.weight_of(x, y, hat.camera)));
        sum += hat.weight[p];
      }
      for (int k = 0; k < pixel.corners; k++)  // cameras that production left out altogether
        if (std::none_of(hats.begin(), hats.end(), [&](const auto& hat) { return hat.camera == pixel.camera[k]; }))
          weight = std::max(weight, pixel.weight[k]);
      ASSERT_NEAR(sum, sum != 0, 1e-6);  // whatever the reference says
      weight = std::max({weight, std::abs(sums.valid[p] - pixel.coverage), std::abs(sums.lost[p] - pixel.lost)});
      if (pixel.coverage > 0.01 && sums.valid[p] > 0.01)
        for (int c = 0; c < 3; c++) colour = std::max(colour, std::abs(sums.colour[3 * p + c] - pixel.colour[c]));
      m.pixels++;
      m.owned += sum != 0;
      m.weight = std::max(m.weight, weight);
      m.colour = std::max(m.colour, colour);
    }
}

// One row of the table: `make` gives the rig and the view of the n-th of `trials`.
struct Case {
  const char* name;
  std::function<std::pair<Rig, View>(Random&)> make;
  Bounds bounds = {};
};

View view_at(const Vec3& eye, const Quat& orientation = {1, 0, 0, 0}, double fov_y = 60, double focus = 2) {
  View view;
  view.width = kWidth;
  view.height = kHeight;
  view.lens = Lens::from_fov_y(fov_y, kWidth, kHeight);
  view.pose = {eye, glm::normalize(orientation)};
  view.focus.plane = plane_through({0, 0, focus}, {0, 0, -1});
  return view;
}

// 4x4 cameras, 0.5 m apart, all corners at quarters of a metre.
Rig array() { return reference::planar_grid(4, 4, 0.5); }

Quat about_y(double angle) { return {std::cos(angle / 2), 0, std::sin(angle / 2), 0}; }

// The same with a pose in the world that is not made of round numbers.
std::pair<Rig, View> moved(Rig rig, View view, const Vec3& by, const Quat& turn) {
  const auto move = [&](Pose& pose) {
    pose.position = glm::mat3_cast(turn) * pose.position + by;
    pose.orientation = glm::normalize(turn * pose.orientation);
  };
  const Plane plane = view.focus.plane;
  const Vec3 normal = glm::normalize(glm::mat3_cast(turn) * plane.normal);
  view.focus.plane = {normal, plane.d - glm::dot(normal, by)};
  for (Camera& camera : rig.cameras) move(camera.pose);
  move(view.pose);
  return {rig, view};
}
std::pair<Rig, View> turned(const Rig& rig, const View& view, Random& random) {
  return moved(rig, view, {0, 0, 0}, random.orientation());
}

Rig triangles(const std::vector<Vec3>& centres, const std::vector<std::array<CameraIndex, 3>>& faces) {
  Rig rig;
  for (const Vec3& centre : centres)
    rig.cameras.push_back(reference::make_camera(static_cast<uint32_t>(rig.cameras.size()), 64, 48,
                                                 reference::grid_lens(), {centre, {1, 0, 0, 0}}));
  if (!faces.empty()) rig.topology = {Topology::Type::kTriangles, 0, 0, faces};
  return rig;
}

const Bounds kStrict{};

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](const char* name, auto make, Bounds bounds = kStrict) { all.push_back({name, make, bounds}); };

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
  add("triangles straddle the eye's plane", [](Random& r) {
    const Rig rig = triangles({{-1, -1, -1}, {1, -1, 1}, {1, 1, 1.2}, {-1, 1, -0.8}}, {{0, 1, 2}, {0, 2, 3}});
    return turned(rig, view_at(r.point_in_box(0.1), r.small_rotation(1), 100, 3), r);
  });
  add("folded mesh, oblique", [](Random& r) {
    Rig rig = reference::planar_grid(3, 5, 0.5);
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
    return turned(reference::planar_grid(4, 4, 1e-6), view_at({1e-7, 2e-7, -1e-6}), r);
  });
  add("baselines of 1e-6 m, eye 1 m behind", [](Random& r) {
    View view = view_at({0, 0, -1}, {1, 0, 0, 0}, 1.5e-4);
    return turned(reference::planar_grid(4, 4, 1e-6), view, r);
  });
  add("baselines of 1e6 m", [](Random& r) {
    return turned(reference::planar_grid(4, 4, 1e6), view_at({1e5, 2e5, -7e5}, {1, 0, 0, 0}, 60, 1e7), r);
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
        // As Delaunay leaves them on the border of a regular grid: first in the mesh, and the eye is at a camera beside
        // it.
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

TEST(HardCases, AreWithinTheirBounds) {
  std::printf("%-38s| %10s %8s | %10s %8s | %6s\n", "case", "weight err", "bound", "colour err", "bound", "owned");
  for (const Case& hard : cases()) {
    SCOPED_TRACE(hard.name);
    Measured m;
    for (int trial = 0; trial < hard.bounds.trials; trial++) {
      Random random(trial);
      const auto [rig, view] = hard.make(random);
      validate(view);
      measure(rig, view, images_of(rig, random, reference::smooth_image), m);
      if (HasFatalFailure()) break;
    }
    const double owned = static_cast<double>(m.owned) / static_cast<double>(m.pixels);
    std::printf("%-38s| %10.2g %8.1g | %10.2g %8.1g | %6.3f\n", hard.name, m.weight, hard.bounds.weight, m.colour,
                hard.bounds.colour, owned);
    EXPECT_LE(m.weight, hard.bounds.weight);
    EXPECT_LE(m.colour, hard.bounds.colour);
    EXPECT_GE(owned, hard.bounds.least_owned);
  }
}

// The eye on the array's border, as that of a viewer who takes the place of a border camera that fails: what positions
// in doubles say of the side it is on is rounding. By the rule the border belongs to the array (weights >= 0), so the
// whole picture must be there, with the weights of the border's two ends.
TEST(EyeOnTheBorder, SeesTheWholePicture) {
  double largest = 0;
  for (int trial = 0; trial < 200; trial++) {
    Random random(trial);
    const bool removed = trial % 2 == 0;
    const double s = removed ? 0.5 : random.uniform(0.01, 0.99);
    auto [rig, view] = moved(array(), view_at({0, 0, 0}), random.point_in_box(1), random.orientation());
    // Border cameras 12 to 15 in a row: between 12 and 14 without 13, or between 13 and 14.
    const CameraIndex from = removed ? 12 : 13;
    const CameraSet out = removed ? CameraSet{13} : CameraSet{};
    const Vec3 a = rig.cameras[from].pose.position, b = rig.cameras[14].pose.position;
    view.pose.position = removed ? rig.cameras[13].pose.position : a + s * (b - a);
    view.pose.orientation = glm::normalize(view.pose.orientation * random.small_rotation(0.4));
    view.focus.plane = focal_plane_at(view.pose, 2);
    const Mesh mesh = build_mesh(rig, out);
    const auto hats = test::Production(rig, mesh, view).hats();
    for (const auto& hat : hats) {
      const double expected = hat.camera == from ? 1 - s : hat.camera == 14 ? s : 0;
      for (const float weight : hat.weight) largest = std::max(largest, std::abs(weight - expected));
    }
    EXPECT_EQ(
        std::count_if(hats.begin(), hats.end(), [&](const auto& h) { return h.camera == from || h.camera == 14; }), 2);
  }
  std::printf("eye on the border, turned: largest weight error %.2g (bound 1e-6)\n", largest);
  EXPECT_LE(largest, 1e-6);
}

// --- numbers that are none -------------------------------------------------------------------------------------------

template <typename Function>
std::string error_of(const Function& function) {
  try {
    function();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(NotANumber, IsAnErrorThatNamesTheField) {
  using testing::StartsWith;
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {kNaN, infinity, -infinity}) {
    const auto message = [&](const std::function<void(View&)>& spoil) {
      View view = view_at({0, 0, -1});
      spoil(view);
      return error_of([&] { validate(view); });
    };
    for (int k = 0; k < 3; k++) {
      EXPECT_THAT(message([&](View& view) { view.pose.position[k] = bad; }), StartsWith("position: "));
      EXPECT_THAT(message([&](View& view) { view.focus.plane.normal[k] = bad; }), StartsWith("focal_plane: "));
    }
    for (int k = 0; k < 4; k++)
      EXPECT_THAT(message([&](View& view) { view.pose.orientation[k] = bad; }), StartsWith("orientation: "));
    EXPECT_THAT(message([&](View& view) { view.focus.plane.d = bad; }), StartsWith("focal_plane: "));
    EXPECT_THAT(error_of([&] { Lens::from_fov_y(bad, 4, 4); }), StartsWith("fov_y: "));
    for (int k = 0; k < 8; k++) {
      std::array<double, Lens::kMaxParams> params{100, 100, 50, 50, 0, 0, 0, 0};
      params[k] = bad;
      EXPECT_THAT(error_of([&] { Lens(LensModel::kOpenCv, params); }),
                  StartsWith("params[" + std::to_string(k) + "]: "));
    }
  }
}

}  // namespace
}  // namespace lf
