// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/tiles.h"

#include <gtest/gtest.h>

#include <random>

#include "lib/wire/answers.h"
#include "wire/answer_writer.h"
#include "wire/payload.h"

namespace lf::wire {
namespace {

FragmentHeader raw(PixelFamily family, const Rect& rect, Codec codec = Codec::kRaw, bool lost = false) {
  return {3, family, rect, codec, 0, lost};
}

TEST(Tiles, StripsWhereRowsFillThem) {
  const std::optional<Tiling> rgb = tile_raw(raw(PixelFamily::kRgb, {10, 20, 110, 51}), 1000);
  ASSERT_TRUE(rgb.has_value());
  EXPECT_EQ(rgb->count(), 11u);  // three rows of 300 bytes each
  EXPECT_EQ(rgb->tile(0), (Rect{10, 20, 110, 23}));
  EXPECT_EQ(rgb->tile(10), (Rect{10, 50, 110, 51}));
  // Row pairs of 330 bytes; the last strip has a single row.
  const std::optional<Tiling> ycc = tile_raw(raw(PixelFamily::kI420, {10, 20, 120, 51}), 1000);
  EXPECT_EQ(ycc->count(), 6u);
  EXPECT_EQ(ycc->tile(1), (Rect{10, 26, 120, 32}));
  EXPECT_EQ(ycc->tile(5), (Rect{10, 50, 120, 51}));
}

TEST(Tiles, ColumnsWhereNoRowFits) {
  const std::optional<Tiling> rgb = tile_raw(raw(PixelFamily::kRgb, {0, 0, 1920, 2}, Codec::kRaw16), 1200);
  EXPECT_EQ(rgb->columns, 10);
  EXPECT_EQ(rgb->rows, 2);
  EXPECT_EQ(rgb->tile(11), (Rect{192, 1, 384, 2}));
  const std::optional<Tiling> ycc = tile_raw(raw(PixelFamily::kI420, {0, 0, 641, 3}, Codec::kRaw16, true), 1000);
  EXPECT_EQ(ycc->width % 2, 0);
  EXPECT_EQ(ycc->tile(ycc->count() - 1).x1, 641);
}

TEST(Tiles, AreWellFilled) {
  for (const int width : {33, 100, 215, 320, 433, 640, 1280, 1920})
    for (const PixelFamily family : {PixelFamily::kRgb, PixelFamily::kI420})
      for (const Codec codec : {Codec::kRaw, Codec::kRaw16}) {
        const FragmentHeader header = raw(family, {0, 0, width, 480}, codec);
        const std::optional<Tiling> tiling = tile_raw(header, 1290);
        EXPECT_GT(static_cast<double>(raw_size(header)) / static_cast<double>(1290 * tiling->count()), .8) << width;
      }
}

TEST(Tiles, NotWhereAPixelDoesNotFitNorInJpeg) {
  EXPECT_FALSE(tile_raw(raw(PixelFamily::kRgb, {0, 0, 4, 4}), 2).has_value());
  EXPECT_TRUE(tile_raw(raw(PixelFamily::kRgb, {0, 0, 4, 4}), 3).has_value());
  EXPECT_FALSE(tile_raw(raw(PixelFamily::kI420, {0, 0, 4, 4}), 5).has_value());
  FragmentHeader jpeg = raw(PixelFamily::kRgb, {0, 0, 4, 4}, Codec::kJpeg);
  jpeg.quality = 90;
  EXPECT_FALSE(tile_raw(jpeg, 1000).has_value());
}

// The value of one sample: which plane it is of, and where in it.
uint8_t value(int plane, int x, int y) { return static_cast<uint8_t>(37 * plane + 3 * x + 101 * y); }

// A payload in which every byte tells its place in the view.
std::vector<uint8_t> payload_of(const FragmentHeader& f) {
  std::vector<uint8_t> out;
  const auto plane = [&](int number, int bytes, int side) {
    for (int y = f.rect.y0 / side; y < (f.rect.y1 + side - 1) / side; y++)
      for (int x = f.rect.x0 / side; x < (f.rect.x1 + side - 1) / side; x++)
        for (int b = 0; b < bytes; b++) out.push_back(static_cast<uint8_t>(value(number, x, y) + b));
  };
  const int sample = f.codec == Codec::kRaw16 ? 2 : 1;
  if (f.family == PixelFamily::kRgb && sample == 1) {
    plane(0, 3, 1);
  } else {
    for (int c = 0; c < 3; c++) plane(c, sample, c > 0 && f.family == PixelFamily::kI420 ? 2 : 1);
  }
  if (f.has_lost) plane(7, sample, 1);
  return out;
}

TEST(Tiles, TogetherAreTheFragment) {
  std::mt19937 random(3);
  for (int round = 0; round < 400; round++) {
    const PixelFamily family = round % 2 ? PixelFamily::kRgb : PixelFamily::kI420;
    const int x = 2 * (random() % 20), y = 2 * (random() % 20);
    const Rect rect{x, y, x + 1 + static_cast<int>(random() % 80), y + 1 + static_cast<int>(random() % 30)};
    const FragmentHeader header = raw(family, rect, random() % 2 ? Codec::kRaw : Codec::kRaw16, random() % 2);
    const std::vector<uint8_t> payload = payload_of(header);
    ASSERT_EQ(payload.size(), raw_size(header));
    const FragmentView fragment{header, payload};
    const size_t most = 16 + random() % 600;
    const std::optional<Tiling> tiling = tile_raw(header, most);
    ASSERT_TRUE(tiling.has_value());
    std::vector<int> covered(80 * 90 * 90);
    for (size_t i = 0; i < tiling->count(); i++) {
      const Rect tile = tiling->tile(i);
      const FragmentHeader tile_of = tile_header(header, tile);
      EXPECT_LE(raw_size(tile_of), most);
      ASSERT_TRUE(family == PixelFamily::kRgb || (tile.x0 % 2 == 0 && tile.y0 % 2 == 0));
      std::vector<uint8_t> bytes(raw_size(tile_of));
      copy_tile(fragment, tile, bytes.data());
      EXPECT_EQ(bytes, payload_of(tile_of));
      for (int v = tile.y0; v < tile.y1; v++)
        for (int u = tile.x0; u < tile.x1; u++) covered[v * 200 + u]++;
    }
    for (int v = rect.y0; v < rect.y1; v++)
      for (int u = rect.x0; u < rect.x1; u++) ASSERT_EQ(covered[v * 200 + u], 1);
    EXPECT_EQ(std::ranges::count(covered, 1), rect.width() * rect.height());
  }
}

}  // namespace
}  // namespace lf::wire
