// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Cameras whose colours the rig corrects, from their files to a picture.
#include <gtest/gtest.h>
#include <cmath>

#include <string>
#include <vector>

#include "image/colour_correction.h"
#include "image/image.h"
#include "pipelines/gst_launch.h"
#include "quality/quality.h"
#include "rig/rig_json.h"
#include "scene/colour_faults.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"
#include "view/views_json.h"

namespace lf::test {
namespace {

// Every other camera gives less red and more blue; a rig file with colours says so.
class ColourPipeline : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(3, 3, 160, 120);
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      Camera& camera = rig.cameras[i];
      camera.image = camera.name + "_0.png";
      camera.source = camera.name + "_%d.png";
      const Image film = render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0);
      const ColourFault fault{.balance = i % 2 ? Vec3(0.85, 1, 1.15) : Vec3(1)};
      save_image(with_fault(film, fault, camera.principal_point(), i), dir_ / camera.image);
    }
    save_rig(rig, dir_ / "wrong.json");
    for (size_t i = 1; i < rig.cameras.size(); i += 2)
      rig.cameras[i].colour =
          ColourModel{.matrix = {std::pow(0.85, -kPictureGamma), 0, 0, 0, 1, 0, 0, 0, std::pow(1.15, -kPictureGamma)}};
    save_rig(rig, dir_ / "right.json");
    View view{.width = 160,
              .height = 120,
              .lens = rig.cameras[4].lens,
              .pose = {{0.012, 0.015, 0}, {1, 0, 0, 0}},
              .focus = {}};
    view.focus.plane = plane_through({0, 0, kSceneMiddle}, {0, 0, 1});
    dir_.write("views.json", views_to_json({{"view", 0, view}}));
  }
  Image pipeline(const std::string& rig, const std::string& access = "") {
    const std::string out = dir_ / (rig + ".png");
    const Launched run = gst_launch("lfviewrequest location=" + dir_ / "views.json" + access +
                                    (access.empty() ? "" : " rig=" + dir_ / rig) +
                                    " ! tee name=r r. ! queue ! n.request "
                                    "lfcameranode name=n rig=" +
                                    dir_ / rig + access +
                                    " ! c.sink_0 r. ! queue ! c.request "
                                    "lfcompositor name=c focus=plane rig=" +
                                    dir_ / rig + " ! videoconvert ! pngenc ! filesink location=" + out);
    EXPECT_EQ(run.status, 0) << run.output;
    return load_image(out);
  }
  Image still(const std::string& rig) {
    const Outcome run = run_program(
        "lf-render", "--rig " + rig + " --views views.json --out still-" + rig + " --focus plane", dir_.path());
    EXPECT_EQ(run.status, 0) << run.output;
    return load_image(dir_ / ("still-" + rig + "/view.png"));
  }
  const TempDir dir_;
};

// The mean of a channel: a fault of every other camera is a sixth of what all see, or half.
double mean(const Image& image, size_t channel) {
  double sum = 0;
  for (size_t i = channel; i < image.data().size(); i += 3) sum += image.data()[i];
  return 3 * sum / static_cast<double>(image.data().size());
}

TEST_F(ColourPipeline, ThePictureHasTheColoursThatTheRigSays) {
  const Image wrong = pipeline("wrong.json"), right = pipeline("right.json");
  EXPECT_GT(mean(right, 0), 1.04 * mean(wrong, 0)) << "red comes back";
  EXPECT_NEAR(mean(right, 1) / mean(wrong, 1), 1, 0.01);
  EXPECT_LT(mean(right, 2), 0.98 * mean(wrong, 2)) << "blue goes";
  EXPECT_EQ(right.data(), still("right.json").data()) << "the same to the bit without GStreamer";
}

TEST_F(ColourPipeline, CamerasThatGivePixelsAloneGiveCorrectedOnes) {
  const Image right = pipeline("right.json"), told = pipeline("right.json", " access=pixels");
  EXPECT_GT(compare(told, right, std::vector<float>(160 * 120, 1)).psnr_db, 40);
}

}  // namespace
}  // namespace lf::test
