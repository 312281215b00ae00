// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/deflate.h"

#include <gtest/gtest.h>

#include <random>

#include "base/error.h"

namespace lf::wire {
namespace {

TEST(Deflate, GoesBothWays) {
  std::mt19937 random(1);
  for (const size_t size : {0, 1, 100, 100'000}) {
    std::vector<uint8_t> bytes(size);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 7);
    EXPECT_EQ(inflate_exactly(deflate_all(bytes), size), bytes);
  }
  EXPECT_LT(deflate_all(std::vector<uint8_t>(19'200, 77)).size(), 120u) << "a flat map costs next to nothing";
}

// Blocks that are not compressed hold 65,535 bytes.
TEST(Deflate, StoresWhatNeedNotBeSmall) {
  std::mt19937 random(2);
  for (const size_t size : {0, 1, 65'534, 65'535, 65'536, 131'070, 200'000}) {
    std::vector<uint8_t> bytes(size);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
    const std::vector<uint8_t> stored = store_all(bytes);
    EXPECT_EQ(inflate_exactly(stored, size), bytes);
    EXPECT_LE(stored.size(), size + 30);
  }
}

TEST(Deflate, RefusesWhatIsNotExactlyThat) {
  const std::vector<uint8_t> bytes(1000, 3), deflated = deflate_all(bytes);
  EXPECT_THROW(inflate_exactly(deflated, 999), Error);
  EXPECT_THROW(inflate_exactly(deflated, 1001), Error);
  std::vector<uint8_t> longer = deflated, damaged = deflated;
  longer.push_back(0);
  EXPECT_THROW(inflate_exactly(longer, 1000), Error);
  damaged[damaged.size() / 2] ^= 0x55;
  EXPECT_THROW(inflate_exactly(damaged, 1000), Error);
  EXPECT_THROW(inflate_exactly({}, 1000), Error);
  EXPECT_THROW(inflate_exactly(deflated, size_t{1} << 40), Error) << "without asking for so much memory";
}

}  // namespace
}  // namespace lf::wire
