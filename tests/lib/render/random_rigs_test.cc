// SPDX-License-Identifier: LGPL-2.1-or-later
// No pixel of a view is counted twice or missed: 10,000 random rigs, views and out-of-service sets, compared with the
// reference.
#include "lib/render/production.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Picture;
using reference::Random;

constexpr int kRigs = 10000;
constexpr int kWidth = 24, kHeight = 16;

// Bound on the error of one camera's weight in one pixel. Triangles that are thin along the line of sight amplify the
// rounding of the edge functions by less than 1 / kMargin.
constexpr double kWeightBound = 1e-6;
// Pixels closer than this (relative) to another face may have another owner than in the reference, with equal weights.
constexpr double kMargin = 1e-9;

// The sum of all weights is 0 or 1, independent of the reference.
TEST(RandomRigs, NoPixelIsCountedTwiceOrMissed) {
  long pixels = 0, owned = 0, folded_views = 0, rigs_of_view = 0;
  double largest_weight_error = 0, largest_sum_error = 0;
  for (int i = 0; i < kRigs; i++) {
    Random random(i);
    const Rig rig = reference::random_rig(random);
    const CameraSet out = reference::random_out_of_service(random, rig);
    const Mesh mesh = build_mesh(rig, out);
    const View view = reference::random_view(random, rig, kWidth, kHeight);
    const test::Production production(rig, mesh, view);
    const auto own_weights = production.own_weights();
    const Picture expected = reference::render(rig, mesh, view, {});
    const reference::Sight sight(rig, mesh, reference::to_v3(view.pose.position));
    bool any = false;

    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const size_t p = static_cast<size_t>(y) * kWidth + x;
        double sum = 0;
        for (const auto& own : own_weights) sum += own.weight[p];
        pixels++;
        owned += sum != 0;
        any = any || sum != 0;
        if (sum != 0) largest_sum_error = std::max(largest_sum_error, std::abs(sum - 1));
        const int32_t owner = production.owners.at(x, y);
        const int face =
            owner == FaceIdMap::kNone ? reference::Pixel::kNone : static_cast<int>(production.plan.faces()[owner].face);
        ASSERT_EQ(sum != 0, face != reference::Pixel::kNone) << "rig " << i << " pixel " << x << ", " << y;
        double error = 0, met = 0;  // met: reference weight of cameras that production uses
        for (const auto& own : own_weights) {
          const double weight = expected.weight_of(x, y, own.camera);
          error = std::max(error, std::abs(own.weight[p] - weight));
          met += weight;
        }
        if (expected.at(x, y).owner != reference::Pixel::kNone) error = std::max(error, 1 - met);
        ASSERT_LE(error, kWeightBound) << "rig " << i << " pixel " << x << ", " << y;
        largest_weight_error = std::max(largest_weight_error, error);
        // On an edge, either face may own the pixel, with equal weights.
        if (expected.at(x, y).owner_margin < kMargin) continue;
        ASSERT_EQ(face, expected.at(x, y).owner) << "rig " << i << " pixel " << x << ", " << y;
      }
    for (const auto& own : own_weights)
      ASSERT_FALSE(std::binary_search(out.begin(), out.end(), own.camera))
          << "rig " << i << ": out of service, yet used";
    rigs_of_view += any;

    std::vector<bool> in_second(rig.cameras.size());
    for (size_t c = 0; c < in_second.size(); c++) in_second[c] = random.one_in(2);
    for (const bool second : {false, true}) {
      Rect region;
      for (const auto& own : own_weights)
        if (in_second[own.camera] == second) region = unite(region, production.plan.camera_rect(own.camera));
      const FaceIdMap owners(production.plan, region);
      for (const auto& own : own_weights) {
        if (in_second[own.camera] != second) continue;
        const Rect& rect = production.plan.camera_rect(own.camera);
        ASSERT_EQ(pixel_weights(production.plan, owners, own.camera, rect),
                  pixel_weights(production.plan, production.owners, own.camera, rect));
      }
    }

    // Detects folds of the mesh as seen from this viewpoint, at the centre of the view.
    const reference::V3 d = reference::rotate(view.pose.orientation, {0, 0, 1});
    int containing = 0;
    for (size_t f = 0; f < mesh.faces.size(); f++) {
      const reference::Sighting seen = sight.look(f, d);
      containing += seen.faces && seen.contains;
    }
    folded_views += containing > 1;
  }
  std::printf("%d rigs, %ld of them in view, %ld with several faces in the middle of the view; %ld pixels, %ld owned\n",
              kRigs, rigs_of_view, folded_views, pixels, owned);
  std::printf("largest weight error %.2g (bound %.0g), largest |sum - 1| %.2g (bound 1e-6)\n", largest_weight_error,
              kWeightBound, largest_sum_error);
  EXPECT_LE(largest_sum_error, 1e-6);
  EXPECT_GT(rigs_of_view, kRigs / 2);
  EXPECT_GT(folded_views, kRigs / 20);
}

TEST(RandomRigs, MissingWeightMatchesTheReference) {
  long compared = 0, lost = 0;
  double largest = 0;
  for (int i = 0; i < 1000; i++) {
    Random random(kRigs + i);
    const Rig rig = reference::random_rig(random);
    const Mesh mesh = build_mesh(rig);
    const View view = reference::random_view(random, rig, kWidth, kHeight);
    const std::vector<Image> white(rig.cameras.size(), reference::white_image(64, 48));
    const auto sums = test::Production(rig, mesh, view).sums(white);
    const Picture expected = reference::render(rig, mesh, view, {});
    for (size_t p = 0; p < sums.valid.size(); p++) {
      const reference::Pixel& pixel = expected.pixels[p];
      if (pixel.owner == reference::Pixel::kNone) continue;
      compared++;
      lost += pixel.lost > 0;
      const double error = std::max(std::abs(sums.valid[p] - pixel.coverage), std::abs(sums.lost[p] - pixel.lost));
      largest = std::max(largest, error);
    }
  }
  std::printf("%ld pixels (%ld with missing weight): largest error of valid and missing weight %.2g (bound %.0g)\n",
              compared, lost, largest, kWeightBound);
  EXPECT_LE(largest, kWeightBound);
  EXPECT_GT(lost, compared / 20);
}

class SubPixels {
 public:
  SubPixels(const Rig& rig, const Mesh& mesh, const View& view)
      : view_(view), lens_(view.lens), sight_(rig, mesh, reference::to_v3(view.pose.position)) {}

  // Returns true if a point of [x0, x1] x [y0, y1] (pixels), sampled every sixth of a pixel, is in the face.
  bool any(size_t face, double x0, double y0, double x1, double y1) const {
    constexpr double kStep = 1.0 / 6;
    for (double y = y0; y <= y1 + 1e-9; y += kStep)
      for (double x = x0; x <= x1 + 1e-9; x += kStep)
        if (holds(face, x, y)) return true;
    return false;
  }

  bool holds(size_t face, double x, double y) const {
    const auto ray = lens_.line_of_sight({x, y});
    const reference::V3 d = reference::rotate(view_.pose.orientation, {ray->x, ray->y, 1});
    const Plane& plane = view_.focus.plane;
    const reference::V3 n = reference::to_v3(plane.normal);
    const reference::Real distance = dot(n, reference::to_v3(view_.pose.position)) + plane.d;
    if (!(-distance / dot(n, d) > 0)) return false;
    const reference::Sighting seen = sight_.look(face, d);
    return seen.faces && seen.contains;
  }

 private:
  const View& view_;
  reference::ReferenceLens lens_;
  reference::Sight sight_;
};

bool has_area(const Rig& rig, const MeshFace& face) {
  if (face.corners() < 3) return true;
  const auto centre = [&](int k) { return rig.cameras[face.camera[k]].pose.position; };
  const Vec3 a = centre(1) - centre(0), b = centre(2) - centre(0);
  return glm::length(glm::cross(a, b)) > 1e-9 * glm::length(a) * glm::length(b);
}

// Every side of a face's rectangle is within a pixel of the face for a pinhole. Rare exceptions are slivers between all
// sampled points.
TEST(RandomRigs, RectanglesAreTight) {
  long sides = 0, touched = 0, area = 0, least = 0;
  for (int i = 0; i < 600; i++) {
    Random random(2 * kRigs + i);
    const Rig rig = reference::random_rig(random);
    const Mesh mesh = build_mesh(rig);
    View view = reference::random_view(random, rig, kWidth, kHeight);
    view.lens = Lens::from_fov_y(random.uniform(20, 100), kWidth, kHeight);
    const ViewPlan plan(rig, mesh, view);
    const SubPixels points(rig, mesh, view);
    for (const FacePlan& face : plan.faces()) {
      if (!has_area(rig, mesh.faces[face.face])) continue;
      const Rect& r = face.rect;
      const double x0 = r.x0 - 0.5, y0 = r.y0 - 0.5, x1 = r.x1 - 0.5, y1 = r.y1 - 0.5;
      sides += 4;
      touched += points.any(face.face, x0 - 0.5, y0 - 0.5, x0 + 1, y1 + 0.5);
      touched += points.any(face.face, x1 - 1, y0 - 0.5, x1 + 0.5, y1 + 0.5);
      touched += points.any(face.face, x0 - 0.5, y0 - 0.5, x1 + 0.5, y0 + 1);
      touched += points.any(face.face, x0 - 0.5, y1 - 1, x1 + 0.5, y1 + 0.5);
      Rect smallest;
      for (int y = r.y0; y < r.y1; y++)
        for (int x = r.x0; x < r.x1; x++)
          if (points.holds(face.face, x, y)) smallest = unite(smallest, {x, y, x + 1, y + 1});
      area += static_cast<long>(r.width()) * r.height();
      least += static_cast<long>(smallest.width()) * smallest.height();
    }
  }
  const double fraction = static_cast<double>(touched) / static_cast<double>(sides);
  const double factor = static_cast<double>(area) / static_cast<double>(least);
  std::printf(
      "%ld sides, %.4f of them touched (bound 0.99); area of all rectangles / least possible: %.4f (bound 1.1)\n",
      sides, fraction, factor);
  EXPECT_GE(fraction, 0.99);
  EXPECT_LE(factor, 1.1);
}

// Holds for any lens and any fold of the mesh.
TEST(RandomRigs, FragmentsAreNoLargerThanTheirWeights) {
  int fragments = 0;
  for (int i = 0; i < 500; i++) {
    Random random(4 * kRigs + i);
    const Rig rig = reference::random_rig(random);
    const Mesh mesh = build_mesh(rig);
    const View view = reference::random_view(random, rig, kWidth, kHeight);
    const Picture expected = reference::render(rig, mesh, view, {});
    if (std::any_of(expected.pixels.begin(), expected.pixels.end(),
                    [](const auto& p) { return p.owner_margin < kMargin; }))
      continue;
    std::vector<Rect> bounds(rig.cameras.size());
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++)
        for (int k = 0; k < expected.at(x, y).corners; k++) {
          Rect& rect = bounds[expected.at(x, y).camera[k]];
          rect = unite(rect, {x, y, x + 1, y + 1});
        }
    const test::Production production(rig, mesh, view);
    for (const CameraIndex camera : production.plan.contributors()) {
      const Rect rect = production.plan.camera_rect(camera);
      const Rect owned = CameraCorners(production.plan, camera).owned(production.owners.runs(), rect);
      fragments += !owned.empty();
      ASSERT_EQ(owned, bounds[camera]) << "rig " << i << " camera " << camera;
    }
  }
  EXPECT_GT(fragments, 1000);
}

// Rectangles planned without pixel tests consist of whole tiles for distorted lenses, which bounds the excess.
TEST(RandomRigs, RectanglesOfDistortedViewsAreNotMuchLarger) {
  long area = 0, least = 0;
  for (int i = 0; i < 40; i++) {
    Random random(3 * kRigs + i);
    const Rig rig = reference::random_rig(random);
    const Mesh mesh = build_mesh(rig);
    View view = reference::random_view(random, rig, 160, 120);
    view.lens = Lens(LensModel::kRadial, {130, 79.5, 59.5, random.uniform(-0.2, 0.1), 0.02});
    const ViewPlan plan(rig, mesh, view);
    const FaceIdMap owners(plan, test::whole(view));
    for (const CameraIndex camera : plan.contributors()) {
      const Rect& r = plan.camera_rect(camera);
      area += static_cast<long>(r.width()) * r.height();
    }
    view.lens = Lens::pinhole(130, 79.5, 59.5);
    const ViewPlan straight(rig, mesh, view);
    for (const CameraIndex camera : straight.contributors()) {
      const Rect& r = straight.camera_rect(camera);
      least += static_cast<long>(r.width()) * r.height();
    }
  }
  const double factor = static_cast<double>(area) / static_cast<double>(least);
  std::printf("area of all rectangles, distorted / pinhole: %.3f (bound 1.5)\n", factor);
  EXPECT_LE(factor, 1.5);
}

}  // namespace
}  // namespace lf
