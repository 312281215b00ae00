// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/fragment_encoder.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include "jpeg/coded_size.h"
#include "jpeg/scan.h"
#include "lib/jpeg/fragment_codec_fixture.h"
#include "support/expect_error.h"
#include "support/weighted_fragments.h"

namespace lf::jpeg {
namespace {

// A whole JPEG file of the same samples, by libjpeg's plain interface.
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

TEST(JpegFragmentEncoder, WritesTheScanOfAWholeFileAndNothingElse) {
  FragmentEncoder encoder;
  for (const auto& [w, h] : {std::pair{1, 1}, {16, 16}, {40, 30}, {97, 71}, {320, 240}})
    for (const int quality : {10, 75, 90, 100}) {
      const Fragment f = patterned(PixelFamily::kI420, {0, 0, w, h});
      const FragmentPlanes in = planes_of(f);
      ByteBuffer scan = {1, 2, 3};  // what is there stays
      encoder.encode_pixels(in, quality, scan);
      ASSERT_EQ(scan[2], 3);
      const std::vector<uint8_t> file = whole_file(in, quality);
      // JFIF, DQT, SOF0, four DHT, SOS in front, EOI behind: 625 bytes that need not travel.
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
      encoder.encode_lost(in, 50, lost);
      EXPECT_GE(pixels.size(), least_pixel_scan(coded_size(in.rect, kPixelUnit)));
      EXPECT_LE(pixels.size(), least_pixel_scan(coded_size(in.rect, kPixelUnit)) + 3);
      EXPECT_GE(lost.size(), least_lost_scan(coded_size(in.rect, kLostUnit)));
      EXPECT_LE(lost.size(), least_lost_scan(coded_size(in.rect, kLostUnit)) + 3);
    }
}

TEST(JpegFragmentEncoder, IsReusedWithoutATrace) {
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
      reused.encode_lost(in, quality, one);
      FragmentEncoder().encode_lost(in, quality, other);
      EXPECT_EQ(one, other);
    }
}

TEST(JpegFragmentEncoder, ErrorsAreThrownAndLeaveNothingBehind) {
  FragmentEncoder encoder;
  const Fragment ycc = patterned(PixelFamily::kI420, {0, 0, 20, 20});
  ByteBuffer out = {7};
  EXPECT_ERROR(encoder.encode_pixels({}, 90, out), "JPEG: a fragment of no family");
  EXPECT_ERROR(encoder.encode_lost(planes_of(ycc), 90, out), "JPEG: a fragment without lost weight");
  const std::vector<uint8_t> rows(3 * 65536);
  const FragmentPlanes wide = packed_planes(PixelFamily::kI420, {0, 0, 65520, 2}, rows.data(), nullptr);
  EXPECT_ERROR(encoder.encode_pixels(wide, 90, out), "JPEG: Maximum supported image dimension is 65500 pixels");
  EXPECT_EQ(out, ByteBuffer{7});
  encoder.encode_pixels(planes_of(ycc), 90, out);
  EXPECT_GT(out.size(), 1u);
}

}  // namespace
}  // namespace lf::jpeg
