// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/memory.h"
#include "support/jpeg_samples.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(ByteBuffer, GrowingDoesNotInitialiseMemory) {
  ByteBuffer bytes(64, 0xaa);
  bytes.resize(0);
  bytes.resize(64);
  EXPECT_EQ(bytes[63], 0xaa);
  bytes.resize(65, 7);
  EXPECT_EQ(bytes[64], 7);
}

TEST(ByteBuffer, AppendKeepsContents) {
  ByteBuffer bytes;
  append(bytes, {});
  EXPECT_TRUE(bytes.empty());
  const uint8_t more[] = {1, 2, 3};
  append(bytes, more);
  append(bytes, {});
  append(bytes, std::span(more).first(1));
  EXPECT_EQ(bytes, (ByteBuffer{1, 2, 3, 1}));
}

TEST(MemoryPool, ShrinksWithTheNeededSize) {
  MemoryPool<ByteBuffer> memory;
  uint64_t now = 5'000'000'000;
  const auto answer = [&](size_t size) {
    ByteBuffer bytes = memory.take();
    bytes.resize(size);
    memory.give_back(std::move(bytes), now);
  };
  for (int i = 0; i < 10; i++) answer(1'000'000);
  for (int i = 0; i < 100; i++) answer(1000);
  EXPECT_GE(memory.pooled_bytes(), 1'000'000u) << "within the minute";
  now += 2 * PeakTracker::kMinute;
  for (int i = 0; i < 2; i++) answer(1000);
  EXPECT_LE(memory.pooled_bytes(), 4 * 2000u);
  EXPECT_GT(memory.pooled_bytes(), 0u) << "still reused";
  now += 2 * PeakTracker::kMinute;
  memory.trim(now);
  EXPECT_EQ(memory.pooled_bytes(), 0u) << "unused for minutes";
}

TEST(BufferPool, ReturnsTheLatestBuffer) {
  PooledBuffer a = take_buffer(1000000), b = take_buffer(1000000);
  uint8_t* const memory = a.get();
  EXPECT_NE(b.get(), memory);
  memory[999999] = 5;
  a.reset();
  EXPECT_EQ(take_buffer(999000).get(), memory) << "a little less";
  a = take_buffer(1000000);
  EXPECT_EQ(a.get(), memory);
  EXPECT_EQ(a[999999], 5) << "nothing was cleared";
  EXPECT_NE(take_buffer(2000000).get(), nullptr);
}

TEST(BufferPool, FramesReuseMemory) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(64, 48, 1), {});
  const uint8_t* memory = nullptr;
  for (int i = 0; i < 3; i++) {
    const auto frame = test::open_jpeg(jpeg);
    ASSERT_TRUE(frame->ensure({0, 0, 64, 48}));
    EXPECT_TRUE(i == 0 || frame->view().plane[0] == memory);
    memory = frame->view().plane[0];
  }
}

}  // namespace
}  // namespace lf
