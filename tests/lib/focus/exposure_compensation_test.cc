// SPDX-License-Identifier: LGPL-2.1-or-later
#include "focus/exposure_compensation.h"

#include "base/text.h"
#include "image/image_filters.h"
#include "lib/focus/array_of_walls.h"
#include "support/test.h"

namespace lf {
namespace {

using Ratios = std::map<CameraIndex, BrightnessRatio>;

// Returns gains after enough rounds with one camera `gain` times as bright as the rest.
ExposureCompensation measured(float gain, float error = 0.002f) {
  ExposureCompensation gains;
  for (unsigned i = 0; i < ExposureCompensation::kMeans; i++)
    gains.take({{1, {std::log(gain / gains.likely(1)), error}}});
  return gains;
}

TEST(ExposureCompensation, GainsFollowTheMeasurements) {
  ExposureCompensation gains;
  EXPECT_EQ(gains.of(3), 1);
  gains.take({{3, {std::log(1.2f), 0}}});
  for (int i = 0; i < 5; i++) gains.take({{3, {std::log(1.1f / gains.likely(3)), 0}}});
  EXPECT_NEAR(gains.measured().at(3).log, std::log(1.1), 1e-4);
  EXPECT_NEAR(gains.of(3), 1.1, 0.001);
  EXPECT_EQ(gains.of(4), 1);
  EXPECT_EQ(gains.measured().size(), 1u);
}

TEST(ExposureCompensation, FirstMeansOnlyChangeTheTrust) {
  ExposureCompensation gains;
  EXPECT_EQ(gains.trust(1), gains.trust(2)) << "no measurements";
  gains.take({{1, {std::log(1.1f), 0.002f}}, {2, {std::log(0.99f), 0.002f}}});
  EXPECT_EQ(gains.of(1), 1);
  EXPECT_NEAR(gains.likely(1), 1.1, 0.001);
  EXPECT_GT(gains.trust(2), 0.9);
  EXPECT_LT(gains.trust(1), 0.01);
  EXPECT_EQ(gains.trust(3), ExposureCompensation::kUnknownTrust) << "not visible";
  gains.take({{2, {0, 0.002f}}});
  EXPECT_EQ(gains.of(1), 1);
  gains.take({});
  EXPECT_EQ(gains.of(1), 1) << "mean without comparisons";
  gains.take({{2, {0, 0.002f}}});
  EXPECT_NEAR(gains.of(1), 1.1, 0.001);
}

TEST(ExposureCompensation, SmallRatiosAreIgnored) {
  for (const float gain : {1.005f, 1.01f, 1.014f}) {
    EXPECT_NEAR(measured(gain).of(1), 1, 0.001) << gain;
    EXPECT_GT(measured(gain).trust(1), 0.85) << gain;
  }
  for (const float gain : {1.04f, 1.1f, 1.5f}) {
    EXPECT_NEAR(measured(gain).of(1), gain, 0.001) << gain;
    EXPECT_LT(measured(gain).trust(1), 0.5) << gain;
  }
  float before = 1;
  for (float gain = 1; gain < 1.1f; gain += 0.002f) {
    EXPECT_GE(measured(gain).of(1), before) << gain;
    before = measured(gain).of(1);
    EXPECT_NEAR(measured(gain).of(1) * measured(1 / gain).of(1), 1, 1e-5) << "symmetric";
  }
}

TEST(ExposureCompensation, UncertainRatiosAreIgnored) {
  EXPECT_NEAR(measured(1.04f, 0.02f).of(1), 1, 0.003);
  EXPECT_NEAR(measured(1.1f, 0.02f).of(1), 1.1, 0.001);
}

TEST(ExposureCompensation, GainsStayInRange) {
  ExposureCompensation gains;
  for (int i = 0; i < 9; i++) gains.take({{1, {std::log(10.f), 0}}, {2, {std::log(0.01f), 0}}});
  EXPECT_NEAR(gains.of(1), ExposureCompensation::kMost, 1e-4);
  EXPECT_NEAR(gains.of(2), ExposureCompensation::kLeast, 1e-4);
}

PhotoConsistency grey(int columns, int rows, double w, double v) {
  PhotoConsistency moments;
  moments.reset(columns, rows);
  for (size_t i = 0; i < moments.weight.size(); i++) {
    moments.weight[i] = static_cast<uint16_t>(w * PhotoConsistency::kWeightOne);
    moments.luma[i] = static_cast<uint16_t>(w * v * PhotoConsistency::kLumaOne);
    moments.square[i] = static_cast<uint16_t>(w * v * v);
  }
  return moments;
}

TEST(MeanLuma, IsTheMeanExceptAtTheBorder) {
  const std::vector<uint8_t> mean = mean_luma(grey(5, 4, 0.7, 100), {});
  for (int y = 0; y < 4; y++)
    for (int x = 0; x < 5; x++)
      EXPECT_EQ(mean[y * 5 + x], x > 0 && x < 4 && y > 0 && y < 3 ? 100 : 0) << x << ", " << y;
}

TEST(MeanLuma, IsUndefinedForPoorNodes) {
  const auto middle = [](const PhotoConsistency& moments) { return mean_luma(moments, {})[4]; };
  EXPECT_EQ(middle(grey(3, 3, 0.02, 100)), 0) << "few cameras";
  EXPECT_EQ(middle(grey(3, 3, 0.7, 5)), 0) << "black";
  EXPECT_EQ(middle(grey(3, 3, 0.7, 252)), 0) << "white";
  PhotoConsistency moments = grey(3, 3, 0.7, 100);
  moments.square[4] = static_cast<uint16_t>(moments.square[4] * 1.2);
  EXPECT_EQ(middle(moments), 0) << "cameras disagree";
  moments = grey(3, 3, 0.7, 100);
  moments.luma[5] = moments.luma[5] / 2;
  EXPECT_EQ(middle(moments), 0) << "an edge";
}

TEST(MeanLuma, DoesNotFollowTheGains) {
  GainSum gains;
  gains.add(1.25f, 0.125f);
  gains.add(1.25f, 0.03f);
  EXPECT_NEAR(gains.mean(), 1.25, 1e-3);
  EXPECT_EQ(mean_luma(grey(3, 3, 0.7, 80), gains)[4], 100) << "luma before division by gains";
}

TEST(GainSum, IsGeometricAndAddsUp) {
  EXPECT_EQ(GainSum{}.mean(), 1);
  GainSum all, a, b;
  all.add(2, 0.125f);
  a.add(2, 0.125f);
  all.add(0.5f, 0.0625f);
  b.add(0.5f, 0.0625f);
  a.add(b);
  EXPECT_EQ(a, all);
  EXPECT_NEAR(all.mean(), std::exp2((2. - 1) / 3), 1e-3);
}

TEST(ExposureSchedule, MeansBecomeRare) {
  ExposureSchedule turns;
  std::vector<int> asking;
  bool asked = false;
  for (int i = 1; i <= 120; i++) {
    EXPECT_FALSE(turns.next(false, asked)) << "without hypotheses";
    asked = turns.next(true, false);
    if (asked) asking.push_back(i);
  }
  EXPECT_EQ(asking, (std::vector<int>{1, 2, 3, 4, 6, 10, 18, 34, 66, 98}));
}

TEST(ExposureSchedule, OnlyOneMeanIsPending) {
  ExposureSchedule turns;
  EXPECT_TRUE(turns.next(true, false));
  for (int i = 0; i < 10; i++) EXPECT_FALSE(turns.next(true, false)) << i;
  EXPECT_TRUE(turns.next(true, true));
}

TEST(ExposureSchedule, LostMeansAreRequestedAgain) {
  ExposureSchedule turns;
  for (unsigned i = 0; i < 3 * ExposureSchedule::kPatience; i++)
    EXPECT_EQ(turns.next(true, false), i % ExposureSchedule::kPatience == 0) << i;
}

struct Wide {
  test::ArrayOfWalls walls{true};
  View view = mean_view(walls.view(60));
  WideLuma luma{walls.rig, walls.mesh, view, walls.own};
};

TEST(WideLuma, HasNodesTwiceAsFarApart) {
  const test::ArrayOfWalls walls;
  const View view = mean_view(walls.view(77));
  EXPECT_EQ(view.width, 20);
  EXPECT_EQ(view.height, 15);
  EXPECT_EQ(view.focus.map->levels, std::vector<uint8_t>(300, 77));
}

TEST(WideLuma, ManyCamerasAreCompared) {
  const Wide wide;
  EXPECT_EQ(wide.luma.cameras().size(), 9u);
  const WideLuma::Seen seen = wide.luma.see(wide.walls.sources(), {});
  ASSERT_EQ(seen.cameras.size(), 9u);
  EXPECT_EQ(seen.gains.mean(), 1);
  const PhotoConsistency& m = seen.moments;
  const size_t middle = 7 * 20 + 10;
  EXPECT_GT(m.weight[middle], 0.5 * ExposureCompensation::kUnknownTrust * PhotoConsistency::kWeightOne)
      << "no measurements yet";
  const double mean = static_cast<double>(m.luma[middle]) / PhotoConsistency::kLumaOne * PhotoConsistency::kWeightOne /
                      m.weight[middle];
  for (const WideLuma::Camera& camera : seen.cameras) EXPECT_NEAR(camera.luma[middle], mean, 2);
  // Gaussians around the intersection of the line of sight with the array; the viewpoint is in the array's plane.
  const Vec3& eye = wide.view.pose.position;
  const Vec3& at = wide.walls.rig.cameras[seen.cameras[5].camera].pose.position;
  const double squared = glm::dot(at - eye, at - eye) / (kScenePitch * kScenePitch);
  EXPECT_NEAR(seen.cameras[5].weight[middle], WideLuma::kPeak * std::exp(-squared / 2), 1e-4);
}

TEST(WideLuma, FindsTheBrighterCamera) {
  Wide wide;
  constexpr CameraIndex kBright = 4;
  for (Image& image : wide.walls.images) std::ranges::fill(image.data(), 120);
  ByteBuffer memory;
  std::vector<Source> sources = wide.walls.sources();
  sources[kBright].image = divide_by_gain(sources[kBright].image, {0, 0, 160, 120}, 1 / 1.1f, memory);
  ExposureCompensation gains;
  for (int round = 0; round < 6; round++) {
    const WideLuma::Seen seen = wide.luma.see(sources, gains);
    const std::vector<uint8_t> mean = mean_luma(seen.moments, seen.gains);
    Ratios ratios;
    for (const WideLuma::Camera& camera : seen.cameras)
      if (const std::optional<BrightnessRatio> ratio = WideLuma::ratio(camera, mean)) ratios[camera.camera] = *ratio;
    gains.take(ratios);
    for (const CameraIndex other : {1, 5}) EXPECT_NEAR(gains.of(other), 1, 0.0005) << "other cameras unaffected";
    if (round + 1 >= static_cast<int>(ExposureCompensation::kMeans)) {
      EXPECT_NEAR(gains.of(kBright), 1.1, 0.01);
    }
  }
  EXPECT_NEAR(wide.luma.see(sources, gains).gains.mean(), 1, 0.002) << "no common drift";
}

TEST(WideLuma, MeanFollowsTheMajority) {
  Wide wide;
  for (Image& image : wide.walls.images) std::ranges::fill(image.data(), 120);
  ByteBuffer memory[3];
  std::vector<Source> sources = wide.walls.sources();
  for (const CameraIndex dark : {1, 4, 7})
    sources[dark].image = divide_by_gain(sources[dark].image, {0, 0, 160, 120}, 1.1f, memory[dark / 3]);
  ExposureCompensation gains;
  for (int round = 0; round < 6; round++) {
    const WideLuma::Seen seen = wide.luma.see(sources, gains);
    const std::vector<uint8_t> mean = mean_luma(seen.moments, seen.gains);
    Ratios ratios;
    for (const WideLuma::Camera& camera : seen.cameras)
      if (const std::optional<BrightnessRatio> ratio = WideLuma::ratio(camera, mean)) ratios[camera.camera] = *ratio;
    gains.take(ratios);
  }
  EXPECT_NEAR(gains.of(4), 1 / 1.1, 0.01);
  for (const CameraIndex other : {3, 5}) EXPECT_NEAR(gains.of(other), 1, 0.002);
}

// Returns gains after many rounds of a row of cameras of the walls, seen `aside` pitches off. All see the same grey,
// but one is 10 % too bright.
ExposureCompensation gains_of_row(const Wide& wide, const std::vector<CameraIndex>& row, CameraIndex bright,
                                  double aside = 0) {
  Rig rig = wide.walls.rig;
  rig.topology = {};
  rig.cameras.clear();
  std::vector<CameraIndex> own;
  for (const CameraIndex camera : row) {
    own.push_back(static_cast<CameraIndex>(rig.cameras.size()));
    rig.cameras.push_back(wide.walls.rig.cameras[camera]);
    rig.cameras.back().pose.position.x += aside * kScenePitch;
  }
  const WideLuma luma(rig, build_mesh(rig), wide.view, own);
  Image grey(PixelFamily::kRgb, 160, 120);
  std::ranges::fill(grey.data(), 120);
  ByteBuffer memory;
  std::vector<Source> sources;
  for (const CameraIndex camera : own) sources.push_back({camera, &rig.cameras[camera], grey.view()});
  sources[bright].image = divide_by_gain(sources[bright].image, {0, 0, 160, 120}, 1 / 1.1f, memory);
  ExposureCompensation gains;
  for (int k = 0; k < 30; k++) {
    const WideLuma::Seen seen = luma.see(sources, gains);
    gains.take(WideLuma::ratios(seen.cameras, mean_luma(seen.moments, seen.gains)));
  }
  return gains;
}

// One of two cameras differs, but nothing shows which: following either would be as wrong.
TEST(WideLuma, TwoCamerasMeetInTheMiddle) {
  const Wide wide;
  for (const CameraIndex bright : {0, 1}) {
    const ExposureCompensation gains = gains_of_row(wide, {4, 5}, bright);
    const float other = gains.of(1 - bright);
    EXPECT_NEAR(gains.of(bright) / other, 1.1, 0.01);
    EXPECT_NEAR(gains.of(bright) * other, 1, 0.03) << "weighted towards the nearer camera";
  }
}

// Near the viewpoint there are two cameras of a row: the third determines which of the two differs.
TEST(WideLuma, ComparesDistantCamerasOfARow) {
  const Wide wide;
  for (const CameraIndex bright : {0, 1}) {
    const ExposureCompensation gains = gains_of_row(wide, {4, 5, 3}, bright);
    EXPECT_GT(gains.of(bright), 1.03) << "less than 1.1: half may be reflection";
    EXPECT_LT(gains.of(bright), 1.1);
    EXPECT_NEAR(gains.of(1 - bright), 1, 0.001);
  }
}

// The rest of the array may be as bright as either of the two.
TEST(WideLuma, TwoCamerasOfALargerArrayStay) {
  const Wide wide;
  for (const CameraIndex bright : {0, 1}) EXPECT_TRUE(gains_of_row(wide, {3, 4, 5}, bright, 2.2).measured().empty());
}

TEST(WideLuma, PartsOfAnArrayAddUpToTheWhole) {
  const Wide wide;
  const WideLuma::Seen whole = wide.luma.see(wide.walls.sources(), {});
  const std::vector<CameraIndex> some{0, 1, 2, 3}, rest{4, 5, 6, 7, 8};
  WideLuma::Seen sum = WideLuma(wide.walls.rig, wide.walls.mesh, wide.view, some).see(wide.walls.sources(), {});
  const WideLuma::Seen other = WideLuma(wide.walls.rig, wide.walls.mesh, wide.view, rest).see(wide.walls.sources(), {});
  sum.moments.add(other.moments);
  sum.gains.add(other.gains);
  EXPECT_EQ(sum.moments.weight, whole.moments.weight);
  EXPECT_EQ(sum.moments.luma, whole.moments.luma);
  EXPECT_EQ(sum.moments.square, whole.moments.square);
  EXPECT_EQ(sum.gains, whole.gains);
}

TEST(WideLuma, ScatterIncreasesTheError) {
  WideLuma::Camera seen{0, std::vector<uint8_t>(100, 110), std::vector<float>(100, WideLuma::kPeak)};
  const std::vector<uint8_t> mean(100, 100);
  const std::optional<BrightnessRatio> alike = WideLuma::ratio(seen, mean);
  ASSERT_TRUE(alike.has_value());
  EXPECT_NEAR(alike->log, std::log(1.1), 1e-6);
  EXPECT_LT(alike->error, 0.005) << "rounding only";
  EXPECT_GT(alike->error, 0.002);
  for (size_t i = 0; i < 100; i++) seen.luma[i] = i % 4 == 0 ? 90 : i % 4 == 1 ? 130 : 110;
  const std::optional<BrightnessRatio> differing = WideLuma::ratio(seen, mean);
  ASSERT_TRUE(differing.has_value());
  EXPECT_NEAR(differing->log, alike->log, 1e-6);
  EXPECT_GT(differing->error, 10 * alike->error);
}

TEST(WideLuma, UndefinedMeanHasNoRatio) {
  const Wide wide;
  const WideLuma::Seen seen = wide.luma.see(wide.walls.sources(), {});
  EXPECT_FALSE(WideLuma::ratio(seen.cameras[0], {}).has_value()) << "another size";
  EXPECT_FALSE(WideLuma::ratio(seen.cameras[0], std::vector<uint8_t>(300, 0)).has_value()) << "nowhere defined";
}

TEST(WideLuma, CamerasWithoutAnImageAreLeftOut) {
  const Wide wide;
  std::vector<Source> sources = wide.walls.sources();
  sources[4].image = {};
  EXPECT_EQ(wide.luma.see(sources, {}).cameras.size(), 8u);
  sources[4].image = wide.walls.images[4].view();
  sources[4].image.width = 80;
  EXPECT_THROW(wide.luma.see(sources, {}), Error);
}

}  // namespace

}  // namespace lf
