// SPDX-License-Identifier: LGPL-2.1-or-later
#include "image/image.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr int kWidth = 40, kHeight = 30;
constexpr double kFocal = 35;

using Numbers = std::vector<double>;

// Returns the 17 numbers of a pose in the order of LLFF's imgs2poses.py.
Numbers numbers_of(const Pose& pose, double width = kWidth, double height = kHeight, double f = kFocal) {
  const Vec3 columns[] = {pose.down(), pose.right(), -pose.forward(), pose.position, Vec3(height, width, f)};
  Numbers numbers;
  for (int row = 0; row < 3; row++)
    for (const Vec3& column : columns) numbers.push_back(column[row]);
  numbers.insert(numbers.end(), {1.5, 20});
  return numbers;
}

template <typename T>
std::string npy(const Numbers& numbers, const std::string& header, char version = 1) {
  std::string bytes = std::string("\x93NUMPY") + version + '\0';
  for (int i = 0; i < (version == 1 ? 2 : 4); i++) bytes += static_cast<char>(header.size() >> 8 * i & 255);
  bytes += header;
  for (const double value : numbers) {
    const T number = static_cast<T>(value);
    bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
  }
  return bytes;
}

std::string header(size_t rows, const char* type = "<f8") {
  return std::string("{'descr': '") + type + "', 'fortran_order': False, 'shape': (" + std::to_string(rows) +
         ", 17), }\n";
}

// An array of cameras that are turned in all directions, with a picture of each.
class LlffTest : public testing::Test {
 protected:
  LlffTest() {
    for (int i = 0; i < 5; i++) {
      Pose pose;
      pose.position = {0.1 * i, std::sin(i), 0.01 * i * i};
      pose.orientation = glm::normalize(Quat(3, 0.3 * i - 0.5, 0.2 * i, 0.1 - 0.2 * i));
      poses_.push_back(pose);
      save_image(Image(PixelFamily::kRgb, kWidth, kHeight), dir_.write(name(i), ""));
      const Numbers numbers = numbers_of(pose);
      numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    }
    dir_.write("images/notes.txt", "");
    write(npy<double>(numbers_, header(5)));
  }
  // The byte order is the same as for the poses.
  static std::string name(int i) { return "images/IMG_" + std::to_string(2 * i + 3) + ".png"; }
  void write(const std::string& bytes) const { dir_.write("poses_bounds.npy", bytes); }
  std::string import_fails() const {
    const std::string error = text_of_error([&] { import_llff(dir_.path()); });
    EXPECT_THAT(error, HasSubstr(dir_.path()));
    return error;
  }

  const TempDir dir_;
  std::vector<Pose> poses_;
  Numbers numbers_;
};

TEST_F(LlffTest, ReadsPosesLensesAndDepths) {
  for (const auto& bytes : {npy<double>(numbers_, header(5)), npy<double>(numbers_, header(5), 2),
                            npy<float>(numbers_, header(5, "<f4"))}) {
    write(bytes);
    const RigImport import = import_llff(dir_.path());
    ASSERT_EQ(import.rig.cameras.size(), 5u);
    for (size_t i = 0; i < 5; i++) {
      const Camera& camera = import.rig.cameras[i];
      EXPECT_EQ(camera.id, i);
      EXPECT_LT(glm::length(camera.pose.position - poses_[i].position), 1e-6);
      EXPECT_LT(glm::length(camera.pose.forward() - poses_[i].forward()), 1e-6);
      EXPECT_LT(glm::length(camera.pose.right() - poses_[i].right()), 1e-6);
      EXPECT_LT(glm::length(camera.pose.down() - poses_[i].down()), 1e-6);
      EXPECT_EQ(camera.lens, Lens::pinhole(kFocal, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0));
    }
    EXPECT_EQ(depth_note(import), "the scene is from 1.5 to 20 units away (focus-near, focus-far)");
  }
}

TEST_F(LlffTest, ReducedImagesHaveShorterFocalLengths) {
  for (int i = 0; i < 5; i++)
    save_image(Image(PixelFamily::kRgb, kWidth / 4, kHeight / 4),
               dir_.write("images_4/" + std::to_string(i) + ".png", ""));
  const Rig rig = import_llff(dir_.path(), dir_ / "images_4").rig;
  EXPECT_EQ(rig.cameras[0].lens.fx(), kFocal / 4);
  EXPECT_EQ(rig.cameras[0].lens.cy(), 3) << "7 rows";
  EXPECT_EQ(rig.cameras[4].width, kWidth / 4);
}

TEST_F(LlffTest, DamagedFilesAreRefused) {
  const std::string good = npy<double>(numbers_, header(5));
  const auto with = [this](size_t index, double value) {
    Numbers changed = numbers_;
    changed[index] = value;
    return npy<double>(changed, header(5));
  };
  const std::pair<std::string, const char*> cases[] = {
      {"", "NumPy"},
      {"poses", "NumPy"},
      {good.substr(0, 40), "header"},
      {good.substr(0, good.size() - 1), "truncated"},
      {good + "x", "damaged"},
      {npy<double>(numbers_, "{'descr': '<f8', 'fortran_order': False, 'shape': (17, 5), }\n"), "shape"},
      {npy<double>(numbers_, "{'descr': '>f8', 'fortran_order': False, 'shape': (5, 17), }\n"), "<f8"},
      {npy<double>(numbers_, "{'descr': '<f8', 'fortran_order': True, 'shape': (5, 17), }\n"), "Fortran"},
      {npy<double>({}, header(0)), "but has 0"},
      {npy<double>(numbers_, header(999999)), "but has 999999"},
      {npy<double>(Numbers(numbers_.begin(), numbers_.begin() + 34), header(2)), "5 images"},
      {with(17 + 3, std::nan("")), "image 1"},
      {with(34, 5), "image 2: its axes are not a rotation"},
      {with(4, -1), "image 0: height"},
      {with(4, kHeight * 2), "40x60"},
  };
  for (const auto& [bytes, fact] : cases) {
    write(bytes);
    EXPECT_THAT(import_fails(), HasSubstr(fact));
  }
  Numbers mirrored = numbers_;
  for (const size_t row : {0, 5, 10}) mirrored[row] *= -1;
  write(npy<double>(mirrored, header(5)));
  EXPECT_THAT(import_fails(), mentions("image 0", "left-handed"));
}

TEST_F(LlffTest, VideosAreSources) {
  std::filesystem::remove_all(dir_ / "images");
  for (int i = 0; i < 5; i++) dir_.write("cam0" + std::to_string(i) + ".mp4", "");
  const Rig rig = import_llff(dir_.path()).rig;
  EXPECT_EQ(rig.cameras.at(3).name, "cam03");
  EXPECT_EQ(std::filesystem::weakly_canonical(rig.cameras[3].source), dir_ / "cam03.mp4");
  EXPECT_EQ(rig.cameras[3].image, "");
  EXPECT_EQ(rig.cameras[3].height, kHeight);
  dir_.write("cam05.MP4", "");
  EXPECT_THAT(import_fails(), mentions("5 poses", "6 videos"));
}

TEST_F(LlffTest, MissingFilesAreNamed) {
  const TempDir empty;
  EXPECT_ERROR(import_llff(empty.path()), "poses_bounds.npy");
  EXPECT_ERROR(import_llff(dir_.path(), dir_ / "none"), "none: can't be read");
}

// The poses of a real capture, in LLFF's file format.
TEST(Llff, ImportsARealCapture) {
  const std::filesystem::path data = std::filesystem::path(LF_SOURCE_ROOT) / "../shared/data/fern";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "needs ../shared/data";
  const Rig fern = load_rig(data / "rig.json");
  const TempDir dir;
  Numbers numbers;
  for (const Camera& camera : fern.cameras) {
    const Numbers pose = numbers_of(camera.pose, 4.0 * camera.width, 4.0 * camera.height, 4 * camera.lens.fx());
    numbers.insert(numbers.end(), pose.begin(), pose.end());
    std::filesystem::create_directories(dir / "images");
    std::filesystem::create_symlink(std::filesystem::absolute(fern.resolve(camera.image)),
                                    dir / ("images/" + std::filesystem::path(camera.image).filename().string()));
  }
  dir.write("poses_bounds.npy", npy<double>(numbers, header(fern.cameras.size())));
  const Rig rig = import_llff(dir.path()).rig;
  EXPECT_LT(max_reprojection_error(fern, rig, 3), 1e-6);
}

}  // namespace
}  // namespace lf
