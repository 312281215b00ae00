// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

// In the style of mrcal 1.0 to 2.5, with the lens of analyses/synthetic_data/2019-01/reference.opencv4.cameramodel and
// the pose of test/data/cam0.opencv8.cameramodel.
constexpr char kModel[] = R"(# generated on 2020-11-14 with   /usr/bin/mrcal-calibrate-cameras --lensmodel ...
# don't parse 'this
{
    'lens_model':  'LENSMODEL_OPENCV4',

    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652,],

    'valid_intrinsics_region': [
    [ 0, 0 ],
    [ 0, 2199 ],
],

    # extrinsics are rt_fromref
    'extrinsics': [ 2e-2, -3e-1, -1e-2,  1., 2, -3., ],

    'imagersize': [ 4000, 2200,],

    # The optimization inputs contain all the data used to compute this model.
    'optimization_inputs': b'P)h>@6aWAK2mlBK0!;#"`{}}]#b*',

}
)";

// The formulas of mrcal's conventions.org (Rodrigues' formula) and of OpenCV's calib3d (k1 k2 p1 p2).
Vec2 mrcal_pixel(const std::vector<double>& k, const std::vector<double>& rt, const Vec3& reference) {
  const Vec3 r(rt[0], rt[1], rt[2]);
  const double angle = glm::length(r);
  const Vec3 axis = r / angle;
  const Vec3 x = reference * std::cos(angle) + glm::cross(axis, reference) * std::sin(angle) +
                 axis * glm::dot(axis, reference) * (1 - std::cos(angle)) + Vec3(rt[3], rt[4], rt[5]);
  const double u = x.x / x.z, v = x.y / x.z, q = u * u + v * v;
  const double radial = 1 + k[4] * q + k[5] * q * q;
  return {k[0] * (u * radial + 2 * k[6] * u * v + k[7] * (q + 2 * u * u)) + k[2],
          k[1] * (v * radial + k[6] * (q + 2 * v * v) + 2 * k[7] * u * v) + k[3]};
}

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kModel;
  const size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

class MrcalTest : public testing::Test {
 protected:
  std::string write(const std::string& text) const { return dir_.write("left.cameramodel", text); }

  const TempDir dir_;
};

TEST_F(MrcalTest, ProjectsLikeMrcal) {
  const RigImport import = import_mrcal(write(kModel));
  ASSERT_EQ(import.rig.cameras.size(), 1u);
  const Camera& camera = import.rig.cameras[0];
  EXPECT_EQ(camera.name, "left");
  EXPECT_EQ(camera.width, 4000);
  EXPECT_EQ(camera.height, 2200);
  EXPECT_EQ(camera.lens.model(), LensModel::kOpenCv);
  for (const Vec3& point : {Vec3(-1, -2, 10), Vec3(-3, 1, 12), Vec3(4, -3, 20)}) {
    const auto pixel = camera.lens.project(camera.pose.camera_from_world(point));
    ASSERT_TRUE(pixel);
    const Vec2 expected = mrcal_pixel({1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516,
                                       0.03590794372, -0.0002547045941, 0.0005275929652},
                                      {2e-2, -3e-1, -1e-2, 1, 2, -3}, point);
    EXPECT_LT(glm::length(*pixel - expected), 1e-9);
  }
}

// Texts of mrcal's test-parser-cameramodel.c: new names of keys, and other places of comments and commas.
TEST_F(MrcalTest, ReadsAllFormsOfTheFile) {
  const RigImport import =
      import_mrcal(write("{\n    'lensmodel':  \"LENSMODEL_PINHOLE\",\n"
                         "    'rt_cam_ref': [ 0., 0, 0, 33, # 44e4, -55.3E-3,\n44e4, -55.3E-3\n#,\n,\n#]\n],"
                         "'intrinsics': [ 4, 3, 4,\n5 ],    'imagersize': [110, 400],# }\n'xxx':\n # fff\n b'rr',"
                         "'qq': b'asdf;lkj&*()DSFEWR]]{}}}'}  \n # }\n"));
  const Camera& camera = import.rig.cameras[0];
  EXPECT_EQ(camera.lens, Lens(LensModel::kPinhole, {4, 3, 4, 5}));
  EXPECT_EQ(camera.pose.position, Vec3(-33, -44e4, 55.3e-3));
  EXPECT_EQ(camera.pose.orientation, Quat(1, 0, 0, 0));
  EXPECT_THAT(import.notes, testing::Contains(mentions("left.cameramodel", "xxx", "qq")));
}

TEST_F(MrcalTest, ReadsTheFilesOfAFolder) {
  for (const int i : {0, 2, 10})
    dir_.write("camera-" + std::to_string(i) + ".cameramodel", replaced("1., 2, -3.", std::to_string(i) + ", 0, 0"));
  dir_.write("board.vnl", "");
  const Rig rig = import_mrcal(dir_.path()).rig;
  ASSERT_EQ(rig.cameras.size(), 3u);
  EXPECT_EQ(rig.cameras[1].name, "camera-2");
  EXPECT_EQ(rig.cameras[2].id, 2u);
  EXPECT_NEAR(glm::length(rig.cameras[2].pose.position), 10, 1e-12);
  const TempDir empty;
  EXPECT_ERROR(import_mrcal(empty.path()), empty.path(), "*.cameramodel");
}

TEST_F(MrcalTest, OtherLensesAreRefused) {
  const std::string more = "0.0005275929652,";
  std::string text = replaced(more, more + " 0,");
  text.replace(text.find("OPENCV4"), 7, "OPENCV5");
  EXPECT_EQ(import_mrcal(write(text)).rig.cameras[0].lens.p2(), 0.0005275929652) << "k3 is 0";
  text.replace(text.find(" 0,]"), 4, " 0.0196,]");
  const Lens lens = import_mrcal(write(text)).rig.cameras[0].lens;
  EXPECT_EQ(lens.model(), LensModel::kFullOpenCv);
  EXPECT_EQ(lens.distortion().k[2], 0.0196);
  text.replace(text.find("OPENCV5"), 7, "OPENCV8");
  text.replace(text.find(" 0.0196,]"), 9, " 0.0196, 0.1, 0.2, 0.3,]");
  EXPECT_EQ(import_mrcal(write(text)).rig.cameras[0].lens.distortion().d, (std::array<double, 3>{0.1, 0.2, 0.3}));
  text.replace(text.find("OPENCV8"), 7, "OPENCV12");
  text.replace(text.find(" 0.3,]"), 6, " 0.3, 0, 0, 0, 1e-4,]");
  EXPECT_ERROR(import_mrcal(write(text)), "left.cameramodel", "intrinsics", "term 11", "mrcal-convert-lensmodel");
  for (const char* name : {"LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=170", "LENSMODEL_CAHVOR"})
    EXPECT_ERROR(import_mrcal(write(replaced("LENSMODEL_OPENCV4", name))), "left.cameramodel", "lens_model", name,
                 "mrcal-reproject-image");
}

TEST_F(MrcalTest, DamagedFilesAreRefused) {
  const InvalidText cases[] = {
      {"", {"object"}},
      {"VERSION 1\nC = 1 2 3\n", {"object"}},
      {replaced("'imagersize'", "'size'"), {"imagersize", "missing"}},
      {replaced("4000, 2200", "4000.5, 2200"), {"imagersize[0]", "integer"}},
      {replaced("4000, 2200", "4000"), {"imagersize", "2"}},
      {replaced("1761.181055, ", ""), {"intrinsics", "8"}},
      {replaced("1761.181055", "-1761"), {"intrinsics", "positive"}},
      {replaced("1., 2, -3.", "1., 2, nan"), {"extrinsics[5]", "number"}},
      {replaced("1., 2, -3., ],", "1., 2, -3.,"), {"line", "Python"}},
      {std::string(kModel) + "} f\n", {"line 23", "after the dictionary"}},
      {replaced("'imagersize'", "'extrinsics'"), {"line 17", "extrinsics", "twice"}},
  };
  for (const auto& [text, facts] : cases) {
    const std::string error = text_of_error([&] { import_mrcal(write(text)); });
    EXPECT_THAT(error, HasSubstr("left.cameramodel"));
    EXPECT_THAT(error, Mentions(facts));
  }
  EXPECT_ERROR(import_mrcal(dir_ / "none"), "none");
}

}  // namespace
}  // namespace lf
