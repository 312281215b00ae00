// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/import_format.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

struct File {
  const char* name;
  const char* text = "";
};

struct Case {
  std::vector<File> files;
  std::string name, path, images, sign;  // paths are relative to the folder
};

constexpr char kStanford[] = "out_00_01_-381.909271_1038.347534_.png";
constexpr char kMiv[] = R"({"cameras": [{"Name": "v0", "Projection": "Perspective"}]})";
constexpr char kOpenCv[] = "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n";
constexpr char kKalibr[] = "cam0:\n  camera_model: pinhole\n";
constexpr char kDeepView[] = R"([{"name": "a", "radial_distortion": [0], "projection_type": "fisheye"}])";
constexpr char kIni[] = "[intrinsics]\nfocal_length_mm = 5\n";

class ImportFormatTest : public testing::Test {
 protected:
  // Writes the files and returns the folder. A file with the name "NAME/" is a folder.
  static std::string write(const TempDir& dir, const std::vector<File>& files) {
    for (const auto& [name, text] : files)
      if (std::string_view(name).ends_with('/'))
        fs::create_directories(dir / name);
      else
        dir.write(name, text);
    return dir.path();
  }
  std::string write(const std::vector<File>& files) const { return write(dir_, files); }

  const TempDir dir_;
};

TEST_F(ImportFormatTest, FindsTheFormatOfAFolder) {
  const Case cases[] = {
      {{{"camera_array.toml"}, {"config.toml"}}, "caliscope", "camera_array.toml", "", "camera_array.toml"},
      {{{"cameras.txt"}, {"images.txt"}, {"0.png"}}, "colmap", "", "", "images.txt"},
      {{{"cameras.bin"}, {"images.bin"}, {"images/"}}, "colmap", "", "images", "images.bin"},
      {{{"cameras.bin"}, {"cameras.txt"}}, "colmap", "", "", "images.txt"},
      {{{"sparse/0/cameras.bin"}, {"images/"}, {"database.db"}}, "colmap", "sparse/0", "images", "sparse/0/images.bin"},
      {{{"sparse/cameras.txt"}}, "colmap", "sparse", "", "sparse/images.txt"},
      {{{"sparse/0/cameras.txt"}, {"sparse/cameras.bin"}}, "colmap", "sparse/0", "", "sparse/0/images.txt"},
      {{{"models.json", kDeepView}, {"camera_0001.mp4"}}, "deepview", "models.json", "", "models.json"},
      {{{"parameters.cfg", kIni}, {"input_Cam000.png"}}, "hci", "", "", "parameters.cfg"},
      {{{"camchain.yaml"}, {"imu.yaml", "imu0:\n"}}, "kalibr", "camchain.yaml", "", "camchain.yaml"},
      {{{"left_and_right.yml", kKalibr}}, "kalibr", "left_and_right.yml", "", "left_and_right.yml"},
      {{{"poses_bounds.npy"}, {"images/"}}, "llff", "", "", "poses_bounds.npy"},
      {{{"view.json", kMiv}, {"other.json", "{}"}}, "miv", "view.json", "", "view.json"},
      {{{"view.json", R"({"cameras":[{"Focal" : [5, 5]}]})"}}, "miv", "view.json", "", "view.json"},
      {{{"a.cameramodel"}}, "mrcal", "", "", "a.cameramodel"},
      {{{"cam10.cameramodel"}, {"cam2.cameramodel"}}, "mrcal", "", "", "cam2.cameramodel, ..."},
      {{{"transforms.json"}, {"transforms_train.json"}, {"transforms_test.json"}},
       "nerf",
       "transforms.json",
       "",
       "transforms.json"},
      {{{"transforms_train.json"}, {"transforms_val.json"}},
       "nerf",
       "transforms_train.json",
       "",
       "transforms_train.json"},
      {{{"out.yml", kOpenCv}}, "opencv", "out.yml", "", "out.yml"},
      {{{"intrinsics.yml", "M1: 5\nD1: 5\n"}, {"extrinsics.yml", "R: 5\nT: 5\n"}},
       "opencv",
       "intrinsics.yml",
       "",
       "intrinsics.yml"},
      {{{"result.yaml", "Ks:\n- 5\ndistortions:\n- 5\n"}}, "opencv", "result.yaml", "", "result.yaml"},
      {{{kStanford}}, "stanford", "", "", kStanford},
      {{{"a b_00_00_4.00_-4.00_30_36.jpg"}}, "stanford", "", "", "a b_00_00_4.00_-4.00_30_36.jpg"},
      {{{"cameras_parameters.txt"}, {"A_undist_00001_00.png"}}, "technicolor", "", "", "cameras_parameters.txt"},
      {{{kStanford}, {"out_00_00_-381.9_-776.8.PNG"}}, "stanford", "", "", "out_00_00_-381.9_-776.8.PNG, ..."},
  };
  for (const Case& expected : cases) {
    const TempDir dir;
    const fs::path folder = write(dir, expected.files);
    SCOPED_TRACE(expected.sign);
    const auto whole = [&](const std::string& name) {
      return name.empty() ? folder.string() : (folder / name).string();
    };
    const ImportFormat format = find_import_format(folder.string());
    EXPECT_EQ(format.name, expected.name);
    EXPECT_EQ(format.path, whole(expected.path));
    EXPECT_EQ(format.images, expected.images.empty() ? "" : whole(expected.images));
    EXPECT_EQ(format.sign, whole(expected.sign));
    EXPECT_EQ(find_import_format(folder.string() + "/").path, format.path);
  }
}

TEST_F(ImportFormatTest, FindsTheFormatOfAFile) {
  const Case cases[] = {
      {{{"a/camera_array.toml"}}, "caliscope", "a/camera_array.toml", "", ""},
      {{{"b/cameras.txt"}, {"b/images/"}}, "colmap", "b", "b/images", ""},
      {{{"c/parameters.cfg", kIni}, {"c/input_Cam000.png"}}, "hci", "c", "", ""},
      {{{"d/chain", kKalibr}}, "kalibr", "d/chain", "", ""},
      {{{"e/poses_bounds.npy"}}, "llff", "e", "", ""},
      {{{"f/view", kMiv}}, "miv", "f/view", "", ""},
      {{{"g/a.cameramodel"}, {"g/b.cameramodel"}}, "mrcal", "g/a.cameramodel", "", ""},
      {{{"h/transforms_val.json", R"({"frames": [{"transform_matrix": []}]})"}},
       "nerf",
       "h/transforms_val.json",
       "",
       ""},
      {{{"i/result", kOpenCv}}, "opencv", "i/result", "", ""},
      {{{"j/out_00_00_1_2.png"}}, "stanford", "j", "", ""},
      {{{"k/cameras_parameters.txt"}}, "technicolor", "k", "", ""},
      {{{"l/cameras", kDeepView}}, "deepview", "l/cameras", "", ""},
  };
  for (const Case& expected : cases) {
    write(expected.files);
    const ImportFormat format = find_import_format(dir_ / expected.files[0].name);
    EXPECT_EQ(format.name, expected.name);
    EXPECT_EQ(format.path, dir_ / expected.path) << expected.name;
    EXPECT_EQ(format.images, expected.images.empty() ? "" : dir_ / expected.images) << expected.name;
  }
}

TEST_F(ImportFormatTest, PathsAreRelativeToTheCurrentFolder) {
  const fs::path before = fs::current_path();
  fs::current_path(write({{"sparse/0/cameras.txt"}, {"images/"}}));
  const ImportFormat folder = find_import_format(".");
  fs::current_path(dir_ / "sparse/0");
  const ImportFormat file = find_import_format("cameras.txt");
  fs::current_path(before);
  EXPECT_EQ(folder.sign, "sparse/0/images.txt");
  EXPECT_EQ(folder.path, "sparse/0");
  EXPECT_EQ(folder.images, "images");
  EXPECT_EQ(file.path, ".");
}

TEST_F(ImportFormatTest, CommandsCanBePasted) {
  EXPECT_EQ(import_command({"nerf", "a/transforms.json", "", ""}), "lf-rig import nerf a/transforms.json");
  EXPECT_EQ(import_command({"colmap", "my scene/sparse/0", "my scene/images", ""}),
            "lf-rig import colmap 'my scene/sparse/0' --images 'my scene/images'");
  EXPECT_EQ(import_command({"llff", "Ann's", "", ""}), "lf-rig import llff 'Ann'\\''s'");
}

TEST_F(ImportFormatTest, SeveralFormatsAreAnError) {
  const std::string folder = write({{"poses_bounds.npy"}, {"sparse/0/cameras.bin"}, {"images/"}});
  EXPECT_ERROR(find_import_format(folder), "colmap (" + folder + "/sparse/0/images.bin)",
               "llff (" + folder + "/poses_bounds.npy)",
               "\"lf-rig import colmap " + folder + "/sparse/0 --images " + folder + "/images\"",
               "\"lf-rig import llff " + folder + "\"");
}

TEST_F(ImportFormatTest, SeveralFilesOfAFormatWithOneFileAreAnError) {
  const std::string folder = write({{"left.yaml", kOpenCv}, {"right.yaml", kOpenCv}});
  EXPECT_ERROR(find_import_format(folder), "2 files", "opencv", folder + "/left.yaml", folder + "/right.yaml",
               "one file");
  EXPECT_EQ(find_import_format(folder + "/left.yaml").name, "opencv");
}

TEST_F(ImportFormatTest, UnknownFilesAreAnError) {
  const std::string folder = write({{"IMG_2021_05_19_20.jpg"},
                                    {"parameters.cfg", "[intrinsics]\n"},
                                    {"notes.json", R"({"cameras": 5, "text": "Projection, Focal"})"},
                                    {"orb.yaml", "Camera.fx: 5\nmy_camera_matrix: 5\n"},
                                    {"camera_array.toml/"},
                                    {"sparse/"}});
  for (const std::string& path : {folder, folder + "/IMG_2021_05_19_20.jpg", folder + "/orb.yaml"})
    EXPECT_ERROR(find_import_format(path), path + ": ", "camera_array.toml", "cameras.bin", "sparse/0",
                 "parameters.cfg", "camchain", "poses_bounds.npy", "Projection", "*.cameramodel", "transforms.json",
                 "camera_matrix", "out_00_01_");
}

TEST_F(ImportFormatTest, OurRigFilesAreNamed) {
  save_rig(make_grid_rig({2, 2, 0.1, 60, 8, 6}), dir_ / "rig.json");
  for (const std::string& path : {dir_.path(), dir_ / "rig.json"})
    EXPECT_ERROR(find_import_format(path), dir_ / "rig.json", "already a rig file");
  // The output of an earlier import.
  write({{"transforms.json"}});
  EXPECT_EQ(find_import_format(dir_.path()).name, "nerf");
}

TEST_F(ImportFormatTest, UnreadablePathsAreAnError) {
  EXPECT_ERROR(find_import_format(dir_ / "none"), dir_ / "none", "can't be read", "No such file");
  EXPECT_ERROR(find_import_format("/dev/zero"), "/dev/zero", "regular file");
  if (geteuid() == 0) return;  // root can read everything
  fs::permissions(dir_.path(), fs::perms::none);
  EXPECT_ERROR(find_import_format(dir_.path()), dir_.path(), "can't be read", "ermission");
  fs::permissions(dir_.path(), fs::perms::owner_all);
}

}  // namespace
}  // namespace lf
