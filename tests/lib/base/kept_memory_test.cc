// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/kept_memory.h"

#include <gtest/gtest.h>

#include "base/byte_buffer.h"

namespace lf {
namespace {

TEST(KeptMemory, ShrinksWithWhatIsNeeded) {
  KeptMemory<ByteBuffer> memory;
  uint64_t now = 5'000'000'000;
  const auto answer = [&](size_t size) {
    ByteBuffer bytes = memory.take();
    bytes.resize(size);
    memory.give_back(std::move(bytes), now);
  };
  for (int i = 0; i < 10; i++) answer(1'000'000);
  for (int i = 0; i < 100; i++) answer(1000);
  EXPECT_GE(memory.kept_bytes(), 1'000'000u) << "within the minute";
  now += 2 * PeakNeed::kMinute;
  for (int i = 0; i < 2; i++) answer(1000);  // in the large one's memory, and in some of its own
  EXPECT_LE(memory.kept_bytes(), 4 * 2000u);
  EXPECT_GT(memory.kept_bytes(), 0u) << "and still serves again";
  now += 2 * PeakNeed::kMinute;
  memory.trim(now);
  EXPECT_EQ(memory.kept_bytes(), 0u) << "nobody has asked for minutes";
}

}  // namespace
}  // namespace lf
