// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/idct.h"

#include <hwy/targets.h>

#include "support/every_target.h"
#include "support/test.h"

namespace lf::jpeg {
namespace {

struct Block {
  alignas(32) int16_t coefficient[64] = {};
  unsigned last = 0;
  void set(unsigned k, int value) {  // k in zigzag order
    coefficient[kIdctOrder[k]] = static_cast<int16_t>(value);
    last = std::max(last, k);
  }
};

// T.81 annex A.3.3, in double precision.
double exact(const Block& block, int x, int y) {
  double sum = 0;
  for (int v = 0; v < 8; v++)
    for (int u = 0; u < 8; u++)
      sum += (u ? 1 : M_SQRT1_2) * (v ? 1 : M_SQRT1_2) * block.coefficient[idct_index(v, u)] *
             std::cos((2 * x + 1) * u * M_PI / 16) * std::cos((2 * y + 1) * v * M_PI / 16);
  return std::clamp(sum / 4 + 128, 0.0, 255.0);
}

class EveryTarget : public testing::Test {
 protected:
  ~EveryTarget() override { hwy::SetSupportedTargetsForTest(0); }
};

// jpeg_frame_test.cc tests that the rounding equals libjpeg's.
TEST_F(EveryTarget, IsIdenticalAndCloseToTheDefinition) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 300; trial++) {
    Block block;
    const unsigned coefficients = 1 + random() % 64;
    for (unsigned i = 0; i < coefficients; i++)
      block.set(random() % coefficients, static_cast<int>(random() % 400) - 200);
    if (trial % 3 == 0) block.set(0, static_cast<int>(random() % 2048) - 1024);
    uint8_t first[64];
    hwy::SetSupportedTargetsForTest(HWY_SCALAR);
    idct(block.coefficient, block.last, first, 8);
    for (int i = 0; i < 64; i++) ASSERT_NEAR(first[i], exact(block, i % 8, i / 8), 1.0);
    hwy::SetSupportedTargetsForTest(0);
    test::on_every_target([&] {
      uint8_t out[8 * 11];
      std::memset(out, 7, sizeof out);
      idct(block.coefficient, block.last, out, 11);
      for (int i = 0; i < 88; i++) ASSERT_EQ(out[i], i % 11 < 8 ? first[i / 11 * 8 + i % 11] : 7);
    });
  }
}

TEST_F(EveryTarget, ExtremesSaturate) {
  for (const int16_t value : {int16_t{32767}, int16_t{-32768}}) {
    Block block;
    for (unsigned k = 0; k < 64; k++) block.set(k, value);
    test::on_every_target([&] {
      uint8_t out[64];
      idct(block.coefficient, block.last, out, 8);
      EXPECT_EQ(out[0], value > 0 ? 255 : 0);
    });
  }
}

TEST_F(EveryTarget, ConstantBlocks) {
  for (int dc = -3000; dc < 3000; dc += 1 + (dc & 3)) {
    Block block;
    block.set(0, dc);
    uint8_t whole[64], low[64], constant[64];
    idct(block.coefficient, 63, whole, 8);
    idct(block.coefficient, 9, low, 8);
    idct(block.coefficient, 0, constant, 8);
    ASSERT_EQ(std::memcmp(whole, low, 64), 0) << dc;
    ASSERT_EQ(std::memcmp(whole, constant, 64), 0) << dc;
  }
}

}  // namespace
}  // namespace lf::jpeg
