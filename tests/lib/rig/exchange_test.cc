// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/mixed_rig.h"

namespace lf {
namespace {

TEST(Exchange, NamesWhatIsLostAndByHowMuch) {
  Rig rig = mixed_rig();
  EXPECT_TRUE(describe_export(rig, rig, {}).notes.empty());
  EXPECT_LT(describe_export(rig, rig, {}).max_error, 1e-9);
  rig.topology = {Topology::Type::kGrid, 1, 5, {}};
  rig.cameras[1].source = "rtsp://host/1";
  rig.cameras[1].time_offset = 0.1;
  EXPECT_EQ(describe_export(rig, rig, {}).notes.size(), 3u);
  EXPECT_EQ(describe_export(rig, rig, {false, false, false}).notes.size(), 6u);
  Rig other = rig;
  other.cameras[0].lens = Lens::pinhole(400, 160.5, 119.5);
  EXPECT_NEAR(describe_export(rig, other, {}).max_error, 1, 1e-9);
  EXPECT_ERROR(refuse_camera(rig.cameras[1], "no"), "camera 19: no");
}

}  // namespace
}  // namespace lf
