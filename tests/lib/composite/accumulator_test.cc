// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/accumulator.h"
#include "base/text.h"
#include "support/fragments.h"
#include "support/test.h"

namespace lf::test {
namespace {

constexpr double kMinWeight = 3 * kMissingOne / 255.;

class Reference {
 public:
  Reference(PixelFamily family, int width, int height)
      : family_(family),
        width_(width),
        height_(height),
        sum_(packed_size(family, width, height)),
        lost_(static_cast<size_t>(width) * height) {}

  void add(const Fragment& f) {
    const Rect& r = f.rect;
    for (int y = r.y0; y < r.y1; y++)
      for (int x = r.x0; x < r.x1; x++) {
        const size_t from = static_cast<size_t>(y - r.y0) * r.width() + (x - r.x0),
                     to = static_cast<size_t>(y) * width_ + x;
        if (!f.lost.empty()) lost_[to] += std::round(f.lost[from] * 32768 / 255.);
        if (family_ == PixelFamily::kI420)
          sum_[to] += f.pixels[from];
        else
          for (int c = 0; c < 3; c++) sum_[3 * to + c] += f.pixels[3 * from + c];
      }
    if (family_ != PixelFamily::kI420) return;
    const int cw = chroma_size(r.width()), ch = chroma_size(r.height());
    for (int p = 0; p < 2; p++)
      for (int y = 0; y < ch; y++)
        for (int x = 0; x < cw; x++)
          sum_[chroma_at(p, r.x0 / 2 + x, r.y0 / 2 + y)] +=
              static_cast<int8_t>(f.pixels[area(r) + (static_cast<size_t>(p) * ch + y) * cw + x]);
  }

  // Before rounding; Accumulator must be within 0.5 (and float precision).
  std::vector<double> resolve(const double back[3]) const {
    std::vector<double> out(sum_.size());
    for (int y = 0; y < height_; y++)
      for (int x = 0; x < width_; x++) {
        const size_t i = static_cast<size_t>(y) * width_ + x;
        const int channels = family_ == PixelFamily::kRgb ? 3 : 1;
        for (int c = 0; c < channels; c++)
          out[channels * i + c] =
              hidden(i) ? back[c]
                        : std::clamp(sum_[channels * i + c] * kMissingOne / (kMissingOne - lost_[i]), 0., 255.);
      }
    if (family_ == PixelFamily::kRgb) return out;
    for (int p = 0; p < 2; p++)
      for (int y = 0; y < chroma_size(height_); y++)
        for (int x = 0; x < chroma_size(width_); x++) {
          double lost = 0, share = 0, n = 0;
          for (int yy = 2 * y; yy < std::min(2 * y + 2, height_); yy++)
            for (int xx = 2 * x; xx < std::min(2 * x + 2, width_); xx++, n++) {
              const size_t i = static_cast<size_t>(yy) * width_ + xx;
              lost += std::min<double>(lost_[i], kMissingOne);
              share += hidden(i);
            }
          const double left = kMissingOne - lost / n;
          share = left < kMinWeight ? 1 : share / n;
          const size_t i = chroma_at(p, x, y);
          const double colour = share == 1 ? 0 : std::clamp(sum_[i] * kMissingOne / left, -128., 127.);
          out[i] = std::clamp(128 + colour * (1 - share) + back[1 + p] * share, 0., 255.);
        }
    return out;
  }

 private:
  bool hidden(size_t i) const { return kMissingOne - lost_[i] < kMinWeight; }
  size_t chroma_at(int plane, int x, int y) const {
    const size_t luma = static_cast<size_t>(width_) * height_;
    const size_t chroma = static_cast<size_t>(chroma_size(width_)) * chroma_size(height_);
    return luma + plane * chroma + static_cast<size_t>(y) * chroma_size(width_) + x;
  }
  PixelFamily family_;
  int width_, height_;
  std::vector<double> sum_, lost_;
};

TEST(Accumulator, AddsFragmentsAtTheirRectangles) {
  Accumulator sum = empty_sum(PixelFamily::kRgb, 5, 3);
  ASSERT_TRUE(sum.add(plain(PixelFamily::kRgb, {0, 0, 3, 3}, 10, 20, 30)));
  ASSERT_TRUE(sum.add(plain(PixelFamily::kRgb, {2, 1, 5, 2}, 1, 2, 3)));
  const Image image = sum.resolve();
  EXPECT_EQ(image.pixel(0, 0)[0], 10);
  EXPECT_EQ(image.pixel(2, 1)[0], 11);
  EXPECT_EQ(image.pixel(2, 1)[1], 22);
  EXPECT_EQ(image.pixel(4, 1)[2], 3);
  EXPECT_EQ(image.pixel(4, 2)[2], 0);
}

TEST(Accumulator, MissingWeightIsNormalised) {
  // A camera with valid weight v shows v * colour; dividing by v restores the colour within the 8-bit rounding of v *
  // colour: 0.5 * 255 / v, plus 0.5 for the result.
  for (const PixelFamily family : kFamilies)
    for (int lost = 0; lost <= 255; lost++) {
      const double weight = (255 - lost) / 255.0;
      const int colour[3] = {200, family == PixelFamily::kRgb ? 17 : -90, family == PixelFamily::kRgb ? 255 : 101};
      const auto weighted = [&](int c) { return static_cast<int>(std::lround(weight * colour[c])); };
      Fragment f = plain(family, {0, 0, 3, 3}, weighted(0), weighted(1), weighted(2));
      if (lost) f.lost.assign(9, static_cast<uint8_t>(lost));
      Accumulator sum = empty_sum(family, 3, 3);
      ASSERT_TRUE(sum.add(f));
      const Image image = sum.resolve({1, 2, 3});
      const double bound = 0.5 / weight + 0.5 + 1e-4;
      for (int c = 0; c < 3; c++) {
        const int value =
            family == PixelFamily::kRgb ? image.pixel(2, 2)[c] : image.plane(c)[c == 0 ? 8 : 3] - (c ? 128 : 0);
        if (lost <= 252) {
          EXPECT_NEAR(value, colour[c], bound) << "lost " << lost << " channel " << c;
        } else if (family == PixelFamily::kRgb) {
          EXPECT_EQ(value, c + 1) << "lost " << lost;
        }
      }
    }
}

TEST(Accumulator, MatchesTheDoubleReference) {
  std::mt19937 random(7);
  double worst = 0;
  for (const PixelFamily family : kFamilies)
    for (const auto& [width, height] : {std::pair{1, 1}, {2, 1}, {1, 2}, {7, 5}, {8, 8}, {33, 19}, {64, 48}, {131, 77}})
      for (int round = 0; round < 12; round++) {
        Accumulator sum = empty_sum(family, width, height);
        Reference reference(family, width, height);
        for (int i = 0; i < 6; i++) {
          const Fragment f = random_fragment(family, width, height, random, 80, round % 3 != 0);
          ASSERT_TRUE(sum.add(f));
          reference.add(f);
        }
        const Background background{200, 30, 90};
        const double back_rgb[3] = {200, 30, 90};
        const double back_ycc[3] = {0.299 * 200 + 0.587 * 30 + 0.114 * 90, -0.168736 * 200 - 0.331264 * 30 + 0.5 * 90,
                                    0.5 * 200 - 0.418688 * 30 - 0.081312 * 90};
        const std::vector<double> expected = reference.resolve(family == PixelFamily::kRgb ? back_rgb : back_ycc);
        const Image image = sum.resolve(background);
        ASSERT_EQ(image.data().size(), expected.size());
        for (size_t i = 0; i < expected.size(); i++) worst = std::max(worst, std::abs(image.data()[i] - expected[i]));
      }
  EXPECT_LE(worst, 0.5 + 1e-4);
}

TEST(Accumulator, OrderDoesNotMatter) {
  std::mt19937 random(3);
  for (const PixelFamily family : kFamilies) {
    std::vector<Fragment> fragments;
    for (int i = 0; i < 40; i++) fragments.push_back(random_fragment(family, 37, 21, random, 255, i % 2));
    if (family == PixelFamily::kI420)
      for (Fragment& f : fragments)
        for (size_t i = area(f.rect); i < f.pixels.size(); i++)
          f.pixels[i] = static_cast<uint8_t>(f.pixels[i] % 13 - 6);
    Accumulator sum = empty_sum(family, 37, 21);
    for (const Fragment& f : fragments) ASSERT_TRUE(sum.add(f));
    const Image first = sum.resolve();
    for (int round = 0; round < 5; round++) {
      std::shuffle(fragments.begin(), fragments.end(), random);
      sum.reset(family, 37, 21);
      for (const Fragment& f : fragments) ASSERT_TRUE(sum.add(f));
      EXPECT_EQ(sum.resolve().data(), first.data());
    }
  }
}

TEST(Accumulator, PartialSumsAddUpToTheSame) {
  std::mt19937 random(4);
  for (const PixelFamily family : kFamilies)
    for (int round = 0; round < 20; round++) {
      Accumulator whole, part[2], tree;
      for (Accumulator* a : {&whole, &part[0], &part[1], &tree}) a->reset(family, 23, 17);
      for (int i = 0; i < 8; i++) {
        const Fragment f = random_fragment(family, 23, 17, random, 30, true);
        ASSERT_TRUE(whole.add(f));
        ASSERT_TRUE(part[i % 2].add(f));
      }
      for (const Accumulator& p : part) {
        const std::optional<Fragment> sum = test::rounded_sum(p);
        ASSERT_TRUE(sum.has_value());
        ASSERT_TRUE(tree.add(*sum));
      }
      EXPECT_EQ(tree.resolve({9, 8, 7}).data(), whole.resolve({9, 8, 7}).data());
    }
}

TEST(Accumulator, PartialSumIsTightAndSaturates) {
  Accumulator sum = empty_sum(PixelFamily::kRgb, 20, 10);
  EXPECT_FALSE(test::rounded_sum(sum).has_value());
  ASSERT_TRUE(sum.add(plain(PixelFamily::kRgb, {3, 4, 5, 6}, 200, 1, 2)));
  ASSERT_TRUE(sum.add(plain(PixelFamily::kRgb, {4, 5, 9, 7}, 100, 1, 2)));
  const std::optional<Fragment> rgb = test::rounded_sum(sum);
  ASSERT_TRUE(rgb.has_value());
  EXPECT_EQ(rgb->rect, (Rect{3, 4, 9, 7}));
  EXPECT_TRUE(rgb->lost.empty());
  EXPECT_EQ(rgb->pixels[(1 * 6 + 1) * 3], 255);
  EXPECT_EQ(rgb->pixels[(1 * 6 + 1) * 3 + 1], 2);

  sum.reset(PixelFamily::kI420, 21, 11);
  EXPECT_FALSE(test::rounded_sum(sum).has_value());
  Fragment f = plain(PixelFamily::kI420, {2, 2, 5, 5}, 1, 100, -100);
  f.lost.assign(9, 200);
  ASSERT_TRUE(sum.add(f));
  ASSERT_TRUE(sum.add(f));
  ASSERT_TRUE(sum.add_missing_weights({1, 3, 2, 4}, {0.5f}));
  const std::optional<Fragment> ycc = test::rounded_sum(sum);
  ASSERT_TRUE(ycc.has_value());
  EXPECT_EQ(ycc->rect, (Rect{0, 2, 5, 5}));
  EXPECT_EQ(ycc->pixels.size(), packed_size(PixelFamily::kI420, 5, 3));
  EXPECT_EQ(static_cast<int8_t>(ycc->pixels[15 + 1]), 127);
  EXPECT_EQ(static_cast<int8_t>(ycc->pixels[15 + 6 + 1]), -128);
  EXPECT_EQ(ycc->lost[0 * 5 + 2], 255);
  EXPECT_EQ(ycc->lost[1 * 5 + 1], 128);
}

TEST(Accumulator, HostileInputSaturates) {
  for (const PixelFamily family : kFamilies) {
    Accumulator sum = empty_sum(family, 3, 3);
    Fragment high = plain(family, {0, 0, 3, 3}, 255, 127, 127), low = plain(family, {0, 0, 3, 3}, 255, -128, -128);
    high.lost.assign(9, 255);
    for (int i = 0; i < 1000; i++) ASSERT_TRUE(sum.add(high));
    EXPECT_EQ(sum.resolve({4, 4, 4}).data()[0], 4);
    sum.reset(family, 3, 3);
    high.lost.clear();
    for (int i = 0; i < 1000; i++) ASSERT_TRUE(sum.add(high));
    const Image image = sum.resolve();
    EXPECT_EQ(image.data().front(), 255);
    if (family == PixelFamily::kRgb) continue;
    EXPECT_EQ(image.plane(1)[0], 255);
    sum.reset(family, 3, 3);
    for (int i = 0; i < 1000; i++) ASSERT_TRUE(sum.add(low));
    EXPECT_EQ(sum.resolve().plane(2)[0], 0);
  }
}

TEST(Accumulator, ChromaOfTwoPicturesDoesNotSaturate) {
  Accumulator sum = empty_sum(PixelFamily::kI420, 2, 2);
  for (int i = 0; i < 2; i++) ASSERT_TRUE(sum.add(plain(PixelFamily::kI420, {0, 0, 2, 2}, 255, 127, -128)));
  for (int i = 0; i < 2; i++) ASSERT_TRUE(sum.add(plain(PixelFamily::kI420, {0, 0, 2, 2}, 0, -127, 127)));
  const Image image = sum.resolve();
  EXPECT_EQ(image.plane(1)[0], 128);
  EXPECT_EQ(image.plane(2)[0], 126);
}

TEST(Accumulator, RejectsWhatDoesNotFit) {
  Accumulator none;
  EXPECT_FALSE(none.add(plain(PixelFamily::kRgb, {0, 0, 1, 1}, 0, 0, 0)));
  EXPECT_FALSE(none.add_missing_weights({0, 0, 1, 1}, {1.f}));
  for (const PixelFamily family : kFamilies) {
    Accumulator sum = empty_sum(family, 8, 6);
    for (const Rect& r : {Rect{-2, 0, 2, 2}, {0, -2, 2, 2}, {6, 0, 9, 2}, {0, 4, 2, 7}, {8, 0, 10, 2}, {2, 2, 2, 4}})
      EXPECT_FALSE(sum.add(blank(family, r))) << r.x0 << ' ' << r.y0;
    EXPECT_FALSE(sum.add(Fragment{.family = family, .rect = {4, 4, 2, 2}}));
    Fragment f = blank(family, {0, 0, 4, 4});
    f.pixels.pop_back();
    EXPECT_FALSE(sum.add(f));
    f = blank(family, {0, 0, 4, 4});
    f.lost.assign(15, 1);
    EXPECT_FALSE(sum.add(f));
    EXPECT_EQ(sum.add(blank(family, {1, 0, 4, 4})), family == PixelFamily::kRgb);
    EXPECT_EQ(sum.add(blank(family, {0, 3, 4, 4})), family == PixelFamily::kRgb);
    EXPECT_FALSE(sum.add(blank(family == PixelFamily::kRgb ? PixelFamily::kI420 : PixelFamily::kRgb, {0, 0, 4, 4})));
    EXPECT_FALSE(sum.add_missing_weights({0, 0, 2, 2}, {1.f, 1.f, 1.f}));
    EXPECT_FALSE(sum.add_missing_weights({7, 0, 9, 1}, {1.f, 1.f}));
    EXPECT_EQ(sum.resolve().data()[0], 0);
  }
}

TEST(Accumulator, MissingWeightsOfACameraEqualMissingWeight) {
  Accumulator sum = empty_sum(PixelFamily::kRgb, 4, 1);
  ASSERT_TRUE(sum.add(plain(PixelFamily::kRgb, {0, 0, 4, 1}, 100, 50, 10)));
  ASSERT_TRUE(sum.add_missing_weights({1, 0, 4, 1}, {0.5f, std::nanf(""), 7.f}));
  const Image image = sum.resolve({1, 2, 3});
  EXPECT_EQ(image.pixel(0, 0)[0], 100);
  EXPECT_EQ(image.pixel(1, 0)[0], 200);
  EXPECT_EQ(image.pixel(2, 0)[0], 100);
  EXPECT_EQ(image.pixel(3, 0)[0], 1);
}

TEST(Accumulator, ChromaUsesTheMeanMissingWeight) {
  Accumulator sum = empty_sum(PixelFamily::kI420, 3, 3);
  Fragment f = plain(PixelFamily::kI420, {0, 0, 3, 3}, 40, 30, -30);
  f.lost = {0, 100, 51, 100, 200, 51, 0, 255, 127};
  ASSERT_TRUE(sum.add(f));
  const Image image = sum.resolve({255, 255, 255});
  EXPECT_EQ(image.plane(0)[1], 66);        // 40 * 255 / 155
  EXPECT_EQ(image.plane(1)[0], 128 + 49);  // mean of 0, 100, 100, 200
  EXPECT_EQ(image.plane(2)[0], 128 - 49);
  EXPECT_EQ(image.plane(1)[1], 128 + 38);  // 51 twice, slightly more than a fifth in units of 1/32768: 37.5006
  EXPECT_EQ(image.plane(2)[1], 128 - 38);
  EXPECT_EQ(image.plane(1)[2], 128 + 30);  // half the background's grey, half 30 * 255 / 127.5
  EXPECT_EQ(image.plane(0)[7], 255);
}

TEST(Accumulator, BackgroundIsConvertedToYCbCr) {
  Accumulator sum = empty_sum(PixelFamily::kI420, 3, 3);
  Fragment f = blank(PixelFamily::kI420, {0, 0, 3, 3});
  f.lost.assign(9, 255);
  ASSERT_TRUE(sum.add(f));
  for (const Background& b :
       {Background{0, 0, 0}, {255, 255, 255}, {255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {12, 200, 99}}) {
    Image rgb(PixelFamily::kRgb, 3, 3);
    for (int i = 0; i < 9; i++) {
      rgb.pixel(i % 3, i / 3)[0] = b.r;
      rgb.pixel(i % 3, i / 3)[1] = b.g;
      rgb.pixel(i % 3, i / 3)[2] = b.b;
    }
    const Image expected = to_i420(rgb), image = sum.resolve(b);
    EXPECT_EQ(image.data(), expected.data());
  }
}

TEST(Accumulator, UncoveredPixelsShowTheBackground) {
  Rig rig;
  rig.cameras.resize(3);
  const Vec3 centres[3] = {{-0.5, -0.5, 0}, {0.5, -0.5, 0}, {-0.5, 0.5, 0}};
  for (int i = 0; i < 3; i++) {
    rig.cameras[i].width = rig.cameras[i].height = 8;
    rig.cameras[i].lens = Lens::pinhole(8, 3.5, 3.5);
    rig.cameras[i].pose.position = centres[i];
  }
  Mesh mesh;
  mesh.faces.push_back({.camera = {0, 1, 2}});
  View view;
  view.width = 15;
  view.height = 9;
  view.lens = Lens::pinhole(10, 7, 4);
  view.pose.position = {0, 0, -1};
  view.focus.plane = focal_plane_at(view.pose, 3);
  view.blending.extrapolates = false;
  const ViewPlan plan(rig, mesh, view);
  const Rect whole{0, 0, 15, 9};
  const FaceIdMap owners(plan, whole);

  for (const PixelFamily family : kFamilies) {
    Accumulator sum = empty_sum(family, 15, 9);
    ASSERT_TRUE(sum.add(plain(family, whole, 90, 50, 40)));
    sum.set_uncovered(owners);
    const Background white{255, 255, 255};
    const Image image = sum.resolve(white);
    const int step = family == PixelFamily::kRgb ? 3 : 1;
    int covered = 0;
    for (int i = 0; i < 15 * 9; i++) {
      const bool owned = owners.at(i % 15, i / 15) != FaceIdMap::kNone;
      covered += owned;
      EXPECT_EQ(image.data()[i * step], owned ? 90 : 255) << i;
    }
    EXPECT_GT(covered, 20);
    EXPECT_LT(covered, 15 * 9 - 20);
    if (family == PixelFamily::kI420)
      for (int cy = 0; cy < 5; cy++)
        for (int cx = 0; cx < 8; cx++) {
          int n = 0, hidden = 0;
          for (int y = 2 * cy; y < std::min(2 * cy + 2, 9); y++)
            for (int x = 2 * cx; x < std::min(2 * cx + 2, 15); x++, n++) hidden += owners.at(x, y) == FaceIdMap::kNone;
          EXPECT_NEAR(image.plane(1)[cy * 8 + cx], 128 + 50. * (n - hidden) / n, 0.501);
        }
    EXPECT_THROW(sum.set_uncovered(FaceIdMap(plan, {0, 0, 15, 8})), Error);
    sum.reset(family, 15, 9);
    EXPECT_EQ(sum.resolve(white).data()[0], 0);
  }
}

TEST(Accumulator, WritesAnyLayoutAndStride) {
  std::mt19937 random(5);
  Accumulator sum = empty_sum(PixelFamily::kRgb, 9, 4);
  ASSERT_TRUE(sum.add(random_fragment(PixelFamily::kRgb, 9, 4, random, 255, true)));
  const Image expected = sum.resolve({7, 8, 9});
  for (const RgbLayout& layout : {RgbLayout{3, 2, 1, 0}, {4, 0, 1, 2}, {4, 2, 1, 0}, {4, 1, 2, 3}, {4, 3, 2, 1}}) {
    const ptrdiff_t stride[3] = {9 * layout.pixel_stride + 5, 0, 0};
    std::vector<uint8_t> bytes(stride[0] * 4, 0x55);
    uint8_t* plane[3] = {bytes.data(), nullptr, nullptr};
    sum.resolve({7, 8, 9}, layout, plane, stride);
    for (int y = 0; y < 4; y++) {
      for (int x = 0; x < 9; x++) {
        const uint8_t* p = &bytes[y * stride[0] + x * layout.pixel_stride];
        EXPECT_EQ(p[layout.r], expected.pixel(x, y)[0]);
        EXPECT_EQ(p[layout.g], expected.pixel(x, y)[1]);
        EXPECT_EQ(p[layout.b], expected.pixel(x, y)[2]);
        if (layout.pixel_stride == 4) {
          EXPECT_EQ(p[6 - layout.r - layout.g - layout.b], 255);
        }
      }
      EXPECT_EQ(bytes[y * stride[0] + stride[0] - 1], 0x55);
    }
  }
}

TEST(Accumulator, ResetClearsTheState) {
  Accumulator sum = empty_sum(PixelFamily::kRgb, 4, 4);
  Fragment f = plain(PixelFamily::kRgb, {0, 0, 4, 4}, 9, 9, 9);
  f.lost.assign(16, 9);
  ASSERT_TRUE(sum.add(f));
  sum.reset(PixelFamily::kI420, 5, 2);
  EXPECT_FALSE(test::rounded_sum(sum).has_value());
  const Image image = sum.resolve({255, 255, 255});
  EXPECT_EQ(image.family(), PixelFamily::kI420);
  EXPECT_TRUE(std::all_of(image.plane(0), image.plane(0) + 10, [](uint8_t v) { return v == 0; }));
  EXPECT_TRUE(std::all_of(image.plane(1), image.plane(1) + 6, [](uint8_t v) { return v == 128; }));
}

struct Sums {
  Sums(PixelFamily family, const Rect& rect, bool with_lost)
      : samples(packed_size(family, rect.width(), rect.height())), lost(with_lost ? area(rect) : 0) {
    planes = packed_sums(family, rect, samples.data(), with_lost ? lost.data() : nullptr);
  }
  ConstSumPlanes view() const {
    return packed_sums<const int16_t, const uint16_t>(planes.family, planes.rect, samples.data(),
                                                      lost.empty() ? nullptr : lost.data());
  }
  std::vector<int16_t> samples;
  std::vector<uint16_t> lost;
  SumPlanes planes;
};

Sums random_sums(PixelFamily family, const Rect& rect, std::mt19937& random, int most, bool lost) {
  Sums out(family, rect, lost);
  const size_t signed_from = family == PixelFamily::kI420 ? area(rect) : out.samples.size();
  for (size_t i = 0; i < out.samples.size(); i++)
    out.samples[i] = static_cast<int16_t>(static_cast<int>(random() % (most + 1)) - (i >= signed_from ? most / 2 : 0));
  for (uint16_t& v : out.lost) v = static_cast<uint16_t>(random() % 3 ? 0 : random() % (most + 1));
  return out;
}

TEST(AccumulatorSums, SixteenBitsAreExactUntilThePictureIsRounded) {
  // Contributions in double precision, each rounded to 1/128 of a level: the sum of n contributions is within n halves
  // of that.
  std::mt19937 random(21);
  const int kCount = 8, w = 37, h = 19;
  for (const PixelFamily family : kFamilies) {
    std::vector<double> exact(packed_size(family, w, h));
    Accumulator sum = empty_sum(family, w, h);
    for (int i = 0; i < kCount; i++) {
      Sums part(family, {0, 0, w, h}, false);
      for (size_t k = 0; k < exact.size(); k++) {
        const double v = (random() % 1000000) / 1e6 * 255 / kCount;
        exact[k] += v;
        part.samples[k] = static_cast<int16_t>(std::lround(v * 128));
      }
      ASSERT_TRUE(sum.add(part.view()));
    }
    const std::optional<ConstSumPlanes> sums = sum.sums();
    ASSERT_TRUE(sums.has_value());
    for (size_t k = 0; k < exact.size(); k++)  // planes of the whole picture are contiguous
      ASSERT_NEAR(sums->plane[0][k] / 128., exact[k], kCount * 0.5 / 128);
    const Image image = sum.resolve();
    for (int y = 0; y < h; y++)
      for (int x = 0; x < w; x++) {
        const size_t k = static_cast<size_t>(y) * w + x;
        const int value = family == PixelFamily::kRgb ? image.pixel(x, y)[0] : image.plane(0)[k];
        ASSERT_NEAR(value, exact[k], 0.5 + kCount * 0.5 / 128);
      }
  }
}

TEST(AccumulatorSums, EightAndSixteenBitsInAnyOrder) {
  std::mt19937 random(22);
  for (const PixelFamily family : kFamilies) {
    std::vector<Fragment> fragments;
    std::vector<Sums> sums;
    for (int i = 0; i < 6; i++) {
      const bool lost = i % 2;
      fragments.push_back(random_fragment(family, 41, 23, random, 20, lost));
      sums.push_back(random_sums(family, random_fragment(family, 41, 23, random, 0, false).rect, random, 2000, lost));
    }
    std::vector<int> order(12);
    for (int i = 0; i < 12; i++) order[i] = i;
    std::vector<uint8_t> first;
    for (int round = 0; round < 6; round++) {
      Accumulator sum = empty_sum(family, 41, 23);
      for (const int i : order) ASSERT_TRUE(i < 6 ? sum.add(fragments[i]) : sum.add(sums[i - 6].view()));
      const Image image = sum.resolve({5, 6, 7});
      if (round == 0) first = image.data();
      EXPECT_EQ(image.data(), first);
      std::shuffle(order.begin(), order.end(), random);
    }
  }
}

TEST(AccumulatorSums, EightBitFragmentsAreSumsWithoutFraction) {
  std::mt19937 random(23);
  for (const PixelFamily family : kFamilies) {
    const Fragment f = random_fragment(family, 33, 21, random, 255, true);
    Accumulator eight, sixteen;
    eight.reset(family, 33, 21);
    sixteen.reset(family, 33, 21);
    ASSERT_TRUE(eight.add(f));
    ASSERT_TRUE(sixteen.add(*eight.sums()));
    EXPECT_EQ(eight.sums()->rect, f.rect);
    EXPECT_EQ(*test::rounded_sum(sixteen), f);
  }
}

TEST(AccumulatorSums, BorrowedSumsMakeTheSamePicture) {
  std::mt19937 random(24);
  for (const PixelFamily family : kFamilies)
    for (const bool lost : {false, true}) {
      const Rect all{0, 0, 31, 18};
      const Sums whole = random_sums(family, all, random, 20000, lost);
      const Fragment more = random_fragment(family, 31, 18, random, 60, true);
      Accumulator kept, copied;
      for (Accumulator* sum : {&kept, &copied}) sum->reset(family, 31, 18);
      ASSERT_TRUE(kept.add_borrowed(whole.view()));
      ASSERT_TRUE(copied.add(whole.view()));
      EXPECT_EQ(kept.sums()->plane[0], whole.samples.data());
      EXPECT_NE(copied.sums()->plane[0], whole.samples.data());
      EXPECT_EQ(kept.resolve({1, 2, 3}).data(), copied.resolve({1, 2, 3}).data());
      for (Accumulator* sum : {&kept, &copied}) {
        ASSERT_TRUE(sum->add(more));
        ASSERT_TRUE(sum->add_borrowed(whole.view()));
        ASSERT_TRUE(sum->add_missing_weights({3, 3, 5, 4}, {0.25f, 1.f}));
      }
      EXPECT_NE(kept.sums()->plane[0], whole.samples.data());
      EXPECT_EQ(kept.resolve({1, 2, 3}).data(), copied.resolve({1, 2, 3}).data());
      EXPECT_FALSE(kept.add_borrowed(random_sums(family, {0, 0, 32, 18}, random, 9, false).view()));
    }
}

TEST(AccumulatorSums, HostileSumsSaturate) {
  for (const PixelFamily family : kFamilies)
    for (const int16_t value : {int16_t{INT16_MAX}, int16_t{INT16_MIN}}) {
      Sums extreme(family, {0, 0, 4, 4}, true);
      std::ranges::fill(extreme.samples, value);
      std::ranges::fill(extreme.lost, uint16_t{20000});
      Accumulator sum = empty_sum(family, 4, 4);
      for (int i = 0; i < 5; i++) ASSERT_TRUE(sum.add(extreme.view()));
      EXPECT_EQ(sum.sums()->plane[0][0], value);
      EXPECT_EQ(sum.sums()->plane[1][0], value);
      EXPECT_EQ(sum.sums()->lost[3], UINT16_MAX);
      EXPECT_EQ(sum.resolve({9, 9, 9}).data()[0], 9);
    }
}

}  // namespace
}  // namespace lf::test
