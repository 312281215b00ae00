// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/baseline_scan.h"
#include "support/test.h"

namespace lf::jpeg {
namespace {

class BitWriter {
 public:
  explicit BitWriter(const HuffmanSpec& spec) {
    unsigned code = 0, index = 0;
    for (int bits = 1; bits <= 16; bits++, code <<= 1)
      for (int i = 0; i < spec.counts[bits - 1]; i++) codes_[spec.symbols[index++]] = {code++, bits};
  }
  void symbol(int symbol) { put(codes_[symbol].first, codes_[symbol].second); }
  void put(unsigned value, int bits) {
    for (int i = bits - 1; i >= 0; i--, bit_++) {
      if (bit_ % 8 == 0) bytes_.push_back(0);
      bytes_.back() |= static_cast<uint8_t>((value >> i & 1) << (7 - bit_ % 8));
    }
  }
  // Includes the padding that a reader needs.
  std::vector<uint8_t> bytes() const {
    std::vector<uint8_t> out = bytes_;
    out.resize(out.size() + 300);
    return out;
  }
  uint64_t bits() const { return bit_; }

 private:
  std::pair<unsigned, int> codes_[256];
  std::vector<uint8_t> bytes_;
  uint64_t bit_ = 0;
};

int random_value(int size, std::mt19937& random) {
  if (size == 0) return 0;
  const int magnitude = (1 << (size - 1)) + static_cast<int>(random() % (1u << (size - 1)));
  return random() % 2 ? magnitude : -magnitude;
}
unsigned coded(int value, int size) { return static_cast<unsigned>(value > 0 ? value : value + (1 << size) - 1); }

TEST(HuffmanTable, DifferencesOfEverySize) {
  std::mt19937 random(1);
  for (int chroma = 0; chroma < 2; chroma++) {
    BitWriter writer(standard_dc(chroma));
    std::vector<int> values;
    for (int i = 0; i < 500; i++) {
      const int size = static_cast<int>(random() % 12), value = random_value(size, random);
      writer.symbol(size);
      writer.put(coded(value, size), size);
      values.push_back(value);
    }
    const auto bytes = writer.bytes();
    BitReader reader(bytes.data(), 0);
    const auto table = dc_table(standard_dc(chroma));
    int32_t predictor = 0, expected = 0;
    for (const int value : values) {
      reader.refill();
      ASSERT_TRUE(read_dc(reader, *table, predictor));
      EXPECT_EQ(predictor, expected += value);
    }
    EXPECT_EQ(reader.position(), writer.bits());
  }
}

// Sparse and full blocks with every symbol: reading and skipping end at the same bit.
TEST(HuffmanTable, BlocksOfEverySymbol) {
  std::mt19937 random(2);
  uint16_t ones[64];
  std::fill(ones, ones + 64, 1);
  for (int chroma = 0; chroma < 2; chroma++) {
    const auto table = ac_table(standard_ac(chroma));
    for (int trial = 0; trial < 2000; trial++) {
      BitWriter writer(standard_ac(chroma));
      int expected[64] = {};
      const unsigned mean_run = 1 + random() % 16, largest = 1 + random() % 10;
      int k = 1, end = trial % 4 == 0 ? 64 : static_cast<int>(1 + random() % 63);
      while (k < end) {
        int run = std::min<int>(static_cast<int>(random() % mean_run) * (random() % 8 ? 1 : 3), end - 1 - k);
        for (k += run; run >= 16; run -= 16) writer.symbol(0xf0);
        const int size = 1 + static_cast<int>(random() % largest);
        expected[kIdctOrder[k++]] = random_value(size, random);
        writer.symbol(run << 4 | size);
        writer.put(coded(expected[kIdctOrder[k - 1]], size), size);
      }
      if (k < 64) writer.symbol(0);
      const uint64_t bits = writer.bits();
      writer.put(0x5a5a5a, 24);
      const auto bytes = writer.bytes();

      BitReader reader(bytes.data(), 0);
      int16_t block[64] = {};
      unsigned last;
      ASSERT_TRUE(read_ac(reader, *table, ones, block, &last));
      EXPECT_EQ(reader.position(), bits);
      for (int i = 0; i < 64; i++) ASSERT_EQ(block[i], expected[i]);
      EXPECT_EQ(last, static_cast<unsigned>(k - 1));

      BitReader passer(bytes.data(), 0);
      ASSERT_TRUE(skip_ac(passer, *table));
      ASSERT_EQ(passer.position(), bits);
    }
  }
}

TEST(HuffmanTable, TooManyCoefficientsAreDamage) {
  uint16_t ones[64] = {};
  for (const int zeros : {3, 4}) {
    BitWriter writer(standard_ac(0));
    writer.symbol(0x11);
    writer.put(1, 1);
    for (int i = 0; i < zeros; i++) writer.symbol(0xf0);
    writer.symbol(0xd1);
    writer.put(1, 1);
    const auto bytes = writer.bytes();
    const auto table = ac_table(standard_ac(0));
    int16_t block[64] = {};
    unsigned last;
    BitReader reader(bytes.data(), 0), passer(bytes.data(), 0);
    EXPECT_FALSE(read_ac(reader, *table, ones, block, &last));
    EXPECT_FALSE(skip_ac(passer, *table));
  }
}

TEST(HuffmanTable, OnlyPrefixCodesHaveTables) {
  HuffmanSpec spec;
  EXPECT_EQ(dc_table(spec), nullptr);
  EXPECT_EQ(ac_table(spec), nullptr);
  spec.counts = {1, 1, 3};
  EXPECT_EQ(ac_table(spec), nullptr);
  spec.counts = {1, 1, 2};
  EXPECT_EQ(ac_table(spec), nullptr) << "no code is all ones";
  spec.counts = {1, 1, 1};
  EXPECT_NE(ac_table(spec), nullptr);
  spec.counts = {3};
  EXPECT_EQ(dc_table(spec), nullptr);
}

TEST(HuffmanTable, DifferencesHaveAtMost15Bits) {
  HuffmanSpec spec;
  spec.counts = {1, 1};
  spec.symbols = {0, 15};
  EXPECT_NE(dc_table(spec), nullptr);
  spec.symbols = {0, 16};
  EXPECT_EQ(dc_table(spec), nullptr);
  EXPECT_NE(ac_table(spec), nullptr);
}

TEST(HuffmanTable, IsCached) {
  EXPECT_EQ(ac_table(standard_ac(0)), ac_table(standard_ac(0)));
  EXPECT_NE(ac_table(standard_ac(0)), ac_table(standard_ac(1)));
  HuffmanSpec spec = standard_ac(0);
  const auto kept = ac_table(spec);
  for (int i = 0; i < 300; i++) {
    spec.symbols[0] = static_cast<uint8_t>(i);
    spec.symbols[1] = static_cast<uint8_t>(i / 256);
    ASSERT_NE(ac_table(spec), nullptr);
  }
  EXPECT_EQ(kept->entries, ac_table(standard_ac(0))->entries);
}

// Returns the segments in hex, separated by bars.
std::string segments_of(const std::vector<uint8_t>& scan, size_t max_segments) {
  ScanData data(scan, max_segments);
  std::vector<std::string> texts(data.segments());
  for (size_t k = data.segments(); k-- > 0;) {
    const ScanData::Range s = data.segment(k);
    for (size_t i = s.begin; i < s.end; i++) {
      char hex[4];
      std::snprintf(hex, sizeof hex, "%02x", data.bytes()[i]);
      texts[k] += hex;
    }
  }
  EXPECT_EQ(data.segment(data.segments()).end, 0u);
  std::string text = texts[0];
  for (size_t k = 1; k < texts.size(); k++) text += "|" + texts[k];
  return text;
}

TEST(ScanData, RemovesStuffing) {
  EXPECT_EQ(segments_of({1, 0xff, 0, 2, 0xff, 0, 0xff, 0, 3, 0xff, 0xd9, 4}, 1), "01ff02ffff03");
  EXPECT_EQ(segments_of({}, 1), "");
  EXPECT_EQ(segments_of({0xff}, 1), "");
  EXPECT_EQ(segments_of({7, 0xff}, 1), "07");
  EXPECT_EQ(segments_of({0xff, 0}, 1), "ff");
}

TEST(ScanData, RestartMarkersDivideTheScan) {
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 2, 3, 0xff, 0xff, 0xff, 0xd1, 4}, 3), "01|0203|04");
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 0xff, 0xd1, 4}, 3), "01||04");
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 2, 0xff, 0xd1, 4}, 2), "01|02") << "too many";
}

TEST(ScanData, UpToTwoSegmentsMayBeMissing) {
  EXPECT_EQ(segments_of({1, 0xff, 0xd1, 2}, 8), "||02");
  EXPECT_EQ(segments_of({1, 0xff, 0xd2, 2}, 8), "|||02");
  EXPECT_EQ(segments_of({1, 0xff, 0xd3, 2}, 8), "01");
  EXPECT_EQ(segments_of({1, 0xff, 0xd7, 2}, 8), "01");
  EXPECT_EQ(segments_of({1, 0xff, 0xd2, 2}, 3), "01") << "beyond the image";
}

TEST(ScanData, RestartNumbersCountModuloEight) {
  std::vector<uint8_t> scan;
  std::string expected;
  for (int i = 0; i < 20; i++) {
    scan.insert(scan.end(), {0x21, 0xff, static_cast<uint8_t>(0xd0 + i % 8)});
    expected += "21|";
  }
  EXPECT_EQ(segments_of(scan, 21), expected);
}

}  // namespace
}  // namespace lf::jpeg
