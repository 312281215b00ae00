// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image_copy.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace lf {
namespace {

TEST(ImageCopy, OfInterleavedColoursIsOnePlane) {
  std::vector<uint8_t> pixels(5 * 40);
  ImageView image{PixelFamily::kRgb, 7, 5, {4, 2, 1, 0}, {pixels.data()}, {40}};
  ByteBuffer memory;
  int planes = 0;
  const ImageView copy = write_copy(image, {1, 2, 6, 5}, memory, [&](const PlaneCopy& plane) {
    planes++;
    EXPECT_EQ(plane.from, pixels.data());
    EXPECT_EQ(plane.to, memory.data());
    EXPECT_EQ(plane.stride, 40);
    EXPECT_EQ(plane.step, 4);
    EXPECT_EQ(plane.width, 7);
    EXPECT_EQ(plane.height, 5);
    EXPECT_EQ(plane.part, (Rect{1, 2, 6, 5}));
    EXPECT_EQ(plane.index, 0);
  });
  EXPECT_EQ(planes, 1);
  EXPECT_EQ(memory.size(), 200u);
  EXPECT_EQ(copy.plane[0], memory.data());
  EXPECT_EQ(copy.stride[0], 40);
  EXPECT_EQ(copy.layout, image.layout);
}

TEST(ImageCopy, OfPlanesCoversTheirHalves) {
  const Image odd(PixelFamily::kI420, 7, 5);
  const ImageView image = odd.view();
  ByteBuffer memory;
  std::vector<PlaneCopy> planes;
  const ImageView copy =
      write_copy(image, {2, 2, 7, 5}, memory, [&](const PlaneCopy& plane) { planes.push_back(plane); });
  ASSERT_EQ(planes.size(), 3u);
  EXPECT_EQ(memory.size(), 7u * 5 + 2 * 4 * 3);
  for (int c = 0; c < 3; c++) {
    EXPECT_EQ(planes[c].index, c);
    EXPECT_EQ(planes[c].from, image.plane[c]);
    EXPECT_EQ(planes[c].to, copy.plane[c]);
    EXPECT_EQ(planes[c].step, 1);
    EXPECT_EQ(planes[c].width, c == 0 ? 7 : 4);
    EXPECT_EQ(planes[c].height, c == 0 ? 5 : 3);
    EXPECT_EQ(planes[c].part, c == 0 ? (Rect{2, 2, 7, 5}) : (Rect{1, 1, 4, 3}));
    EXPECT_EQ(copy.plane[c] - memory.data(), image.plane[c] - image.plane[0]);
  }
}

TEST(ImageCopy, LeavesAloneWhatNobodyWrites) {
  const Image grey(PixelFamily::kRgb, 4, 4);
  ByteBuffer memory(4 * 4 * 3, 9);
  write_copy(grey.view(), {0, 1, 4, 2}, memory, [](const PlaneCopy& plane) {
    std::memset(plane.to + plane.part.y0 * plane.stride, 1, plane.part.width() * plane.step);
  });
  for (size_t i = 0; i < memory.size(); i++) EXPECT_EQ(memory[i], i / 12 == 1 ? 1 : 9);
}

}  // namespace
}  // namespace lf
