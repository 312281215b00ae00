// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/still_images.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "image/image.h"
#include "support/expect_error.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

Rig three_cameras(const std::string& directory) {
  Rig rig;
  for (int i = 0; i < 3; i++) {
    Camera camera;
    camera.id = static_cast<uint32_t>(100 + i);
    camera.width = 32;
    camera.height = 24;
    camera.image = "cam_" + std::to_string(i) + ".png";
    rig.cameras.push_back(camera);
  }
  rig.directory = directory;
  return rig;
}

Image picture(int seed, int width = 32, int height = 24) {
  Image image(PixelFamily::kRgb, width, height);
  for (size_t i = 0; i < image.data().size(); i++) image.data()[i] = static_cast<uint8_t>((i * 37 + seed * 91) % 251);
  return image;
}

class Folder {
 public:
  Folder() : path_(fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name()) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string path(const std::string& name = "") const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

TEST(StillImages, ReadsOnDemandAndKeepsWhatThereIsRoomFor) {
  const Folder folder;
  Rig rig = three_cameras(folder.path());
  for (int i = 0; i < 3; i++) save_image(picture(i), folder.path(rig.cameras[i].image));
  StillImages images(rig, PixelFamily::kRgb, 2 * 32 * 24 * 3);
  for (CameraIndex i = 0; i < 3; i++) EXPECT_EQ(images.get(i).data(), picture(static_cast<int>(i)).data());
  for (int i = 0; i < 3; i++) fs::remove(folder.path(rig.cameras[i].image));
  EXPECT_EQ(images.get(1).data(), picture(1).data());
  EXPECT_EQ(images.get(2).data(), picture(2).data());
  EXPECT_ERROR(images.get(0), "no such image file");  // it had to go
}

TEST(StillImages, HasImagesIfEveryCameraNamesOne) {
  Rig rig = three_cameras("");
  EXPECT_TRUE(has_images(rig));
  rig.cameras[1].image = "";
  EXPECT_FALSE(has_images(rig));
}

TEST(StillImages, GivesI420WhereAsked) {
  const Folder folder;
  const Rig rig = three_cameras(folder.path());
  save_image(picture(0), folder.path("cam_0.png"));
  EXPECT_EQ(StillImages(rig, PixelFamily::kI420).get(0).data(), to_i420(picture(0)).data());
}

TEST(StillImages, ErrorsNameCameraAndFile) {
  const Folder folder;
  Rig rig = three_cameras(folder.path());
  rig.cameras[0].image = "";
  save_image(picture(0, 31, 24), folder.path("cam_2.png"));
  StillImages images(rig);
  EXPECT_ERROR(images.get(0), "camera 100: the rig names no image for it");
  EXPECT_ERROR(images.get(1), "camera 101: " + folder.path("cam_1.png"));
  EXPECT_ERROR(images.get(2), "camera 102: " + folder.path("cam_2.png") + ": has 31x24 pixels, the rig says 32x24");
}

}  // namespace
}  // namespace lf
