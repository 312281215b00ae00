// SPDX-License-Identifier: LGPL-2.1-or-later
// Network cameras that run freely, at 15 and 30 frames/s, film a moved bar: lf-rig records them through RTSP, and
// lf-calibrate is to find by how much each of them is late.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "gst/live_film.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;
using testing::Not;

#if LF_HAS_RTSP_SERVER

TEST(RtspOffsets, AreFoundToHalfAMillisecond) {
  g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, FALSE);
  gst_init(nullptr, nullptr);
  const TempDir dir;
  Rig truth = scene_rig(2, 2, 240, 176);
  const double offsets[] = {0.033, -0.033, 0.02, -0.011};
  for (size_t i = 0; i < 4; i++) truth.cameras[i].time_offset = offsets[i];
  save_rig(truth, dir / "true.json");
  const Outcome filmed = run_program(
      "lf-scene", "lights --rig true.json --out films --framerate 30,15 --seconds 40 --speed 0.5", dir.path());
  ASSERT_EQ(filmed.status, 0) << filmed.output;
  {
    Rig free = truth;
    for (Camera& camera : free.cameras) camera.time_offset = 0;
    const test::FilmServers servers(free, dir / "films");
    save_rig(servers.rig(), dir / "rig.json");
    const Outcome recorded = run_program("lf-rig", "record rig.json --out lights --seconds 10 --lights 2", dir.path());
    ASSERT_EQ(recorded.status, 0) << recorded.output;
    EXPECT_THAT(recorded.output, Not(HasSubstr("dated as they came")));
  }
  const Outcome solved =
      run_program("../calib/lf-calibrate", "all rig.json --lights lights --bar 0.3 --out found.json", dir.path());
  ASSERT_TRUE(std::filesystem::exists(dir / "found.json")) << solved.output;
  const Rig found = load_rig(dir / "found.json");
  double mean = 0, squares = 0;
  for (size_t i = 0; i < 4; i++) {
    const double error = found.cameras[i].time_offset - offsets[i];
    std::printf("camera %zu: %.3f ms\n", i, 1e3 * error);
    mean += error / 4, squares += error * error / 4;
  }
  const double rms = std::sqrt(squares - mean * mean);
  std::printf("offsets through RTSP: %.3f ms root mean square\n", 1e3 * rms);
  EXPECT_LE(rms, 5e-4);
}

#else
TEST(RtspOffsets, AreFoundToHalfAMillisecond) { GTEST_SKIP() << test::kRtspServerMissing; }
#endif

}  // namespace
}  // namespace lf
