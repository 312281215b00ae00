// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/gpu_sum.h"

#include <EGL/egl.h>

#include "composite/accumulator.h"
#include "lib/render/gl/external_context.h"
#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/generators.h"
#include "render/gl/gles_renderer.h"
#include "render/simd/sum_task.h"
#include "render/sum_renderer.h"
#include "support/fragments.h"

namespace lf {
namespace {

using reference::Random;
using test::ExternalContext;
using test::Sum;

class GpuSum : public test::InExternalContext {
 protected:
  // A view of an array; with `lost`, two cameras have no picture and one sees only half.
  struct Scene {
    Scene(int seed, int width, int height, PixelFamily family, bool lost, bool is_turned)
        : random(seed),
          rig(test::jittered_array(random, 3, 160, 120, seed % 2 ? -0.25 : 0)),
          view(test::view_into(3, width, height, random.small_rotation(is_turned ? 0.5 : 0.05))),
          production(rig, build_mesh(rig), view),
          images(test::in_family(family, images_of(rig, random, reference::smooth_image))),
          sources(test::sources_of(rig, production.plan, images)),
          family(family) {
      if (lost && sources.size() > 4) sources[1].image = sources[4].image = {.family = PixelFamily::kNone};
    }
    SumRenderer renderer(const std::shared_ptr<gl::GlesRenderer>& gpu, bool keep_on_gpu) const {
      return {production.plan, production.owners.runs(), sources, family, Coordinates::kExact, gpu.get(), serial_for,
              keep_on_gpu};
    }

    Random random;
    Rig rig;
    View view;
    test::Production production;
    std::vector<Image> images;
    std::vector<Source> sources;
    PixelFamily family;
  };
};
INSTANTIATE_TEST_SUITE_P(, GpuSum, testing::Values(EGL_OPENGL_ES_API, EGL_OPENGL_API), GpuSum::name_of);

TEST_P(GpuSum, EqualsTheDownloadedSum) {
  size_t fixed_up = 0;
  for (int seed = 0; seed < 12; seed++) {
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    const Scene scene(seed, seed % 3 ? 157 : 160, seed % 3 ? 121 : 120, family, seed % 4 == 1, seed % 5 == 2);
    const SumRenderer came = scene.renderer(gpu_, false), stays = scene.renderer(gpu_, true);
    ASSERT_TRUE(came.drawing().drawn && stays.drawing().drawn) << came.drawing().why_not << stays.drawing().why_not;
    EXPECT_EQ(came.gpu_sum(), nullptr);
    ASSERT_TRUE(stays.gpu_sum());
    fixed_up += gpu_->fixed_up();
    const ConstSumPlanes sum = stays.gpu_sum()->fetch();
    EXPECT_EQ(sum.plane[0], stays.gpu_sum()->fetch().plane[0]) << "fetched once";
    ASSERT_EQ(sum.rect, stays.gpu_sum()->rect());
    ASSERT_EQ(sum.rect, chroma_aligned(came.rect(), scene.view));
    Sum expected(family, sum.rect);
    const bool any_missing = came.render_rows(sum.rect.y0, sum.rect.y1, expected.planes);
    ASSERT_TRUE(sum.lost || !any_missing);
    for (int c = 0; c < 3; c++)
      for (size_t i = 0; i < expected.memory[c].size(); i++) ASSERT_EQ(sum.plane[c][i], expected.memory[c][i]) << i;
    for (size_t i = 0; sum.lost && i < expected.lost.size(); i++) ASSERT_EQ(sum.lost[i], expected.lost[i]) << i;
  }
  EXPECT_GT(fixed_up, 0u);
}

// Pixels that the CPU must fix up survive renderings of other sums without doubtful pixels.
TEST_P(GpuSum, IsRenderedForSeveralViews) {
  std::vector<std::unique_ptr<const Scene>> scenes;
  std::vector<Sum> expected;
  for (int seed = 0; seed < 6; seed++) {
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    scenes.push_back(std::make_unique<const Scene>(seed, 157, 121, family, seed % 4 == 1, seed % 3 == 2));
    const SumRenderer came = scenes.back()->renderer(gpu_, false);
    const Rect rect = chroma_aligned(came.rect(), scenes.back()->view);
    expected.emplace_back(family, rect);
    came.render_rows(rect.y0, rect.y1, expected.back().planes);
  }
  std::atomic<int> wrong = 0, stayed = 0;
  const auto draw = [&](size_t first) {
    for (size_t i = 0; i < 4 * scenes.size(); i++) {
      const size_t of = (first + i) % scenes.size();
      const auto sum = scenes[of]->renderer(gpu_, true).gpu_sum();
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

TEST_P(GpuSum, BecomesThePicture) {
  const Layout of_rgb[] = {{{3, 0, 1, 2}}, {{4, 0, 1, 2}}, {{4, 2, 1, 0}}, {{4, 1, 2, 3}}, {{4, 3, 2, 1}}};
  const Layout of_i420[] = {{{}, false}, {{}, true}};
  int pictures = 0, worst_whole = 0, worst = 0;
  size_t off = 0, all = 0;
  for (int seed = 0; seed < 40; seed++) {
    const bool rgb = seed % 2;
    const int width = 148 + 4 * (seed % 3) + seed % 7, height = 110 + seed % 5;
    const Scene scene(seed, width, height, rgb ? PixelFamily::kRgb : PixelFamily::kI420, seed % 4 < 2, seed % 5 == 2);
    const SumRenderer stays = scene.renderer(gpu_, true);
    if (!stays.gpu_sum()) continue;
    const Layout& layout = rgb ? of_rgb[seed / 2 % 5] : of_i420[seed / 2 % 2];
    const Background background = seed % 3 ? Background{200, 30, 90} : Background{};
    const Levels levels = seed % 8 < 4 || rgb ? kFullLevels : kVideoLevels;
    Accumulator sum = test::empty_sum(scene.family, width, height);
    ASSERT_TRUE(sum.add_borrowed(stays.gpu_sum()));
    ASSERT_EQ(sum.share_group(), ExternalContext::kGroup);

    const int step = layout.rgb.pixel_stride, cw = chroma_size(width), ch = chroma_size(height);
    struct Plane {
      int width, height, bytes;
    };
    std::vector<Plane> planes{{width, height, rgb ? step : 1}};
    if (!rgb && layout.is_interleaved) planes.push_back({cw, ch, 2});
    if (!rgb && !layout.is_interleaved) planes.insert(planes.end(), 2, {cw, ch, 1});
    gl::GpuPicture to{.layout = layout.rgb, .is_interleaved = layout.is_interleaved};
    for (size_t i = 0; i < planes.size(); i++)
      to.textures[i] = somebody_.texture(planes[i].width, planes[i].height, planes[i].bytes);
    std::string why;
    const auto readback_buffer = sum.resolve_on_gpu(background, levels, to, why);
    ASSERT_TRUE(readback_buffer && readback_buffer->wait(why)) << why;

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
    EXPECT_EQ(sum.share_group(), ExternalContext::kGroup) << "still owned after reading";
    for (size_t i = 0; i < planes.size(); i++) {
      const auto drawn = somebody_.bytes_of(to.textures[i], planes[i].width, planes[i].height, planes[i].bytes);
      for (size_t k = 0; k < drawn.size(); k++) {
        const int difference = std::abs(drawn[k] - expected[i][k]);
        int& most = stays.gpu_sum()->has_missing() || levels != kFullLevels ? worst : worst_whole;
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

// Several nodes in one process, each with a part of the array and a renderer in the same contexts. Bit-identical to the
// CPU, including missing weight.
TEST_P(GpuSum, IsAddedOnTheGpu) {
  std::string why;
  const std::shared_ptr<gl::GlesRenderer> other = new_renderer();
  int smaller = 0, with_loss = 0;
  for (int seed = 0; seed < 24; seed++) {
    SCOPED_TRACE(seed);
    const PixelFamily family = seed % 2 ? PixelFamily::kI420 : PixelFamily::kRgb;
    Random random(seed);
    const int width = 148 + seed % 7, height = 110 + seed % 5;
    const Scene scene(seed, width, height, family, seed % 4 < 2, seed % 5 == 2);
    const int nodes = 2 + seed % 3;
    Accumulator on_gpu, here;
    for (Accumulator* sum : {&on_gpu, &here}) sum->reset(family, width, height);
    for (int node = 0; node < nodes; node++) {
      std::vector<Source> own;
      for (const Source& source : scene.sources)
        if (seed % 3 ? static_cast<int>(source.camera) % nodes == node
                     : static_cast<int>(source.camera) * nodes / 9 == node)
          own.push_back(source);
      const SumRenderer renderer(scene.production.plan, scene.production.owners.runs(), own, family,
                                 Coordinates::kExact, (node % 2 ? other : gpu_).get(), serial_for, true);
      if (renderer.rect().empty()) continue;
      ASSERT_TRUE(renderer.gpu_sum()) << renderer.drawing().why_not;
      for (int i = 0; i < (seed % 6 == 5 ? 3 : 1); i++) {
        ASSERT_TRUE(on_gpu.add_borrowed(renderer.gpu_sum()));
        ASSERT_TRUE(here.add(renderer.gpu_sum()->fetch()));
      }
      smaller += renderer.rect() != test::whole(scene.view);
      with_loss += renderer.gpu_sum()->has_missing();
    }
    ASSERT_EQ(on_gpu.share_group(), ExternalContext::kGroup);
    const bool rgb = family == PixelFamily::kRgb;
    const int cw = chroma_size(width), ch = chroma_size(height);
    gl::GpuPicture to{.layout = {4, 0, 1, 2}};
    to.textures[0] = somebody_.texture(width, height, rgb ? 4 : 1);
    for (int c = 1; c < (rgb ? 1 : 3); c++) to.textures[c] = somebody_.texture(cw, ch, 1);
    const auto drawn = on_gpu.resolve_on_gpu({}, kFullLevels, to, why);
    ASSERT_TRUE(drawn && drawn->wait(why)) << why;
    const auto expected = here.sums(), added = on_gpu.sums();
    const ConstSumPlanes all = drawn->fetch();
    ASSERT_EQ(all.rect, test::whole(scene.view));
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
        const int lost = expected->lost ? expected->lost[y * expected->missing_stride + x] : 0;
        ASSERT_EQ(all.lost ? all.lost[(y + rect.y0) * all.missing_stride + x + rect.x0] : 0, lost);
      }
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

TEST_P(GpuSum, IsAddedToOtherSums) {
  const Scene scene(1, 160, 120, PixelFamily::kI420, false, false);
  const auto stays = [&] { return scene.renderer(gpu_, true).gpu_sum(); };
  ASSERT_TRUE(stays());
  Accumulator twice, after;
  for (Accumulator* sum : {&twice, &after}) sum->reset(scene.family, 160, 120);
  ASSERT_TRUE(twice.add_borrowed(stays()));
  ASSERT_TRUE(twice.add_borrowed(stays()));
  EXPECT_EQ(twice.share_group(), ExternalContext::kGroup);
  ASSERT_TRUE(after.add(stays()->fetch()));
  ASSERT_TRUE(after.add_borrowed(stays()));
  EXPECT_EQ(after.share_group(), 0u);
  std::string why;
  EXPECT_FALSE(after.resolve_on_gpu({}, kFullLevels, {}, why));
  EXPECT_MENTIONS(why, "GPU");
  const Image one = twice.resolve(), other_way = after.resolve();
  for (int c = 0; c < 3; c++)
    for (int y = 0; y < (c > 0 ? 60 : 120); y++)
      ASSERT_TRUE(std::equal(one.view().plane[c] + y * one.view().stride[c],
                             one.view().plane[c] + y * one.view().stride[c] + (c > 0 ? 80 : 160),
                             other_way.view().plane[c] + y * other_way.view().stride[c]));
  Accumulator lossy = test::empty_sum(scene.family, 160, 120);
  ASSERT_TRUE(lossy.add_borrowed(stays()));
  ASSERT_TRUE(lossy.add_missing_weights({0, 0, 10, 10}, std::vector<float>(100, 0.5f)));
  EXPECT_EQ(lossy.share_group(), 0u);
  Accumulator other = test::empty_sum(scene.family, 162, 120);
  EXPECT_FALSE(other.add_borrowed(stays())) << "another size";
}

// Holders of a lost sum see all weight missing.
TEST_P(GpuSum, IsLostWithItsGpu) {
  const Scene scene(1, 160, 120, PixelFamily::kI420, false, false);
  const auto sum = scene.renderer(gpu_, true).gpu_sum();
  ASSERT_TRUE(sum);
  somebody_.leave();
  std::string why;
  EXPECT_FALSE(sum->draw({}, why));
  EXPECT_MENTIONS(why, "context", "lost");
  why.clear();
  EXPECT_FALSE(sum->wait(why));
  EXPECT_MENTIONS(why, "context", "lost");
  const ConstSumPlanes nothing = sum->fetch();
  ASSERT_TRUE(nothing.lost);
  EXPECT_EQ(nothing.lost[0], kMissingOne);
  EXPECT_EQ(nothing.lost[160 * 120 - 1], kMissingOne);
  EXPECT_TRUE(gpu_->is_lost());
  const SumRenderer next = scene.renderer(gpu_, true);
  EXPECT_TRUE(next.drawing().refused);
  EXPECT_EQ(next.gpu_sum(), nullptr);
}

TEST_P(GpuSum, RefusesUnsuitableContexts) {
  std::string why;
  ExternalContext other(GetParam());
  if (gpu_->is_software()) {
    EXPECT_EQ(gl::GlesRenderer::create_in(other.foreign(), gl::Context::Drivers::kHardware, why), nullptr);
    EXPECT_MENTIONS(why, gpu_->device(), "CPU");
  }
  other.leave();
  EXPECT_EQ(gl::GlesRenderer::create_in(other.foreign(), gl::Context::Drivers::kAny, why), nullptr);
  EXPECT_MENTIONS(why, "context", "exists");
}

TEST_P(GpuSum, KeepsItsMemory) {
  std::vector<std::shared_ptr<gl::GpuSum>> held;
  std::vector<std::vector<int16_t>> expected;
  for (int seed = 1; seed < 10; seed += 2) {
    const Scene scene(seed, 160, 120, PixelFamily::kI420, false, false);
    Sum came(PixelFamily::kI420, test::whole(scene.view));
    scene.renderer(gpu_, false).render_rows(0, 120, came.planes);
    const auto sum = scene.renderer(gpu_, true).gpu_sum();
    if (!sum) continue;
    held.push_back(sum);
    expected.emplace_back(came.memory[0].begin(), came.memory[0].end());
  }
  ASSERT_GE(held.size(), 3u);
  gpu_.reset();
  for (size_t i = 0; i < held.size(); i++) {
    const ConstSumPlanes sum = held[i]->fetch();
    EXPECT_TRUE(std::equal(expected[i].begin(), expected[i].end(), sum.plane[0]));
  }
}

}  // namespace
}  // namespace lf
