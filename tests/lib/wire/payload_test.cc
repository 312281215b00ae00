// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/payload.h"

#include <gtest/gtest.h>

namespace lf::wire {
namespace {

FragmentHeader fragment(PixelFamily family, const Rect& rect, Codec codec, bool lost) {
  return {3, family, rect, codec, 0, lost};
}

TEST(Payload, RawSizesAreThoseOfTheSpec) {
  const Rect rect{2, 2, 7, 5};  // 5 x 3
  const struct {
    PixelFamily family;
    Codec codec;
    bool lost;
    size_t size;
  } rows[] = {{PixelFamily::kRgb, Codec::kRaw, false, 45},    {PixelFamily::kRgb, Codec::kRaw, true, 60},
              {PixelFamily::kI420, Codec::kRaw, false, 27},   {PixelFamily::kI420, Codec::kRaw, true, 42},
              {PixelFamily::kRgb, Codec::kRaw16, false, 90},  {PixelFamily::kRgb, Codec::kRaw16, true, 120},
              {PixelFamily::kI420, Codec::kRaw16, false, 54}, {PixelFamily::kI420, Codec::kRaw16, true, 84}};
  for (const auto& row : rows) EXPECT_EQ(raw_size(fragment(row.family, rect, row.codec, row.lost)), row.size);
}

TEST(Payload, PlanesLieOneAfterTheOther) {
  alignas(2) uint8_t bytes[120];
  const Rect rect{2, 2, 7, 5};
  const FragmentPlanes raw = raw_planes(fragment(PixelFamily::kI420, rect, Codec::kRaw, true), bytes);
  EXPECT_EQ(raw.plane[1] - raw.plane[0], 15);
  EXPECT_EQ(raw.plane[2] - raw.plane[1], 6);
  EXPECT_EQ(raw.lost - raw.plane[2], 6);
  EXPECT_EQ(raw.stride[1], 3);
  const SumPlanes ycc = raw16_planes(fragment(PixelFamily::kI420, rect, Codec::kRaw16, true), bytes);
  EXPECT_EQ(ycc.plane[2] - ycc.plane[0], 21);
  EXPECT_EQ(reinterpret_cast<uint8_t*>(ycc.lost) - bytes, 54);
  const SumPlanes rgb = raw16_planes(fragment(PixelFamily::kRgb, rect, Codec::kRaw16, false), bytes);
  EXPECT_EQ(rgb.plane[2] - rgb.plane[0], 30);
  EXPECT_EQ(rgb.stride[2], 5);
  EXPECT_EQ(rgb.lost, nullptr);
}

TEST(Payload, ScansAreSplitAtTheirLength) {
  const uint8_t bytes[] = {0, 0, 0, 2, 10, 11, 12};
  EXPECT_EQ(split_scans(bytes, false)->pixels.size(), 7u);
  const std::optional<Scans> two = split_scans(bytes, true);
  ASSERT_TRUE(two.has_value());
  EXPECT_EQ(two->pixels.data(), bytes + 4);
  EXPECT_EQ(two->pixels.size(), 2u);
  EXPECT_EQ(two->lost.size(), 1u);
  EXPECT_FALSE(split_scans(std::span(bytes).first(5), true).has_value());
  EXPECT_FALSE(split_scans(std::span(bytes).first(3), true).has_value());
  EXPECT_FALSE(split_scans({}, true).has_value());
}

}  // namespace
}  // namespace lf::wire
