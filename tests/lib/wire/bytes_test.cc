// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/bytes.h"

#include <gtest/gtest.h>

#include <limits>

namespace lf::wire {
namespace {

TEST(Bytes, AreBigEndian) {
  Writer out(23);
  out.put(uint8_t{0x01});
  out.put(uint16_t{0x0203});
  out.put(uint32_t{0x04050607});
  out.put(uint64_t{0x08090a0b0c0d0e0f});
  out.put(-2.0);
  const std::vector<uint8_t> bytes = out.take();
  std::vector<uint8_t> expected;
  for (uint8_t i = 1; i <= 15; i++) expected.push_back(i);
  expected.insert(expected.end(), {0xc0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(bytes, expected);
}

TEST(Bytes, ComeBack) {
  const double doubles[] = {
      0., -0., 1.5, std::numeric_limits<double>::denorm_min(), -1e300, std::numeric_limits<double>::infinity()};
  Writer out(1);  // grows
  out.put(uint8_t{255});
  out.put(uint64_t{UINT64_MAX});
  for (const double d : doubles) out.put(d);
  const std::vector<uint8_t> bytes = out.take();
  Reader in(bytes);
  EXPECT_EQ(in.get<uint8_t>(), 255);
  EXPECT_EQ(in.get<uint64_t>(), UINT64_MAX);
  for (const double d : doubles) EXPECT_EQ(std::bit_cast<uint64_t>(in.get<double>()), std::bit_cast<uint64_t>(d));
  EXPECT_TRUE(in.ok());
  EXPECT_EQ(in.left(), 0u);
}

TEST(Bytes, BeyondTheEndIsNothingForGood) {
  const std::vector<uint8_t> bytes = {1, 2, 3};
  Reader in(bytes);
  EXPECT_EQ(in.get<uint32_t>(), 0u);
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.get<uint8_t>(), 0);
  EXPECT_EQ(in.left(), 0u);
  EXPECT_FALSE(in.ok());
  Reader blocks(bytes);
  EXPECT_EQ(blocks.get_bytes(3).size(), 3u);
  EXPECT_TRUE(blocks.get_bytes(SIZE_MAX).empty());
  EXPECT_FALSE(blocks.ok());
}

}  // namespace
}  // namespace lf::wire
