// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include <hwy/targets.h>

#include "base/error.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "lib/render/sum_errors.h"
#include "reference/hard_cases.h"
#include "reference/renderer.h"

namespace lf {
namespace {

using reference::Random;
using test::checkerboard, test::compare, test::depths, test::FloatSum, test::jittered_array, test::sources_of,
    test::Sum, test::view_into, test::Worst;

constexpr Blending kNarrow{Blending::Kind::kAperture, 0.25, 0}, kWide{Blending::Kind::kAperture, 0.8, 0},
    kByAngle{Blending::Kind::kAngle, 0, 4};

TEST(SumRenderer, IsWithinItsBoundOfTheRule) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Coordinates coordinates : {Coordinates::kGrid, Coordinates::kExact})
        for (const bool hard : {false, true}) {
          Worst worst;
          for (int trial = 0; trial < 4; trial++) {
            Random random(trial);
            const int side = 3 + trial, width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
            const Rig rig = jittered_array(random, side, width, height, trial % 3 == 0 ? 0 : -0.25);
            const View view = view_into(rig, side, width, height, random.small_rotation(0.2));
            const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
            compare(rig, view, images, family, coordinates, worst);
          }
          std::printf("%-8s %s %-5s %-12s: level error %.3f, chroma %.3f, lost %.2g, %ld pixels\n",
                      hwy::TargetName(target), family == PixelFamily::kI420 ? "I420" : "RGB ",
                      coordinates == Coordinates::kGrid ? "grid" : "exact", hard ? "checkerboard" : "smooth",
                      worst.level, worst.chroma, worst.lost, long(worst.pixels));
          EXPECT_LE(worst.level, hard ? 0.75 : 0.2);
          EXPECT_LE(worst.chroma, hard ? 0.75 : 0.2);
          EXPECT_LE(worst.lost, 1e-4);
        }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST(SumRenderer, IsWithinItsBoundThroughAFocalMap) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const bool hard : {false, true}) {
        Worst worst;
        for (int trial = 0; trial < 4; trial++) {
          Random random(trial);
          const int side = 3 + trial, width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
          const Rig rig = jittered_array(random, side, width, height, trial % 3 == 0 ? 0 : -0.25);
          View view = view_into(rig, side, width, height, random.small_rotation(0.2));
          view.focus.map = depths(random, view, trial == 1 ? 7 : FocalMap::kFinestStep, trial == 2);
          const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
          compare(rig, view, images, family, Coordinates::kGrid, worst);
        }
        std::printf("%-8s %s map   %-12s: level error %.3f, chroma %.3f, lost %.2g, %ld pixels\n",
                    hwy::TargetName(target), family == PixelFamily::kI420 ? "I420" : "RGB ",
                    hard ? "checkerboard" : "smooth", worst.level, worst.chroma, worst.lost, long(worst.pixels));
        EXPECT_LE(worst.level, hard ? 0.75 : 0.2);
        EXPECT_LE(worst.chroma, hard ? 0.75 : 0.2);
        EXPECT_LE(worst.lost, 1e-4);
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// The yardstick of the above beside the reference.
TEST(FloatRenderer, SamplesAsTheReference) {
  Random random(5);
  const Rig rig = jittered_array(random, 3, 93, 71, -0.1);
  View view = view_into(rig, 3, 93, 71, random.small_rotation(0.1));
  view.focus.map = depths(random, view, FocalMap::kFinestStep, false);
  const auto images = images_of(rig, random, reference::noise_image);
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  const FloatSum sums(rig, production, images);
  const reference::Picture expected = reference::render(rig, mesh, view, images);
  int compared = 0;
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      const reference::Pixel& pixel = expected.at(x, y);
      if (std::min(pixel.owner_margin, pixel.sample_margin) < 1e-9 || pixel.coverage < 0.5) continue;
      const size_t i = static_cast<size_t>(y) * view.width + x;
      for (int c = 0; c < 3; c++) EXPECT_NEAR(sums.plane[c][i], pixel.colour[c] * (1 - pixel.lost), 1e-2);
      compared++;
    }
  EXPECT_GT(compared, 3000);
}

// Chroma, lost weight and a checkerboard, too, which reference::subjects() don't have; beside the rule in doubles.
TEST(SumRenderer, IsWithinItsBoundInTheHardCases) {
  for (const reference::HardCase& small : reference::hard_cases())
    for (const reference::HardCase& hard : {small, reference::enlarged(small, reference::kEnlarged)})
      for (const Coordinates coordinates : {Coordinates::kGrid, Coordinates::kExact})
        for (const bool sharp : {false, true}) {
          Worst worst;
          for (int trial = 0; trial < 2; trial++) {
            Random random(trial);
            const auto [rig, view] = hard.make(random);
            const auto images = images_of(rig, random, sharp ? checkerboard : reference::smooth_image);
            compare(rig, view, images, PixelFamily::kI420, coordinates, worst);
          }
          SCOPED_TRACE(hard.name);
          EXPECT_LE(worst.level, sharp ? 0.75 : 0.2);
          EXPECT_LE(worst.chroma, 0.2);
          EXPECT_LE(worst.lost, 1e-4);
        }
}

// All ways to blend: tens of cameras a pixel add up as well as three do.
TEST(SumRenderer, IsWithinItsBoundHoweverManyCamerasBlend) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Blending blending : {kNarrow, kWide, kByAngle}) {
        Worst worst;
        for (int trial = 2; trial < 4; trial++) {
          Random random(trial);
          const int width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
          const Rig rig = jittered_array(random, 8, width, height, trial % 3 == 0 ? 0 : -0.25);
          View view = view_into(rig, 8, width, height, random.small_rotation(0.2));
          if (trial == 3) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * width, 78, 60, -0.1});
          view.blending = blending;
          const auto images = images_of(rig, random, reference::smooth_image);
          compare(rig, view, images, family, trial == 2 ? Coordinates::kExact : Coordinates::kGrid, worst);
        }
        std::printf("%-8s %s kind %d %.1f m: level error %.3f, chroma %.3f, lost %.2g, %ld pixels\n",
                    hwy::TargetName(target), family == PixelFamily::kI420 ? "I420" : "RGB ",
                    static_cast<int>(blending.kind), blending.aperture, worst.level, worst.chroma, worst.lost,
                    long(worst.pixels));
        EXPECT_LE(worst.level, 0.15);
        EXPECT_LE(worst.chroma, 0.15);
        EXPECT_LE(worst.lost, 1e-4);
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// 64 cameras of white and of the strongest colours overflow nothing, and two nodes' sums add up to the sum of both.
TEST(SumRenderer, SixtyFourCamerasOfWhiteAreWhite) {
  Random random(3);
  const Rig rig = jittered_array(random, 8, 160, 120, 0);
  View view = view_into(rig, 8, 160, 120, {1, 0, 0, 0});
  view.pose.position.z = -0.1;
  view.blending = kWide;
  view.blending.aperture = 5;
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  EXPECT_EQ(production.plan.contributors().size(), 64u);
  for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
    for (const int colour : {7, 4, 2, 1}) {  // bits: R, G, B
      Image one(PixelFamily::kRgb, 160, 120);
      for (size_t i = 0; i < one.data().size(); i++) one.data()[i] = colour >> (2 - i % 3) & 1 ? 255 : 0;
      const std::vector<Image> rgb(64, one), images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
      const std::vector<Source> sources = sources_of(rig, production.plan, images);
      const Rect whole = test::whole(view);
      Sum all(family, whole), first(family, whole), second(family, whole);
      const std::span<const Source> span(sources);
      const auto render = [&](std::span<const Source> part, Sum& sum) {
        SumRenderer(production.plan, production.owners.runs(), part, family).render_rows(0, whole.y1, sum.planes);
      };
      render(span, all);
      render(span.first(25), first);
      render(span.subspan(25), second);
      for (int c = 0; c < 3; c++)
        for (size_t i = 0; i < all.memory[c].size(); i++) {
          ASSERT_EQ(all.memory[c][i], first.memory[c][i] + second.memory[c][i]);
          const bool chroma = family == PixelFamily::kI420 && c > 0;
          const double expected =
              chroma ? images[0].plane(c)[0] - 128 : images[0].data()[family == PixelFamily::kRgb ? c : 0];
          const double lost = chroma ? 0 : (all.lost[i]) / double{kLostOne};
          if (!chroma) {
            ASSERT_NEAR(all.memory[c][i] / 128., expected * (1 - lost), 0.3);
          }
          if (chroma) {
            ASSERT_LE(std::abs(all.memory[c][i] / 128.), std::abs(expected) + 0.5);
          }
        }
    }
}

}  // namespace
}  // namespace lf
