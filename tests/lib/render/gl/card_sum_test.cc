// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/card_sum.h"

#include <EGL/egl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <span>
#include <thread>

#include "composite/accumulator.h"
#include "lib/render/gl/somebody.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/generators.h"
#include "render/gl/sum_drawer.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"

namespace lf {
namespace {

using reference::Random;
using test::Somebody;
using test::Sum;

// In OpenGL ES, and in OpenGL, which windows are drawn with by default.
class CardSum : public testing::TestWithParam<EGLenum> {
 protected:
  void SetUp() override {
    std::string why;
    drawer_ = gl::SumDrawer::create_in(somebody_.foreign(), gl::Context::Drivers::kAny, why);
    ASSERT_TRUE(drawer_) << why;
  }

  // An array's view, of which two cameras have no picture where `lost`, and one none of its sight beyond the middle.
  struct Scene {
    Scene(int seed, int width, int height, PixelFamily family, bool lost, bool is_turned)
        : random(seed),
          rig(test::jittered_array(random, 3, 160, 120, seed % 2 ? -0.25 : 0)),
          view(test::view_into(rig, 3, width, height, random.small_rotation(is_turned ? 0.5 : 0.05))),
          production(rig, build_mesh(rig), view),
          rgb(images_of(rig, random, reference::smooth_image)),
          images(family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb),
          sources(test::sources_of(rig, production.plan, images)),
          family(family) {
      if (lost && sources.size() > 4) sources[1].image = sources[4].image = {.family = PixelFamily::kNone};
    }
    SumRenderer renderer(const std::shared_ptr<gl::SumDrawer>& card, bool may_stay) const {
      return {production.plan, production.owners.runs(), sources, family, Coordinates::kExact, card.get(), serial_for,
              may_stay};
    }

    Random random;
    Rig rig;
    View view;
    test::Production production;
    std::vector<Image> rgb, images;
    std::vector<Source> sources;
    PixelFamily family;
  };

  Somebody somebody_{GetParam()};
  std::shared_ptr<gl::SumDrawer> drawer_;
};
INSTANTIATE_TEST_SUITE_P(, CardSum, testing::Values(EGL_OPENGL_ES_API, EGL_OPENGL_API), [](const auto& of) {
  return std::string(of.param == EGL_OPENGL_ES_API ? "OpenGlEs" : "OpenGl");
});

// What has stayed is what would have come, mended where the card was in doubt.
TEST_P(CardSum, IsTheSumThatWouldHaveCome) {
  int stayed = 0;
  size_t mended = 0;
  for (int seed = 0; seed < 12; seed++) {
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Scene scene(seed, seed % 3 ? 157 : 160, seed % 3 ? 121 : 120, family, seed % 4 == 1, seed % 5 == 2);
    const SumRenderer came = scene.renderer(drawer_, false), stays = scene.renderer(drawer_, true);
    ASSERT_TRUE(came.drawing().drawn && stays.drawing().drawn) << came.drawing().why_not << stays.drawing().why_not;
    EXPECT_EQ(came.card_sum(), nullptr);
    ASSERT_TRUE(stays.card_sum());
    stayed++;
    mended += drawer_->mended();
    const ConstSumPlanes sum = stays.card_sum()->fetch();
    EXPECT_EQ(sum.plane[0], stays.card_sum()->fetch().plane[0]) << "is fetched once";
    ASSERT_EQ(sum.rect, stays.card_sum()->rect());
    ASSERT_EQ(sum.rect, chroma_aligned(came.rect(), scene.view));
    Sum expected(family, sum.rect);
    const bool any_lost = came.render_rows(sum.rect.y0, sum.rect.y1, expected.planes);
    ASSERT_TRUE(sum.lost || !any_lost);
    for (int c = 0; c < 3; c++)
      for (size_t i = 0; i < expected.memory[c].size(); i++) ASSERT_EQ(sum.plane[c][i], expected.memory[c][i]) << i;
    for (size_t i = 0; sum.lost && i < expected.lost.size(); i++) ASSERT_EQ(sum.lost[i], expected.lost[i]) << i;
  }
  EXPECT_EQ(stayed, 12);
  EXPECT_GT(mended, 0u);
}

// What is open of one's sum is mended whatever others, who have nothing to mend, draw meanwhile.
TEST_P(CardSum, IsDrawnForSeveralAtOnce) {
  std::vector<std::unique_ptr<const Scene>> scenes;
  std::vector<Sum> expected;
  for (int seed = 0; seed < 6; seed++) {
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    scenes.push_back(std::make_unique<const Scene>(seed, 157, 121, family, seed % 4 == 1, seed % 3 == 2));
    const SumRenderer came = scenes.back()->renderer(drawer_, false);
    const Rect rect = chroma_aligned(came.rect(), scenes.back()->view);
    expected.emplace_back(family, rect);
    came.render_rows(rect.y0, rect.y1, expected.back().planes);
  }
  std::atomic<int> wrong = 0, stayed = 0;
  const auto draw = [&](size_t first) {
    for (size_t i = 0; i < 4 * scenes.size(); i++) {
      const size_t of = (first + i) % scenes.size();
      const auto sum = scenes[of]->renderer(drawer_, true).card_sum();
      if (!sum) continue;
      stayed++;
      const ConstSumPlanes planes = sum->fetch();
      for (int c = 0; c < 3; c++)
        wrong += !std::ranges::equal(std::span(planes.plane[c], expected[of].memory[c].size()), expected[of].memory[c]);
      if (planes.lost)
        wrong += !std::ranges::equal(std::span(planes.lost, expected[of].lost.size()), expected[of].lost);
    }
  };
  {
    std::vector<std::jthread> threads;
    for (size_t i = 0; i < 3; i++) threads.emplace_back(draw, 2 * i);
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(stayed, 72);
}

struct Layout {
  RgbLayout rgb;
  bool is_interleaved = false;
};

// Pictures are to the bit the compositor's, and within a level where what is left was divided by its weight.
TEST_P(CardSum, BecomesTheCompositorsPicture) {
  const Layout of_rgb[] = {{{3, 0, 1, 2}}, {{4, 0, 1, 2}}, {{4, 2, 1, 0}}, {{4, 1, 2, 3}}, {{4, 3, 2, 1}}};
  const Layout of_i420[] = {{{}, false}, {{}, true}};
  int pictures = 0, worst_whole = 0, worst = 0;
  size_t off = 0, all = 0;
  for (int seed = 0; seed < 40; seed++) {
    const bool rgb = seed % 2;
    const int width = 148 + 4 * (seed % 3) + seed % 7, height = 110 + seed % 5;
    const Scene scene(seed, width, height, rgb ? PixelFamily::kRgb : PixelFamily::kI420, seed % 4 < 2, seed % 5 == 2);
    const SumRenderer stays = scene.renderer(drawer_, true);
    if (!stays.card_sum()) continue;
    const Layout& layout = rgb ? of_rgb[seed / 2 % 5] : of_i420[seed / 2 % 2];
    const Background background = seed % 3 ? Background{200, 30, 90} : Background{};
    const Levels levels = seed % 8 < 4 || rgb ? kFullLevels : kVideoLevels;
    Accumulator sum;
    sum.reset(scene.family, width, height);
    ASSERT_TRUE(sum.add_kept(stays.card_sum()));
    ASSERT_EQ(sum.share_group(), Somebody::kGroup);

    const int step = layout.rgb.pixel_stride, cw = chroma_size(width), ch = chroma_size(height);
    struct Plane {
      int width, height, bytes;
    };
    std::vector<Plane> planes{{width, height, rgb ? step : 1}};
    if (!rgb && layout.is_interleaved) planes.push_back({cw, ch, 2});
    if (!rgb && !layout.is_interleaved) planes.insert(planes.end(), 2, {cw, ch, 1});
    gl::CardPicture to{.layout = layout.rgb, .is_interleaved = layout.is_interleaved};
    for (size_t i = 0; i < planes.size(); i++)
      to.textures[i] = somebody_.texture(planes[i].width, planes[i].height, planes[i].bytes);
    std::string why;
    const auto drawn_sum = sum.resolve_on_card(background, levels, to, why);
    ASSERT_TRUE(drawn_sum && drawn_sum->wait(why)) << why;

    std::vector<std::vector<uint8_t>> expected;
    uint8_t* plane[3] = {};
    ptrdiff_t stride[3] = {};
    for (size_t i = 0; i < planes.size(); i++) {
      expected.emplace_back(static_cast<size_t>(planes[i].width) * planes[i].height * planes[i].bytes);
      stride[i] = planes[i].width * planes[i].bytes;
    }
    for (size_t i = 0; i < planes.size(); i++) plane[i] = expected[i].data();
    if (layout.is_interleaved) {
      plane[2] = plane[1] + 1;
      stride[2] = stride[1];
    }
    sum.resolve(background, layout.rgb, plane, stride, levels);
    EXPECT_EQ(sum.share_group(), Somebody::kGroup) << "looking at it does not take it away";
    for (size_t i = 0; i < planes.size(); i++) {
      const auto drawn = somebody_.bytes_of(to.textures[i], planes[i].width, planes[i].height, planes[i].bytes);
      for (size_t k = 0; k < drawn.size(); k++) {
        const int difference = std::abs(drawn[k] - expected[i][k]);
        int& most = stays.card_sum()->has_lost() || levels != kFullLevels ? worst : worst_whole;
        most = std::max(most, difference);
        off += difference > 0;
      }
      all += drawn.size();
    }
    pictures++;
  }
  std::printf("%d pictures: off by %d at most, by %d where nothing is lost; %zu bytes of %zu\n", pictures, worst,
              worst_whole, off, all);
  EXPECT_GE(pictures, 24);
  EXPECT_EQ(worst_whole, 0);
  EXPECT_LE(worst, 1);
  EXPECT_LE(off, all / 500);
}

// As many nodes in one process have, each with a part of the array and a drawer in the same contexts. To the bit what
// the CPU adds, lost weight included.
TEST_P(CardSum, IsAddedToThoseBesideItOnTheCard) {
  std::string why;
  const std::shared_ptr<gl::SumDrawer> other =
      gl::SumDrawer::create_in(somebody_.foreign(), gl::Context::Drivers::kAny, why);
  ASSERT_TRUE(other) << why;
  int smaller = 0, with_loss = 0;
  for (int seed = 0; seed < 24; seed++) {
    SCOPED_TRACE(seed);
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    Random random(seed);
    const int width = 148 + seed % 7, height = 110 + seed % 5;
    const Scene scene(seed, width, height, family, seed % 4 < 2, seed % 5 == 2);
    const int nodes = 2 + seed % 3;
    Accumulator on_card, here;
    for (Accumulator* sum : {&on_card, &here}) sum->reset(family, width, height);
    for (int node = 0; node < nodes; node++) {
      std::vector<Source> own;
      for (const Source& source : scene.sources)
        if (seed % 3 ? static_cast<int>(source.camera) % nodes == node
                     : static_cast<int>(source.camera) * nodes / 9 == node)
          own.push_back(source);
      const SumRenderer renderer(scene.production.plan, scene.production.owners.runs(), own, family,
                                 Coordinates::kExact, (node % 2 ? other : drawer_).get(), serial_for, true);
      if (renderer.rect().empty()) continue;
      ASSERT_TRUE(renderer.card_sum()) << renderer.drawing().why_not;
      // More than there can be of a picture saturates.
      for (int i = 0; i < (seed % 6 == 5 ? 3 : 1); i++) {
        ASSERT_TRUE(on_card.add_kept(renderer.card_sum()));
        ASSERT_TRUE(here.add(renderer.card_sum()->fetch()));
      }
      smaller += renderer.rect() != test::whole(scene.view);
      with_loss += renderer.card_sum()->has_lost();
    }
    ASSERT_EQ(on_card.share_group(), Somebody::kGroup);
    const bool rgb = family == PixelFamily::kRgb;
    const int cw = chroma_size(width), ch = chroma_size(height);
    gl::CardPicture to{.layout = {4, 0, 1, 2}};
    to.textures[0] = somebody_.texture(width, height, rgb ? 4 : 1);
    for (int c = 1; c < (rgb ? 1 : 3); c++) to.textures[c] = somebody_.texture(cw, ch, 1);
    const auto drawn = on_card.resolve_on_card({}, kFullLevels, to, why);
    ASSERT_TRUE(drawn && drawn->wait(why)) << why;
    // What was added on the card,
    const auto expected = here.sums(), added = on_card.sums();
    const ConstSumPlanes all = drawn->fetch();
    ASSERT_EQ(all.rect, test::whole(scene.view));
    // and what is there for whoever looks at it in this process.
    ASSERT_EQ(added->rect, expected->rect);
    const Rect& rect = expected->rect;
    for (int c = 0; c < 3; c++) {
      const int w = plane_width(family, rect, c), h = plane_height(family, rect, c), half = !rgb && c > 0 ? 2 : 1;
      for (int y = 0; y < h; y++) {
        const int16_t* const row = expected->plane[c] + y * expected->stride[c];
        ASSERT_TRUE(std::equal(row, row + w, added->plane[c] + y * added->stride[c]));
        ASSERT_TRUE(std::equal(row, row + w, all.plane[c] + (y + rect.y0 / half) * all.stride[c] + rect.x0 / half));
      }
    }
    for (int y = 0; y < rect.height() && (expected->lost || all.lost); y++)
      for (int x = 0; x < rect.width(); x++) {
        const int lost = expected->lost ? expected->lost[y * expected->lost_stride + x] : 0;
        ASSERT_EQ(all.lost ? all.lost[(y + rect.y0) * all.lost_stride + x + rect.x0] : 0, lost);
      }
    // The picture.
    const auto bytes = somebody_.bytes_of(to.textures[0], width, height, rgb ? 4 : 1);
    std::vector<uint8_t> picture(bytes.size()), chroma(2 * static_cast<size_t>(cw) * ch);
    uint8_t* plane[3] = {picture.data(), chroma.data(), chroma.data() + chroma.size() / 2};
    const ptrdiff_t stride[3] = {width * (rgb ? 4 : 1), cw, cw};
    here.resolve({}, to.layout, plane, stride);
    for (size_t i = 0; i < bytes.size(); i++) ASSERT_LE(std::abs(bytes[i] - picture[i]), 1);
  }
  std::printf("%d of parts of the view, %d with loss\n", smaller, with_loss);
  EXPECT_GT(smaller, 10);
  EXPECT_GT(with_loss, 5);
}

// What else is added to it is added in this process's memory, in either order.
TEST_P(CardSum, IsAddedToOthers) {
  const Scene scene(1, 160, 120, PixelFamily::kI420, false, false);
  const auto stays = [&] { return scene.renderer(drawer_, true).card_sum(); };
  ASSERT_TRUE(stays());
  Accumulator twice, after;
  for (Accumulator* sum : {&twice, &after}) sum->reset(scene.family, 160, 120);
  ASSERT_TRUE(twice.add_kept(stays()));
  ASSERT_TRUE(twice.add_kept(stays()));
  EXPECT_EQ(twice.share_group(), Somebody::kGroup);
  ASSERT_TRUE(after.add(stays()->fetch()));
  ASSERT_TRUE(after.add_kept(stays()));
  EXPECT_EQ(after.share_group(), 0u);
  std::string why;
  EXPECT_FALSE(after.resolve_on_card({}, kFullLevels, {}, why));
  EXPECT_EQ(why, "it is not on a card");
  const Image one = twice.resolve(), other_way = after.resolve();
  for (int c = 0; c < 3; c++)
    for (int y = 0; y < (c > 0 ? 60 : 120); y++)
      ASSERT_TRUE(std::equal(one.view().plane[c] + y * one.view().stride[c],
                             one.view().plane[c] + y * one.view().stride[c] + (c > 0 ? 80 : 160),
                             other_way.view().plane[c] + y * other_way.view().stride[c]));
  Accumulator lossy;
  lossy.reset(scene.family, 160, 120);
  ASSERT_TRUE(lossy.add_kept(stays()));
  ASSERT_TRUE(lossy.add_lost_weights({0, 0, 10, 10}, std::vector<float>(100, 0.5f)));
  EXPECT_EQ(lossy.share_group(), 0u);
  Accumulator other;
  other.reset(scene.family, 162, 120);
  EXPECT_FALSE(other.add_kept(stays())) << "of another size";
}

// Whoever still holds a sum that can't be had any more has one of which all weight is lost.
TEST_P(CardSum, IsLostWithItsCard) {
  const Scene scene(1, 160, 120, PixelFamily::kI420, false, false);
  const auto sum = scene.renderer(drawer_, true).card_sum();
  ASSERT_TRUE(sum);
  somebody_.leave();
  std::string why;
  EXPECT_FALSE(sum->draw({}, why));
  EXPECT_EQ(why, "the context is lost");
  why.clear();
  EXPECT_FALSE(sum->wait(why));
  EXPECT_EQ(why, "the context is lost");
  const ConstSumPlanes nothing = sum->fetch();
  ASSERT_TRUE(nothing.lost);
  EXPECT_EQ(nothing.lost[0], kLostOne);
  EXPECT_EQ(nothing.lost[160 * 120 - 1], kLostOne);
  EXPECT_TRUE(drawer_->is_lost());
  const SumRenderer next = scene.renderer(drawer_, true);
  EXPECT_TRUE(next.drawing().refused);
  EXPECT_EQ(next.card_sum(), nullptr);
}

TEST_P(CardSum, IsNoneOfTheCpus) {
  std::string why;
  Somebody other(GetParam());
  if (drawer_->is_software()) {
    EXPECT_EQ(gl::SumDrawer::create_in(other.foreign(), gl::Context::Drivers::kHardware, why), nullptr);
    EXPECT_EQ(why, drawer_->device() + ": computes on the CPU");
  }
  other.leave();
  EXPECT_EQ(gl::SumDrawer::create_in(other.foreign(), gl::Context::Drivers::kAny, why), nullptr);
  EXPECT_EQ(why, "the context is there no more");
}

// Sums outlive drawers, and nothing is drawn over one that somebody holds.
TEST_P(CardSum, IsHeldAsLongAsItIsWanted) {
  std::vector<std::shared_ptr<gl::CardSum>> held;
  std::vector<std::vector<int16_t>> expected;
  for (int seed = 1; seed < 10; seed += 2) {
    const Scene scene(seed, 160, 120, PixelFamily::kI420, false, false);
    Sum came(PixelFamily::kI420, test::whole(scene.view));
    scene.renderer(drawer_, false).render_rows(0, 120, came.planes);
    const auto sum = scene.renderer(drawer_, true).card_sum();
    if (!sum) continue;
    held.push_back(sum);
    expected.emplace_back(came.memory[0].begin(), came.memory[0].end());
  }
  ASSERT_GE(held.size(), 3u);
  drawer_.reset();
  for (size_t i = 0; i < held.size(); i++) {
    const ConstSumPlanes sum = held[i]->fetch();
    EXPECT_TRUE(std::equal(expected[i].begin(), expected[i].end(), sum.plane[0]));
  }
}

}  // namespace
}  // namespace lf
