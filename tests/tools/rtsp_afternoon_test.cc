// SPDX-License-Identifier: LGPL-2.1-or-later
// The afternoon as somebody has it whose cameras are on a network: each is behind an RTSP server, all run freely, and
// the array is not as it was planned. lf-rig records a bar and a chart, lf-calibrate makes a rig of that.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>

#include "base/json_value.h"
#include "calibration/planned_array.h"
#include "gst/live_film.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;

#if LF_HAS_RTSP_SERVER

Outcome timed(const std::string& name, const std::string& arguments, const TempDir& dir) {
  const auto begin = std::chrono::steady_clock::now();
  const Outcome outcome = run_program(name, arguments, dir.path());
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  std::printf("%.0f s: %s %s\n", seconds.count(), name.c_str(), arguments.c_str());
  return outcome;
}

void rehearse(int rows, int columns) {
  g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, FALSE);
  gst_init(nullptr, nullptr);
  const TempDir dir;
  const sim::PlannedArray array(rows, columns, 320, 240);
  const std::string stuck = std::to_string(array.stuck()), name = array.truth.cameras[array.stuck()].name;
  save_rig(array.truth, dir / "true.json");
  save_rig(array.nominal, dir / "nominal.json");
  for (const std::string filmed : {"lights --rig true.json --out light-films --framerate 30,15 --seconds 40 --noise 3 "
                                   "--exposure 0.012 --reflection 0.3",
                                   "chart --rig true.json --out chart-films --faults 7 --stuck "}) {
    const Outcome outcome = timed("lf-scene", filmed.starts_with("chart") ? filmed + stuck : filmed, dir);
    ASSERT_EQ(outcome.status, 0) << outcome.output;
  }
  for (const auto& [films, hold, arguments] : {std::tuple{"light-films", 0, "--out lights --seconds 20 --lights 2"},
                                               std::tuple{"chart-films", 15, "--out colours --seconds 14"}}) {
    const test::FilmServers servers(array.nominal, dir / films, hold);
    save_rig(servers.rig(), dir / "rig.json");
    const Outcome outcome = timed("lf-rig", std::string("record rig.json ") + arguments, dir);
    ASSERT_EQ(outcome.status, 0) << outcome.output;
    std::printf("%s", outcome.output.c_str());
  }
  const Outcome all =
      timed("../calib/lf-calibrate", "all rig.json --lights lights --bar 0.3 --colour colours --out found.json", dir);
  std::printf("%s", all.output.c_str());
  EXPECT_EQ(all.status, 1) << "the stuck camera needs somebody";
  EXPECT_THAT(all.output, HasSubstr("camera " + stuck + " " + name + ": its exposure is stuck"));
  ASSERT_TRUE(std::filesystem::exists(dir / "found.json")) << all.output;
  const Rig found = load_rig(dir / "found.json");
  const nlohmann::json after = parse_json(read_text_file(dir / "found/colour.json"), "colour.json")["after"];
  const double median = after["median"].get<double>(), p95 = after["p95"].get<double>();
  EXPECT_LE(median, 1);
  EXPECT_LE(p95, 3);
  const double clocks = array.clock_error(found);
  EXPECT_LE(clocks, 5e-4);  // seconds
  std::printf("%dx%d cameras through RTSP: clocks %.3f ms rms; colours differ by %.2f of 255, 95 %% by %.2f at most\n",
              rows, columns, 1e3 * clocks, median, p95);
  const auto best = array.shown_db(array.truth_with_colours_of(found)), calibrated = array.shown_db(found),
             planned = array.shown_db(array.nominal);
  for (size_t eye = 0; eye < best.size(); eye++) {
    std::printf("eye %zu: true rig %.2f dB, calibrated %.2f, nominal %.2f\n", eye, best[eye], calibrated[eye],
                planned[eye]);
    EXPECT_GE(calibrated[eye], best[eye] - 1);
    EXPECT_LE(planned[eye], best[eye] - 3);
  }
}

TEST(RtspAfternoon, NineCamerasShowAsThoseOfTheTrueRig) { rehearse(3, 3); }
TEST(RtspAfternoon, SixtyFourCamerasShowAsThoseOfTheTrueRig) { rehearse(8, 8); }

#else
TEST(RtspAfternoon, NineCamerasShowAsThoseOfTheTrueRig) { GTEST_SKIP() << test::kRtspServerMissing; }
#endif

}  // namespace
}  // namespace lf
