// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "rig/colmap_model.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/colmap_binary.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr char kImage[] = "1 1 0 0 0 0 0 0 1 a.png\n\n";

struct Colmap : testing::Test {
  void write_model(const std::string& cameras, const std::string& images = kImage) const {
    dir.write("cameras.txt", cameras);
    dir.write("images.txt", images);
  }
  RigImport import_model(const ColmapImportOptions& options = {}) const { return import_colmap(dir.path(), options); }
  const TempDir dir;
};
using ImageSearchTest = Colmap;

TEST_F(ImageSearchTest, FindsByNameAndSuffix) {
  for (const char* name : {"1.jpg", "11.jpg", "20.23.45.jpg", "left/a.png", "right/a.png", "left/b.png", "x_c.png"})
    dir.write(name, "");
  const ImageSearch search(dir.path());
  const std::pair<const char*, const char*> cases[] = {
      {"1.jpg", "1.jpg"},
      {"11.jpg", "11.jpg"},
      {"./left/../1.jpg", "1.jpg"},
      {"left/a.png", "left/a.png"},
      {"2021-05-19 20.23.45.jpg", "20.23.45.jpg"},
      {"b.png", "left/b.png"},
      {"images/left/b.png", "left/b.png"},
      {"c.png", "x_c.png"},
      {"frame 1.jpg", "1.jpg"},
  };
  for (const auto& [name, file] : cases) EXPECT_EQ(search.find(name), dir / file) << name;
}

TEST_F(ImageSearchTest, MissingAndAmbiguousNamesAreErrors) {
  for (const char* name : {"1.jpg", "left/a.png", "right/a.png", "x_c.png", "y_c.png"}) dir.write(name, "");
  const ImageSearch search(dir.path());
  EXPECT_ERROR(search.find("2.jpg"), dir.path(), "no image", "2.jpg");
  EXPECT_ERROR(search.find("21.jpg"), "no image", "21.jpg");  // 1.jpg is not a separate word in 21.jpg
  EXPECT_ERROR(search.find("a.png"), "more than one", "\"a.png\"", "left/a.png", "right/a.png");
  EXPECT_ERROR(search.find("c.png"), "more than one", "c.png");
  EXPECT_ERROR(search.find(""), "no image file");
  dir.write("cam_7.PNG", "");
  EXPECT_ERROR(ImageSearch(dir.path()).find("cam_7.png"), "cam_7.PNG");
  EXPECT_ERROR(ImageSearch(dir.path()).find("cam_7.jpg"), "cam_7.PNG");
  EXPECT_ERROR(ImageSearch(dir / "none"), "none", "read");
  EXPECT_ERROR(ImageSearch(dir / "1.jpg"), "1.jpg", "read");
}

TEST_F(ImageSearchTest, LongNamesAreFast) {
  dir.write("1.jpg", "");
  const ImageSearch search(dir.path());
  std::string name(1 << 20, ' ');
  name += "1.jpg";
  EXPECT_ERROR(search.find(name), "no image");
}

TEST_F(Colmap, ConventionsOfPixelsAndPoses) {
  // camera_from_world: a quarter turn about y, then one metre along x.
  write_model("1 SIMPLE_RADIAL 320 240 400 160 120 0.1\n",
              "7 0.70710678118654752 0 0.70710678118654752 0 1 0 0 1 a b.png\n\n");
  const RigImport result = import_model();
  ASSERT_EQ(result.rig.cameras.size(), 1u);
  const Camera& camera = result.rig.cameras[0];
  EXPECT_EQ(camera.id, 7u);
  EXPECT_EQ(camera.name, "a b");
  EXPECT_EQ(camera.image, "a b.png");
  EXPECT_EQ(camera.lens, Lens(LensModel::kSimpleRadial, {400, 159.5, 119.5, 0.1}))
      << "the centre of 320 pixels is 160 with pixel centres at 0.5, else 159.5";
  // R turns world z to camera x and world x to camera -z: the camera looks along world -x, at c with R c + (1, 0, 0) =
  // 0: c = (0, 0, -1).
  EXPECT_NEAR(glm::length(camera.pose.position - Vec3(0, 0, -1)), 0, 1e-15);
  EXPECT_NEAR(glm::length(camera.pose.forward() - Vec3(-1, 0, 0)), 0, 1e-15);
  EXPECT_EQ(result.rig.topology.type, Topology::Type::kDelaunay);
  EXPECT_EQ(result.notes.size(), 1u) << "sizes were not checked";
}

TEST_F(Colmap, RoundTripsEveryModelWithin1e9Pixels) {
  const Rig rig = mixed_rig();
  const RigExport result = export_colmap(rig, dir / "new/model");
  EXPECT_LE(result.max_error, 1e-9);
  EXPECT_TRUE(result.notes.empty());
  EXPECT_TRUE(std::filesystem::exists(dir / "new/model/points3D.txt"));
  const Rig back = import_colmap(dir / "new/model").rig;
  for (const double distance : {0.5, 3.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  ASSERT_EQ(back.cameras.size(), rig.cameras.size());
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    EXPECT_EQ(back.cameras[i].id, rig.cameras[i].id);
    EXPECT_EQ(back.cameras[i].name, rig.cameras[i].name);
    EXPECT_EQ(back.cameras[i].image, rig.cameras[i].image);
    EXPECT_EQ(back.cameras[i].lens.model(), rig.cameras[i].lens.model());
    EXPECT_EQ(back.cameras[i].width, 320);
    EXPECT_EQ(back.cameras[i].height, 240);
  }
}

TEST_F(Colmap, RoundTripsNamesWithoutImages) {
  Rig rig = mixed_rig();
  for (Camera& camera : rig.cameras) camera.image = "";
  rig.cameras[0].name = "20.23.45";
  export_colmap(rig, dir.path());
  const Rig back = import_model().rig;
  EXPECT_EQ(back.cameras[0].name, "20.23.45");
  EXPECT_EQ(back.cameras[0].image, "");
}

TEST_F(Colmap, ExportReportsLosses) {
  Rig rig = mixed_rig();
  rig.topology = {Topology::Type::kGrid, 1, 5, {}};
  rig.cameras[1].source = "rtsp://host/1";
  rig.cameras[1].time_offset = 0.1;
  const double norm = 1 + 9e-7;  // files may have unnormalised quaternions; COLMAP normalises
  rig.cameras[2].pose.orientation = rig.cameras[2].pose.orientation * norm;
  const RigExport result = export_colmap(rig, dir.path());
  EXPECT_EQ(result.notes.size(), 3u);
  EXPECT_LE(result.max_error, 1e-9);  // Pose::rotation() normalises, so the norm has no effect
}

TEST_F(Colmap, ExportRefusesUnreadableNames) {
  Rig rig = mixed_rig();
  Camera& camera = rig.cameras[1];
  camera.image = "a b.png";
  EXPECT_ERROR(export_colmap(rig, dir.path()), "camera 19", "COLMAP", "a b.png", "first space");
  camera.image = rig.cameras[0].image;
  EXPECT_ERROR(export_colmap(rig, dir.path()), "camera 19", "cam_0.png", "camera 20");
  camera.image = camera.name = "";
  EXPECT_ERROR(export_colmap(rig, dir.path()), "camera 19", "no name");
  rig = mixed_rig();
  rig.cameras[1].id = UINT32_MAX;
  EXPECT_ERROR(export_colmap(rig, dir.path()), "camera 4294967295", "COLMAP", "ids");
  EXPECT_FALSE(std::filesystem::exists(dir / "cameras.txt")) << "nothing is written then";
  dir.write("file", "");
  EXPECT_ERROR(export_colmap(mixed_rig(), dir / "file/x"), "file/x", "made");
}

TEST_F(Colmap, RoundTripsEveryLensModel) {
  using enum LensModel;
  const std::pair<const char*, Lens> cases[] = {
      {"FULL_OPENCV 4 3 5 6 2 1.5 -0.1 0.01 0.001 0.002 0.3 0.4 0.5 0.6",
       Lens(kFullOpenCv, {5, 6, 1.5, 1, -0.1, 0.01, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6})},
      {"OPENCV_FISHEYE 4 3 5 6 2 1.5 0.1 0.2 0.3 0.4", Lens(kOpenCvFisheye, {5, 6, 1.5, 1, 0.1, 0.2, 0.3, 0.4})},
      {"SIMPLE_RADIAL_FISHEYE 4 3 5 2 1.5 0.1", Lens(kSimpleRadialFisheye, {5, 1.5, 1, 0.1})},
      {"RADIAL_FISHEYE 4 3 5 2 1.5 0.1 0.2", Lens(kRadialFisheye, {5, 1.5, 1, 0.1, 0.2})},
      {"THIN_PRISM_FISHEYE 4 3 5 6 2 1.5 0.1 0.2 0.01 0.02 0.3 0.4 0.05 0.06",
       Lens(kThinPrismFisheye, {5, 6, 1.5, 1, 0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.05, 0.06})},
  };
  for (const auto& [line, lens] : cases) {
    write_model(std::string("1 ") + line + "\n");
    const Rig rig = import_model().rig;
    EXPECT_EQ(rig.cameras.at(0).lens, lens) << line;
    export_colmap(rig, dir / "back");
    EXPECT_EQ(import_colmap(dir / "back").rig.cameras.at(0).lens, lens) << line;
  }
}

TEST_F(Colmap, UnsupportedLensesAreErrorsWithTheCamera) {
  const InvalidText cases[] = {
      {"1 FOV 4 3 5 5 2 1.5 0", {"hold", "FOV", "colmap image_undistorter"}},
      {"1 PINHOLE 4 3 5 0 2 1.5", {"params[1]", "focal length", "positive"}},
  };
  for (const auto& c : cases) {
    write_model(c.text);
    EXPECT_ERROR(import_model(), dir / "cameras.txt" + ": camera 1: ");
    EXPECT_ERROR(import_model(), c.facts);
  }
  write_model("1 DIVISION 4 3 5 5 2 1.5 0");
  EXPECT_ERROR(import_model(), "DIVISION", "colmap image_undistorter");
}

TEST_F(Colmap, SizesOfImageFilesMustAgree) {
  write_model("1 PINHOLE 4 3 5 5 2 1.5\n");
  std::filesystem::create_directories(dir / "images");
  EXPECT_ERROR(import_model(), "images", "no image", "a.png");
  save_image(Image(PixelFamily::kRgb, 4, 3), dir / "images/a.png");
  EXPECT_EQ(import_model().rig.cameras[0].image, std::filesystem::proximate(dir / "images/a.png"));
  EXPECT_TRUE(import_model().notes.empty());
  save_image(Image(PixelFamily::kRgb, 8, 2), dir / "images/a.png");
  EXPECT_ERROR(import_model(), dir / "images/a.png", "8x2", "model", "camera 1", "4x3", "--undistorted");
  save_image(Image(PixelFamily::kRgb, 2, 2), dir / "images/a.png");
  for (const bool undistorted : {false, true})
    EXPECT_ERROR(import_model({.images = dir / "images", .undistorted = undistorted}), "2x2", "model", "camera 1",
                 "4x3", "scaled copy");
  dir.write("images/a.png", "not a picture");
  EXPECT_ERROR(import_model(), dir / "images/a.png");
  EXPECT_ERROR(import_model({dir / "nowhere"}), "nowhere", "read");
}

TEST_F(Colmap, UndistortedImagesHavePinholes) {
  write_model("1 SIMPLE_RADIAL 8 6 5 4 3 0.1\n2 OPENCV_FISHEYE 8 6 5 6 4 2 0 0 0 1\n",
              "1 1 0 0 0 0 0 0 1 day 1.png\n\n2 1 0 0 0 0 0 0 2 day 2.png\n\n");
  const ColmapImportOptions options = {dir / "files", true};
  EXPECT_ERROR(import_model({"", true}), "give", "folder");
  save_image(Image(PixelFamily::kRgb, 7, 5), dir.write("files/1.png", ""));
  save_image(Image(PixelFamily::kRgb, 16, 12), dir / "files/2.png");
  const RigImport result = import_model(options);
  ASSERT_EQ(result.rig.cameras.size(), 2u);
  EXPECT_EQ(result.rig.cameras[0].width, 7);
  EXPECT_EQ(result.rig.cameras[0].height, 5);
  EXPECT_EQ(result.rig.cameras[0].lens, Lens(LensModel::kPinhole, {5, 5, 3, 2})) << "the centre stays the centre";
  EXPECT_EQ(result.rig.cameras[1].lens, Lens(LensModel::kPinhole, {5, 6, 7.5, 3.5}));
  EXPECT_THAT(result.notes, ElementsAre(mentions("2", "model", "1.png", "day 1.png", "...")));

  write_model("1 PINHOLE 8 6 5 5 4 3\n", "1 1 0 0 0 0 0 0 1 day 1.png\n\n2 1 0 0 0 0 0 0 1 night 1.png\n\n");
  EXPECT_ERROR(import_model(options), "1.png", "two images", "day 1.png", "night 1.png");
}

// COLMAP's workspace has the folders images and sparse/0.
TEST_F(Colmap, NamesTheImageFolderOfAWorkspace) {
  std::filesystem::create_directories(dir / "w/images");
  dir.write("w/sparse/0/cameras.txt", "1 PINHOLE 4 3 5 5 2 1.5\n");
  dir.write("w/sparse/0/images.txt", kImage);
  EXPECT_THAT(import_colmap(dir / "w/sparse/0").notes.at(0), testing::HasSubstr("--images " + dir / "w/images"));
  EXPECT_ERROR(import_colmap(dir / "w/sparse/0/cameras.txt"), "is a file");
  save_image(Image(PixelFamily::kRgb, 3, 4), dir / "w/images/a.png");
  EXPECT_ERROR(import_colmap(dir / "w/sparse/0", {.images = dir / "w/images"}), "EXIF");
}

TEST_F(Colmap, GridIsInTheOrderOfNames) {
  write_model("1 PINHOLE 8 6 5 5 4 3\n",
              "1 1 0 0 0 0 1 0 1 cam9.png\n\n2 1 0 0 0 0 0 0 1 cam1.png\n\n3 1 0 0 0 1 1 0 1 cam10.png\n\n"
              "4 1 0 0 0 1 0 0 1 cam2.png\n\n");
  const Rig rig = import_model({"", false, 2, 2}).rig;
  EXPECT_EQ(rig.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(rig.topology.rows, 2);
  EXPECT_EQ(rig.topology.columns, 2);
  std::string names;
  for (const Camera& camera : rig.cameras) names += camera.name;
  EXPECT_EQ(names, "cam1cam2cam9cam10") << "by number";
  EXPECT_ERROR(import_model({"", false, 2, 3}), "images.txt", "4 images", "2x3");
}

TEST_F(Colmap, GridOfMisplacedCamerasIsRefused) {
  std::string images;
  for (int i = 0; i < 12; i++)
    images += std::to_string(i + 1) + " 1 0 0 0 " + std::to_string(-(i / 3)) + " " + std::to_string(-(i % 3)) +
              " 0 1 c" + std::to_string(i) + ".png\n\n";
  write_model("1 PINHOLE 8 6 5 5 4 3\n", images);
  EXPECT_EQ(import_model({"", false, 4, 3}).rig.topology.rows, 4) << "rows and columns are swapped";
  EXPECT_ERROR(import_model({"", false, 3, 4}), "order", "3x4");
  EXPECT_ERROR(import_model({"", false, 3, 4}), "--grid");
}

TEST_F(Colmap, ImagesMissingInTheModelAreNamed) {
  write_model("1 PINHOLE 4.0 3 5 5 2 1.5\n");
  for (const char* name : {"images/a.png", "images/b.png", "images/c.png"})
    save_image(Image(PixelFamily::kRgb, 4, 3), dir.write(name, ""));
  EXPECT_THAT(import_model().notes, ElementsAre(mentions("2 of 3", dir / "images", "model", "left out")));
}

TEST_F(Colmap, BinaryModelsMakeTheSameRig) {
  const TempDir text, binary;
  Rig rig = mixed_rig();
  for (size_t i = 0; i < rig.cameras.size(); i++) rig.cameras[i].id = static_cast<uint32_t>(i);
  export_colmap(rig, text.path());
  const ColmapModel model = read_colmap_model(text.path());
  binary.write("cameras.bin", colmap_cameras_file(model.cameras, true));
  binary.write("images.bin", colmap_images_file(model.images, true));
  const RigImport of_text = import_colmap(text.path()), of_binary = import_colmap(binary.path());
  EXPECT_EQ(rig_to_json(of_binary.rig), rig_to_json(of_text.rig));
  EXPECT_EQ(of_binary.notes, of_text.notes);
  EXPECT_EQ(read_text_file(text.path() + "/cameras.txt"), colmap_cameras_file(model.cameras, false));
  text.write("cameras.bin", "old");
  EXPECT_EQ(import_colmap(text.path()).notes.size(), of_text.notes.size() + 1) << "of the binary model";
}

// Two frames of a rig with two cameras, in COLMAP's documentation of frames.txt. The second camera of frame 7 was not
// registered.
TEST_F(Colmap, AFrameIsOneInstantOfARig) {
  write_model("1 PINHOLE 640 480 500 500 320 240\n2 PINHOLE 640 480 510 510 320 240\n",
              "1 1 0 0 0 0 0 0 1 left/0.png\n\n2 1 0 0 0 -1 0 0 2 right/0.png\n\n3 1 0 0 0 0 0 -5 1 left/1.png\n\n");
  const std::string frames =
      "# FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, "
      "SENSOR_ID, DATA_ID)\n6 1 1 0 0 0 0 0 0 2 CAMERA 1 1 CAMERA 2 2\n7 1 1 0 0 0 0 0 -5 3 CAMERA 1 3 CAMERA 2 4 IMU "
      "1 2\n";
  dir.write("frames.txt", frames);
  EXPECT_EQ(import_model().rig.cameras.size(), 3u) << "every image is a camera";
  const Rig rig = import_model({.frame = 6}).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].name, "right/0");
  EXPECT_EQ(rig.cameras[1].pose.position, Vec3(1, 0, 0));
  EXPECT_EQ(import_model({.frame = 7}).rig.cameras.at(0).id, 3u);
  EXPECT_ERROR(import_model({.frame = 8}), dir.path(), "frame 8", "from 6 to 7");

  const TempDir binary;
  const ColmapModel model = read_colmap_model(dir.path());
  binary.write("cameras.bin", colmap_cameras_file(model.cameras, true));
  binary.write("images.bin", colmap_images_file(model.images, true));
  EXPECT_ERROR(import_colmap(binary.path(), {.frame = 6}), "frames.bin", "3.12");
  const auto frame = [](uint32_t id) {
    return test::bytes_of(id, uint32_t{1}, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, uint32_t{2}, int32_t{0}, uint32_t{1},
                          uint64_t{id - 5}, int32_t{1}, uint32_t{1}, uint64_t{2});
  };
  const std::string bytes = test::bytes_of(uint64_t{2}) + frame(6) + frame(8);
  binary.write("frames.bin", bytes);
  const Rig other = import_colmap(binary.path(), {.frame = 8}).rig;
  ASSERT_EQ(other.cameras.size(), 1u) << "the other sensor is not a camera";
  EXPECT_EQ(other.cameras[0].id, 3u);

  const InvalidText texts[] = {
      {frames + "6 1 1 0 0 0 0 0 0 0\n", {"line 4", "FRAME_ID 6", "twice"}},
      {"6 1 1 0 0 0 0 0 0 2 CAMERA 1 1\n", {"line 1", "SENSOR_TYPE", "missing"}},
      {"6 1 1 0 0 0 0 0 nan 0\n", {"line 1", "TZ", "finite"}},
      {"6 1 1 0 0 0 0 0 0 0 5\n", {"line 1", "more data"}},
      {"6 1 1 0 0 0 0 0 0 0\n", {"frame 6", "no image"}},
      {"", {"frame 6", "has none"}},
  };
  for (const auto& [text, facts] : texts) {
    dir.write("frames.txt", text);
    EXPECT_THAT(text_of_error([&] { import_model({.frame = 6}); }), Mentions(facts));
  }
  const InvalidText files[] = {
      {bytes.substr(0, bytes.size() - 1), {"frames.bin", "byte", "truncated within DATA_ID"}},
      {bytes + "x", {"frames.bin", "byte", "more data"}},
      {test::bytes_of(uint64_t{2}) + frame(6) + frame(6), {"frames.bin", "FRAME_ID 6", "twice"}},
      {test::bytes_of(~uint64_t{0}), {"frames.bin", "truncated within FRAME_ID"}},
  };
  for (const auto& [text, facts] : files) {
    binary.write("frames.bin", text);
    EXPECT_THAT(text_of_error([&] { import_colmap(binary.path(), {.frame = 6}); }), Mentions(facts));
  }
}

// rigs.txt of COLMAP's documentation, and a rig with a camera that is not calibrated and another sensor.
TEST_F(Colmap, ARigHasItsCameras) {
  write_model("1 PINHOLE 640 480 500 500 320 240\n2 PINHOLE 640 480 510 510 320 240\n3 PINHOLE 64 48 50 50 32 24\n",
              "7 1 0 0 0 5 5 5 1 rig1/left/0.png\n\n8 1 0 0 0 4 5 5 2 rig1/right/0.png\n\n");
  const std::string rigs =
      "# RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, "
      "QY, QZ, TX, TY, TZ])\n1 2 CAMERA 1 CAMERA 2 1 -0.9999701516465348 -0.0011120266840749639 -0.0075347911527510894 "
      "0.0012985125893421306 -0.19316906391350164 0.00085222218993398979 0.0070758955539026785\n2 1 CAMERA 3\n"
      "5 4 IMU 1 CAMERA 1 1 1 0 0 0 0 0 2 CAMERA 3 0 IMU 2 0\n";
  dir.write("rigs.txt", rigs);
  const RigImport first = import_model({.rig = 1});
  ASSERT_EQ(first.rig.cameras.size(), 2u);
  EXPECT_EQ(first.rig.cameras[0].pose, Pose());
  EXPECT_EQ(first.rig.cameras[1].id, 2u);
  EXPECT_EQ(first.rig.cameras[1].name, "rig1/right");
  EXPECT_EQ(first.rig.cameras[1].lens, Lens(LensModel::kPinhole, {510, 510, 319.5, 239.5}));
  const Vec3 reference = first.rig.cameras[1].pose.camera_from_world({0, 0, 0});
  EXPECT_LT(glm::length(reference - Vec3(-0.19316906391350164, 0.00085222218993398979, 0.0070758955539026785)), 1e-12);
  EXPECT_EQ(import_model({.rig = 2}).rig.cameras.at(0).width, 64);
  const RigImport third = import_model({.rig = 5});
  ASSERT_EQ(third.rig.cameras.size(), 1u);
  EXPECT_EQ(third.rig.cameras[0].pose.position, Vec3(0, 0, -2));
  EXPECT_THAT(third.notes, Contains(mentions("without a pose", "3")));
  EXPECT_ERROR(import_model({.rig = 3}), dir.path(), "rig 3", "from 1 to 5");

  const TempDir binary;
  const ColmapModel model = read_colmap_model(dir.path());
  binary.write("cameras.bin", colmap_cameras_file(model.cameras, true));
  binary.write("images.bin", colmap_images_file(model.images, true));
  EXPECT_ERROR(import_colmap(binary.path(), {.rig = 1}), "rigs.bin", "3.12");
  const auto rig = [](uint32_t id, uint8_t has_pose) {
    return test::bytes_of(id, uint32_t{2}, int32_t{0}, uint32_t{1}, int32_t{0}, uint32_t{2}, has_pose) +
           (has_pose ? test::bytes_of(0.5, 0.5, 0.5, 0.5, 1.0, 2.0, 3.0) : "");
  };
  const std::string bytes = test::bytes_of(uint64_t{2}) + rig(4, 0) + rig(6, 1);
  binary.write("rigs.bin", bytes);
  EXPECT_EQ(import_colmap(binary.path(), {.rig = 4}).rig.cameras.size(), 1u);
  const Rig other = import_colmap(binary.path(), {.rig = 6}).rig;
  ASSERT_EQ(other.cameras.size(), 2u);
  EXPECT_LT(glm::length(other.cameras[1].pose.camera_from_world({0, 0, 0}) - Vec3(1, 2, 3)), 1e-12);

  const InvalidText texts[] = {
      {rigs + "1 1 CAMERA 2\n", {"rigs.txt", "line 5", "RIG_ID 1", "twice"}},
      {"1 2 CAMERA 1\n", {"line 1", "SENSOR_TYPE", "missing"}},
      {"1 2 CAMERA 1 CAMERA 2 2\n", {"line 1", "HAS_POSE", "0 to 1"}},
      {"1 2 CAMERA 1 CAMERA 2 1 0 0 0 0 1 2 3\n", {"line 1", "rotation"}},
      {"1 2 CAMERA 1 CAMERA 1 0\n", {"line 1", "camera 1", "twice"}},
      {"1 1 CAMERA 1 5\n", {"line 1", "more data"}},
      {"1 1 CAMERA 9\n", {"rig 1", "camera 9", "cameras.txt"}},
      {"1 1 IMU 1\n", {"rig 1", "no camera"}},
      {"", {"rig 1", "none"}},
  };
  for (const auto& [text, facts] : texts) {
    dir.write("rigs.txt", text);
    EXPECT_THAT(text_of_error([&] { import_model({.rig = 1}); }), Mentions(facts));
  }
  const InvalidText files[] = {
      {bytes.substr(0, bytes.size() - 1), {"rigs.bin", "byte", "truncated within TZ"}},
      {bytes + "x", {"rigs.bin", "byte", "more data"}},
      {test::bytes_of(uint64_t{1}) + rig(6, 2), {"rigs.bin", "HAS_POSE", "2"}},
  };
  for (const auto& [text, facts] : files) {
    binary.write("rigs.bin", text);
    EXPECT_THAT(text_of_error([&] { import_colmap(binary.path(), {.rig = 6}); }), Mentions(facts));
  }
}

TEST_F(Colmap, MissingAndEmptyModels) {
  EXPECT_ERROR(import_model(), "cameras.txt", "read", "positions");
  dir.write("sparse/0/cameras.txt", "");
  EXPECT_ERROR(import_model(), "model", dir / "sparse/0");
  dir.write("llff/poses_bounds.npy", "");
  EXPECT_ERROR(import_colmap(dir / "llff"), "llff", "lf-rig import llff");
  dir.write("cameras.bin", "");
  EXPECT_ERROR(import_model(), "cameras.bin", "byte 0");
  write_model("1 PINHOLE 8 6 5 5 4 3\n", "# none\n");
  EXPECT_ERROR(import_model(), "images.txt: no images");
}

TEST_F(Colmap, RoundTripsTheRealRigs) {
  const std::filesystem::path data = std::filesystem::path(LF_SOURCE_ROOT) / "../shared/data";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "needs ../shared/data";
  for (const char* name : {"chess", "toys"}) {
    const Rig rig = load_rig(data / name / "rig.json");
    EXPECT_LE(export_colmap(rig, dir / name).max_error, 1e-9);
    const Rig back = import_colmap(dir / name).rig;
    for (const double distance : {1.0, 10.0, 100.0}) EXPECT_LE(max_reprojection_error(rig, back, distance), 1e-9);
  }
}

}  // namespace
}  // namespace lf
