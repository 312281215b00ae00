// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include "image/image.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

void write_images(const TempDir& dir, std::initializer_list<const char*> names) {
  for (const char* name : names) save_image(Image(PixelFamily::kRgb, 8, 6), dir.write(name, ""));
}

TEST(StanfordNames, YPrecedesXAndPointsDown) {
  const TempDir dir;
  write_images(dir, {"out_00_00_-10_20.5_.png", "out_00_01_-10_30.5.png"});
  const RigImport result = import_stanford(dir.path(), {100, 0, 0.001});
  const Rig& rig = result.rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(rig.topology.columns, 2);
  EXPECT_LT(glm::length(rig.cameras[1].pose.position - Vec3(0.0305, -0.01, 0)), 1e-15);
  EXPECT_EQ(rig.cameras[1].lens, Lens::pinhole(100, 3.5, 2.5));
  EXPECT_EQ(result.notes.size(), 1u) << "no focus distance";
}

// Names of the light field "shop" of linusmossberg's light-field-renderer. The first image is at the bottom right.
TEST(StanfordNames, ReadsTheLensOfRenderedLightFields) {
  const TempDir dir;
  write_images(dir, {"Original Camera_00_00_400.000000_400.000000_30_36.png",
                     "Original Camera_00_01_400.000000_-369.230769_30_36.png",
                     "Original Camera_01_00_-369.230769_400.000000_30_36.png",
                     "Original Camera_01_01_-369.230769_-369.230769_30_36.png"});
  const double f = stanford_focal_length(dir.path());
  EXPECT_NEAR(f, 30 * 8 / 36.0, 1e-12);
  const RigImport result = import_stanford(dir.path(), {.f = f});
  EXPECT_TRUE(result.has_unit);
  const Rig& rig = result.rig;
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_LT(glm::length(rig.cameras.at(1).pose.position - Vec3(-0.369230769, 0.4, 0)), 1e-15);
  EXPECT_EQ(build_mesh(rig).faces.size(), 2u);

  write_images(dir, {"Original Camera_02_00_-400.0_400.0_50_36.png"});
  EXPECT_ERROR(stanford_focal_length(dir.path()), "Original Camera_02_00", "Original Camera_00_00", "lens");
  const TempDir damaged;
  write_images(damaged, {"a_00_00_1.0_2.0_30_0.png"});
  EXPECT_ERROR(stanford_focal_length(damaged.path()), "a_00_00_1.0_2.0_30_0.png", "sensor width", "positive");
  const TempDir archive;
  write_images(archive, {"out_00_00_-10_20.5_.png", "lego_12_00_01_-10_30.5.png"});
  EXPECT_EQ(stanford_focal_length(archive.path()), 0);
  EXPECT_FALSE(import_stanford(archive.path(), {.f = 10}).has_unit);
  const TempDir numbered;
  write_images(numbered, {"b_5_12_00_00_1_2.5.png", "b_5_12_00_01_1_3.5.png", "b_5_12_01_00_2_2.5.png"});
  EXPECT_EQ(stanford_focal_length(numbered.path()), 0) << "numbers of the prefix are not row and column";
}

TEST(StanfordNames, PointAtTheFocusDistanceDoesNotMove) {
  const TempDir dir;
  write_images(dir, {"out_00_00_0_0_.png", "out_00_01_1_10_.png", "out_01_00_12_0_.png"});
  const RigImport result = import_stanford(dir.path(), {100, 2, 0.001});
  EXPECT_EQ(result.rig.topology.type, Topology::Type::kDelaunay);
  EXPECT_EQ(result.notes.size(), 1u) << "not a grid";
  std::optional<Vec2> first;
  for (const Camera& camera : result.rig.cameras) {
    const Vec2 pixel = *camera.lens.project(camera.pose.camera_from_world(Vec3(0.01, 0.02, 2)));
    if (!first) first = pixel;
    EXPECT_LT(glm::length(pixel - *first), 1e-12);
  }
}

TEST(StanfordNames, RoundTripsWithin1e9Pixels) {
  const TempDir dir;
  Rig rig = make_grid_rig({2, 3, 0.1, 60, 8, 6});
  const double f = rig.cameras[0].lens.fx();
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    Camera& camera = rig.cameras[i];
    camera.pose.position += Vec3(i / 700.0, i / 900.0, 0);
    camera.image = "in_" + std::to_string(i) + ".png";
    save_image(Image(PixelFamily::kRgb, 8, 6), dir / camera.image);
  }
  Vec3 middle(0, 0, 0);
  for (const Camera& camera : rig.cameras) middle += camera.pose.position / 6.0;
  for (Camera& camera : rig.cameras) {
    const Vec3 shift = (camera.pose.position - middle) * (f / 3);
    camera.lens = Lens::pinhole(f, 3.5 + shift.x, 2.5 + shift.y);
  }
  rig.directory = dir.path();
  const RigExport result = export_stanford(rig, dir / "out");
  EXPECT_LE(result.max_error, 1e-9);
  ASSERT_EQ(result.notes.size(), 2u) << "notes: names, inverse mapping";
  const Rig back = import_stanford(dir / "out", {f, 3}).rig;
  EXPECT_LE(max_reprojection_error(rig, back, 1), 1e-9);
  EXPECT_EQ(back.topology.rows, 2);
  EXPECT_TRUE(std::filesystem::exists(back.cameras[0].image));
}

TEST(StanfordNames, RefusesRigsThatNamesCannotHold) {
  const TempDir dir;
  Rig rig = make_grid_rig({2, 2, 0.1, 60, 8, 6});
  EXPECT_ERROR(export_stanford(rig, dir / "out"), "camera 0", "no image");
  for (Camera& camera : rig.cameras) camera.image = "none.png";
  Rig jittered = rig;
  jittered.cameras[3].pose.position.z = 0.01;
  EXPECT_ERROR(export_stanford(jittered, dir / "out"), "format", "hold");
  EXPECT_FALSE(std::filesystem::exists(dir / "out"));
  EXPECT_ERROR(export_stanford(rig, dir / "out"), "none.png", "copied");
  rig.topology.type = Topology::Type::kDelaunay;
  EXPECT_ERROR(export_stanford(rig, dir / "out"), "grid");
  EXPECT_ERROR(import_stanford(dir / "nowhere", {1}), "nowhere", "read");
  EXPECT_ERROR(import_stanford(dir.path(), {1}), "out_00_01_");
  EXPECT_ERROR(import_stanford(dir.path(), {}), "focal length");
  write_images(dir, {"out_00_00_0_0_.png", "x_00_00_1_10_.png"});
  EXPECT_ERROR(import_stanford(dir.path(), {1}), "same row", "column");
}

}  // namespace
}  // namespace lf
