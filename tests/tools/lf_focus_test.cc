// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-focus as a program: a short version of what it measures for the record.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;

class LfFocus : public testing::Test {
 protected:
  nlohmann::json row(const std::string& name) const {
    const Outcome outcome =
        run_program("lf-focus", "--acceptance --most-views 1 --only '" + name + "' --json row.json", folder_.path());
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    return nlohmann::json::parse(read_text_file(folder_ / "row.json"))["rows"][0];
  }
  TempDir folder_;
};

TEST_F(LfFocus, AFlatSceneIsAsSharpAsItsPlaneAndCostsNextToNothing) {
  const nlohmann::json flat = row("flat");
  EXPECT_GT(flat["rest_gain_db"], -0.1) << "the same picture";
  EXPECT_LT(flat["rest_percent"], 2) << "of the bytes of a picture";
  EXPECT_GT(flat["gain_db"], -0.5);
  EXPECT_GT(flat["worst_on_way_db"], -0.5);
  EXPECT_LE(flat["flicker_median"], 1);
}

TEST_F(LfFocus, ThinThingsAreNoWorseThanThroughAPlane) {
  const nlohmann::json wires = row("wires");
  EXPECT_GT(wires["gain_db"], 0);
  EXPECT_GT(wires["worst_on_way_db"], -0.3);
  EXPECT_GT(wires["rest_gain_db"], 0);
  EXPECT_LT(wires["rest_percent"], 5);
  EXPECT_LE(wires["flicker_median"], 1);
}

TEST_F(LfFocus, TheBuiltInSceneGainsAndThenRests) {
  const nlohmann::json scene = row("built-in scene");
  EXPECT_GT(scene["gain_db"], 6.5);
  EXPECT_GT(scene["rest_gain_db"], 6.5);
  EXPECT_LT(scene["rest_percent"], 5);
  EXPECT_GE(scene["worst_on_way_db"], -0.1);
  EXPECT_LE(scene["flicker_median"], 1);
  EXPECT_LT(scene["surface_bytes"], 1.2 * static_cast<double>(scene["plane_bytes"]));
  EXPECT_GT(scene["surface_ssim"], scene["plane_ssim"]);
}

// Not matched, it gains 2.6 dB, the same at rest, and flickers by 16 of 255 (99th percentile).
TEST_F(LfFocus, CamerasOfOtherBrightnessLoseLittle) {
  const nlohmann::json matched = row("built-in scene, gains off by 10 %");
  EXPECT_GT(matched["gain_db"], 7);
  EXPECT_GT(matched["rest_gain_db"], 6.5);
  EXPECT_LT(matched["rest_percent"], 5);
  EXPECT_LT(matched["flicker_p99"], 11);
}

TEST_F(LfFocus, UnknownScenesAreRefused) {
  const Outcome outcome = run_program("lf-focus", "--acceptance --only nowhere", folder_.path());
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.output, HasSubstr("none of the scenes is known"));
}

}  // namespace
}  // namespace lf
