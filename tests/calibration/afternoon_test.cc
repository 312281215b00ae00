// SPDX-License-Identifier: LGPL-2.1-or-later
// The afternoon from its beginning to pictures: an array that is not as it was planned films a bar, a chart and then
// the built-in scene, and is to show that as well as if it had been known from the start.
#include <cstdio>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/json_value.h"
#include "calibration/planned_array.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Afternoon, ItsPicturesAreAsThoseOfTheTrueRig) {
  const TempDir dir;
  const sim::PlannedArray array(3, 3, 240, 180);
  save_rig(array.truth, dir / "true.json");
  save_rig(array.nominal, dir / "nominal.json");
  for (const char* filmed : {"lights --rig true.json --out lights --framerate 30,15 --seconds 9,8 --noise 3 "
                             "--exposure 0.012 --reflection 0.3",
                             "chart --rig true.json --out colours --faults 7 --stuck 8"}) {
    const Outcome outcome = run_program("../tools/lf-scene", filmed, dir.path());
    ASSERT_EQ(outcome.status, 0) << outcome.output;
  }
  const Outcome all = run_program(
      "lf-calibrate", "all nominal.json --lights lights --bar 0.3 --colour colours --out rig.json", dir.path());
  EXPECT_EQ(all.status, 1) << "the stuck camera needs somebody";
  EXPECT_THAT(all.output, HasSubstr("camera 8 cam_02_02: its exposure is stuck"));
  EXPECT_THAT(all.output, Not(HasSubstr(" levels off the others"))) << "a chart that was misread is nobody's fault";
  ASSERT_TRUE(std::filesystem::exists(dir / "rig.json")) << all.output;
  const Rig found = load_rig(dir / "rig.json");
  const nlohmann::json colours = parse_json(read_text_file(dir / "rig/colour.json"), "colour.json");
  EXPECT_LE(colours["after"]["median"].get<double>(), 1);
  EXPECT_LE(colours["after"]["p95"].get<double>(), 3);
  const double clocks = array.clock_error(found);
  EXPECT_LE(clocks, 5e-4);  // seconds

  const auto best = array.shown_db(array.truth_with_colours_of(found)), calibrated = array.shown_db(found),
             planned = array.shown_db(array.nominal);
  for (size_t eye = 0; eye < best.size(); eye++) {
    std::printf("true rig %.2f dB, calibrated %.2f, nominal %.2f; clocks %.3f ms\n", best[eye], calibrated[eye],
                planned[eye], 1e3 * clocks);
    EXPECT_GE(calibrated[eye], best[eye] - 1);
    EXPECT_LE(planned[eye], best[eye] - 3) << "it is worth an afternoon";
  }
}

}  // namespace
}  // namespace lf
