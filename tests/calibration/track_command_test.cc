// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate track and solve, from rendered recordings to a rig.

#include <nlohmann/json.hpp>

#include "calibration/simulator.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

Rig array() {
  sim::ArrayOptions options;
  options.rows = options.columns = 3;
  options.k1 = -0.1, options.k2 = 0, options.k2_spread = 0;
  Rig rig = rig_subset(sim::make_array(options, 8), {0, 2, 4, 6, 8});
  const double offsets[] = {0.02, -0.015, 0, 0.031, -0.024};
  for (size_t i = 0; i < 5; i++) rig.cameras[i].time_offset = offsets[i];
  return rig;
}

// Records lights with lf-scene into the folder "rec" of `dir`.
void record(const TempDir& dir, const Rig& rig, const std::string& options) {
  save_rig(rig, dir / "true.json");
  test::expect_outcome(run_program("../tools/lf-scene", "lights --rig true.json --out rec " + options, dir.path()), 0);
}

TEST(TrackCommand, CalibratesFromRecordingsOfABar) {
  const TempDir dir;
  const Rig truth = array();
  record(dir, truth, "--framerate 30,15 --seconds 7,6 --noise 3 --exposure 0.012 --reflection 0.3");
  test::expect_outcome(
      run_program("lf-calibrate", "track true.json --recordings rec --bar --out tracks.json", dir.path()), 0,
      AllOf(mentions("tracks.json", "5 of 5 cameras"), mentions("camera 2", "5.9 s", "7.0 s")));

  // Compares with the truth from lf-scene: every detection is a light, within the stated precision.
  const auto found = parse_light_detections(read_text_file(dir / "tracks.json"), "tracks.json");
  const auto expected = parse_light_detections(read_text_file(dir / "rec/lights.json"), "lights.json");
  ASSERT_TRUE(found && expected);
  double squared = 0, count = 0, lights = 0;
  for (size_t i = 0; i < 5; i++) {
    ASSERT_EQ(found->cameras[i].frames.size(), expected->cameras[i].frames.size());
    for (size_t n = 15; n < found->cameras[i].frames.size(); n++)
      for (const LightDetection& light : expected->cameras[i].frames[n].sights) {
        double nearest = 1;
        for (const LightDetection& sight : found->cameras[i].frames[n].sights)
          nearest = std::min(nearest, glm::length(sight.pixel - light.pixel));
        lights++;
        if (nearest < 1) squared += nearest * nearest, count++;
      }
  }
  EXPECT_GT(count, 0.95 * lights);
  EXPECT_LE(std::sqrt(squared / count / 2), 0.1);  // pixels, x and y each

  test::expect_outcome(
      run_program("lf-calibrate", "solve --tracks tracks.json --bar 0.3 --out rig.json --json report.json", dir.path()),
      0, AllOf(HasSubstr("clocks      offsets"), mentions("rig.json", "5 of 5 cameras")));
  const Rig rig = load_rig(dir / "rig.json");
  std::vector<Pose> a, b;
  double mean = 0, squares = 0;
  for (size_t i = 0; i < 5; i++) {
    a.push_back(rig.cameras[i].pose), b.push_back(truth.cameras[i].pose);
    const double e = rig.cameras[i].time_offset - truth.cameras[i].time_offset;
    mean += e / 5, squares += e * e / 5;
    EXPECT_NEAR(rig.cameras[i].lens.fx(), truth.cameras[i].lens.fx(), 0.02 * truth.cameras[i].lens.fx());
  }
  EXPECT_LE(std::sqrt(squares - mean * mean), 5e-4);  // seconds
  const Similarity s = align(a, b);
  EXPECT_NEAR(s.scale, 1, 0.01);
  for (size_t i = 0; i < 5; i++) EXPECT_LE(glm::length(s(a[i]).position - b[i].position), 1e-3);
  const nlohmann::json report = parse_json(read_text_file(dir / "report.json"), "report.json");
  EXPECT_TRUE(report["cameras"][0]["time_offset_ms"].is_number());
  EXPECT_GT(report["cameras"][2]["reflections"].get<int>(), 20);
}

void make_video(const std::string& path, const std::string& source) {
  const std::string line = "gst-launch-1.0 -q " + source +
                           " ! video/x-raw,width=320,height=240,framerate=15/1 ! jpegenc ! matroskamux ! filesink "
                           "location='" +
                           path + "'";
  ASSERT_EQ(std::system(line.c_str()), 0) << line;
}

TEST(TrackCommand, UnusableRecordingsAreNamed) {
  const TempDir dir;
  const Rig truth = array();
  record(dir, truth, "--framerate 15 --seconds 3 --bar 0");
  const auto name = [&](int i) { return dir / "rec/" + truth.cameras[static_cast<size_t>(i)].name + ".mkv"; };
  make_video(name(1), "videotestsrc num-buffers=45 pattern=black");
  make_video(name(3), "videotestsrc num-buffers=45 pattern=snow");
  const Outcome one = run_program("lf-calibrate", "track true.json --recordings rec --out tracks.json", dir.path());
  EXPECT_EQ(one.status, 1) << one.output;
  const auto who = [&](int i) { return "camera " + std::to_string(truth.cameras[static_cast<size_t>(i)].id) + " ("; };
  EXPECT_THAT(one.output, AllOf(HasSubstr(who(1)), mentions("black", "lens"), mentions("room", "not dark")));
  EXPECT_THAT(one.output, mentions("2 of 5", "tracks.json"));
  EXPECT_TRUE(std::filesystem::exists(dir / "tracks.json"));

  // No light; an empty file; no file; two files.
  std::filesystem::remove(dir / "tracks.json");
  make_video(name(0), "videotestsrc num-buffers=45 pattern=solid-color foreground-color=0xff404040");
  dir.write("rec/" + truth.cameras[2].name + ".mkv", "this is no video");
  std::filesystem::remove(name(3));
  std::filesystem::copy(name(4), dir / "rec/" + truth.cameras[4].name + ".mp4");  // a second file for this camera
  test::expect_outcome(run_program("lf-calibrate", "track true.json --recordings rec --out tracks.json", dir.path()), 1,
                       AllOf(HasSubstr("shows no light: "), mentions("no recording", truth.cameras[3].name + ".*"),
                             mentions("both films", truth.cameras[4].name), mentions("two cameras", "light")));
  EXPECT_FALSE(std::filesystem::exists(dir / "tracks.json"));
}

TEST(TrackCommand, CommandLineErrors) {
  const TempDir dir;
  save_rig(array(), dir / "rig.json");
  test::expect_outcome(run_program("lf-calibrate", "track rig.json --out t.json --recordings nowhere", dir.path()), 1,
                       mentions("nowhere", "folder"));
  test::expect_outcome(run_program("lf-calibrate", "track rig.json --out t.json", dir.path()), 1,
                       mentions("no source", "--recordings", "cam_"));
}

}  // namespace
}  // namespace lf
