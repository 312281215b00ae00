// SPDX-License-Identifier: LGPL-2.1-or-later
#include "composite/answer_coverage.h"
#include "render/sum_planes.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(DisjointRects, RejectsOverlaps) {
  constexpr int kWidth = 300, kHeight = 200;
  std::mt19937 random(3);
  for (const int largest : {4, 20, 150}) {
    DisjointRects rects;
    std::vector<bool> taken(kWidth * kHeight);
    size_t added = 0;
    for (int i = 0; i < 3000; i++) {
      const int x = static_cast<int>(random() % kWidth), y = static_cast<int>(random() % kHeight);
      const Rect rect{x, y, std::min(kWidth, x + 1 + static_cast<int>(random() % largest)),
                      std::min(kHeight, y + 1 + static_cast<int>(random() % largest))};
      bool meets = false;
      for (int v = rect.y0; v < rect.y1; v++)
        for (int u = rect.x0; u < rect.x1; u++) meets = meets || taken[static_cast<size_t>(v * kWidth + u)];
      ASSERT_EQ(rects.meets(rect), meets) << i;
      ASSERT_EQ(rects.add(rect), !meets) << i;
      if (meets) continue;
      added++;
      for (int v = rect.y0; v < rect.y1; v++)
        for (int u = rect.x0; u < rect.x1; u++) taken[static_cast<size_t>(v * kWidth + u)] = true;
    }
    EXPECT_EQ(rects.rects().size(), added);
    EXPECT_TRUE(largest == 150 || added > DisjointRects::kFew);
  }
}

TEST(DisjointRects, ManyRectanglesAreFast) {
  DisjointRects rects;
  for (int i = 0; i < 65536; i++) ASSERT_TRUE(rects.add({i % 256 * 4, i / 256 * 4, i % 256 * 4 + 4, i / 256 * 4 + 4}));
  for (int i = 0; i < 65536; i++) ASSERT_TRUE(rects.meets({i % 256 * 4, 0, i % 256 * 4 + 1, 2000}));
  EXPECT_FALSE(rects.meets({1024, 0, 2000, 2000}));
  EXPECT_FALSE(rects.meets({0, 1024, 2000, 2000}));
}

const CameraRanges kRow(CameraSet{4, 5, 6, 7});

bool add(Coverage& coverage, const CameraRanges& cameras, const Rect& rect) {
  return Coverage::Sums(coverage, cameras).add(rect);
}

TEST(Coverage, AcceptsStripsOfACameraOnce) {
  Coverage coverage;
  EXPECT_TRUE(coverage.add(3, {0, 0, 10, 4}));
  EXPECT_TRUE(coverage.add(3, {0, 4, 10, 8}));
  EXPECT_FALSE(coverage.add(3, {9, 7, 12, 9}));
  EXPECT_TRUE(coverage.add(2, {9, 7, 12, 9}));
  EXPECT_TRUE(coverage.has(3));
  EXPECT_FALSE(coverage.has(4));
}

TEST(Coverage, SumCountsForItsCameras) {
  Coverage coverage;
  EXPECT_TRUE(add(coverage, kRow, {0, 0, 10, 4}));
  EXPECT_FALSE(coverage.add(5, {5, 0, 20, 4}));
  EXPECT_TRUE(coverage.add(5, {5, 4, 20, 8}));
  EXPECT_TRUE(coverage.add(8, {0, 0, 10, 4}));
  EXPECT_FALSE(add(coverage, CameraRanges(CameraSet{7, 9}), {0, 3, 1, 9}));
  EXPECT_FALSE(add(coverage, CameraRanges(CameraSet{5, 9}), {5, 6, 6, 9}));
  EXPECT_TRUE(add(coverage, CameraRanges(CameraSet{6, 9}), {5, 6, 6, 9}));
  EXPECT_TRUE(coverage.has(6));
  coverage.clear();
  EXPECT_FALSE(coverage.has(6));
  EXPECT_TRUE(coverage.add(5, {5, 0, 20, 4}));
}

// An answer with the maximum number of fragments, and many sets of many camera ranges: searching all sets for each
// fragment would take minutes.
TEST(Coverage, OtherSetsAreSearchedOncePerAnswer) {
  Coverage coverage;
  CameraRanges even;
  for (CameraIndex camera = 0; camera < 2000; camera += 2) even.append({camera, camera});
  for (int node = 0; node < 300; node++) {
    CameraRanges cameras = even;
    cameras.append({3000 + 2 * static_cast<CameraIndex>(node), 3000 + 2 * static_cast<CameraIndex>(node)});
    EXPECT_TRUE(add(coverage, cameras, {node, 0, node + 1, 1}));
  }
  const CameraRanges odd(CameraSet{2001}), both(CameraSet{3002, 3005});
  Coverage::Sums sums(coverage, odd), shared(coverage, both);
  int added = 0;
  for (int y = 0; y < 256; y++)
    for (int x = 0; x < 256; x++) added += sums.add({x, y, x + 1, y + 1});
  EXPECT_EQ(added, 256 * 256);
  EXPECT_FALSE(shared.add({1, 0, 2, 1})) << "already added by node 1";
  EXPECT_TRUE(shared.add({2, 0, 3, 1}));
  EXPECT_TRUE(coverage.has(2));
  EXPECT_FALSE(coverage.has(1));
}

TEST(Coverage, SubtractsReceivedWeights) {
  Coverage coverage;
  add(coverage, kRow, {0, 0, 4, 1});
  coverage.add(5, {3, 1, 9, 2});
  std::vector<float> own(4 * 3, 0.5f);
  coverage.subtract(5, {2, 0, 6, 3}, own);
  const float x = 0.5f;
  EXPECT_EQ(own, (std::vector<float>{0, 0, x, x, x, 0, 0, 0, x, x, x, x}));
  coverage.subtract(1, {2, 0, 6, 3}, own);
  EXPECT_EQ(own[2], x);
}

class CameraPixelsTest : public testing::Test {
 protected:
  CameraPixelsTest() {
    camera_.width = 21;
    camera_.height = 11;
  }
  bool add(const Rect& rect, uint8_t value = 7, CameraIndex camera = 3, PixelFamily family = PixelFamily::kI420) {
    const std::vector<uint8_t> bytes(3 * 21 * 11, value);
    return pixels_.add(camera, camera_, packed_planes(family, rect, bytes.data(), nullptr));
  }
  Camera camera_;
  CameraPixels pixels_;
};

TEST_F(CameraPixelsTest, AssemblesPieces) {
  EXPECT_TRUE(add({2, 2, 10, 6}, 50));
  EXPECT_FALSE(pixels_.has(3, {2, 2, 21, 6}));
  EXPECT_TRUE(add({10, 2, 21, 6}, 60));
  EXPECT_TRUE(pixels_.has(3, {2, 2, 21, 6}));
  EXPECT_TRUE(pixels_.has(3, {5, 3, 12, 4}));
  EXPECT_FALSE(pixels_.has(3, {0, 2, 21, 6}));
  EXPECT_FALSE(pixels_.has(4, {2, 2, 3, 3}));
  EXPECT_TRUE(add({0, 10, 1, 11}, 9, 1));
  EXPECT_EQ(pixels_.cameras(), (std::vector<CameraIndex>{1, 3}));
  const ImageView image = pixels_.image(3);
  EXPECT_EQ(image.width, 21);
  EXPECT_EQ(image.height, 11);
  EXPECT_EQ(image.plane[0][2 * image.stride[0] + 9], 50);
  EXPECT_EQ(image.plane[0][5 * image.stride[0] + 20], 60);
  EXPECT_EQ(image.plane[1][1 * image.stride[1] + 4], 50 + 128);
  EXPECT_EQ(image.plane[2][2 * image.stride[2] + 10], 60 + 128);
  pixels_.clear();
  EXPECT_TRUE(pixels_.cameras().empty());
}

TEST_F(CameraPixelsTest, RejectsInvalidPieces) {
  EXPECT_TRUE(add({2, 2, 10, 6}));
  EXPECT_FALSE(add({8, 4, 12, 8})) << "overlaps another piece";
  EXPECT_FALSE(add({10, 2, 22, 6})) << "outside";
  EXPECT_FALSE(add({12, 6, 12, 8})) << "empty";
  EXPECT_FALSE(add({12, 6, 14, 8}, 7, 3, PixelFamily::kRgb)) << "another family";
  EXPECT_TRUE(add({12, 6, 14, 8}));
}

}  // namespace
}  // namespace lf
