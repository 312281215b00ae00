// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/scan_data.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace lf::jpeg {
namespace {

// The segments in hex, divided by bars.
std::string segments_of(const std::vector<uint8_t>& scan, size_t max_segments) {
  ScanData data(scan, max_segments);
  std::vector<std::string> texts(data.segments());
  for (size_t k = data.segments(); k-- > 0;) {  // in any order
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

TEST(ScanData, StuffingGoes) {
  EXPECT_EQ(segments_of({1, 0xff, 0, 2, 0xff, 0, 0xff, 0, 3, 0xff, 0xd9, 4}, 1), "01ff02ffff03");
  EXPECT_EQ(segments_of({}, 1), "");
  EXPECT_EQ(segments_of({0xff}, 1), "");
  EXPECT_EQ(segments_of({7, 0xff}, 1), "07");
  EXPECT_EQ(segments_of({0xff, 0}, 1), "ff");
}

TEST(ScanData, RestartMarkersDivide) {
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 2, 3, 0xff, 0xff, 0xff, 0xd1, 4}, 3), "01|0203|04");
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 0xff, 0xd1, 4}, 3), "01||04");
  EXPECT_EQ(segments_of({1, 0xff, 0xd0, 2, 0xff, 0xd1, 4}, 2), "01|02") << "too many";
}

TEST(ScanData, UpToTwoSegmentsMayBeMissing) {
  EXPECT_EQ(segments_of({1, 0xff, 0xd1, 2}, 8), "||02");
  EXPECT_EQ(segments_of({1, 0xff, 0xd2, 2}, 8), "|||02");
  EXPECT_EQ(segments_of({1, 0xff, 0xd3, 2}, 8), "01");
  EXPECT_EQ(segments_of({1, 0xff, 0xd7, 2}, 8), "01");
  EXPECT_EQ(segments_of({1, 0xff, 0xd2, 2}, 3), "01") << "they would be beyond the image";
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
