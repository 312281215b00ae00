// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/stanford_focus.h"

#include <regex>

#include "scene/scene.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

// Exports the built-in scene, 1.2 to 6 m away, with images shifted so that points at `focus` metres have no disparity.
StanfordOptions export_scene(const TempDir& dir, double focus) {
  Rig rig = make_grid_rig({3, 3, 0.06, 40, 320, 240});
  const double f = rig.cameras[0].lens.fx();
  Vec3 middle(0, 0, 0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / 9.0;
  for (Camera& camera : rig.cameras) {
    camera.pose.position -= middle;
    const Vec3 shift = focus > 0 ? camera.pose.position * (f / focus) : Vec3(0);
    camera.lens = Lens::pinhole(f, 159.5 + shift.x, 119.5 + shift.y);
    camera.image = "camera_" + std::to_string(camera.id) + ".png";
    save_image(render_scene({camera.width, camera.height, camera.lens, camera.pose}, 0, 1), dir / camera.image);
  }
  rig.directory = dir.path();
  export_stanford(rig, dir / "named");
  return {.f = f, .focus_distance = focus};
}

TEST(StanfordFocus, IsFoundInThePictures) {
  const TempDir dir;
  const StanfordOptions truth = export_scene(dir, 2.2);
  const RigImport found = import_stanford_pictures(dir / "named", {.f = truth.f, .focus_distance = -1});
  // The assumed depth of the scene changes where points have no disparity, but not the shift of the pictures.
  const Camera &a = found.rig.cameras[0], &b = found.rig.cameras[1];
  const double shift = (b.lens.cx() - a.lens.cx()) / (b.pose.position.x - a.pose.position.x);
  EXPECT_GT(shift, 0.5 * truth.f / truth.focus_distance);
  EXPECT_LT(shift, 2 * truth.f / truth.focus_distance);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("from the images")));
}

TEST(StanfordFocus, UnshiftedPicturesStayUnshifted) {
  const TempDir dir;
  export_scene(dir, 0);
  const RigImport found = import_stanford_pictures(dir / "named", {.focus_distance = -1});
  EXPECT_EQ(found.rig.cameras[0].lens.cx(), 159.5);
  EXPECT_NEAR(found.rig.cameras[0].lens.fx(), 343, 1);
  EXPECT_THAT(found.notes, ElementsAre(HasSubstr("--f"), HasSubstr("unshifted")));
}

// The focal length in the names is 35 mm on a sensor of 36 mm, and a name with a focal length means unshifted images.
TEST(StanfordFocus, TakesTheLensFromTheNames) {
  const TempDir dir;
  export_scene(dir, 2.2);
  for (const auto& entry : std::filesystem::directory_iterator(dir / "named")) {
    // names with a lens need decimal points
    const std::string stem =
        std::regex_replace(entry.path().stem().string(), std::regex(R"(_(-?\d+)(?=(_-?[\d.]+)?_$))"), "_$1.0");
    std::filesystem::copy(entry.path(), dir.write("lens/" + stem + "35_36.png", ""),
                          std::filesystem::copy_options::overwrite_existing);
  }
  const Lens found = import_stanford_pictures(dir / "lens", {.focus_distance = -1}).rig.cameras.at(0).lens;
  EXPECT_EQ(found, Lens::pinhole(320 * 35 / 36.0, 159.5, 119.5));
  const Lens given = import_stanford_pictures(dir / "lens", {.f = 300, .focus_distance = 2}).rig.cameras.at(0).lens;
  EXPECT_EQ(given.fx(), 300);
  EXPECT_NE(given.cx(), 159.5);
}

TEST(StanfordFocus, KeepsGivenOptions) {
  const TempDir dir;
  const StanfordOptions truth = export_scene(dir, 3);
  const Camera found = import_stanford_pictures(dir / "named", truth).rig.cameras[2];
  EXPECT_EQ(found.lens, import_stanford(dir / "named", truth).rig.cameras[2].lens);
}

}  // namespace
}  // namespace lf
