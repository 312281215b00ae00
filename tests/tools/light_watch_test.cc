// SPDX-License-Identifier: LGPL-2.1-or-later
// Films of a moved bar as cameras: where it came to while it is filmed, and what looking costs.
#include "cameras/light_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "base/json_value.h"
#include "calibration/light_sights.h"
#include "cameras/recorder.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Watching : public testing::Test {
 protected:
  Watching() {
    g_setenv("GST_PLUGIN_PATH", LF_PLUGIN_DIR, FALSE);
    gst_init(nullptr, nullptr);
  }
  void film(const Rig& rig, const std::string& arguments) {
    save_rig(rig, dir_ / "rig.json");
    const Outcome filmed = run_program("lf-scene", "lights --rig rig.json --out lights " + arguments, dir_.path());
    ASSERT_EQ(filmed.status, 0) << filmed.output;
  }
  const TempDir dir_;
};

TEST_F(Watching, FollowsTheLightsInTheFilmsThatAreTaken) {
  ASSERT_NO_FATAL_FAILURE(film(scene_rig(2, 2, 640, 480), "--framerate 30 --seconds 8"));
  const std::string path = dir_ / "lights/rig.json";
  const auto rig = std::make_shared<const Rig>(load_rig(path));
  cameras::LightWatch watch(*rig, 2);
  const std::vector<cameras::Recorded> recorded = cameras::record_cameras(
      rig, path, dir_ / "films", {.seconds = 6, .shown = [&](const cameras::CameraFrame& frame) { watch.see(frame); }},
      [](double) { return true; });
  for (const cameras::Recorded& one : recorded) EXPECT_EQ(one.problem, "");
  const uint64_t looks = watch.looks();
  EXPECT_GT(looks, 4u * 10);
  EXPECT_LE(looks, 4u * 32) << "five a second";
  std::printf("%.2f ms of the processor a look at 640x480\n", 1e3 * watch.busy() / static_cast<double>(looks));
  // Not more places than the lights came to, and not far fewer.
  const auto truth = parse_light_sights(read_text_file(dir_ / "lights/lights.json"), "lights.json");
  ASSERT_TRUE(truth);
  for (CameraIndex i = 0; i < 4; i++) {
    PicturePlaces places(640, 480);
    for (const LightSights::Frame& frame : truth->cameras[i].frames)
      for (const Sight& sight : frame.sights) places.come(sight.pixel);
    EXPECT_LE(watch.places(i).share(), places.share() + 1.5 / 12);
    EXPECT_GE(watch.places(i).share(), 0.5 * places.share());
  }
  EXPECT_THAT(watch.told(), AllOf(HasSubstr("The light came to "), HasSubstr("Next: ")));
}

TEST_F(Watching, LfRigRecordSaysItWhileItRecords) {
  ASSERT_NO_FATAL_FAILURE(film(scene_rig(1, 2, 320, 240), "--framerate 15 --seconds 6"));
  const Outcome outcome =
      run_program("lf-rig", "record lights/rig.json --out films --seconds 5 --lights 2", dir_.path());
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, AllOf(HasSubstr("the left is on your right"), HasSubstr("The light came to "),
                                    HasSubstr("Next: "), HasSubstr("films: 2 of 2 cameras")));
  EXPECT_NE(run_program("lf-rig", "record lights/rig.json --out films --lights 3", dir_.path()).status, 0);
}

}  // namespace
}  // namespace lf
