// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/swap_devices.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "rig/rig_json.h"
#include "support/expect_error.h"

namespace lf {
namespace {

TEST(SwapDevices, MovesWhatBelongsToTheDeviceAndNothingElse) {
  Rig rig = make_grid_rig({1, 3, 0.1, 60, 8, 6});
  rig.cameras[0].source = "v4l2:///dev/video0";
  rig.cameras[0].time_offset = 0.01;
  rig.cameras[2].width = 16;
  nlohmann::json json = nlohmann::json::parse(rig_to_json(rig));
  json["cameras"][2]["covariance"] = {1, 2};
  swap_devices(json, 0, 2);
  const Rig swapped = parse_rig(json.dump(), "r");
  for (size_t i = 0; i < 3; i++) {
    EXPECT_EQ(swapped.cameras[i].id, rig.cameras[i].id);
    EXPECT_EQ(swapped.cameras[i].name, rig.cameras[i].name);
    EXPECT_EQ(swapped.cameras[i].pose, rig.cameras[i].pose);
  }
  EXPECT_EQ(swapped.cameras[2].source, "v4l2:///dev/video0");
  EXPECT_EQ(swapped.cameras[2].time_offset, 0.01);
  EXPECT_EQ(swapped.cameras[0].source, "");
  EXPECT_EQ(swapped.cameras[0].width, 16);
  EXPECT_TRUE(json["cameras"][0].contains("covariance"));
  EXPECT_FALSE(json["cameras"][2].contains("covariance"));
  const nlohmann::json before = json;
  swap_devices(json, 1, 1);
  EXPECT_EQ(json, before);
  EXPECT_ERROR(swap_devices(json, 0, 9), "there is no camera 9");
}

}  // namespace
}  // namespace lf
