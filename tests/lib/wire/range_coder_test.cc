// SPDX-License-Identifier: LGPL-2.1-or-later
#include "wire/range_coder.h"

#include <array>
#include <cmath>

#include "support/test.h"

namespace lf::wire {
namespace {

// Random decisions of several kinds, which are true with this probability.
std::vector<bool> decisions(double probability, int count, std::mt19937& random) {
  std::vector<bool> out;
  std::bernoulli_distribution draw(probability);
  for (int i = 0; i < count; i++) out.push_back(draw(random));
  return out;
}

std::vector<uint8_t> encoded(const std::vector<bool>& bits, size_t kinds) {
  RangeEncoder out;
  std::vector<AdaptiveBit> models(kinds);
  for (size_t i = 0; i < bits.size(); i++) out.code(models[i % kinds], bits[i]);
  return out.finish();
}

// All probabilities, also decisions that never change, which have long carries.
TEST(RangeCoder, DecisionsSurviveAndReachTheirEntropy) {
  std::mt19937 random(1);
  for (const double p : {0.0, 1e-3, 0.02, 0.3, 0.5, 0.9, 0.999, 1.0})
    for (const int count : {0, 1, 7, 100, 20000})
      for (const size_t kinds : {size_t{1}, size_t{5}}) {
        const std::vector<bool> bits = decisions(p, count, random);
        const std::vector<uint8_t> bytes = encoded(bits, kinds);
        RangeDecoder in(bytes);
        std::vector<AdaptiveBit> models(kinds);
        for (size_t i = 0; i < bits.size(); i++)
          ASSERT_EQ(in.code(models[i % kinds], false), bits[i]) << p << ", " << i;
        EXPECT_TRUE(in.is_complete()) << p << ", " << count;
        const double entropy = p > 0 && p < 1 ? -p * std::log2(p) - (1 - p) * std::log2(1 - p) : 0;
        EXPECT_LE(static_cast<double>(bytes.size()), (1.05 * entropy + 0.02) * count / 8 + 8 + 10 * kinds)
            << p << ", " << count;
      }
}

TEST(RangeCoder, OtherLengthsAreDetected) {
  std::mt19937 random(2);
  const std::vector<bool> bits = decisions(0.3, 1000, random);
  const std::vector<uint8_t> good = encoded(bits, 1);
  for (const size_t size : {size_t{0}, size_t{3}, good.size() - 1, good.size(), good.size() + 1}) {
    std::vector<uint8_t> other = good;
    other.resize(size);
    RangeDecoder in(other);
    AdaptiveBit model;
    for (size_t i = 0; i < bits.size(); i++) in.code(model, false);
    EXPECT_EQ(in.is_complete(), size == good.size()) << size;
  }
}

}  // namespace
}  // namespace lf::wire
