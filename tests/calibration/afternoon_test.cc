// SPDX-License-Identifier: LGPL-2.1-or-later
// The afternoon from its beginning to pictures: an array that is not as it was planned films a bar, a chart and then
// the built-in scene, and is to show that as well as if it had been known from the start.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/json_value.h"
#include "calibration/adjustment.h"
#include "calibration/simulator.h"
#include "composite/still.h"
#include "focus/view_focus.h"
#include "image/colour_correction.h"
#include "quality/quality.h"
#include "rig/rig_json.h"
#include "scene/colour_faults.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

using testing::HasSubstr;

constexpr int kStuck = 8, kSeed = 7, kWidth = 240, kHeight = 180;
constexpr double kTime = 0.55;

double rate_of(size_t camera) { return camera % 2 ? 15 : 30; }

std::vector<Pose> poses_of(const Rig& rig) {
  std::vector<Pose> poses;
  for (const Camera& camera : rig.cameras) poses.push_back(camera.pose);
  return poses;
}

class Afternoon : public testing::Test {
 protected:
  Afternoon() : nominal_(make_grid_rig({3, 3, 0.06, 35, kWidth, kHeight})) {
    sim::ArrayOptions options{.rows = 3, .columns = 3, .f = 285, .width = kWidth, .height = kHeight};
    options.k2 = options.k1_spread = options.k2_spread = 0;
    truth_ = sim::make_array(options, 3);
    const double offsets[] = {0.02, -0.013, 0.004, 0.017, -0.02, 0.011, -0.008, 0.0, -0.011};
    for (size_t i = 0; i < 9; i++) truth_.cameras[i].time_offset = offsets[i];
    save_rig(truth_, dir_ / "true.json");
    save_rig(nominal_, dir_ / "nominal.json");
  }
  void record(const std::string& arguments) const {
    const Outcome outcome = run_program("../tools/lf-scene", arguments, dir_.path());
    ASSERT_EQ(outcome.status, 0) << outcome.output;
  }

  // What the array shows of the scene where it is taken for `rig`. Each camera gives the frame that is nearest to the
  // instant by the rig's offsets, with its faults; the rig's colours are corrected. `truth_from_rig` leads to the eye.
  double shown_db(const Rig& rig, const Similarity& truth_from_rig, const View& view) const {
    const std::vector<ColourFault> faults = stuck_faults();
    std::vector<Image> images;
    for (size_t i = 0; i < 9; i++) {
      const Camera &camera = truth_.cameras[i], &known = rig.cameras[i];
      const double frame = std::round((kTime - known.time_offset) * rate_of(i)) / rate_of(i);
      Image image = render_scene({camera.width, camera.height, camera.lens, camera.pose}, frame + camera.time_offset);
      image = with_fault(image, faults[i], camera.principal_point(), i);
      if (known.colour) image = corrected(image, *known.colour, known.principal_point());
      images.push_back(std::move(image));
    }
    View carried = view;
    const Quat back = glm::inverse(truth_from_rig.rotation);
    carried.pose = {back * ((view.pose.position - truth_from_rig.translation) / truth_from_rig.scale),
                    glm::normalize(back * view.pose.orientation)};
    carried.focus.plane = plane_through(carried.pose.world_from_camera({0, 0, kSceneMiddle / truth_from_rig.scale}),
                                        carried.pose.forward());
    const Mesh mesh = build_mesh(rig);
    const CameraImages image_of = [&](CameraIndex i) -> const Image& { return images[i]; };
    const View focused = focus_still(rig, mesh, carried, image_of, {.mode = FocusMode::kSurface});
    const Still still = render_still(rig, mesh, focused, image_of, Resampling::kSharpened);
    const Image scene = render_scene({view.width, view.height, view.lens, view.pose}, kTime);
    return compare(still.picture, scene, still.coverage).psnr_db;
  }
  static std::vector<ColourFault> stuck_faults() {
    std::vector<ColourFault> faults = random_faults(9, kSeed);
    faults[kStuck].gain = kStuckGain;
    return faults;
  }

  const TempDir dir_;
  Rig nominal_, truth_;
};

TEST_F(Afternoon, ItsPicturesAreAsThoseOfTheTrueRig) {
  ASSERT_NO_FATAL_FAILURE(
      record("lights --rig true.json --out lights --framerate 30,15 --seconds 9,8 --noise 3 --exposure 0.012 "
             "--reflection 0.3"));
  ASSERT_NO_FATAL_FAILURE(record("chart --rig true.json --out colours --faults 7 --stuck 8"));
  const Outcome all = run_program(
      "lf-calibrate", "all nominal.json --lights lights --bar 0.3 --colour colours --out rig.json", dir_.path());
  EXPECT_EQ(all.status, 1) << "the stuck camera needs somebody";
  EXPECT_THAT(all.output, HasSubstr("camera 8 cam_02_02: its exposure is stuck"));
  ASSERT_TRUE(std::filesystem::exists(dir_ / "rig.json")) << all.output;
  const Rig found = load_rig(dir_ / "rig.json");
  const nlohmann::json colours = parse_json(read_text_file(dir_ / "rig/colour.json"), "colour.json");
  EXPECT_LE(colours["after"]["median"].get<double>(), 1);
  EXPECT_LE(colours["after"]["p95"].get<double>(), 3);
  double mean = 0, squares = 0;
  for (size_t i = 0; i < 9; i++) {
    const double error = found.cameras[i].time_offset - truth_.cameras[i].time_offset;
    mean += error / 9, squares += error * error / 9;
  }
  const double clocks = std::sqrt(squares - mean * mean);
  EXPECT_LE(clocks, 5e-4);  // seconds

  // Beside the truth the colours are those that were measured: there are no true ones, but of a mean camera.
  Rig known = truth_;
  for (size_t i = 0; i < 9; i++) known.cameras[i].colour = found.cameras[i].colour;
  View view{.width = kWidth,
            .height = kHeight,
            .lens = nominal_.cameras[0].lens,
            .pose = {{-0.022, -0.017, 0}, {1, 0, 0, 0}},
            .focus = {}};
  const double best = shown_db(known, {}, view);
  const double calibrated = shown_db(found, align(poses_of(found), poses_of(truth_)), view);
  const double planned = shown_db(nominal_, align(poses_of(nominal_), poses_of(truth_)), view);
  std::printf("true rig %.2f dB, calibrated %.2f, nominal %.2f; clocks %.3f ms\n", best, calibrated, planned,
              1e3 * clocks);
  EXPECT_GE(calibrated, best - 1);
  EXPECT_LE(planned, best - 3) << "it is worth an afternoon";
}

}  // namespace
}  // namespace lf
