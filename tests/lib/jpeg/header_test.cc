// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/header.h"

#include "support/jpeg_samples.h"
#include "support/test.h"

namespace lf::jpeg {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes jpeg_of(const test::JpegKind& kind) { return test::encode_jpeg(test::noisy_picture(33, 17, 1), kind); }

Header header_of(const Bytes& jpeg) { return parse_header(jpeg, nullptr).value(); }

std::string reason_for(const Bytes& jpeg) {
  std::string reason;
  const auto header = parse_header(jpeg, &reason);
  return header ? "" : reason;
}

size_t find_marker(const Bytes& jpeg, int marker) {
  for (size_t at = 2;; at += 2 + (static_cast<size_t>(jpeg[at + 2]) << 8 | jpeg[at + 3]))
    if (jpeg[at + 1] == marker || jpeg[at + 1] == 0xda) return at;
}

TEST(JpegHeader, ParsesCameraFrames) {
  const Header header = header_of(jpeg_of({.restart_interval = 3}));
  EXPECT_EQ(header.width, 33);
  EXPECT_EQ(header.height, 17);
  EXPECT_EQ(header.components, 3);
  EXPECT_EQ(header.blocks_per_mcu(), 6);
  EXPECT_EQ(header.mcus_x(), 3);
  EXPECT_EQ(header.mcus_y(), 2);
  EXPECT_EQ(header.restart_interval, 3);
  EXPECT_TRUE(header.one_baseline_scan);
  EXPECT_EQ(header.ac[1], standard_ac(1));
}

TEST(JpegHeader, GreyMcuIsOneBlock) {
  const Header header = header_of(jpeg_of({.grey = true}));
  EXPECT_EQ(header.blocks_per_mcu(), 1);
  EXPECT_EQ(header.mcus_x(), 5);
  EXPECT_TRUE(header.one_baseline_scan);
}

TEST(JpegHeader, DetectsFramesWithoutRegionDecoding) {
  const test::JpegKind rgb{.h = 1, .v = 1, .rgb = true};
  for (const test::JpegKind& kind :
       {test::JpegKind{.progressive = true}, {.arithmetic = true}, {.one_by_one = true}, {.h = 4, .v = 1}, rgb})
    EXPECT_FALSE(header_of(jpeg_of(kind)).one_baseline_scan);
}

TEST(JpegHeader, StandardTablesEqualLibjpegs) {
  const Header with = header_of(jpeg_of({})), without = header_of(test::without_huffman_tables(jpeg_of({})));
  EXPECT_TRUE(std::ranges::equal(with.dc, without.dc));
  EXPECT_TRUE(std::ranges::equal(with.ac, without.ac));
}

TEST(JpegHeader, NamesUnsupportedKinds) {
  Bytes jpeg = jpeg_of({});
  const size_t sof = find_marker(jpeg, 0xc0);
  jpeg[sof + 4] = 12;
  EXPECT_MENTIONS(reason_for(jpeg), "precision 12");
  jpeg[sof + 4] = 8;
  jpeg[sof + 1] = 0xc3;
  EXPECT_MENTIONS(reason_for(jpeg), "SOF", "0xc3");
}

TEST(JpegHeader, DistinguishesUnsupportedKindsFromDamage) {
  Bytes jpeg = jpeg_of({});
  bool unsupported = true;
  EXPECT_FALSE(parse_header(std::span(jpeg).first(30), nullptr, &unsupported));
  EXPECT_FALSE(unsupported);
  jpeg[find_marker(jpeg, 0xc0) + 4] = 12;
  EXPECT_FALSE(parse_header(jpeg, nullptr, &unsupported));
  EXPECT_TRUE(unsupported);
}

TEST(JpegHeader, FourComponentsAreDecodedAsAWhole) {
  Bytes jpeg = jpeg_of({});
  const auto insert = [&jpeg](size_t at, const Bytes& bytes) {
    jpeg.insert(jpeg.begin() + static_cast<ptrdiff_t>(at), bytes.begin(), bytes.end());
  };
  const size_t sos = find_marker(jpeg, 0xda), sof = find_marker(jpeg, 0xc0);
  jpeg[sos + 3] += 2;
  jpeg[sos + 4] = 4;
  insert(sos + 11, {4, 0});
  jpeg[sof + 3] += 3;
  jpeg[sof + 9] = 4;
  insert(sof + 19, {4, 0x11, 0});
  EXPECT_FALSE(header_of(jpeg).one_baseline_scan);
}

TEST(JpegHeader, FramesAreIndependent) {
  const Bytes own = jpeg_of({.restart_interval = 3, .optimise = true}), later = jpeg_of({.one_by_one = true});
  const Header standard = header_of(test::without_huffman_tables(jpeg_of({})));
  for (int i = 0; i < 3; i++) {
    header_of(own);
    header_of(later);
    const Header bare = header_of(test::without_huffman_tables(jpeg_of({})));
    EXPECT_EQ(bare.restart_interval, 0);
    EXPECT_TRUE(std::ranges::equal(bare.dc, standard.dc));
    EXPECT_TRUE(std::ranges::equal(bare.ac, standard.ac));
    EXPECT_NE(reason_for(Bytes(own.begin(), own.begin() + 40)), "");
  }
  Bytes without_quantisation = jpeg_of({});
  without_quantisation[find_marker(without_quantisation, 0xdb) + 1] = 0xec;
  EXPECT_MENTIONS(reason_for(without_quantisation), "quantisation table");
}

TEST(JpegHeader, ImpossibleSizesAreRefused) {
  Bytes jpeg = jpeg_of({});
  const size_t sof = find_marker(jpeg, 0xc0);
  const auto with_size = [&](int width, int height) {
    Bytes lie = jpeg;
    lie[sof + 5] = static_cast<uint8_t>(height >> 8);
    lie[sof + 6] = static_cast<uint8_t>(height);
    lie[sof + 7] = static_cast<uint8_t>(width >> 8);
    lie[sof + 8] = static_cast<uint8_t>(width);
    return reason_for(lie);
  };
  EXPECT_EQ(with_size(33, 17), "");
  EXPECT_MENTIONS(with_size(0, 17), "Empty", "DNL");
  EXPECT_MENTIONS(with_size(33, 0), "Empty", "DNL");
  EXPECT_EQ(with_size(16385, 17), "bad image size");
  EXPECT_MENTIONS(with_size(16384, 16384), "few bytes", "size");
}

TEST(JpegHeader, WholeFramesHaveASmallerLimit) {
  Bytes jpeg = jpeg_of({.progressive = true});
  const size_t sof = find_marker(jpeg, 0xc2);
  jpeg[sof + 5] = jpeg[sof + 7] = 0x40;
  jpeg[sof + 6] = jpeg[sof + 8] = 0;
  jpeg.resize(1 << 20);
  EXPECT_MENTIONS(reason_for(jpeg), "large", "whole");
  jpeg[sof + 5] = jpeg[sof + 7] = 0x20;
  EXPECT_EQ(reason_for(jpeg), "");
}

TEST(JpegHeader, TruncatedHeadersAreErrors) {
  const Bytes jpeg = jpeg_of({});
  const size_t scan = parse_header(jpeg, nullptr)->scan;
  for (size_t size = 0; size < scan; size++)
    EXPECT_NE(reason_for(Bytes(jpeg.begin(), jpeg.begin() + size)), "") << size;
  EXPECT_MENTIONS(reason_for(Bytes(jpeg.begin(), jpeg.begin() + scan)), "few bytes", "size");
}

}  // namespace
}  // namespace lf::jpeg
