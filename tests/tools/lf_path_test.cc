// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/run_program.h"
#include "support/temp_dir.h"
#include "view/view_path.h"

namespace lf {
namespace {

double depth(const View& view) { return -view.focus.plane.d / view.focus.plane.normal.z; }

class LfPath : public testing::Test {
 protected:
  Outcome lf_path(const std::string& arguments) const { return run_program("lf-path", arguments, dir.path()); }
  void write_rig(const std::string& source, const std::string& image) const {
    Rig rig = scene_rig(3, 3, 32, 24);
    for (Camera& camera : rig.cameras) {
      camera.source = source;
      camera.image = image;
    }
    save_rig(rig, dir / "rig.json");
  }

  const TempDir dir;
};

TEST_F(LfPath, VideosMakeAPathWithTimesAndFocus) {
  write_rig("film.mkv", "");
  test::expect_outcome(
      lf_path("--rig rig.json --out views.json --frames 31 --framerate 10 --near 1.5 --far 3 --width 20 --height 16"),
      0, mentions("31 views", "1.5 to 3 m"));
  const std::vector<NamedView> views = load_views(dir / "views.json");
  ASSERT_EQ(views.size(), 31u);
  EXPECT_NEAR(views[30].time, 3, 1e-9);
  EXPECT_NEAR(depth(views[0].view), 1.5, 1e-9);
  EXPECT_EQ(views[0].view.width, 20);
}

TEST_F(LfPath, WithoutImagesTheFocusFollowsFromTheSize) {
  write_rig("film.mkv", "");
  ASSERT_EQ(lf_path("--rig rig.json --out views.json --frames 5").status, 0);
  const double near = depth(load_views(dir / "views.json")[0].view), extent = 2 * std::sqrt(2.0) * kScenePitch;
  EXPECT_NEAR(near, 2 * extent, 1e-6);
}

TEST_F(LfPath, StillsHaveTimeZero) {
  write_rig("", "still.png");
  test::expect_outcome(lf_path("--rig rig.json --out views.json --frames 5 --near 1 --far 2"), 0);
  for (const NamedView& view : load_views(dir / "views.json")) EXPECT_EQ(view.time, 0);
}

// The viewpoints on both sides of a view must be inside the array as well.
TEST_F(LfPath, PathLeavesRoomForViewSets) {
  write_rig("film.mkv", "");
  const auto widest = [&](const std::string& options) {
    EXPECT_EQ(lf_path("--rig rig.json --out views.json --frames 61 --near 1 --far 2" + options).status, 0);
    double most = 0;
    for (const NamedView& view : load_views(dir / "views.json"))
      most = std::max(most, std::abs(view.view.pose.position.x));
    return most;
  };
  const double all = widest(""), some = widest(" --room " + std::to_string(kScenePitch));
  EXPECT_GT(all, 0);
  EXPECT_LT(some, all);
  EXPECT_LE(some, kScenePitch / 2 + 1e-9) << "the array is two pitches wide, the view set one";
}

TEST_F(LfPath, ErrorsNameTheFileOrOption) {
  write_rig("", "still.png");
  const auto expect_failure = [&](const std::string& arguments, const std::vector<std::string>& facts) {
    test::expect_outcome(lf_path(arguments), 1, mentions(facts));
  };
  expect_failure("--rig no.json --out v.json", {"no.json", "read"});
  expect_failure("--rig rig.json --out v.json", {"still.png", "no such"});
  expect_failure("--rig rig.json --out v.json --near 2 --far 1", {"focus", "near <= far"});
  expect_failure("--rig rig.json --out v.json --frames 0", {"--frames"});
  expect_failure("--rig rig.json --near 1 --far 2 --out no/folder/v.json", {"no/folder/v.json", "written"});
}

}  // namespace
}  // namespace lf
