// SPDX-License-Identifier: LGPL-2.1-or-later
#include "view/view_set.h"

#include <gtest/gtest.h>

#include <set>

#include "rig/rig.h"
#include "support/expect_error.h"

namespace lf {
namespace {

View middle_view() {
  View view;
  view.width = 420;
  view.height = 560;
  view.lens = Lens::from_fov_y(40, 420, 560);
  view.pose = {{1, 2, 3}, glm::angleAxis(0.5, glm::normalize(Vec3(1, 2, 3)))};
  view.focus.plane = focal_plane_at(view.pose, 2);
  return view;
}

ViewSet set_of(SetLayout layout, int columns = 8, int rows = 6) {
  return {.layout = layout, .columns = columns, .rows = rows};
}

// Where a view sees a point of the middle view's coordinates.
Vec2 seen(const View& view, const View& middle, const Vec3& point) {
  return *view.lens.project(view.pose.camera_from_world(middle.pose.world_from_camera(point)));
}

TEST(ViewSet, OneViewIsTheView) {
  const View middle = middle_view();
  const ViewSet set;
  ASSERT_EQ(set.places().size(), 1u);
  EXPECT_EQ(set.places()[0], PlaceInSet());
  EXPECT_TRUE(PlaceInSet().leads());
  EXPECT_EQ(set.view(middle, set.places()[0]), middle);
}

TEST(ViewSet, DisparityOfAPairIsThatOfGeometry) {
  const View middle = middle_view();
  ViewSet set = set_of(SetLayout::kStereo);
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

TEST(ViewSet, AConeIsTheAngleBetweenTheOutermostEyes) {
  const View middle = middle_view();
  ViewSet set = set_of(SetLayout::kQuilt);
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
  far.focus.plane.normal = middle.pose.right();  // never in front
  const double apart =
      glm::distance(set.view(far, set.place(3)).pose.position, set.view(far, set.place(4)).pose.position);
  EXPECT_NEAR(apart, 0.063, 1e-12);
}

TEST(ViewSet, PicturesGoWhereDisplaysTakeThem) {
  const auto at = [](const PlaceInSet& place) { return std::pair(place.column(), place.row()); };
  using Pair = std::pair<int, int>;
  const ViewSet quilt = set_of(SetLayout::kQuilt), row = set_of(SetLayout::kRow, 5);
  EXPECT_EQ(at(quilt.place(0)), Pair(0, 5)) << "bottom left";
  EXPECT_EQ(at(quilt.place(7)), Pair(7, 5));
  EXPECT_EQ(at(quilt.place(8)), Pair(0, 4));
  EXPECT_EQ(at(quilt.place(47)), Pair(7, 0)) << "top right";
  EXPECT_EQ(row.place(0).count(), 5);
  EXPECT_EQ(at(row.place(3)), Pair(3, 0));
  EXPECT_EQ(at(set_of(SetLayout::kStereo).place(1)), Pair(1, 0));
  EXPECT_EQ(at(set_of(SetLayout::kCrossEyed).place(1)), Pair(0, 0));
  EXPECT_EQ(at(set_of(SetLayout::kTopBottom).place(1)), Pair(0, 1));
  EXPECT_EQ(quilt.place_at({0.5, 5.5})->index, 0);
  EXPECT_EQ(quilt.place_at({8, 0})->index, 47) << "the border is inside";
  EXPECT_EQ(set_of(SetLayout::kCrossEyed).place_at({0.2, 0.2})->index, 1);
  EXPECT_FALSE(quilt.place_at({8.01, 0}));
  EXPECT_FALSE(quilt.place_at({NAN, 0}));
}

TEST(ViewSet, TheMiddleIsAskedForFirstAndEachOnce) {
  for (const ViewSet& set : {set_of(SetLayout::kQuilt), set_of(SetLayout::kRow, 5), set_of(SetLayout::kStereo),
                             set_of(SetLayout::kRow, 1), set_of(SetLayout::kQuilt, 1, 1)}) {
    const std::vector<PlaceInSet> places = set.places();
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
  EXPECT_EQ(set_of(SetLayout::kRow, 5).places()[0].index, 2);
}

TEST(ViewSet, RefusesByName) {
  const auto refuse = [](PlaceInSet place, int width, int height, const char* why) {
    EXPECT_ERROR(validate(place, width, height), why);
  };
  refuse({SetLayout::kStereo, 3, 1, 0}, 2, 2, "set: layout 1 has no 3x1 views");
  refuse({SetLayout::kRow, 5, 2, 0}, 2, 2, "set: layout 4 has no 5x2 views");
  refuse({SetLayout::kMono, 2, 1, 0}, 2, 2, "set: layout 0 has no 2x1 views");
  refuse({static_cast<SetLayout>(6), 1, 1, 0}, 2, 2, "set: layout 6 has no");
  refuse({SetLayout::kQuilt, 0, 4, 0}, 2, 2, "set: layout 5 has no 0x4 views");
  refuse({SetLayout::kQuilt, 16, 9, 0}, 2, 2, "set: 16x9 views are more than 128");
  refuse({SetLayout::kRow, 5, 1, 5}, 2, 2, "set: view 5 is none of its 5");
  refuse({SetLayout::kRow, 5, 1, -1}, 2, 2, "set: view -1 is none of its 5");
  refuse({SetLayout::kStereo, 2, 1, 0}, 321, 240, "set: views must have an even width and height, not 321x240");
  refuse({SetLayout::kQuilt, 8, 6, 0}, 320, 240 + 2 * kMaxImageSize / 12, "set: 8x6 views of 320x");
  EXPECT_NO_THROW(validate({SetLayout::kQuilt, 1, 1, 0}, 321, 241));
}

}  // namespace
}  // namespace lf
