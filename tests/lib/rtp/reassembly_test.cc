// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/reassembly.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace lf::rtp {
namespace {

using enum Reassembly::Result;

std::vector<uint8_t> numbers(size_t count) {
  std::vector<uint8_t> out(count);
  std::iota(out.begin(), out.end(), uint8_t{1});
  return out;
}

class ReassemblyTest : public testing::Test {
 protected:
  // Bytes [offset, offset + count) of a unit.
  Reassembly::Result add(uint16_t unit, uint32_t offset, size_t count, uint32_t size = 30, uint32_t source = 1) {
    return reassembly_.add(source, {unit, offset, size, std::span(bytes_).subspan(offset % 1000, count)}, out_);
  }
  std::vector<uint8_t> bytes_ = numbers(5000);
  ByteBuffer out_;
  Reassembly reassembly_{{.bytes = 4000, .units = 3}};
};

TEST_F(ReassemblyTest, AnyOrder) {
  std::vector<uint32_t> offsets{0, 10, 20};
  do {
    EXPECT_EQ(add(1, offsets[0], 10), kKept);
    EXPECT_EQ(add(1, offsets[1], 10), kKept);
    EXPECT_EQ(add(1, offsets[2], 10), kComplete);
    EXPECT_TRUE(std::ranges::equal(out_, std::span(bytes_).first(30)));
    EXPECT_EQ(reassembly_.bytes(), 0u);
  } while (std::ranges::next_permutation(offsets).found);
  EXPECT_EQ(add(1, 0, 30), kComplete);
  EXPECT_EQ(reassembly_.dropped(), 0u);
}

TEST_F(ReassemblyTest, UnitsOfSeveralSendersAtOnce) {
  EXPECT_EQ(add(1, 0, 10, 20, 1), kKept);
  EXPECT_EQ(add(1, 0, 10, 20, 2), kKept);
  EXPECT_EQ(add(2, 0, 10, 20, 1), kKept);
  EXPECT_EQ(add(1, 10, 10, 20, 2), kComplete);
  EXPECT_EQ(add(2, 10, 10, 20, 1), kComplete);
  EXPECT_EQ(add(1, 10, 10, 20, 1), kComplete);
}

TEST_F(ReassemblyTest, ContradictionsAreRefused) {
  EXPECT_EQ(add(1, 10, 10), kKept);
  EXPECT_EQ(add(1, 10, 10), kDuplicate);
  EXPECT_EQ(add(1, 0, 10, 31), kBad);  // another size
  EXPECT_EQ(add(1, 10, 9), kBad);
  EXPECT_EQ(add(1, 10, 11), kBad);
  EXPECT_EQ(add(1, 0, 11), kBad);
  EXPECT_EQ(add(1, 5, 20), kBad);
  EXPECT_EQ(add(1, 19, 2), kBad);
  EXPECT_EQ(add(1, 12, 3), kBad);
  EXPECT_EQ(add(1, 0, 30), kBad);
  EXPECT_EQ(add(1, 0, 10), kKept);
  EXPECT_EQ(add(1, 20, 10), kComplete);
  EXPECT_TRUE(std::ranges::equal(out_, std::span(bytes_).first(30)));
}

TEST_F(ReassemblyTest, TheOldestMakesRoom) {
  for (uint16_t unit = 1; unit <= 4; unit++) EXPECT_EQ(add(unit, 0, 10), kKept);
  EXPECT_EQ(reassembly_.units(), 3u);
  EXPECT_EQ(reassembly_.dropped(), 1u);
  EXPECT_EQ(add(2, 10, 20), kComplete);
  EXPECT_EQ(add(1, 10, 20), kKept);  // begins anew, without its first chunk
  reassembly_.clear();
  EXPECT_EQ(reassembly_.dropped(), 4u);
  EXPECT_EQ(reassembly_.bytes(), 0u);
}

TEST_F(ReassemblyTest, SizesAreBounded) {
  EXPECT_EQ(add(1, 0, 1, 4001), kTooLarge);
  EXPECT_EQ(add(1, 0, 1, UINT32_MAX), kTooLarge);
  EXPECT_EQ(add(1, UINT32_MAX - 1, 1, UINT32_MAX), kTooLarge);
  EXPECT_EQ(reassembly_.units(), 0u);
  std::mt19937 random(1);
  for (int i = 0; i < 20000; i++) {
    const uint32_t size = 12 + random() % 4000, offset = random() % size;
    add(static_cast<uint16_t>(random() % 6), offset, 1 + random() % std::min<uint32_t>(40, size - offset), size);
    ASSERT_LE(reassembly_.bytes(), 4000u);
    ASSERT_LE(reassembly_.units(), 3u);
  }
}

}  // namespace
}  // namespace lf::rtp
