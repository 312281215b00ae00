// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/grouped_reasons.h"

#include <gtest/gtest.h>

#include <vector>

namespace lf::test {
namespace {

std::vector<std::string> cameras(int first, int last, const std::string& why) {
  std::vector<std::string> reasons;
  for (int id = first; id <= last; id++)
    reasons.push_back("rig.json: camera " + std::to_string(id) + ": rtsp://host/" + std::to_string(id) + ": " + why);
  return reasons;
}

TEST(GroupedReasons, NoneAreNothing) { EXPECT_EQ(grouped_reasons({}, "; "), ""); }

TEST(GroupedReasons, AFewStandAsTheyAre) {
  EXPECT_EQ(grouped_reasons(cameras(0, 1, "it is gone"), "; "),
            "rig.json: camera 0: rtsp://host/0: it is gone; rig.json: camera 1: rtsp://host/1: it is gone");
  EXPECT_EQ(grouped_reasons(std::vector<std::string>{"no place"}, "; "), "no place");
}

TEST(GroupedReasons, ManyOfOneKindAreToldOnce) {
  EXPECT_EQ(grouped_reasons(cameras(0, 63, "it is gone"), "; "),
            "64 cameras: it is gone (rig.json: camera 0: rtsp://host/0 and others)");
  EXPECT_EQ(grouped_reasons(std::vector<std::string>(4, "no place"), "; "), "4 cameras: no place");
}

TEST(GroupedReasons, KindsStayApart) {
  std::vector<std::string> reasons = cameras(0, 0, "it is busy");
  for (const std::string& reason : cameras(1, 4, "it is gone")) reasons.push_back(reason);
  reasons.push_back("rig.json: camera 5: no such file");
  EXPECT_EQ(grouped_reasons(reasons, "\n"),
            "rig.json: camera 0: rtsp://host/0: it is busy\n"
            "4 cameras: it is gone (rig.json: camera 1: rtsp://host/1 and others)\n"
            "rig.json: camera 5: no such file");
}

}  // namespace
}  // namespace lf::test
