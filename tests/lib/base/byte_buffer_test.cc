// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/byte_buffer.h"

#include <gtest/gtest.h>

namespace lf {
namespace {

TEST(ByteBuffer, GrowingLeavesMemoryAsItIs) {
  ByteBuffer bytes(64, 0xaa);
  bytes.resize(0);
  bytes.resize(64);
  EXPECT_EQ(bytes[63], 0xaa);
  bytes.resize(65, 7);  // with a value it is written
  EXPECT_EQ(bytes[64], 7);
}

TEST(ByteBuffer, AppendKeepsWhatIsThere) {
  ByteBuffer bytes;
  append(bytes, {});
  EXPECT_TRUE(bytes.empty());
  const uint8_t more[] = {1, 2, 3};
  append(bytes, more);
  append(bytes, {});
  append(bytes, std::span(more).first(1));
  EXPECT_EQ(bytes, (ByteBuffer{1, 2, 3, 1}));
}

}  // namespace
}  // namespace lf
