// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/placement.h"
#include "base/text.h"
#include "calibration/simulator.h"
#include "support/test.h"

namespace lf {
namespace {

struct Array {
  std::vector<Pose> layout, truth, found;  // found: the truth in another frame
  std::vector<size_t> own;
  Similarity layout_from_found;
};

// Cameras near their nominal poses, in another frame; camera i is at position at[i].
Array make(int rows, int columns, uint64_t seed, const std::vector<size_t>& at = {}) {
  sim::ArrayOptions options;
  options.rows = rows, options.columns = columns;
  const Rig real = sim::make_array(options, seed);
  options.position_jitter = options.pointing_jitter = 0;
  const Rig nominal = sim::make_array(options, seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const Vec3 axis = glm::normalize(Vec3(normal(random), normal(random), normal(random)));
  const Similarity moved{0.1 + std::abs(normal(random)),
                         glm::angleAxis(normal(random), axis),
                         {normal(random), normal(random), normal(random)}};
  Array array;
  for (size_t i = 0; i < real.cameras.size(); i++) {
    array.layout.push_back(nominal.cameras[i].pose);
    array.truth.push_back(real.cameras[at.empty() ? i : at[i]].pose);
    array.found.push_back(moved(array.truth.back()));
    array.own.push_back(i);
  }
  const Quat back = glm::conjugate(moved.rotation);
  array.layout_from_found = {1 / moved.scale, back, -(back * moved.translation) / moved.scale};
  return array;
}

LayoutAlignment aligned(const Array& array) {
  return align_to_layout(array.found, array.layout, array.own, std::nullopt, 0);
}

std::vector<size_t> in_order(size_t n) {
  std::vector<size_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  return order;
}

TEST(LayoutAlignment, FindsSwappedCameras) {
  for (uint64_t seed = 0; seed < 100; seed++) {
    const int rows = 2 + static_cast<int>(seed % 4), columns = 3 + static_cast<int>(seed % 3);
    auto at = in_order(static_cast<size_t>(rows * columns));
    std::mt19937_64 random(seed);
    for (size_t swaps = 1 + seed % 3; swaps > 0; swaps--) std::swap(at[random() % at.size()], at[random() % at.size()]);
    const Array array = make(rows, columns, seed, at);
    const LayoutAlignment found = aligned(array);
    EXPECT_EQ(found.place, at) << "seed " << seed;
    EXPECT_NEAR(found.layout_from_scene.scale / array.layout_from_found.scale, 1, 0.06) << "seed " << seed;
  }
}

TEST(LayoutAlignment, FindsTheOrderOfAllCameras) {
  for (uint64_t seed = 0; seed < 100; seed++) {
    auto at = in_order(16);
    std::mt19937_64 random(seed);
    if (seed % 2)
      std::shuffle(at.begin(), at.end(), random);
    else
      for (size_t i = 0; i < 16; i++) at[i] = i / 4 * 4 + 3 - i % 4;
    const Array array = make(4, 4, seed, at);
    EXPECT_EQ(aligned(array).place, at) << "seed " << seed;
  }
}

TEST(LayoutAlignment, MisplacedCameraDoesNotRotateTheFrame) {
  for (uint64_t seed = 0; seed < 50; seed++) {
    Array array = make(3, 3, seed);
    const LayoutAlignment right = aligned(array);
    array.found[4].position += 0.2 / array.layout_from_found.scale * (array.found[4].rotation() * Vec3(0.3, 0.2, 1));
    const LayoutAlignment found = aligned(array);
    EXPECT_EQ(found.place, array.own) << "seed " << seed;
    EXPECT_FALSE(found.fits[4]) << "seed " << seed;
    EXPECT_NEAR(found.layout_from_scene.scale / right.layout_from_scene.scale, 1, 0.02) << "seed " << seed;
  }
}

TEST(LayoutAlignment, CameraAtThePlaceOfAMissingCamera) {
  Array array = make(3, 3, 3);
  array.found[2] = array.found[8];
  array.found.pop_back(), array.own.pop_back();
  const LayoutAlignment found = aligned(array);
  std::vector<size_t> expected = array.own;
  expected[2] = 8;
  EXPECT_EQ(found.place, expected);
}

// Root mean square rotation error of the frame in degrees, over many arrays; with and without orientations.
TEST(LayoutAlignment, OrientationsStabiliseTheFrame) {
  for (const int side : {3, 8}) {
    double both = 0, centres = 0;
    constexpr int kArrays = 100;
    for (uint64_t seed = 0; seed < kArrays; seed++) {
      const Array array = make(side, side, 1000 + seed);
      const auto off = [&](const Similarity& s) {
        const Quat q = s.rotation * glm::conjugate(array.layout_from_found.rotation);
        return std::pow(2 * std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z) * 180 / M_PI, 2) / kArrays;
      };
      both += off(aligned(array).layout_from_scene);
      centres += off(align(array.found, array.layout));
    }
    std::printf("%dx%d: %.2f degrees, by centres alone %.2f\n", side, side, std::sqrt(both), std::sqrt(centres));
    EXPECT_LT(both, (side == 3 ? 0.5 : 0.95) * centres);
  }
}

TEST(LayoutAlignment, KeepsAGivenScale) {
  const Array array = make(3, 3, 7);
  EXPECT_EQ(align_to_layout(array.found, array.layout, array.own, 0.7, 0).layout_from_scene.scale, 0.7);
}

TEST(LayoutAlignment, AlignsRings) {
  const Rig ring = sim::make_rig_around(sim::Around::kRing, 12, 3);
  std::vector<Pose> layout, found;
  std::vector<size_t> own = in_order(12);
  const Similarity moved{0.3, glm::angleAxis(2.0, glm::normalize(Vec3(1, 2, 3))), {4, 5, 6}};
  for (const Camera& camera : ring.cameras) layout.push_back(camera.pose), found.push_back(moved(camera.pose));
  std::swap(found[3], found[9]);
  const LayoutAlignment alignment = align_to_layout(found, layout, own, std::nullopt, 0);
  std::swap(own[3], own[9]);
  EXPECT_EQ(alignment.place, own);
  EXPECT_NEAR(alignment.layout_from_scene.scale, 1 / 0.3, 1e-3);
}

class PlacementTest : public testing::Test {
 protected:
  void SetUp() override {
    const sim::Watched watched = sim::watch(truth_, {.bar = 0.3}, 2);
    tracks_ = watched.tracks;
    solution_.scene = sim::true_scene(truth_, watched, {});
    const Similarity moved{1, glm::angleAxis(1.0, Vec3(0, 0.6, 0.8)), {1, 2, 3}};
    for (CameraState& camera : solution_.scene.cameras) camera.set_pose(moved(camera.pose()));
  }
  double distance(const Similarity& s, size_t a, size_t b) {
    return glm::length(s(solution_.scene.cameras[a].pose()).position - s(solution_.scene.cameras[b].pose()).position);
  }
  const Rig truth_ = sim::make_array({}, 1);
  Tracks tracks_;
  Solution solution_;
  const double true_distance_ = glm::length(truth_.cameras[3].pose.position - truth_.cameras[60].pose.position);
};

TEST_F(PlacementTest, EachSourceOfTheScale) {
  PlacementOptions bar, pitch, known;
  bar.bar_length = 0.3;
  pitch.pitch = 0.06;
  known.distance = {3, 60, true_distance_};
  const auto placed = [&](const PlacementOptions& options) {
    return distance(place_solution(solution_, tracks_, {}, options).world_from_scene, 3, 60);
  };
  EXPECT_NEAR(placed(bar), true_distance_, 1e-9);
  EXPECT_NEAR(placed(known), true_distance_, 1e-9);
  EXPECT_NEAR(placed(pitch), true_distance_, 0.03);
  EXPECT_EQ(place_solution(solution_, tracks_, {}, {}).scale_from, "");
  known.distance->a = 99;
  EXPECT_THROW(place_solution(solution_, tracks_, {}, known), Error);
}

TEST_F(PlacementTest, UsesTheFrameOfThePriorRig) {
  SolveOptions options;
  options.prior = truth_;
  const Rig rig = make_rig(solution_, tracks_, options, place_solution(solution_, tracks_, options, {}));
  for (size_t i = 0; i < rig.cameras.size(); i++)
    EXPECT_LE(glm::length(rig.cameras[i].pose.position - truth_.cameras[i].pose.position), 1e-9);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
}

TEST_F(PlacementTest, DefaultFrameLooksAlongZ) {
  const Rig rig = make_rig(solution_, tracks_, {}, place_solution(solution_, tracks_, {}, {}));
  Vec3 mean(0, 0, 0);
  for (const Camera& camera : rig.cameras) mean += camera.pose.position / static_cast<double>(rig.cameras.size());
  EXPECT_LE(glm::length(mean), 1e-9);
  EXPECT_GE(rig.cameras[0].pose.forward().z, 0.99);
  EXPECT_GE(rig.cameras[0].pose.right().x, 0.99);
}

}  // namespace
}  // namespace lf
