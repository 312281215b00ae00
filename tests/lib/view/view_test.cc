// SPDX-License-Identifier: LGPL-2.1-or-later
#include <numbers>

#include "base/text.h"
#include "reference/generators.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/test.h"
#include "view/view.h"

namespace lf {
namespace {

View good_view() { return test::view_from({0, 0, 0}, 320, 240, 50, 3); }

View changed(const std::function<void(View&)>& change) {
  View view = good_view();
  change(view);
  return view;
}

TEST(View, ValidatesSizesFromTinyToLargest) {
  View view = good_view();
  EXPECT_NO_THROW(validate(view));
  for (const int size : {1, 8192, kMaxImageSize}) {
    view.width = view.height = size;
    EXPECT_NO_THROW(validate(view));
  }
}

TEST(View, EyesShareTheFocalPlane) {
  View view = good_view();
  view.pose = {{1, 2, 3}, glm::angleAxis(0.5, glm::normalize(Vec3(1, 2, 3)))};
  view.focus.plane = focal_plane_at(view.pose, 3);
  const View right = offset_view(view, 0.06);
  EXPECT_LT(glm::length(view.pose.camera_from_world(right.pose.position) - Vec3(0.06, 0, 0)), 1e-15);
  EXPECT_EQ(right.pose.orientation, view.pose.orientation);
  EXPECT_EQ(right.focus, view.focus);
  EXPECT_EQ(right.lens, view.lens);
  EXPECT_EQ(offset_view(view, 0), view);
}

TEST(View, ErrorsNameTheMember) {
  const std::pair<std::vector<std::string>, std::function<void(View&)>> cases[] = {
      {{"width", "1 to"}, [](View& v) { v.width = 0; }},
      {{"width", "1 to"}, [](View& v) { v.width = kMaxImageSize + 1; }},
      {{"height", "1 to"}, [](View& v) { v.height = -1; }},
      {{"orientation"}, [](View& v) { v.pose.orientation.w = 1.001; }},
      {{"orientation"}, [](View& v) { v.pose.orientation = Quat(0, 0, 0, 0); }},
      {{"focal_plane"}, [](View& v) { v.focus.plane.normal.z *= 0.9; }},
  };
  for (const auto& [facts, spoil] : cases) EXPECT_ERROR(validate(changed(spoil)), facts);
}

TEST(View, NumbersThatAreNotFiniteAreNamed) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity}) {
    for (int k = 0; k < 3; k++) {
      EXPECT_ERROR(validate(changed([&](View& v) { v.pose.position[k] = bad; })), "position: ");
      EXPECT_ERROR(validate(changed([&](View& v) { v.focus.plane.normal[k] = bad; })), "focal_plane: ");
    }
    for (int k = 0; k < 4; k++)
      EXPECT_ERROR(validate(changed([&](View& v) { v.pose.orientation[k] = bad; })), "orientation: ");
    EXPECT_ERROR(validate(changed([&](View& v) { v.focus.plane.d = bad; })), "focal_plane: ");
  }
}

TEST(FocalPlane, FacesTheView) {
  const Pose pose = look_at({1, 2, 3}, {4, 4, 9}, {0, 1, 0});
  const Plane plane = focal_plane_at(pose, 2.5);
  EXPECT_NEAR(plane.signed_distance(pose.position), 2.5, 1e-14);
  EXPECT_NEAR(plane.signed_distance(pose.world_from_camera({0.7, -3, 2.5})), 0, 1e-14);
}

using Kind = Blending::Kind;

TEST(Blending, DefaultsToTheMesh) {
  EXPECT_TRUE(Blending{}.is_mesh());
  EXPECT_NO_THROW(validate(Blending{}));
}

TEST(Blending, AperturePrecedesAngle) {
  EXPECT_EQ(make_blending(0, 0), Blending{});
  EXPECT_EQ(make_blending(0.2, 0), (Blending{Kind::kAperture, 0.2, 0}));
  EXPECT_EQ(make_blending(0.2, 4), (Blending{Kind::kAperture, 0.2, 0}));
  EXPECT_EQ(make_blending(0, 4), (Blending{Kind::kAngle, 0, 4}));
}

TEST(Blending, ErrorsNameTheProblem) {
  EXPECT_NO_THROW(validate({Kind::kAperture, 1e-9, 0}));
  EXPECT_NO_THROW(validate({Kind::kAperture, Blending::kMaxAperture, 0}));
  EXPECT_NO_THROW(validate({Kind::kAngle, 0, 1}));
  EXPECT_NO_THROW(validate({Kind::kAngle, 0, Blending::kMaxNearest}));
  for (const double bad : {0., -1., 1.1e6, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_ERROR(validate({Kind::kAperture, bad, 0}), "blending", "aperture", "0");
  for (const int bad : {0, -1, Blending::kMaxNearest + 1})
    EXPECT_ERROR(validate({Kind::kAngle, 0, bad}), "blending", "1 to 32 cameras");
  EXPECT_ERROR(validate({Kind::kMesh, 0.1, 0}), "aperture");
  EXPECT_ERROR(validate({Kind::kAperture, 0.1, 2}), "blending", "kind", "number");
}

View middle_view() {
  const Pose pose{{1, 2, 3}, glm::angleAxis(0.5, glm::normalize(Vec3(1, 2, 3)))};
  return {420, 560, Lens::from_fov_y(40, 420, 560), pose, {focal_plane_at(pose, 2)}};
}

ViewSet set_of(ViewSetLayout layout, int columns = 8, int rows = 6) {
  return {.layout = layout, .columns = columns, .rows = rows};
}

Vec2 seen(const View& view, const View& middle, const Vec3& point) {
  return *view.lens.project(view.pose.camera_from_world(middle.pose.world_from_camera(point)));
}

TEST(ViewSet, SingleViewIsUnchanged) {
  const View middle = middle_view();
  const ViewSet set;
  ASSERT_EQ(set.places().size(), 1u);
  EXPECT_EQ(set.places()[0], ViewSetPosition());
  EXPECT_TRUE(ViewSetPosition().leads());
  EXPECT_EQ(set.view(middle, set.places()[0]), middle);
}

TEST(ViewSet, DisparityOfAPairIsCorrect) {
  const View middle = middle_view();
  ViewSet set = set_of(ViewSetLayout::kStereo);
  for (const bool converged : {false, true}) {
    set.converged = converged;
    const View left = set.view(middle, set.place(0)), right = set.view(middle, set.place(1));
    EXPECT_NEAR(glm::distance(left.pose.position, right.pose.position), 0.063, 1e-15);
    EXPECT_EQ(left.pose.orientation, middle.pose.orientation);
    EXPECT_EQ(left.focus, middle.focus);
    for (const double depth : {0.5, 2.0, 10.0})
      for (const Vec2 at : {Vec2(0, 0), Vec2(0.1, -0.2)}) {
        const Vec3 point(at.x * depth, at.y * depth, depth);
        const Vec2 l = seen(left, middle, point), r = seen(right, middle, point);
        const double expected = middle.lens.fx() * 0.063 * (1 / depth - (converged ? 1 / 2.0 : 0));
        EXPECT_NEAR(l.x - r.x, expected, 1e-9) << depth << " " << converged;
        EXPECT_NEAR(l.y, r.y, 1e-9);
        EXPECT_NEAR((l.x + r.x) / 2, seen(middle, middle, point).x, 1e-9) << "around the view";
      }
  }
}

TEST(ViewSet, ConeIsTheAngleBetweenTheOutermostEyes) {
  const View middle = middle_view();
  ViewSet set = set_of(ViewSetLayout::kQuilt);
  set.cone = 40;
  const Vec3 target = middle.pose.world_from_camera({0, 0, 2});
  const Vec3 a = set.view(middle, set.place(0)).pose.position - target;
  const Vec3 b = set.view(middle, set.place(47)).pose.position - target;
  EXPECT_NEAR(std::acos(glm::dot(glm::normalize(a), glm::normalize(b))) * 180 / M_PI, 40, 1e-9);
  const double x0 = middle.pose.camera_from_world(set.view(middle, set.place(0)).pose.position).x;
  const double x1 = middle.pose.camera_from_world(set.view(middle, set.place(1)).pose.position).x;
  EXPECT_LT(x0, x1) << "from the left";
  EXPECT_NEAR(x1 - x0, -2 * x0 / 47, 1e-12);
  View far = middle;
  far.focus.plane = {{0, 0, 1}, -1e300};
  far.focus.plane.normal = middle.pose.right();
  const double apart =
      glm::distance(set.view(far, set.place(3)).pose.position, set.view(far, set.place(4)).pose.position);
  EXPECT_NEAR(apart, 0.063, 1e-12);
}

TEST(ViewSet, LayoutsMatchDisplays) {
  const auto at = [](const ViewSetPosition& place) { return std::pair(place.column(), place.row()); };
  using Pair = std::pair<int, int>;
  const ViewSet quilt = set_of(ViewSetLayout::kQuilt), row = set_of(ViewSetLayout::kRow, 5);
  EXPECT_EQ(at(quilt.place(0)), Pair(0, 5)) << "bottom left";
  EXPECT_EQ(at(quilt.place(7)), Pair(7, 5));
  EXPECT_EQ(at(quilt.place(8)), Pair(0, 4));
  EXPECT_EQ(at(quilt.place(47)), Pair(7, 0)) << "top right";
  EXPECT_EQ(row.place(0).count(), 5);
  EXPECT_EQ(at(row.place(3)), Pair(3, 0));
  EXPECT_EQ(at(set_of(ViewSetLayout::kStereo).place(1)), Pair(1, 0));
  EXPECT_EQ(at(set_of(ViewSetLayout::kCrossEyed).place(1)), Pair(0, 0));
  EXPECT_EQ(at(set_of(ViewSetLayout::kTopBottom).place(1)), Pair(0, 1));
  EXPECT_EQ(quilt.place_at({0.5, 5.5})->index, 0);
  EXPECT_EQ(quilt.place_at({8, 0})->index, 47) << "the border is inside";
  EXPECT_EQ(set_of(ViewSetLayout::kCrossEyed).place_at({0.2, 0.2})->index, 1);
  EXPECT_FALSE(quilt.place_at({8.01, 0}));
  EXPECT_FALSE(quilt.place_at({NAN, 0}));
}

TEST(ViewSet, MiddleViewIsRequestedFirst) {
  for (const ViewSet& set :
       {set_of(ViewSetLayout::kQuilt), set_of(ViewSetLayout::kRow, 5), set_of(ViewSetLayout::kStereo),
        set_of(ViewSetLayout::kRow, 1), set_of(ViewSetLayout::kQuilt, 1, 1)}) {
    const std::vector<ViewSetPosition> places = set.places();
    std::set<int> indices;
    for (size_t i = 0; i < places.size(); i++) {
      indices.insert(places[i].index);
      EXPECT_EQ(places[i].leads(), i == 0);
      EXPECT_EQ(places[i].turn(), static_cast<int>(i));
      EXPECT_NO_THROW(validate(places[i], 320, 240));
    }
    EXPECT_EQ(indices.size(), static_cast<size_t>(places[0].count()));
    EXPECT_EQ(*indices.rbegin(), places[0].count() - 1);
  }
  EXPECT_EQ(set_of(ViewSetLayout::kRow, 5).places()[0].index, 2);
}

TEST(ViewSet, ErrorsNameTheMember) {
  const auto refuse = [](ViewSetPosition place, int width, int height, const std::vector<std::string>& facts) {
    EXPECT_ERROR(validate(place, width, height), facts);
  };
  refuse({ViewSetLayout::kStereo, 3, 1, 0}, 2, 2, {"set", "layout 1", "3x1"});
  refuse({ViewSetLayout::kRow, 5, 2, 0}, 2, 2, {"set", "layout 4", "5x2"});
  refuse({ViewSetLayout::kMono, 2, 1, 0}, 2, 2, {"set", "layout 0", "2x1"});
  refuse({static_cast<ViewSetLayout>(6), 1, 1, 0}, 2, 2, {"set", "layout 6"});
  refuse({ViewSetLayout::kQuilt, 0, 4, 0}, 2, 2, {"set", "layout 5", "0x4"});
  refuse({ViewSetLayout::kQuilt, 16, 9, 0}, 2, 2, {"set", "16x9", "128"});
  refuse({ViewSetLayout::kRow, 5, 1, 5}, 2, 2, {"set", "view 5"});
  refuse({ViewSetLayout::kRow, 5, 1, -1}, 2, 2, {"set", "view -1"});
  refuse({ViewSetLayout::kStereo, 2, 1, 0}, 321, 240, {"set", "even", "321x240"});
  refuse({ViewSetLayout::kQuilt, 8, 6, 0}, 320, 240 + 2 * kMaxImageSize / 12, {"set", "8x6", "320x"});
  EXPECT_NO_THROW(validate({ViewSetLayout::kQuilt, 1, 1, 0}, 321, 241));
}

struct Display {
  LenticularDisplay lenses;
  int columns, rows, view_width, view_height, width, height;
};

// The rule in double precision. NaN where rounding decides which view is visible.
double expected(const Display& d, const Image& quilt, int x, int y, int c) {
  const double across = x + (c - 1) / 3.0 - (d.width - 1) / 2.0, up = (d.height - 1) / 2.0 - y;
  const double lean = std::tan(d.lenses.slant * std::numbers::pi / 180);
  double lens = (across - up * lean) / d.lenses.lens_pitch - d.lenses.centre + 0.5;
  lens -= std::floor(lens);
  const int views = d.columns * d.rows;
  if (std::abs(lens * views - std::round(lens * views)) < 1e-4) return NAN;
  const int k = static_cast<int>(lens * views), view = d.lenses.reversed ? k : views - 1 - k;
  const int left = view % d.columns * d.view_width, top = (d.rows - 1 - view / d.columns) * d.view_height;
  const auto at = [&](int i, int j) {
    i = std::clamp(i, 0, d.view_width - 1);
    j = std::clamp(j, 0, d.view_height - 1);
    return static_cast<double>(quilt.pixel(left + i, top + j)[c]);
  };
  const double u = (x + 0.5) * d.view_width / d.width - 0.5, v = (y + 0.5) * d.view_height / d.height - 0.5;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const double a = u - i, b = v - j;
  return (at(i, j) * (1 - a) + at(i + 1, j) * a) * (1 - b) + (at(i, j + 1) * (1 - a) + at(i + 1, j + 1) * a) * b;
}

TEST(LenticularDisplay, SubpixelsShowTheVisibleView) {
  reference::Random random(11);
  const Display displays[] = {
      {{4.7, 0, 0}, 5, 1, 24, 16, 150, 40},    {{9.31, 12.3, 0.4}, 4, 3, 20, 18, 97, 61},
      {{3.02, -35, -3.7}, 8, 6, 7, 5, 64, 48}, {{17.5, 9.5, 0.1, true}, 3, 2, 40, 30, 40, 30},
      {{0.9, 0, 0.25}, 2, 1, 31, 1, 60, 3},    {{1e4, 80, 12}, 1, 1, 16, 12, 33, 25},
  };
  for (const Display& d : displays) {
    SCOPED_TRACE(d.lenses.lens_pitch);
    Image quilt(PixelFamily::kRgb, d.columns * d.view_width, d.rows * d.view_height);
    for (uint8_t& value : quilt.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
    const ptrdiff_t stride = ptrdiff_t{3} * d.width + 5;
    std::vector<uint8_t> out(static_cast<size_t>(stride * d.height), 77);
    interleave_views(d.lenses, {quilt.view(), d.columns, d.rows}, d.width, d.height, stride, out.data());
    int known = 0;
    for (int y = 0; y < d.height; y++) {
      for (int x = 0; x < d.width; x++)
        for (int c = 0; c < 3; c++) {
          const double value = expected(d, quilt, x, y, c);
          if (std::isnan(value)) continue;
          known++;
          ASSERT_NEAR(out[y * stride + 3 * x + c], value, 2) << x << ", " << y << ", " << c;
        }
      for (int i = 0; i < 5; i++) ASSERT_EQ(out[y * stride + 3 * d.width + i], 77) << "row padding is unchanged";
    }
    EXPECT_GT(known, 3 * d.width * d.height * 9 / 10);
  }
}

// Seen from far left, each lens shows the part behind its right border: view 0 of the left-most viewpoint.
TEST(LenticularDisplay, LeftEyeSeesTheLeftView) {
  const LenticularDisplay display{6, 0, 0};
  EXPECT_NEAR(display.place(0, 5), 0.5, 1e-12);
  EXPECT_NEAR(display.place(2.4, 0), 0.9, 1e-12);
  Image quilt(PixelFamily::kRgb, 6, 1);
  for (int view = 0; view < 6; view++)
    for (int c = 0; c < 3; c++) quilt.pixel(view, 0)[c] = static_cast<uint8_t>(40 * view);
  uint8_t out[3 * 7];
  interleave_views(display, {quilt.view(), 6, 1}, 7, 1, sizeof out, out);
  EXPECT_EQ(out[3 * 5 + 2], 0) << "2 1/3 pixels right of the centre of a lens 6 pixels wide";
  EXPECT_EQ(out[3 * 1 + 0], 200);
}

TEST(LenticularDisplay, ResultDoesNotDependOnThreads) {
  reference::Random random(12);
  Image quilt(PixelFamily::kRgb, 40, 30);
  for (uint8_t& value : quilt.data()) value = static_cast<uint8_t>(random.uniform(0, 256));
  std::vector<uint8_t> one(3 * 90 * 100), other(one.size());
  const LenticularDisplay display{5.3, 10, 0.3};
  interleave_views(display, {quilt.view(), 4, 3}, 90, 100, 270, one.data());
  interleave_views(display, {quilt.view(), 4, 3}, 90, 100, 270, other.data(), [](size_t count, const auto& task) {
    for (size_t i = count; i-- > 0;) task(i);
  });
  EXPECT_EQ(one, other);
}

TEST(LenticularDisplay, InvalidLensesAreErrors) {
  for (const LenticularDisplay& none :
       {LenticularDisplay{0}, LenticularDisplay{-3}, LenticularDisplay{NAN}, LenticularDisplay{INFINITY},
        LenticularDisplay{4, 90}, LenticularDisplay{4, NAN}, LenticularDisplay{4, 0, INFINITY}})
    EXPECT_THROW(validate(none), Error);
  EXPECT_NO_THROW(validate(LenticularDisplay{4, -89, 100}));
}

}  // namespace
}  // namespace lf
