// SPDX-License-Identifier: LGPL-2.1-or-later

#include <jpeglib.h>

#include "jpeg/fragment_codec.h"
#include "lib/wire/wire_test.h"
#include "support/expect_error.h"
#include "support/fragments.h"

namespace lf::jpeg {
namespace {

std::vector<uint8_t> whole_file(const FragmentPlanes& in, int quality) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &data, &size);
  info.image_width = padded(in.rect.width(), kPixelUnit);
  info.image_height = padded(in.rect.height(), kPixelUnit);
  info.input_components = 3;
  info.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  info.raw_data_in = TRUE;
  jpeg_start_compress(&info, TRUE);
  std::vector<uint8_t> rows[3];
  for (unsigned y = 0; y < info.image_height; y += 16) {
    JSAMPROW lines[3][16];
    for (int c = 0; c < 3; c++) {
      const int half = c ? 2 : 1, n = 16 / half, width = static_cast<int>(info.image_width) / half;
      const int w = (in.rect.width() + half - 1) / half, h = (in.rect.height() + half - 1) / half;
      rows[c].resize(static_cast<size_t>(n) * width);
      for (int i = 0; i < n; i++) {
        lines[c][i] = &rows[c][static_cast<size_t>(i) * width];
        for (int x = 0; x < width; x++)
          lines[c][i][x] = static_cast<uint8_t>(
              in.plane[c][std::min(static_cast<int>(y) / half + i, h - 1) * in.stride[c] + std::min(x, w - 1)] +
              (c ? 128 : 0));
      }
    }
    JSAMPARRAY planes[3] = {lines[0], lines[1], lines[2]};
    jpeg_write_raw_data(&info, planes, 16);
  }
  jpeg_finish_compress(&info);
  std::vector<uint8_t> out(data, data + size);
  jpeg_destroy_compress(&info);
  free(data);
  return out;
}

TEST(JpegFragmentEncoder, WritesOnlyTheScan) {
  FragmentEncoder encoder;
  for (const auto& [w, h] : {std::pair{1, 1}, {16, 16}, {40, 30}, {97, 71}, {320, 240}})
    for (const int quality : {10, 75, 90, 100}) {
      const Fragment f = patterned(PixelFamily::kI420, {0, 0, w, h});
      const FragmentPlanes in = planes_of(f);
      ByteBuffer scan = {1, 2, 3};
      encoder.encode_pixels(in, quality, scan);
      ASSERT_EQ(scan[2], 3);
      const std::vector<uint8_t> file = whole_file(in, quality);
      // JFIF, DQT, SOF0, four DHT and SOS before the scan, EOI after: 625 bytes that need not be transmitted.
      const size_t markers = 2 + 18 + 2 * 69 + 19 + 2 * (33 + 183) + 14 + 2;
      EXPECT_EQ(scan.size() - 3, file.size() - markers) << w << 'x' << h;
      EXPECT_TRUE(std::equal(scan.begin() + 3, scan.end(), file.end() - 2 - (scan.size() - 3)));
    }
}

TEST(JpegFragmentEncoder, NoScanIsShorterThanStated) {
  FragmentEncoder encoder;
  for (const int size : {1, 16, 17, 100, 500})
    for (const int level : {0, 128, 255}) {
      Fragment f{PixelFamily::kI420, {0, 0, size, size}, {}, {}};
      f.pixels.assign(packed_size(f.family, size, size), 0);
      std::fill_n(f.pixels.begin(), size * size, static_cast<uint8_t>(level));
      f.lost.assign(static_cast<size_t>(size) * size, static_cast<uint8_t>(level));
      const FragmentPlanes in = planes_of(f);
      ByteBuffer pixels, lost;
      encoder.encode_pixels(in, 50, pixels);
      encoder.encode_missing(in, 50, lost);
      EXPECT_GE(pixels.size(), min_pixel_scan(coded_size(in.rect, kPixelUnit)));
      EXPECT_LE(pixels.size(), min_pixel_scan(coded_size(in.rect, kPixelUnit)) + 3);
      EXPECT_GE(lost.size(), min_missing_scan(coded_size(in.rect, kMissingUnit)));
      EXPECT_LE(lost.size(), min_missing_scan(coded_size(in.rect, kMissingUnit)) + 3);
    }
}

TEST(JpegFragmentEncoder, ReuseDoesNotChangeTheResult) {
  FragmentEncoder reused;
  const Fragment a = patterned(PixelFamily::kI420, {0, 0, 200, 100}, true),
                 b = patterned(PixelFamily::kI420, {0, 0, 40, 30}, true);
  const Fragment c = patterned(PixelFamily::kRgb, {0, 0, 40, 30});
  const std::vector<FragmentPlanes> all = {planes_of(a), planes_of(b), planes_of(c), planes_of(b)};
  for (const int quality : {90, 20, 90})
    for (const FragmentPlanes& in : all) {
      ByteBuffer one, other;
      reused.encode_pixels(in, quality, one);
      FragmentEncoder().encode_pixels(in, quality, other);
      EXPECT_EQ(one, other);
      if (!in.lost) continue;
      one.clear();
      other.clear();
      reused.encode_missing(in, quality, one);
      FragmentEncoder().encode_missing(in, quality, other);
      EXPECT_EQ(one, other);
    }
}

TEST(JpegFragmentEncoder, ErrorsLeaveTheOutputUnchanged) {
  FragmentEncoder encoder;
  const Fragment ycc = patterned(PixelFamily::kI420, {0, 0, 20, 20});
  ByteBuffer out = {7};
  EXPECT_ERROR(encoder.encode_pixels({}, 90, out), "JPEG", "pixel family");
  EXPECT_ERROR(encoder.encode_missing(planes_of(ycc), 90, out), "JPEG", "missing weight");
  const std::vector<uint8_t> rows(3 * 65536);
  const FragmentPlanes wide = packed_planes(PixelFamily::kI420, {0, 0, 65520, 2}, rows.data(), nullptr);
  EXPECT_ERROR(encoder.encode_pixels(wide, 90, out), "JPEG", "65500 pixels");
  EXPECT_EQ(out, ByteBuffer{7});
  encoder.encode_pixels(planes_of(ycc), 90, out);
  EXPECT_GT(out.size(), 1u);
}

constexpr PixelFamily kFamilies[] = {PixelFamily::kRgb, PixelFamily::kI420};

ByteBuffer pixels_scan(const FragmentPlanes& fragment, int quality) {
  ByteBuffer out;
  FragmentEncoder().encode_pixels(fragment, quality, out);
  return out;
}

// Stated bounds: the loss of a picture of the built-in scene per quality. RGB loses chroma resolution at every quality.
TEST(JpegFragmentDecoder, LosesNoMoreThanStated) {
  const struct {
    int quality;
    double psnr, chroma_psnr, rgb_psnr;
    int worst;
  } rows[] = {
      {50, 38, 40, 35, 60}, {75, 41, 42, 36, 45}, {90, 45, 45, 38, 30}, {95, 48, 47, 39, 20}, {100, 54, 51, 40, 8}};
  for (const PixelFamily family : kFamilies) {
    const std::vector<Fragment> fragments = weighted_fragments(family, 8, 320, 240, 12);
    const std::vector<FragmentPlanes> members = planes_of_all(fragments);
    FragmentDecoder decoder;
    for (const auto& row : rows) {
      Errors8 luma, chroma;
      for (const FragmentPlanes& member : members) {
        FragmentPlanes out = empty_like(member);
        ASSERT_TRUE(decoder.decode_pixels(pixels_scan(member, row.quality), row.quality, out));
        compare_pixels(member, out, luma, chroma);
      }
      const bool rgb = family == PixelFamily::kRgb;
      EXPECT_GE(luma.psnr(), rgb ? row.rgb_psnr : row.psnr) << "quality " << row.quality;
      if (rgb) continue;
      EXPECT_GE(chroma.psnr(), row.chroma_psnr) << "quality " << row.quality;
      EXPECT_LE(std::max(luma.worst, chroma.worst), row.worst) << "quality " << row.quality;
    }
  }
}

TEST(JpegFragmentDecoder, DecodesEverySize) {
  FragmentEncoder encoder;
  FragmentDecoder decoder;
  for (const PixelFamily family : kFamilies)
    for (const auto& [w, h] :
         {std::pair{1, 1}, {1, 40}, {40, 1}, {2, 2}, {15, 17}, {16, 16}, {17, 15}, {33, 47}, {129, 64}}) {
      const Fragment f = patterned(family, {2, 4, 2 + w, 4 + h}, true);
      const FragmentPlanes in = planes_of(f);
      ByteBuffer pixels, lost;
      encoder.encode_pixels(in, 95, pixels);
      encoder.encode_missing(in, 95, lost);
      FragmentPlanes out = empty_like(in);
      ASSERT_TRUE(decoder.decode_pixels(pixels, 95, out)) << w << 'x' << h;
      ASSERT_TRUE(decoder.decode_missing(lost, 95, out)) << w << 'x' << h;
      Errors8 luma, chroma, weight;
      compare_pixels(in, out, luma, chroma);
      compare_missing(in, out, weight);
      EXPECT_LE(luma.worst, family == PixelFamily::kRgb ? 40 : 12) << w << 'x' << h;
      EXPECT_LE(chroma.worst, 14) << w << 'x' << h;
      EXPECT_LE(weight.worst, 24) << w << 'x' << h;
    }
}

TEST(JpegFragmentDecoder, TruncatedScansAreDamaged) {
  for (const PixelFamily family : kFamilies) {
    const Fragment f = patterned(family, {0, 0, 60, 44});
    const ByteBuffer scan = pixels_scan(planes_of(f), 90);
    FragmentDecoder decoder;
    for (size_t n = 0; n < scan.size(); n++) {
      FragmentPlanes out{.family = family, .rect = f.rect};
      EXPECT_FALSE(decoder.decode_pixels(std::span(scan).first(n), 90, out)) << n;
      EXPECT_EQ(out.plane[0], nullptr);
    }
    FragmentPlanes out{.family = family, .rect = f.rect};
    EXPECT_TRUE(decoder.decode_pixels(scan, 90, out));
    ByteBuffer longer = scan;
    longer.resize(scan.size() + 16, 0x55);
    EXPECT_FALSE(decoder.decode_pixels(longer, 90, out));
    out.rect.y1 += 16;
    EXPECT_FALSE(decoder.decode_pixels(scan, 90, out));
    out.rect.y1 -= 32;
    EXPECT_FALSE(decoder.decode_pixels(scan, 90, out));
  }
}

TEST(JpegFragmentDecoder, RefusesImpossibleScans) {
  const Fragment f = patterned(PixelFamily::kI420, {0, 0, 30, 30});
  const ByteBuffer scan = pixels_scan(planes_of(f), 90);
  FragmentDecoder decoder;
  FragmentPlanes none, out = empty_like(planes_of(f));
  EXPECT_FALSE(decoder.decode_pixels(scan, 90, none));
  EXPECT_FALSE(decoder.decode_missing(scan, 90, none));
  EXPECT_FALSE(decoder.decode_pixels(scan, 0, out));
  EXPECT_FALSE(decoder.decode_pixels(scan, 101, out));
  out.rect = {5, 5, 5, 9};
  EXPECT_FALSE(decoder.decode_pixels(scan, 90, out));
  out.rect = {0, 0, 16384, 16384};
  EXPECT_FALSE(decoder.decode_pixels(scan, 90, out));
  out.rect = {0, 0, 70000, 1};
  EXPECT_FALSE(decoder.decode_pixels(ByteBuffer(70000, 0), 90, out));
}

// Markers in the scan have no effect; in particular they leave no other tables behind.
TEST(JpegFragmentDecoder, AcceptsArbitraryBytes) {
  std::mt19937 random(5);
  for (const PixelFamily family : kFamilies) {
    const Fragment f = patterned(family, {0, 0, 70, 50});
    const FragmentPlanes in = planes_of(f);
    const ByteBuffer scan = pixels_scan(in, 80);
    FragmentDecoder decoder;
    FragmentPlanes out = empty_like(in);
    ASSERT_TRUE(decoder.decode_pixels(scan, 80, out));
    const std::vector<uint8_t> first(out.plane[0], out.plane[0] + out.stride[0] * 50);
    int accepted = 0;
    for (int i = 0; i < 3000; i++) {
      ByteBuffer bad = scan;
      const size_t at = random() % bad.size();
      switch (i % 4) {
        case 0: bad[at] ^= static_cast<uint8_t>(1 << random() % 8); break;
        case 1: bad[at] = 0xff; break;
        case 2:  // a marker: restart, tables, another frame, EOI
          if (at + 3 < bad.size()) {
            const uint8_t markers[] = {0xd0, 0xc4, 0xdb, 0xc0, 0xd9, 0xda, 0xd8, 0xdd};
            bad[at] = 0xff;
            bad[at + 1] = markers[random() % 8];
          }
          break;
        case 3:
          for (size_t k = at; k < bad.size(); k++) bad[k] = static_cast<uint8_t>(random());
          break;
      }
      accepted += decoder.decode_pixels(bad, 80, out);
      decoder.decode_missing(bad, 80, out);
    }
    EXPECT_LT(accepted, 1500);  // flipped bits often decode to a valid picture
    ASSERT_TRUE(decoder.decode_pixels(scan, 80, out));
    EXPECT_EQ(first, std::vector<uint8_t>(out.plane[0], out.plane[0] + out.stride[0] * 50));
  }
}

}  // namespace
}  // namespace lf::jpeg
