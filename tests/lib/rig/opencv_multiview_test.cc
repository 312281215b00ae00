// SPDX-License-Identifier: LGPL-2.1-or-later

#include <opencv2/core.hpp>

#include "rig/exchange.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

constexpr int kCameras = 3, kTerms = 5;

// Rodrigues' formula, as in cv::Rodrigues().
Vec3 rotated(const Vec3& rvec, const Vec3& x) {
  const double angle = glm::length(rvec);
  const Vec3 axis = rvec / angle;
  return x * std::cos(angle) + glm::cross(axis, x) * std::sin(angle) + axis * glm::dot(axis, x) * (1 - std::cos(angle));
}

// The results of a calibration. saveToFile() of OpenCV's multiview_calibration.py writes arrays of numpy, of which
// three-dimensional ones become matrices with several channels.
struct MultiviewYaml : testing::Test {
  MultiviewYaml() {
    for (int i = 0; i < kCameras; i++) {
      sizes(i, 0) = 640 + i;
      sizes(i, 1) = 480;
      const double focal = 500 + 10 * i;
      Ks.at<cv::Vec3d>(i, 0) = {focal, 0, 320.5};
      Ks.at<cv::Vec3d>(i, 1) = {0, focal + 1, 240.25};
      Ks.at<cv::Vec3d>(i, 2) = {0, 0, 1};
      const double terms[] = {0.1 - 0.01 * i, -0.05, 0.002, -0.001 * i, 0};
      for (int k = 0; k < kTerms; k++) distortions(kTerms * i + k) = terms[k];
      const Vec3 rvec(0.1 * i, -0.2 * i, 0.05);
      const Vec3 columns[] = {rotated(rvec, {1, 0, 0}), rotated(rvec, {0, 1, 0}), rotated(rvec, {0, 0, 1})};
      for (int r = 0; r < 3; r++) {
        rvecs(i, r) = rvec[r];
        Rs.at<cv::Vec3d>(i, r) = {columns[0][r], columns[1][r], columns[2][r]};
        Ts(i, r) = i == 0 ? 0 : 0.3 * r - 0.2 * i;
      }
    }
  }
  std::string text() const {
    cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    file << "Rs" << Rs << "distortions" << distortions << "Ks" << Ks << "Ts" << Ts << "models" << models
         << "image_sizes" << sizes << "detection_mask" << cv::Mat(kCameras, 4, CV_8U, cv::Scalar(1)) << "cam_ids"
         << std::vector<std::string>{"left", "middle", "right"};
    return file.releaseAndGetString();
  }
  RigImport read(const std::string& yaml, bool undistorted = false) const {
    return import_opencv_yaml(dir.write("cameras.yaml", yaml), undistorted);
  }

  cv::Mat_<int> sizes = cv::Mat_<int>(kCameras, 2), models = cv::Mat_<int>::zeros(kCameras, 1);
  cv::Mat Ks = cv::Mat(kCameras, 3, CV_64FC3), Rs = cv::Mat(kCameras, 3, CV_64FC3);
  cv::Mat_<double> distortions = cv::Mat_<double>(kCameras * kTerms, 1);
  cv::Mat_<double> rvecs = cv::Mat_<double>(kCameras, 3), Ts = cv::Mat_<double>(kCameras, 3);
  const TempDir dir;
};

TEST_F(MultiviewYaml, ProjectsLikeOpenCv) {
  const RigImport import = read(text());
  ASSERT_EQ(import.rig.cameras.size(), 3u);
  EXPECT_THAT(import.notes, testing::Not(testing::Contains(HasSubstr("not read"))));
  for (int i = 0; i < kCameras; i++) {
    const Camera& camera = import.rig.cameras[i];
    EXPECT_EQ(camera.width, 640 + i);
    EXPECT_EQ(camera.height, 480);
    const auto* const k = &distortions(kTerms * i);  // k1 k2 p1 p2
    for (const Vec3& point : {Vec3(0.1, -0.2, 4), Vec3(-0.5, 0.3, 6)}) {
      const Vec3 x = rotated({rvecs(i, 0), rvecs(i, 1), rvecs(i, 2)}, point) + Vec3(Ts(i, 0), Ts(i, 1), Ts(i, 2));
      const double u = x.x / x.z, v = x.y / x.z, q = u * u + v * v, radial = 1 + k[0] * q + k[1] * q * q;
      const Vec2 expected((500 + 10 * i) * (u * radial + 2 * k[2] * u * v + k[3] * (q + 2 * u * u)) + 320.5,
                          (501 + 10 * i) * (v * radial + k[2] * (q + 2 * v * v) + 2 * k[3] * u * v) + 240.25);
      const auto pixel = camera.lens.project(camera.pose.camera_from_world(point));
      ASSERT_TRUE(pixel);
      EXPECT_LT(glm::length(*pixel - expected), 1e-9);
    }
  }
  EXPECT_EQ(import.rig.cameras[2].name, "right");
}

// Versions before OpenCV 5 write rotation vectors, and the names as one text.
TEST_F(MultiviewYaml, ReadsOlderFiles) {
  cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  const int dimensions[] = {kCameras, 3, 3};
  file << "rvecs" << rvecs << "distortions" << distortions.reshape(1, kCameras) << "Ks"
       << cv::Mat(3, dimensions, CV_64F, Ks.data) << "Ts" << Ts << "is_fisheye" << models << "image_sizes" << sizes
       << "cam_ids"
       << "a,b,c";
  const Rig rig = read(file.releaseAndGetString()).rig;
  EXPECT_EQ(rig.cameras.at(1).name, "b");
  EXPECT_LT(max_reprojection_error(rig, read(text()).rig, 2), 1e-9);
}

TEST_F(MultiviewYaml, UndistortedPicturesHavePinholes) {
  distortions(9) = 0.4;
  models(1) = 1;
  EXPECT_ERROR(read(text()), "cameras.yaml", "camera 1", "fisheye", "--undistorted") << "five terms";
  models(1) = 2;
  EXPECT_ERROR(read(text()), "cameras.yaml", "models", "0 (pinhole) or 1 (fisheye)");
  models(1) = 1;
  const RigImport import = read(text(), true);
  EXPECT_EQ(import.rig.cameras[1].lens, Lens(LensModel::kPinhole, {510, 511, 320.5, 240.25}));
  EXPECT_THAT(import.notes, testing::Not(testing::Contains(HasSubstr("free of distortion"))));
}

TEST_F(MultiviewYaml, ReadsFisheyeLensesAndK3) {
  models(1) = 1;
  distortions(14) = 0.25;
  const Rig rig = read(text()).rig;
  const Distortion<double>& fisheye = rig.cameras[1].lens.distortion();
  EXPECT_EQ(rig.cameras[1].lens.model(), LensModel::kOpenCvFisheye);
  for (int i = 0; i < 4; i++) EXPECT_EQ(fisheye.k[i], distortions(5 + i));
  EXPECT_EQ(rig.cameras[2].lens.model(), LensModel::kFullOpenCv);
  EXPECT_EQ(rig.cameras[2].lens.distortion().k[2], 0.25);
}

TEST_F(MultiviewYaml, OtherFormsOfTheFileCanBeUndistorted) {
  const std::string yaml =
      "%YAML:1.0\n---\nimage_width: 4\nimage_height: 3\ndistortion_model: equidistant\n"
      "camera_matrix: {rows: 3, cols: 3, data: [5, 0, 2, 0, 6, 1.5, 0, 0, 1]}\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0.2]}\n";
  EXPECT_ERROR(read(yaml), "cameras.yaml", "k1, k2, k3 and k4");
  const RigImport import = read(yaml, true);
  EXPECT_EQ(import.rig.cameras.at(0).lens, Lens(LensModel::kPinhole, {5, 6, 2, 1.5}));
  EXPECT_THAT(import.notes, testing::Not(testing::Contains(HasSubstr("free of distortion"))));
}

TEST_F(MultiviewYaml, DamagedFilesAreRefused) {
  const std::string good = text();
  const auto without = [&](const std::string& key) {
    std::string yaml = good;
    return yaml.replace(yaml.find("\n" + key + ":") + 1, key.size(), "x_" + key);
  };
  const auto with = [&](const cv::Mat& matrix, const std::string& key) {
    cv::FileStorage file(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
    file << key << matrix;
    const std::string yaml = file.releaseAndGetString();
    return without(key) + yaml.substr(yaml.find(key + ":"));
  };
  const cv::Mat_<double> small = cv::Mat_<double>::ones(2, 4);
  cv::Mat skewed = Ks.clone(), negative = Ks.clone(), stretched = Rs.clone();
  skewed.at<cv::Vec3d>(1, 0)[1] = 0.5;
  negative.at<cv::Vec3d>(2, 0)[0] = -5;
  stretched.at<cv::Vec3d>(0, 0)[0] = 1.5;
  const InvalidText cases[] = {
      {without("Ts"), {"Ts", "missing"}},
      {without("Rs"), {"rvecs", "missing"}},
      {without("image_sizes"), {"image_sizes", "missing"}},
      {with(small, "Ts"), {"Ts", "9", "8"}},
      {with(small, "Rs"), {"Rs", "rotation"}},
      {with(small, "Ks"), {"Ks", "27", "8"}},
      {with(small, "distortions"), {"distortions", "same number", "3"}},
      {with(small * 0.5, "image_sizes"), {"Ks", "36", "27"}},
      {with(-sizes, "image_sizes"), {"image_sizes", "camera 0"}},
      {with(skewed, "Ks"), {"Ks", "camera 1", "skew"}},
      {with(negative, "Ks"), {"Ks", "camera 2", "positive"}},
      {with(stretched, "Rs"), {"Rs", "orthonormal"}},
      {with(cv::Mat(), "Ks"), {"Ks", "27", "0"}},
  };
  for (const auto& [yaml, facts] : cases) {
    const std::string error = text_of_error([&] { read(yaml); });
    EXPECT_THAT(error, HasSubstr("cameras.yaml"));
    EXPECT_THAT(error, Mentions(facts));
  }
}

}  // namespace
}  // namespace lf
