// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/fragment_codec.h"
#include "lib/wire/wire_test.h"
#include "support/answers.h"
#include "support/expect_error.h"
#include "wire/answer_codec.h"

namespace lf::wire {
namespace {

FragmentHeader raw(PixelFamily family, const Rect& rect, Codec codec = Codec::kRaw, bool lost = false) {
  return {3, family, rect, codec, 0, lost};
}

TEST(Tiles, AreStripsIfRowsFillThem) {
  const std::optional<Tiling> rgb = tile_raw(raw(PixelFamily::kRgb, {10, 20, 110, 51}), 1000);
  EXPECT_EQ(rgb.value().count(), 11u);  // three rows of 300 bytes each
  EXPECT_EQ(rgb->tile(0), (Rect{10, 20, 110, 23}));
  EXPECT_EQ(rgb->tile(10), (Rect{10, 50, 110, 51}));
  // Row pairs of 330 bytes; the last strip has a single row.
  const std::optional<Tiling> ycc = tile_raw(raw(PixelFamily::kI420, {10, 20, 120, 51}), 1000);
  EXPECT_EQ(ycc->count(), 6u);
  EXPECT_EQ(ycc->tile(1), (Rect{10, 26, 120, 32}));
  EXPECT_EQ(ycc->tile(5), (Rect{10, 50, 120, 51}));
}

TEST(Tiles, AreColumnsIfNoRowFits) {
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

TEST(Tiles, DoNotExistForJpegAndTooSmallSizes) {
  EXPECT_FALSE(tile_raw(raw(PixelFamily::kRgb, {0, 0, 4, 4}), 2).has_value());
  EXPECT_TRUE(tile_raw(raw(PixelFamily::kRgb, {0, 0, 4, 4}), 3).has_value());
  EXPECT_FALSE(tile_raw(raw(PixelFamily::kI420, {0, 0, 4, 4}), 5).has_value());
  FragmentHeader jpeg = raw(PixelFamily::kRgb, {0, 0, 4, 4}, Codec::kJpeg);
  jpeg.quality = 90;
  EXPECT_FALSE(tile_raw(jpeg, 1000).has_value());
}

uint8_t value(int plane, int x, int y) { return static_cast<uint8_t>(37 * plane + 3 * x + 101 * y); }

// A payload with bytes that identify their position in the view.
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
  if (f.has_missing) plane(7, sample, 1);
  return out;
}

TEST(Tiles, CoverTheFragment) {
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
    const auto tiling = tile_raw(header, most).value();
    std::vector<int> covered(80 * 90 * 90);
    for (size_t i = 0; i < tiling.count(); i++) {
      const Rect tile = tiling.tile(i);
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

constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

TEST(FragmentCodec, RoundTripsEveryQuality) {
  for (const PixelFamily family : kFamilies)
    for (const auto& [w, h] : {std::pair{40, 30}, {96, 72}, {1, 1}})
      for (const int quality : {0, 1, 50, 90, 100}) {
        const std::vector<Fragment> fragments = patterned_fragments(family, 9, w, h);
        const AnswerHeader header = header_of_view(family, 400, 400);
        const ByteBuffer bytes = encode_fragments(header, fragments, quality);
        const Answer answer = decode_answer(bytes).value();
        EXPECT_EQ(static_cast<const AnswerHeader&>(answer), header);
        ASSERT_EQ(answer.fragments.size(), fragments.size());
        jpeg::Errors8 luma, chroma, lost;
        for (size_t i = 0; i < fragments.size(); i++) {
          const Fragment &in = fragments[i], &out = answer.fragments[i];
          EXPECT_EQ(out.rect, in.rect);
          EXPECT_EQ(out.lost.empty(), in.lost.empty());
          EXPECT_TRUE(quality > 0 || out == in);
          jpeg::compare_pixels(planes_of(in), planes_of(out), luma, chroma);
          if (!in.lost.empty()) jpeg::compare_missing(planes_of(in), planes_of(out), lost);
        }
        EXPECT_GT(luma.psnr(), quality >= 90 ? 34 : 0) << w << 'x' << h << " quality " << quality;
        EXPECT_LE(lost.worst, 32) << w << 'x' << h << " quality " << quality;
        EXPECT_GT(lost.psnr(), 40) << w << 'x' << h << " quality " << quality;
      }
}

TEST(FragmentCodec, PixelsOfACameraAreInItsImage) {
  for (const PixelFamily family : kFamilies)
    for (const int quality : {0, 90}) {
      const Fragment pixels = jpeg::patterned(family, {200, 100, 296, 172}, false, 1);
      const AnswerHeader header = header_of_view(family, 40, 30);
      const std::vector<AnswerFragment> fragments{{5, planes_of(pixels)}};
      const ByteBuffer bytes = encode_fragments(header, fragments, quality);
      const AnswerView answer = parsed(bytes);
      ASSERT_EQ(answer.fragments.size(), 1u);
      EXPECT_EQ(answer.fragments[0].camera, 5u);
      EXPECT_EQ(answer.fragments[0].rect, pixels.rect);
      jpeg::Errors8 luma, chroma;
      FragmentDecoder decoder;
      jpeg::compare_pixels(planes_of(pixels), decoder.decode(answer.fragments[0]).value(), luma, chroma);
      EXPECT_LE(luma.worst, quality == 0 ? 0 : 255);
      EXPECT_GT(luma.psnr(), 34);
      std::string reason;
      EXPECT_FALSE(decode_answer(bytes, &reason));
      EXPECT_MENTIONS(reason, "fragments[0].camera", "sum");
    }
}

TEST(FragmentCodec, RefusesInvalidPixelsOfACamera) {
  const Fragment pixels = jpeg::patterned(PixelFamily::kRgb, {0, 0, 8, 8}, true, 1);
  const AnswerHeader header = header_of_view(PixelFamily::kRgb, 40, 30);
  const auto encode = [&](AnswerFragment fragment) { return encode_fragments(header, {&fragment, 1}, 0); };
  EXPECT_ERROR(encode({5, planes_of(pixels)}), "fragments[0].flags", "missing weight");
  Fragment whole = pixels;
  whole.lost.clear();
  whole.rect = {kMaxImageSize - 7, 0, kMaxImageSize + 1, 8};
  EXPECT_ERROR(encode({5, planes_of(whole)}), "fragments[0].rectangle", "inside");
}

TEST(FragmentCodec, DamageAffectsOneFragment) {
  const std::vector<Fragment> fragments = patterned_fragments(PixelFamily::kI420, 2, 40, 30);
  ByteBuffer bytes = encode_fragments(header_of_view(PixelFamily::kI420, 400, 400), fragments, 90);
  const AnswerView view = parsed(bytes);
  bytes[view.fragments[0].payload.data() - bytes.data() + 40] = 0xff;
  bytes[view.fragments[0].payload.data() - bytes.data() + 41] = 0xd9;
  FragmentDecoder decoder;
  EXPECT_FALSE(decoder.decode(view.fragments[0]));
  EXPECT_TRUE(decoder.decode(view.fragments[1]));
  std::string reason;
  EXPECT_FALSE(decode_answer(bytes, &reason).has_value());
  EXPECT_EQ(reason, "fragments[0].payload: damaged JPEG");
}

TEST(FragmentCodec, AlignedSumsAreNotCopied) {
  const int16_t samples[6] = {-1, 2, 300, -400, 32767, -32768};
  std::vector<uint8_t> memory(32);
  FragmentView f;
  f.family = PixelFamily::kRgb;
  f.rect = {3, 3, 5, 4};
  f.codec = Codec::kRaw16;
  FragmentDecoder decoder;
  for (size_t offset = 0; offset < 4; offset++) {
    std::memcpy(memory.data() + offset, samples, sizeof samples);
    f.payload = std::span(memory).subspan(offset, sizeof samples);
    bool copied;
    const ConstSumPlanes sums = decoder.sums(f, &copied);
    EXPECT_EQ(copied, offset % 2 == 1);
    EXPECT_EQ(reinterpret_cast<const uint8_t*>(sums.plane[0]) == f.payload.data(), !copied);
    for (int c = 0; c < 3; c++)
      for (int x = 0; x < 2; x++) EXPECT_EQ(sums.plane[c][x], samples[2 * c + x]);
    EXPECT_FALSE(decoder.decode(f));
  }
}

}  // namespace
}  // namespace lf::wire
