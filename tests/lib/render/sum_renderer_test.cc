// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/sum_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include <hwy/targets.h>

#include "base/error.h"
#include "lib/render/production.h"
#include "reference/hard_cases.h"
#include "reference/renderer.h"
#include "render/float_renderer.h"
#include "render/fragment_set.h"
#include "render/sum_rounding.h"

namespace lf {
namespace {

using reference::Random;

// Memory for a sum over a rectangle.
struct Sum {
  Sum(PixelFamily family, const Rect& rect) {
    planes.family = family;
    planes.rect = rect;
    for (int c = 0; c < 3; c++) {
      const bool half = family == PixelFamily::kI420 && c > 0;
      const int w = half ? chroma_size(rect.width()) : rect.width(),
                h = half ? chroma_size(rect.height()) : rect.height();
      memory[c].assign(static_cast<size_t>(w) * h, 12345);
      planes.plane[c] = memory[c].data();
      planes.stride[c] = w;
    }
    lost.assign(static_cast<size_t>(rect.width()) * rect.height(), 12345);
    planes.lost = lost.data();
    planes.lost_stride = rect.width();
  }
  double lost_weight(int x, int y) const {
    return planes.lost[(y - planes.rect.y0) * planes.lost_stride + (x - planes.rect.x0)] / double{kLostOne};
  }
  bool operator==(const Sum& o) const {
    return memory[0] == o.memory[0] && memory[1] == o.memory[1] && memory[2] == o.memory[2] && lost == o.lost;
  }
  std::vector<int16_t> memory[3];
  std::vector<uint16_t> lost;
  SumPlanes planes;
};

std::vector<Source> sources_of(const Rig& rig, const ViewPlan& plan, const std::vector<Image>& images) {
  std::vector<Source> sources;
  for (const CameraIndex i : plan.contributors()) sources.push_back({i, &rig.cameras[i], images[i].view()});
  return sources;
}

Image checkerboard(Random& random, int width, int height) {
  Image image(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++)
      for (int c = 0; c < 3; c++) image.pixel(x, y)[c] = (x + y) % 2 ? 255 : 0;
  (void)random;
  return image;
}

constexpr Blending kNarrow{Blending::Kind::kAperture, 0.25, 0}, kWide{Blending::Kind::kAperture, 0.8, 0},
    kByAngle{Blending::Kind::kAngle, 0, 4};

struct Worst {
  double level = 0, chroma = 0, lost = 0;
  int64_t pixels = 0;
};

// Sums of render_float() over the view, per plane: R, G, B or Y, Cb, Cr.
struct FloatSum {
  FloatSum(const Rig& rig, const test::Production& production, const std::vector<Image>& images,
           Resampling resampling) {
    const View& view = production.plan.view();
    const bool i420 = images.front().family() == PixelFamily::kI420;
    width = view.width;
    for (int c = 0; c < 3; c++) {
      stride[c] = i420 && c > 0 ? chroma_size(width) : width;
      plane[c].resize(static_cast<size_t>(stride[c]) * (i420 && c > 0 ? chroma_size(view.height) : view.height));
    }
    lost.resize(static_cast<size_t>(width) * view.height);
    for (const CameraIndex i : production.plan.contributors()) {
      const auto f = render_float(production.plan, production.owners, i, rig.cameras[i], images[i].view(), resampling);
      if (!f) continue;
      const Rect& rect = f->rect;
      size_t from = 0;
      for (int y = rect.y0; y < rect.y1; y++)
        for (int x = rect.x0; x < rect.x1; x++, from++) {
          lost[y * width + x] += f->lost[from];
          for (int c = 0; c < 3 && !i420; c++) plane[c][y * width + x] += f->colour[3 * from + c];
          if (i420) plane[0][y * width + x] += f->colour[from];
        }
      for (int c = 1; c < 3 && i420; c++)
        for (int y = 0; y < chroma_size(rect.height()); y++)
          for (int x = 0; x < chroma_size(rect.width()); x++, from++)
            plane[c][(rect.y0 / 2 + y) * stride[c] + rect.x0 / 2 + x] += f->colour[from];
    }
  }
  int width;
  int stride[3];
  std::vector<double> plane[3], lost;
};

// Beside render_float(), in sums that are not divided by what was lost.
void compare(const Rig& rig, const View& view, const std::vector<Image>& rgb, PixelFamily family,
             Coordinates coordinates, Worst& worst, Resampling resampling = Resampling::kBilinear) {
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
  const FloatSum expected(rig, production, images, resampling);
  const OwnerRuns runs(production.plan, test::whole(view));
  auto sources = sources_of(rig, production.plan, images);
  for (Source& source : sources) source.resampling = resampling;
  const SumRenderer renderer(production.plan, runs, sources, family, coordinates);
  const Rect& rect = renderer.rect();
  if (rect.empty()) return;
  Sum sum(family, rect);
  const bool any_lost = renderer.render_rows(rect.y0, rect.y1, sum.planes);
  bool expect_lost = false;
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      worst.pixels++;
      const double lost = expected.lost[y * view.width + x];
      expect_lost = expect_lost || lost > 1e-4;
      worst.lost = std::max(worst.lost, std::abs(sum.lost_weight(x, y) - lost));
    }
  EXPECT_TRUE(any_lost || !expect_lost);
  for (int c = 0; c < 3; c++) {
    const int shift = family == PixelFamily::kI420 && c > 0 ? 1 : 0;
    for (int y = rect.y0 >> shift; y < (rect.y1 + shift) >> shift; y++)
      for (int x = rect.x0 >> shift; x < (rect.x1 + shift) >> shift; x++) {
        const int16_t value =
            sum.planes.plane[c][(y - (rect.y0 >> shift)) * sum.planes.stride[c] + x - (rect.x0 >> shift)];
        const double error = std::abs(value / 128.0 - expected.plane[c][y * expected.stride[c] + x]);
        double& largest = shift ? worst.chroma : worst.level;
        largest = std::max(largest, error);
      }
  }
}

// An array of cameras as they are mounted: jitter, lenses that differ and distort.
Rig jittered_array(Random& random, int side, int width, int height, double k1) {
  Rig rig;
  for (int i = 0; i < side * side; i++) {
    const double focal = 1.25 * width * random.uniform(0.98, 1.02);
    const Lens lens(LensModel::kRadial, {focal, (width - 1) / 2.0, (height - 1) / 2.0, k1, -k1 / 5});
    const Vec3 place(i % side + random.uniform(-0.05, 0.05), i / side + random.uniform(-0.05, 0.05), 0);
    rig.cameras.push_back(reference::make_camera(i, width, height, lens, {0.1 * place, random.small_rotation(0.0175)}));
  }
  rig.topology = {Topology::Type::kGrid, side, side, {}};
  return rig;
}

View view_into(const Rig& rig, int side, int width, int height, const Quat& turn) {
  View view;
  view.width = width;
  view.height = height;
  const double f = 1.25 * width;
  view.lens = Lens::pinhole(f, (width - 1) / 2.0, (height - 1) / 2.0);
  const double middle = 0.1 * (side - 1) / 2;
  view.pose = {Vec3(middle + 0.01, middle - 0.02, -0.9 * middle * 2 * 1.25), turn};
  view.focus.plane = plane_through({0, 0, 2}, glm::normalize(Vec3(0.1, 0.2, -1)));
  (void)rig;
  return view;
}

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

// Depths with slopes, steps and, where `rough`, with nothing in common from node to node.
std::shared_ptr<const FocalMap> depths(Random& random, const View& view, int step, bool rough) {
  FocalMap map = FocalMap::for_view(view.width, view.height);
  map.step = step;
  map.columns = FocalMap::nodes(view.width, step);
  map.rows = FocalMap::nodes(view.height, step);
  map.from = plane_through({0, 0, 0}, {0, 0, 1});
  map.farthest = 1 / 6.0;
  map.nearest = 1 / 1.3;
  for (int j = 0; j < map.rows; j++)
    for (int i = 0; i < map.columns; i++) {
      const bool nearer = (i * 5 / map.columns + j * 4 / map.rows) % 2;
      const int slope = 60 * i / map.columns + 90 * j / map.rows;
      map.levels.push_back(static_cast<uint8_t>(rough ? random.integer(0, 255) : slope + (nearer ? 100 : 0)));
    }
  return std::make_shared<FocalMap>(std::move(map));
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

// On a plane and through a map. Steep as a checkerboard is, cubic samples are steeper, and overshoot on either side.
TEST(SumRenderer, IsWithinItsBoundWithCatmullRom) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const bool mapped : {false, true})
        for (const bool hard : {false, true}) {
          Worst worst;
          for (int trial = 0; trial < 3; trial++) {
            Random random(trial);
            const int side = 3 + trial, width = trial % 2 ? 157 : 160, height = trial % 2 ? 121 : 120;
            const Rig rig = jittered_array(random, side, width, height, trial == 0 ? 0 : -0.25);
            View view = view_into(rig, side, width, height, random.small_rotation(0.2));
            if (mapped) view.focus.map = depths(random, view, FocalMap::kFinestStep, trial == 2);
            const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
            compare(rig, view, images, family, Coordinates::kGrid, worst, Resampling::kCatmullRom);
          }
          std::printf("%-8s %s cubic %-5s %-12s: level error %.3f, chroma %.3f, lost %.2g, %ld pixels\n",
                      hwy::TargetName(target), family == PixelFamily::kI420 ? "I420" : "RGB ", mapped ? "map" : "plane",
                      hard ? "checkerboard" : "smooth", worst.level, worst.chroma, worst.lost, long(worst.pixels));
          EXPECT_LE(worst.level, hard ? 1.2 : 0.2);
          EXPECT_LE(worst.chroma, hard ? 1.2 : 0.2);
          EXPECT_LE(worst.lost, 1e-4);
        }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// An image whose planes end where memory does or, `at_front`, begin where it does.
class GuardedImage {
 public:
  GuardedImage(const ImageView& from, bool at_front) : view_(from) {
    const bool i420 = from.family == PixelFamily::kI420;
    for (int c = 0; c < (i420 ? 3 : 1); c++) {
      const int rows = c > 0 ? chroma_size(from.height) : from.height;
      const int width = c > 0 ? chroma_size(from.width) : i420 ? from.width : 3 * from.width;
      const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE)), size = static_cast<size_t>(rows) * width;
      const size_t pages = (size + page - 1) / page * page;
      auto* const memory = static_cast<uint8_t*>(
          mmap(nullptr, pages + 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
      EXPECT_NE(static_cast<void*>(memory), MAP_FAILED);
      memory_.push_back({memory, pages + 2 * page});
      uint8_t* const plane = memory + page + (at_front ? 0 : pages - size);
      for (int y = 0; y < rows; y++) std::copy_n(from.plane[c] + y * from.stride[c], width, plane + y * width);
      mprotect(memory, page, PROT_NONE);
      mprotect(memory + page + pages, page, PROT_NONE);
      view_.plane[c] = plane;
      view_.stride[c] = width;
    }
  }
  GuardedImage(const GuardedImage&) = delete;
  GuardedImage& operator=(const GuardedImage&) = delete;
  ~GuardedImage() {
    for (const auto& [memory, size] : memory_) munmap(memory, size);
  }
  const ImageView& view() const { return view_; }

 private:
  ImageView view_;
  std::vector<std::pair<uint8_t*, size_t>> memory_;
};

// Views that see all of the cameras' borders, at several scales.
TEST(SumRenderer, ReadsNothingOutsideOfImages) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (int trial = 0; trial < 12; trial++) {
        Random random(trial);
        const int width = trial % 2 ? 93 : 96, height = trial % 2 ? 71 : 72;
        const Rig rig = jittered_array(random, 3, width, height, trial % 3 == 0 ? 0 : -0.1);
        View view = view_into(rig, 3, width, height, random.small_rotation(0.1));
        view.lens = Lens::pinhole(width * random.uniform(0.6, 1.4), (width - 1) / 2.0, (height - 1) / 2.0);
        if (trial % 4) view.focus.map = depths(random, view, FocalMap::kFinestStep, trial % 4 == 3);
        const Mesh mesh = build_mesh(rig);
        const test::Production production(rig, mesh, view);
        const auto rgb = images_of(rig, random, reference::noise_image);
        const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
        const std::vector<Source> sources = sources_of(rig, production.plan, images);
        for (const Resampling resampling : {Resampling::kBilinear, Resampling::kCatmullRom})
          for (const bool at_front : {false, true}) {
            std::vector<std::unique_ptr<GuardedImage>> guarded;
            std::vector<Source> all = sources;
            for (Source& source : all) {
              guarded.push_back(std::make_unique<GuardedImage>(source.image, at_front));
              source.image = guarded.back()->view();
              source.resampling = resampling;
            }
            const SumRenderer renderer(production.plan, production.owners.runs(), all, family);
            Sum sum(family, renderer.rect());
            renderer.render_rows(renderer.rect().y0, renderer.rect().y1, sum.planes);
          }
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

// The yardstick of the above beside the reference, which knows the kernel by its formula.
TEST(FloatRenderer, SamplesByCatmullRomAsTheReference) {
  Random random(5);
  const Rig rig = jittered_array(random, 3, 93, 71, -0.1);
  View view = view_into(rig, 3, 93, 71, random.small_rotation(0.1));
  view.focus.map = depths(random, view, FocalMap::kFinestStep, false);
  const auto images = images_of(rig, random, reference::noise_image);
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  const FloatSum sums(rig, production, images, Resampling::kCatmullRom);
  const reference::Picture expected = reference::render(rig, mesh, view, images, Resampling::kCatmullRom);
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
          const double expected = chroma ? images[0].plane(c)[0] - 128 : images[0].data()[family == PixelFamily::kRgb ? c : 0];
          const double lost = chroma ? 0 : (all.lost[i]) / double{kLostOne};
          if (!chroma) { ASSERT_NEAR(all.memory[c][i] / 128., expected * (1 - lost), 0.3); }
          if (chroma) { ASSERT_LE(std::abs(all.memory[c][i] / 128.), std::abs(expected) + 0.5); }
        }
    }
}

// Fragments are what the sum of one camera rounds to, whatever the others are.
TEST(FragmentSet, IsEachCamerasSumRounded) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (int trial = 0; trial < 4; trial++) {
        Random random(trial);
        const int width = trial == 1 ? 93 : 128, height = trial == 1 ? 71 : 96;
        const Rig rig = jittered_array(random, 4, width, height, -0.25);
        View view = view_into(rig, 4, width, height, random.small_rotation(0.2));
        if (trial == 1) view.focus.map = depths(random, view, FocalMap::kFinestStep, false);
        if (trial >= 2) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * width, 63.5, 47.5, -0.1});
        if (trial == 3) view.blending = kNarrow;
        const Mesh mesh = build_mesh(rig);
        const ViewPlan plan(rig, mesh, view);
        const OwnerRuns runs(plan, test::whole(view));
        const auto rgb = images_of(rig, random, reference::noise_image);
        const std::vector<Image> images = family == PixelFamily::kI420 ? test::i420_of(rgb) : rgb;
        std::vector<Source> sources = sources_of(rig, plan, images);
        sources[1].image.family = PixelFamily::kNone;  // no picture: all lost
        for (size_t i = 2; i < sources.size(); i += 3) sources[i].resampling = Resampling::kCatmullRom;
        FragmentSet set;
        set.begin(plan, runs, sources, family);
        // Bands in another order and of other heights than all at once.
        for (int y = (set.rect().y1 - 1) / 16 * 16; y >= 0; y -= 16)
          if (y + 16 > set.rect().y0) set.render_rows(std::max(y, set.rect().y0), std::min(y + 16, set.rect().y1));
        for (const CameraFragment& fragment : set.fragments()) {
          const Source source = *std::ranges::find(sources, fragment.camera, &Source::camera);
          Rect owned = CameraCorners(plan, fragment.camera).owned(runs, plan.camera_rect(fragment.camera));
          if (family == PixelFamily::kI420) owned = chroma_aligned(owned, view);
          ASSERT_EQ(fragment.planes.rect, owned);
          const SumRenderer renderer(plan, runs, {&source, 1}, family);
          Sum sum(family, fragment.planes.rect);
          const bool lost = renderer.render_rows(fragment.planes.rect.y0, fragment.planes.rect.y1, sum.planes);
          ConstSumPlanes sums{.family = family,
                              .rect = fragment.planes.rect,
                              .lost = lost ? sum.lost.data() : nullptr,
                              .lost_stride = sum.planes.lost_stride};
          for (int c = 0; c < 3; c++) {
            sums.plane[c] = sum.planes.plane[c];
            sums.stride[c] = sum.planes.stride[c];
          }
          const Fragment expected = rounded_fragment(fragment.camera, sums);
          const FragmentPlanes planes = planes_of(expected);
          const int w = planes.rect.width(), h = planes.rect.height();
          ASSERT_EQ(fragment.planes.lost != nullptr, planes.lost != nullptr);
          for (int y = 0; y < h; y++) {
            const auto row = [&](const FragmentPlanes& p, int c, int n) {
              const uint8_t* at = p.plane[c] + y * p.stride[c];
              return std::vector<uint8_t>(at, at + n);
            };
            ASSERT_EQ(row(fragment.planes, 0, family == PixelFamily::kI420 ? w : 3 * w),
                      row(planes, 0, family == PixelFamily::kI420 ? w : 3 * w))
                << "camera " << fragment.camera << " row " << y;
            for (int c = 1; c < 3 && family == PixelFamily::kI420 && y < chroma_size(h); c++)
              ASSERT_EQ(row(fragment.planes, c, chroma_size(w)), row(planes, c, chroma_size(w)));
            for (int x = 0; planes.lost && x < w; x++)
              ASSERT_EQ(fragment.planes.lost[y * fragment.planes.lost_stride + x],
                        planes.lost[y * planes.lost_stride + x]);
          }
        }
        EXPECT_GT(set.fragments().size(), 8u);
      }
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace lf
