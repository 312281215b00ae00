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
#include "reference/hard_cases.h"
#include "reference/numerics.h"

namespace lf {
namespace {

using reference::array;
using reference::moved;
using reference::Random;
using reference::view_at;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void expect_within_bounds(const reference::HardCase& hard, const std::vector<reference::Subject>& subjects) {
  SCOPED_TRACE(hard.name);
  const std::vector<reference::Measured> measured = reference::measure(hard, subjects);
  reference::print_row(hard, measured);
  for (size_t i = 0; i < subjects.size(); i++) {
    SCOPED_TRACE(subjects[i].name);
    EXPECT_LE(measured[i].weight, subjects[i].weight_bound);
    EXPECT_LE(measured[i].partition, subjects[i].partition_bound);
    EXPECT_LE(measured[i].colour, subjects[i].colour_bound);
    EXPECT_GE(measured[i].owned, hard.least_owned);
  }
}

TEST(HardCases, AreWithinTheirBounds) {
  const std::vector<reference::Subject> subjects = reference::subjects();
  reference::print_heading(subjects);
  for (const reference::HardCase& hard : reference::hard_cases()) expect_within_bounds(hard, subjects);
}

TEST(HardCases, AreWithinTheirBoundsInLargePictures) {
  const std::vector<reference::Subject> subjects = reference::subjects();
  reference::print_heading(subjects);
  for (const reference::HardCase& hard : reference::hard_cases())
    expect_within_bounds(reference::enlarged(hard, reference::kEnlarged), subjects);
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
    const auto own_weights = test::Production(rig, mesh, view).own_weights();
    for (const auto& own : own_weights) {
      const double expected = own.camera == from ? 1 - s : own.camera == 14 ? s : 0;
      for (const float weight : own.weight) largest = std::max(largest, std::abs(weight - expected));
    }
    EXPECT_EQ(std::count_if(own_weights.begin(), own_weights.end(),
                            [&](const auto& h) { return h.camera == from || h.camera == 14; }),
              2);
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
