// SPDX-License-Identifier: LGPL-2.1-or-later
#include <numbers>

#include <hwy/targets.h>
#include <sys/mman.h>

#include "lib/render/production.h"
#include "lib/render/sum_arrays.h"
#include "reference/float_renderer.h"
#include "reference/generators.h"
#include "reference/renderer.h"
#include "render/ownership.h"
#include "render/sum_renderer.h"
#include "scene/scene.h"
#include "support/every_target.h"
#include "support/rigs.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;
using test::checkerboard, test::depths, test::jittered_array, test::sources_of, test::Sum, test::view_into;

struct Worst {
  double level = 0, chroma = 0, lost = 0;
  long pixels = 0;
  void expect_at_most(double level_bound, double chroma_bound) const {
    EXPECT_LE(level, level_bound);
    EXPECT_LE(chroma, chroma_bound);
    EXPECT_LE(lost, 1e-4);
  }
  void print(const std::string& of) const {
    std::printf("%s: level error %.3f, chroma %.3f, lost %.2g, %ld pixels\n", of.c_str(), level, chroma, lost, pixels);
  }
};

// Sums of render_float() over the view, per plane: R, G, B or Y, Cb, Cr.
struct FloatSum {
  FloatSum(const Rig& rig, const test::Production& production, const std::vector<Image>& images) {
    const View& view = production.plan.view();
    const bool i420 = images.front().family() == PixelFamily::kI420;
    width = view.width;
    for (int c = 0; c < 3; c++) {
      stride[c] = i420 && c > 0 ? chroma_size(width) : width;
      plane[c].resize(static_cast<size_t>(stride[c]) * (i420 && c > 0 ? chroma_size(view.height) : view.height));
    }
    lost.resize(static_cast<size_t>(width) * view.height);
    for (const CameraIndex i : production.plan.contributors()) {
      const auto f = render_float(production.plan, production.owners, i, rig.cameras[i], images[i].view());
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

// Compares with render_float(), in sums without division by the valid weight.
void compare(const Rig& rig, const View& view, const std::vector<Image>& rgb, PixelFamily family,
             Coordinates coordinates, Worst& worst) {
  const Mesh mesh = build_mesh(rig);
  const test::Production production(rig, mesh, view);
  const std::vector<Image> images = test::in_family(family, rgb);
  const FloatSum expected(rig, production, images);
  const FaceRuns runs(production.plan, test::whole(view));
  auto sources = sources_of(rig, production.plan, images);
  const SumRenderer renderer(production.plan, runs, sources, family, coordinates);
  const Rect& rect = renderer.rect();
  if (rect.empty()) return;
  Sum sum(family, rect);
  const bool any_missing = renderer.render_rows(rect.y0, rect.y1, sum.planes);
  bool expect_lost = false;
  for (int y = rect.y0; y < rect.y1; y++)
    for (int x = rect.x0; x < rect.x1; x++) {
      worst.pixels++;
      const double lost = expected.lost[y * view.width + x];
      expect_lost = expect_lost || lost > 1e-4;
      worst.lost = std::max(worst.lost, std::abs(sum.missing_weight(x, y) - lost));
    }
  EXPECT_TRUE(any_missing || !expect_lost);
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

constexpr Blending kNarrow{Blending::Kind::kAperture, 0.25, 0}, kWide{Blending::Kind::kAperture, 0.8, 0},
    kByAngle{Blending::Kind::kAngle, 0, 4}, kMesh{};

// Checks the largest errors of four views, with smooth or (`hard`) noisy pictures.
void expect_within_bound(PixelFamily family, Coordinates coordinates, bool hard, bool mapped) {
  Worst worst;
  for (int trial = 0; trial < 4; trial++) {
    Random random(trial);
    const auto [rig, view] = test::array_and_view(trial, random, mapped);
    const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
    compare(rig, view, images, family, coordinates, worst);
  }
  const std::string kind = mapped ? "map" : coordinates == Coordinates::kGrid ? "grid" : "exact";
  worst.print(test::name_of(family) + (" " + kind) + (hard ? " checkerboard" : " smooth"));
  worst.expect_at_most(hard ? 0.75 : 0.2, hard ? 0.75 : 0.2);
}

TEST(SumRenderer, IsWithinTheErrorBound) {
  test::on_every_target([] {
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Coordinates coordinates : {Coordinates::kGrid, Coordinates::kExact})
        for (const bool hard : {false, true})
          for (const bool mapped : {false, true})
            if (!mapped || coordinates == Coordinates::kGrid) expect_within_bound(family, coordinates, hard, mapped);
  });
}

TEST(SumRenderer, IsWithinTheErrorBoundWithEveryLens) {
  test::on_every_target([] {
    const std::vector<Lens> lenses = test::lenses_beyond_opencv(320, 240);
    for (size_t i = 0; i < lenses.size(); i++)
      for (const bool mapped : {false, true})
        for (const bool hard : {false, true}) {
          Worst worst;
          Random random(static_cast<uint32_t>(i));
          const auto [rig, view] = test::array_with_lens(lenses[i], random, mapped);
          const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
          compare(rig, view, images, i % 2 ? PixelFamily::kRgb : PixelFamily::kI420, Coordinates::kGrid, worst);
          SCOPED_TRACE(testing::Message() << lens_model_name(lenses[i].model()) << (mapped ? " map" : " plane"));
          worst.expect_at_most(hard ? 0.75 : 0.2, hard ? 0.75 : 0.2);
        }
  });
}

// The upper quarter of a view of 103 degrees. Fisheye lenses bend its rows, so that the windows of a block begin in
// different rows of the image.
TEST(SumRenderer, IsWithinTheErrorBoundInWideViews) {
  test::on_every_target([] {
    constexpr int kWidth = 640, kHeight = 480, kRows = 120;
    const double f = 0.4 * kWidth, cx = (kWidth - 1) / 2.0, cy = (kHeight - 1) / 2.0;
    for (const bool hard : {false, true})
      for (const double roll : {0.0, 0.1}) {
        Worst worst;
        Random random(1);
        Rig rig = jittered_array(random, 2, kWidth, kHeight, 0);
        for (Camera& camera : rig.cameras)
          camera.lens = Lens(LensModel::kOpenCvFisheye, {f, f, cx, cy, -0.02, 0.002, 0, 0});
        View view = view_into(2, kWidth, kRows, glm::angleAxis(roll, Vec3(0, 0, 1)));
        view.lens = Lens::pinhole(f, cx, cy);
        view.pose.position = {0.05, 0.05, -0.035};
        const auto images = images_of(rig, random, hard ? checkerboard : reference::smooth_image);
        compare(rig, view, images, PixelFamily::kI420, Coordinates::kGrid, worst);
        SCOPED_TRACE(roll);
        EXPECT_GT(worst.pixels, kWidth * kRows * 3 / 4);
        worst.expect_at_most(hard ? 0.75 : 0.2, hard ? 0.75 : 0.2);
      }
  });
}

// Large terms of opposite sign cancel, so that float is not precise enough.
TEST(SumRenderer, IsWithinTheErrorBoundWithCancellingTerms) {
  const Lens lens(LensModel::kFullOpenCv, {320, 320, 159.5, 119.5, -19.999, 100.5, 0, 0, 0, -20, 100.5, 0});
  for (const bool mapped : {false, true}) {
    Worst worst;
    Random random(1);
    const auto [rig, view] = test::array_with_lens(lens, random, mapped);
    compare(rig, view, images_of(rig, random, checkerboard), PixelFamily::kI420, Coordinates::kGrid, worst);
    EXPECT_LE(worst.level, 0.75);
    EXPECT_LE(worst.lost, 1e-4);
  }
}

void expect_like_the_reference(Random& random, const Rig& rig, const View& view, int least = 3000) {
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
  EXPECT_GT(compared, least);
}

TEST(FloatRenderer, SamplesLikeTheReference) {
  Random random(5);
  const Rig rig = jittered_array(random, 3, 93, 71, -0.1);
  View view = view_into(3, 93, 71, random.small_rotation(0.1));
  view.focus.map = depths(random, view, FocalMap::kMinStep, false);
  expect_like_the_reference(random, rig, view);
}

// In the cameras and in the view.
TEST(FloatRenderer, SamplesEveryLensLikeTheReference) {
  for (const Lens& lens : test::lenses_beyond_opencv(93, 71)) {
    SCOPED_TRACE(lens_model_name(lens.model()));
    Random random(5);
    Rig rig = jittered_array(random, 3, 93, 71, -0.1);
    View view = view_into(3, 93, 71, random.small_rotation(0.1));
    view.focus.map = depths(random, view, FocalMap::kMinStep, false);
    for (Camera& camera : rig.cameras) camera.lens = lens;
    expect_like_the_reference(random, rig, view, 2000);  // a fisheye view is a circle
    view.lens = lens;
    view.pose.position.z = -0.05;
    expect_like_the_reference(random, rig, view, 2000);  // a fisheye view is a circle
  }
}

// Adds chroma, missing weight and a checkerboard to reference::subjects(); compared with the rule in double precision.
TEST(SumRenderer, IsWithinTheErrorBoundInHardCases) {
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
          worst.expect_at_most(sharp ? 0.75 : 0.2, 0.2);
        }
}

TEST(SumRenderer, IsWithinTheErrorBoundWithManyCameras) {
  test::on_every_target([] {
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Blending blending : {kNarrow, kWide, kByAngle, kMesh}) {
        Worst worst;
        for (int trial = 2; trial < 4; trial++) {
          Random random(trial);
          const int width = trial % 2 ? 157 : 320, height = trial % 2 ? 121 : 240;
          const Rig rig = jittered_array(random, 8, width, height, trial % 3 == 0 ? 0 : -0.25);
          View view = view_into(8, width, height, random.small_rotation(0.2));
          if (trial == 3) view.lens = Lens(LensModel::kSimpleRadial, {1.25 * width, 78, 60, -0.1});
          view.blending = blending;
          if (blending == kMesh) view.pose.position.x += 0.3;  // a good part of the view is beside the mesh
          const auto images = images_of(rig, random, reference::smooth_image);
          compare(rig, view, images, family, trial == 2 ? Coordinates::kExact : Coordinates::kGrid, worst);
        }
        worst.print(test::name_of(family) + (" kind " + std::to_string(static_cast<int>(blending.kind))) + " " +
                    std::to_string(blending.aperture) + " m");
        worst.expect_at_most(0.15, 0.15);
      }
  });
}

// A mask multiplies the sum of its camera, and the rest of the weight is missing.
TEST(SumRenderer, VisibilityReducesTheWeightOfACamera) {
  test::on_every_target([] {
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (const Blending blending : {kMesh, kByAngle}) {
        Random random(11);
        const Rig rig = jittered_array(random, 4, 93, 71, -0.1);
        View view = view_into(4, 93, 71, random.small_rotation(0.1));
        view.blending = blending;
        view.focus.map = depths(random, view, FocalMap::kMinStep, false);
        const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::smooth_image));
        const test::Production production(rig, build_mesh(rig), view);
        const FaceRuns runs(production.plan, test::whole(view));
        std::vector<Source> sources = sources_of(rig, production.plan, images);
        std::vector<VisibilityMask> masks(sources.size(), {view.focus.map->columns, view.focus.map->rows, {}, {}});
        const size_t pixels = static_cast<size_t>(view.width) * view.height;
        std::vector<double> expected(pixels), lost(pixels);
        for (size_t i = 0; i < sources.size(); i++) {
          for (size_t node = 0; node < view.focus.map->levels.size(); node++)
            masks[i].nodes.push_back(static_cast<uint8_t>(
                random.uniform(0, 1) < 0.3 ? random.uniform(VisibilityMask::kHidden, 255) : VisibilityMask::kVisible));
          FocalMap seen = *view.focus.map;  // interpolates like the mask
          seen.levels = masks[i].nodes;
          seen.farthest = 0;
          seen.nearest = 1;
          const SumRenderer alone(production.plan, runs, {&sources[i], 1}, family);
          const Rect& rect = alone.rect();
          Sum sum(family, rect);
          alone.render_rows(rect.y0, rect.y1, sum.planes);
          const std::vector<float> weights = pixel_weights(production.plan, production.owners, sources[i].camera, rect);
          for (int y = rect.y0; y < rect.y1; y++)
            for (int x = rect.x0; x < rect.x1; x++) {
              const size_t at = static_cast<size_t>(y - rect.y0) * rect.width() + (x - rect.x0);
              const size_t pixel = static_cast<size_t>(y) * view.width + x;
              const double part = seen.inverse_at(x, y);
              expected[pixel] += part * sum.planes.plane[0][(y - rect.y0) * sum.planes.stride[0] + x - rect.x0] / 128.;
              lost[pixel] += part * sum.missing_weight(x, y) + (1 - part) * weights[at];
            }
        }
        for (size_t i = 0; i < sources.size(); i++) sources[i].visibility = &masks[i];
        const SumRenderer renderer(production.plan, runs, sources, family);
        const Rect& rect = renderer.rect();
        Sum sum(family, rect);
        EXPECT_TRUE(renderer.render_rows(rect.y0, rect.y1, sum.planes));
        Worst worst;
        for (int y = rect.y0; y < rect.y1; y++)
          for (int x = rect.x0; x < rect.x1; x++) {
            const size_t pixel = static_cast<size_t>(y) * view.width + x;
            const int16_t value = sum.planes.plane[0][(y - rect.y0) * sum.planes.stride[0] + x - rect.x0];
            worst.level = std::max(worst.level, std::abs(value / 128. - expected[pixel]));
            worst.lost = std::max(worst.lost, std::abs(sum.missing_weight(x, y) - lost[pixel]));
            worst.pixels++;
          }
        worst.print(test::name_of(family) + std::string(" with masks"));
        EXPECT_LE(worst.level, 0.2);
        EXPECT_LE(worst.lost, 5e-4);
      }
  });
}

// Pixels in cells with depth edges have the depths of another map. They are drawn as with that map, and all other
// pixels as without edges.
TEST(SumRenderer, DepthEdgesPlaceSinglePixels) {
  test::on_every_target([] {
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb}) {
      Random random(12);
      const Rig rig = jittered_array(random, 4, 93, 71, -0.1);
      View view = view_into(4, 93, 71, random.small_rotation(0.1));
      view.focus.map = depths(random, view, FocalMap::kMinStep, false);
      View other = view;
      FocalMap turned = *view.focus.map;
      std::ranges::reverse(turned.levels);
      other.focus.map = std::make_shared<FocalMap>(turned);
      DepthEdges edges(*view.focus.map, 1e9);  // no cells yet
      for (int j = 0; j < edges.rows; j++)
        for (int i = 0; i < edges.columns; i++) {
          if (random.uniform(0, 1) > 0.3) continue;
          edges.index[static_cast<size_t>(j) * edges.columns + i] = static_cast<int32_t>(edges.cells.size());
          DepthEdges::Cell& cell = edges.cells.emplace_back();
          for (int k = 0; k < DepthEdges::kPixels; k++) {
            const auto [x, y] = DepthEdges::pixel_of(i, j, k);
            cell[k] = static_cast<float>(turned.inverse_at(x, y));
          }
        }
      const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::smooth_image));
      const Rect whole = test::whole(view);
      const auto render = [&](const View& shown, const DepthEdges* used, const VisibilityMask* mask) {
        const test::Production production(rig, build_mesh(rig), shown);
        std::vector<Source> sources = sources_of(rig, production.plan, images);
        for (Source& source : sources) source.edges = used, source.visibility = mask;
        Sum sum(family, whole);
        SumRenderer(production.plan, FaceRuns(production.plan, whole), sources, family)
            .render_rows(0, whole.y1, sum.planes);
        return sum;
      };
      const Sum plain = render(view, nullptr, nullptr), swapped = render(other, nullptr, nullptr);
      const Sum sum = render(view, &edges, nullptr);
      VisibilityMask half{view.focus.map->columns, view.focus.map->rows, {}, {}};
      half.nodes.assign(view.focus.map->levels.size(), VisibilityMask::kVisible);
      half.edges.resize(edges.cells.size());
      for (auto& cell : half.edges) cell.fill(128);
      const Sum masked = render(view, &edges, &half);
      Worst worst, worst_masked;
      for (int y = 0; y < view.height; y++)
        for (int x = 0; x < view.width; x++) {
          const bool has_edge = edges.depth_at(x, y);
          const Sum& expected = has_edge ? swapped : plain;
          const auto level = [&](const Sum& of) { return of.planes.plane[0][y * of.planes.stride[0] + x] / 128.; };
          worst.level = std::max(worst.level, std::abs(level(sum) - level(expected)));
          worst.lost = std::max(worst.lost, std::abs(sum.missing_weight(x, y) - expected.missing_weight(x, y)));
          const double part = has_edge ? 128 / 255. : 1;
          worst_masked.level = std::max(worst_masked.level, std::abs(level(masked) - part * level(expected)));
          worst.pixels += has_edge;
        }
      worst.print(test::name_of(family) + std::string(" with depth edges"));
      worst.expect_at_most(0.15, 0);
      EXPECT_LE(worst_masked.level, 0.2);
      EXPECT_GT(worst.pixels, 1000);
    }
  });
}

TEST(SumRenderer, SixtyFourCamerasOfWhiteAreWhite) {
  Random random(3);
  const Rig rig = jittered_array(random, 8, 160, 120, 0);
  View view = view_into(8, 160, 120, {1, 0, 0, 0});
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
      const std::vector<Image> images = test::in_family(family, std::vector<Image>(64, one));
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
          const double lost = chroma ? 0 : (all.lost[i]) / double{kMissingOne};
          if (chroma) {
            ASSERT_LE(std::abs(all.memory[c][i] / 128.), std::abs(expected) + 0.5);
          } else {
            ASSERT_NEAR(all.memory[c][i] / 128., expected * (1 - lost), 0.3);
          }
        }
    }
}

// An image with planes that end or, with `at_front`, begin at a guard page.
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

TEST(SumRenderer, ReadsNothingOutsideOfImages) {
  test::on_every_target([] {
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb})
      for (int trial = 0; trial < 12; trial++) {
        Random random(trial);
        const int width = trial % 2 ? 93 : 96, height = trial % 2 ? 71 : 72;
        const Rig rig = jittered_array(random, 3, width, height, trial % 3 == 0 ? 0 : -0.1);
        View view = view_into(3, width, height, random.small_rotation(0.1));
        view.lens = Lens::pinhole(width * random.uniform(0.6, 1.4), (width - 1) / 2.0, (height - 1) / 2.0);
        if (trial % 4) view.focus.map = depths(random, view, FocalMap::kMinStep, trial % 4 == 3);
        const Mesh mesh = build_mesh(rig);
        const test::Production production(rig, mesh, view);
        const std::vector<Image> images = test::in_family(family, images_of(rig, random, reference::noise_image));
        const std::vector<Source> sources = sources_of(rig, production.plan, images);
        for (const bool at_front : {false, true}) {
          std::vector<std::unique_ptr<GuardedImage>> guarded;
          std::vector<Source> all = sources;
          for (Source& source : all) {
            guarded.push_back(std::make_unique<GuardedImage>(source.image, at_front));
            source.image = guarded.back()->view();
          }
          const SumRenderer renderer(production.plan, production.owners.runs(), all, family);
          Sum sum(family, renderer.rect());
          renderer.render_rows(renderer.rect().y0, renderer.rect().y1, sum.planes);
        }
      }
  });
}

class SumScales : public testing::Test {
 protected:
  void TearDown() override {
    hwy::SetSupportedTargetsForTest(0);
    std::printf("level error %.3f, chroma %.3f\n", worst_.level, worst_.chroma);
  }
  // Checks view number n. `scale`: camera pixels per view pixel; `turn`: rotation of the view, radians.
  void check(int n, Random& random, double scale, double turn, bool mapped) {
    hwy::SetSupportedTargetsForTest(targets_[static_cast<size_t>(n) % targets_.size()]);
    const Rig rig = jittered_array(random, kSide, kWidth, kHeight, n % 5 ? 0 : -0.25);
    View view = view_into(kSide, random.integer(60, 150), random.integer(40, 100),
                          Quat(std::cos(turn / 2), 0, 0, std::sin(turn / 2)) * random.small_rotation(0.05));
    view.lens = Lens::pinhole(1.25 * kWidth / scale, (view.width - 1) / 2.0, (view.height - 1) / 2.0);
    view.pose.position.z = random.uniform(-0.1, 0);
    if (mapped) view.focus.map = depths(random, view, FocalMap::kMinStep, n % 8 > 5);
    const auto images = images_of(rig, random, reference::smooth_image);
    for (const PixelFamily family : {PixelFamily::kI420, PixelFamily::kRgb}) {
      Worst worst;
      compare(rig, view, images, family, Coordinates::kGrid, worst);
      EXPECT_LE(std::max(worst.level, worst.chroma), 0.15)
          << "scale " << scale << ", view " << n << ", turned by " << turn << (mapped ? ", map, " : ", plane, ")
          << test::name_of(family);
      EXPECT_LE(worst.lost, 1e-4) << "scale " << scale << ", view " << n;
      worst_.level = std::max(worst_.level, worst.level);
      worst_.chroma = std::max(worst_.chroma, worst.chroma);
    }
  }

 private:
  static constexpr int kSide = 3, kWidth = 160, kHeight = 120;
  const std::vector<int64_t> targets_ = hwy::SupportedAndGeneratedTargets();
  Worst worst_;
};

// `LF_SCALES`: number of scales.
TEST_F(SumScales, AreWithinTheErrorBound) {
  const int scales = test::number_of_views(250);
  constexpr double kLeast = 0.15, kLargest = 6;
  for (int n = 0; n < scales; n++) {
    Random random(n);
    const double scale = kLeast * std::pow(kLargest / kLeast, (n + random.uniform(0, 1)) / scales);
    check(n, random, scale, (n % 3 ? 0.02 : std::numbers::pi) * random.uniform(-1, 1), n % 4 > 1);
  }
}

// At the limit of 16 bits over a block's width.
TEST_F(SumScales, TwoPixelsPerPixelAreWithinTheErrorBound) {
  for (int n = 0; n < 40; n++) {
    Random random(n);
    check(n, random, random.uniform(1.9, 2.1), 0, false);
  }
}

std::vector<Rect> tiles_of(const RenderJob& job, PixelFamily family, size_t max_extra_pixels) {
  return sum_tiles(job.plan(), job.runs(), job.cameras(), family, max_extra_pixels);
}

size_t area(const Rect& rect) { return static_cast<size_t>(rect.width()) * rect.height(); }

size_t total(const std::vector<Rect>& tiles) {
  size_t sum = 0;
  for (const Rect& tile : tiles) sum += area(tile);
  return sum;
}

std::vector<bool> weighted(const test::Production& production, const std::vector<CameraIndex>& cameras) {
  const View& view = production.plan.view();
  std::vector<bool> out(static_cast<size_t>(view.width) * view.height);
  for (const auto& own : production.own_weights())
    if (std::ranges::binary_search(cameras, own.camera))
      for (size_t i = 0; i < out.size(); i++)
        if (own.weight[i] != 0) out[i] = true;
  return out;
}

TEST(SumTiles, ContainEveryPixelOnce) {
  for (int trial = 0; trial < 24; trial++) {
    SCOPED_TRACE(trial);
    Random random(trial);
    const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
    View view = view_into(5, trial % 3 == 1 ? 157 : 160, trial % 3 == 2 ? 119 : 120, random.small_rotation(0.3));
    if (trial % 4 == 2) view.lens = Lens(LensModel::kSimpleRadial, {200, 79.5, 59.5, -0.1});
    if (trial % 4 == 3) view.blending = Blending{Blending::Kind::kAperture, 0.1, 0};
    std::vector<CameraIndex> own;
    for (CameraIndex camera = 0; camera < rig.cameras.size(); camera++)
      if (random.uniform(0, 1) < (trial % 2 ? 0.1 : 0.4)) own.push_back(camera);
    const Mesh mesh = build_mesh(rig);
    const RenderJob job(rig, mesh, view, own);
    const std::vector<bool> wanted = weighted({rig, mesh, view}, own);
    size_t before = SIZE_MAX;
    for (const size_t spare : {size_t{0}, size_t{300}, size_t{5000}}) {
      const std::vector<Rect> tiles = tiles_of(job, PixelFamily::kI420, spare);
      std::vector<int> there(wanted.size());
      for (const Rect& tile : tiles) {
        EXPECT_FALSE(tile.empty());
        EXPECT_EQ(tile, chroma_aligned(tile, view));
        EXPECT_EQ(intersect(tile, job.runs().region()), tile);
        for (int y = tile.y0; y < tile.y1; y++)
          for (int x = tile.x0; x < tile.x1; x++) there[static_cast<size_t>(y) * view.width + x]++;
      }
      for (size_t i = 0; i < wanted.size(); i++) {
        ASSERT_LE(there[i], 1) << i;
        ASSERT_GE(there[i], wanted[i]) << i % view.width << ", " << i / view.width;
      }
      EXPECT_TRUE(std::ranges::is_sorted(tiles, {}, &Rect::y0));
      EXPECT_LE(tiles.size(), before) << "fewer tiles";
      before = tiles.size();
    }
  }
}

TEST(SumTiles, OneCameraSendsLessThanItsBounds) {
  Random random(3);
  const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
  const View view = view_into(5, 320, 240, random.small_rotation(0));
  const RenderJob job(rig, build_mesh(rig), view, std::vector<CameraIndex>{12});
  const Rect bounds = CameraCorners(job.plan(), 12).owned(job.runs(), job.plan().camera_rect(12));
  const std::vector<Rect> tight = tiles_of(job, PixelFamily::kRgb, 0);
  EXPECT_GT(tight.size(), 3u);
  EXPECT_LT(total(tight), area(bounds) * 9 / 10);
  EXPECT_EQ(tiles_of(job, PixelFamily::kRgb, 1 << 20), std::vector{bounds});
}

TEST(SumTiles, DistantCamerasHaveSeparateTiles) {
  Random random(4);
  const Rig rig = jittered_array(random, 5, 64, 48, -0.2);
  const View view = view_into(5, 320, 240, random.small_rotation(0));
  const RenderJob job(rig, build_mesh(rig), view, std::vector<CameraIndex>{5, 9});
  const std::vector<Rect> apart = tiles_of(job, PixelFamily::kRgb, 1000);
  EXPECT_EQ(apart.size(), 2u);
  EXPECT_EQ(tiles_of(job, PixelFamily::kRgb, 1 << 20).size(), 1u);
}

View view_from(const Vec3& position) {
  return {96,
          64,
          Lens(LensModel::kPinhole, {100, 100, 47.5, 31.5}),
          {.position = position},
          {plane_through({0, 0, kSceneMiddle}, {0, 0, 1})}};
}

TEST(SumTiles, OfAllCamerasAndOfInvisibleCameras) {
  const Rig rig = scene_rig(4, 4, 64, 48);
  const auto tiles = [&](const Vec3& position, const std::vector<CameraIndex>& own, PixelFamily family) {
    return tiles_of({rig, build_mesh(rig), view_from(position), own}, family, 0);
  };
  EXPECT_THAT(tiles({0, 0, -0.01}, test::all_cameras(rig), PixelFamily::kI420),
              testing::ElementsAre(Rect{0, 0, 96, 64}));
  EXPECT_THAT(tiles({5, 0, -0.01}, {0, 1}, PixelFamily::kRgb), testing::IsEmpty());
}

}  // namespace
}  // namespace lf
