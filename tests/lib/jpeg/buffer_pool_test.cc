// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/buffer_pool.h"

#include <gtest/gtest.h>

#include "support/jpeg_samples.h"

namespace lf::jpeg {
namespace {

TEST(BufferPool, GivesTheLatestAgain) {
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

TEST(BufferPool, FramesShareTheirMemoryOneAfterTheOther) {
  const auto jpeg = test::encode_jpeg(test::noisy_picture(64, 48, 1), {});
  const uint8_t* memory = nullptr;
  for (int i = 0; i < 3; i++) {
    const auto frame = test::open_jpeg(jpeg);
    ASSERT_TRUE(frame->ensure({0, 0, 64, 48}));
    if (i > 0) {
      EXPECT_EQ(frame->view().plane[0], memory);
    }
    memory = frame->view().plane[0];
  }
}

}  // namespace
}  // namespace lf::jpeg
