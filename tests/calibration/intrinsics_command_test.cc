// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_json.h"
#include "support/board_views.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

TEST(IntrinsicsCommand, UsesStillBoardsOfAVideo) {
  const TempDir dir;
  const Lens lens(LensModel::kRadial, {420, 319.5, 239.5, -0.1, 0.02});
  std::mt19937 random(5);
  char name[32];
  for (int pose = 0, frame = 0; pose < 10; pose++) {
    const Image picture = picture_of_board(lens, board_pose(random, 0.6), 640, 480, is_white_on_checkerboard);
    for (int i = 0; i < 2; i++, frame++) {
      std::snprintf(name, sizeof name, "%02d.png", frame);
      save_image(picture, dir / name);
    }
  }
  const std::string location = dir.path();
  const std::string make = "gst-launch-1.0 -q multifilesrc location='" + location +
                           "/%02d.png' caps=image/png,framerate=10/1 ! pngdec ! videoconvert ! "
                           "jpegenc quality=98 ! avimux ! filesink location='" +
                           location + "/board.avi'";
  ASSERT_EQ(std::system(make.c_str()), 0);
  test::expect_outcome(
      run_program("lf-calibrate", "intrinsics 'file://" + location + "/board.avi' --board 8x6 --out lens.json",
                  location),
      0, AllOf(mentions("view 8 of 20"), HasSubstr("board.avi frame 1: ")));
  const Lens found = load_rig(dir / "lens.json").cameras.at(0).lens;
  EXPECT_NEAR(found.fx(), 420, 2);
  EXPECT_NEAR(found.cx(), 319.5, 2);

  // The same through a rig, which describes how to open the camera.
  setenv("GST_PLUGIN_PATH", (std::filesystem::path(LF_TOOLS_DIR) / "../gst").c_str(), 0);
  Rig rig = make_grid_rig({1, 2, 0.1, 60, 640, 480});
  rig.cameras[1].source = "filesrc location=\"" + location + "/board.avi\" ! avidemux ! jpegdec";
  save_rig(rig, dir / "rig.json");
  test::expect_outcome(
      run_program("lf-calibrate", "intrinsics --rig rig.json --camera 1 --board 8x6 --views 8 --out rig.json",
                  location),
      0, mentions("rig.json", "camera 1 frame"));
  EXPECT_NEAR(load_rig(dir / "rig.json").cameras[1].lens.fx(), 420, 4);
  EXPECT_EQ(load_rig(dir / "rig.json").cameras[0].lens, rig.cameras[0].lens);

  // Elements that can write files require explicit trust.
  rig.cameras[1].source += " ! tee name=t t. ! queue";
  save_rig(rig, dir / "rig.json");
  const std::string again = "intrinsics --rig rig.json --camera 1 --board 8x6 --views 8 --out other.json";
  EXPECT_EQ(run_program("lf-calibrate", again, location).status, 1);
  test::expect_outcome(run_program("lf-calibrate", again + " --trust-rig", location), 0);
}

TEST(IntrinsicsCommand, ErrorsLeaveNoRig) {
  const TempDir dir;
  save_image(Image(PixelFamily::kRgb, 64, 48), dir / "grey.png");
  const auto expect_failure = [&](const std::string& options, const std::vector<std::string>& facts) {
    test::expect_outcome(run_program("lf-calibrate", "intrinsics --out lens.json " + options, dir.path()), 1,
                         mentions(facts));
    EXPECT_FALSE(std::filesystem::exists(dir / "lens.json"));
  };
  expect_failure("grey.png --board 8x6", {"no image", "8x6"});
  expect_failure("grey.png --board 8", {"number", "inner corners"});
  expect_failure("grey.png --board 8x6 --charuco 5X5", {"dictionary 5X5"});
  save_rig(make_grid_rig({1, 1, 0.1, 60, 64, 48}), dir / "rig.json");
  expect_failure("--board 8x6", {"images", "videos", "--rig"});
  expect_failure("--rig rig.json --board 8x6", {"rig.json", "camera 0", "no source"});
  expect_failure("--rig rig.json --camera 3 --board 8x6", {"rig.json", "camera 3"});
  expect_failure("file:///nothing/here.avi --board 8x6", {"file:///nothing/here.avi", "read"});
}

}  // namespace
}  // namespace lf
