// SPDX-License-Identifier: LGPL-2.1-or-later
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/text.h"
#include "calibration/adjustment.h"
#include "geometry/pose.h"
#include "rig/rig_json.h"
#include "support/printed_boards.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kInstants = 10;
const CalibrationBoard kCharuco{.columns = 8,
                                .rows = 5,
                                .square = 0.03,
                                .kind = CalibrationBoard::Kind::kCharuco,
                                .dictionary = "5X5_100",
                                .marker = 0.7};

Rig three_cameras() {
  Rig rig = make_grid_rig({1, 3, 0.1, 50, 480, 360});
  for (size_t i = 0; i < rig.cameras.size(); i++) {
    rig.cameras[i].lens = Lens(LensModel::kRadial, {420 + 5.0 * static_cast<double>(i), 240, 180, -0.1, 0.02});
    rig.cameras[i].pose.orientation = glm::angleAxis(0.05 - 0.05 * static_cast<double>(i), Vec3(0, 1, 0));
    rig.cameras[i].pose.position.z += 0.01 * static_cast<double>(i);
  }
  return rig;
}

// Photographs of a board in `folder`/NAME/NUMBER.png.
void photograph_board(const Rig& rig, const CalibrationBoard& board, const std::string& folder) {
  const test::Print print = test::print_of(board);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<test::PrintCamera> cameras;
  for (const Camera& camera : rig.cameras) {
    fs::create_directories(fs::path(folder) / camera.name);
    cameras.emplace_back(camera.lens, camera.width, camera.height);
  }
  for (int n = 0; n < kInstants; n++) {
    const Quat turn = glm::angleAxis(0.6 * uniform(random), Vec3(1, 0, 0)) *
                      glm::angleAxis(0.6 * uniform(random), Vec3(0, 1, 0)) *
                      glm::angleAxis(uniform(random), Vec3(0, 0, 1));
    const Vec3 at(0.06 * uniform(random), 0.05 * uniform(random), 0.5 + 0.12 * uniform(random));
    const Vec2 middle = board.corner(board.num_corners() - 1) / 2.0;
    const Pose world_from_board{at - glm::mat3_cast(turn) * Vec3(middle, 0), turn};
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      const Camera& camera = rig.cameras[i];
      const Quat inverse = glm::conjugate(camera.pose.orientation);
      const Pose camera_from_board{camera.pose.camera_from_world(world_from_board.position), inverse * turn};
      save_image(cameras[i].photograph(print, board.square, camera_from_board),
                 fs::path(folder) / camera.name / (std::to_string(n) + ".png"));
    }
  }
}

double position_error(const Rig& found, const Rig& truth) {
  std::vector<Pose> a, b;
  for (size_t i = 0; i < truth.cameras.size(); i++)
    a.push_back(found.cameras.at(i).pose), b.push_back(truth.cameras[i].pose);
  const Similarity s = align(a, b, true);
  double worst = 0;
  for (size_t i = 0; i < a.size(); i++) worst = std::max(worst, glm::length(s(a[i]).position - b[i].position));
  return worst;
}

TEST(BoardsCommand, CalibratesACharucoBoard) {
  const TempDir dir;
  const Rig truth = three_cameras();
  CalibrationBoard board = kCharuco;
  board.columns = 7;
  board.legacy = board.inverted = true;
  photograph_board(truth, board, dir / "boards");
  const std::string options = " --board 7x5 --square 0.03 --charuco 5X5_100 --marker 0.7";
  test::expect_outcome(
      run_program("lf-calibrate",
                  "boards boards" + options + " --legacy --inverted --threads 2 --out rig.json --json boards.json",
                  dir.path()),
      0, testing::AllOf(mentions("rig.json: 3 of 3 cameras"), mentions("cam_00_00"), mentions("residuals")));
  const Rig found = load_rig(dir / "rig.json");
  EXPECT_LT(position_error(found, truth), 2e-3);
  EXPECT_EQ(found.cameras[2].name, truth.cameras[2].name);
  for (size_t i = 0; i < 3; i++) EXPECT_NEAR(found.cameras[i].lens.fx(), truth.cameras[i].lens.fx(), 4) << i;
  const json report = parse_json(read_text_file(dir / "boards.json"), "boards.json");
  EXPECT_EQ(report["scale_from"], "the board's size");
  EXPECT_LT(report["inliers"]["rms_px"], 0.2);
  EXPECT_EQ(report["cameras"][1]["position_covariance"].size(), 3u);
  const json rig = parse_json(read_text_file(dir / "rig.json"), "rig.json");
  EXPECT_GE(rig["cameras"][0]["covariance"]["parameters"].size(), 9u);
  test::expect_outcome(run_program("lf-calibrate", "report boards.json --out report.html", dir.path()), 0,
                       mentions("report.html"));

  // The same with the layout of a nominal rig, which defines the frame.
  save_rig(truth, dir / "nominal.json");
  test::expect_outcome(
      run_program("lf-calibrate",
                  "boards boards" + options + " --legacy --inverted --prior nominal.json --out again.json", dir.path()),
      0, mentions("again.json: 3 of 3 cameras"));
  EXPECT_LT(glm::length(load_rig(dir / "again.json").cameras[0].pose.position - truth.cameras[0].pose.position), 5e-3);

  // One camera alone.
  const auto focal_of = [&](const std::string& more) {
    test::expect_outcome(
        run_program("lf-calibrate", "intrinsics boards/cam_00_01/*.png --out lens.json " + more, dir.path()), 0);
    return load_rig(dir / "lens.json").cameras.at(0).lens.fx();
  };
  EXPECT_NEAR(focal_of("--board 7x5 --charuco 5X5_100 --marker 0.7 --legacy --inverted"), 425, 8);

  // The other layout does not fit the markers.
  test::expect_outcome(
      run_program("lf-calibrate", "boards boards" + options + " --inverted --out wrong.json", dir.path()), 1,
      mentions("markers", "7x5", "--board", "--legacy"));
  EXPECT_FALSE(fs::exists(dir / "wrong.json"));
}

TEST(BoardsCommand, CalibratesAnAprilGridInVideos) {
  const TempDir dir;
  const Rig truth = three_cameras();
  photograph_board(truth, {.columns = 5, .rows = 4, .square = 0.045, .kind = CalibrationBoard::Kind::kAprilGrid},
                   dir / "stills");
  // Videos at different rates: the board stands still for a moment in each position.
  fs::create_directories(dir / "boards");
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const std::string name = truth.cameras[i].name;
    const std::string make = "gst-launch-1.0 -q multifilesrc location='" + dir / "stills" + "/" + name +
                             "/%d.png' caps=image/png,framerate=1/1 ! pngdec ! videoconvert ! videorate ! "
                             "video/x-raw,framerate=" +
                             (i == 1 ? "15" : "10") + "/1 ! jpegenc quality=98 ! matroskamux ! filesink location='" +
                             dir / "boards" + "/" + name + ".mkv'";
    ASSERT_EQ(std::system(make.c_str()), 0);
  }
  test::expect_outcome(
      run_program("lf-calibrate",
                  "boards boards --board 5x4 --square 0.045 --april-grid 0.3 --instants 40 --out rig.json", dir.path()),
      0, mentions("rig.json: 3 of 3 cameras"));
  EXPECT_LT(position_error(load_rig(dir / "rig.json"), truth), 2e-3);
  test::expect_outcome(
      run_program("lf-calibrate",
                  "intrinsics stills/cam_00_01/*.png --board 5x4 --square 0.045 --april-grid 0.3 --out lens.json "
                  "--json lens_report.json",
                  dir.path()),
      0);
  EXPECT_NEAR(load_rig(dir / "lens.json").cameras.at(0).lens.fx(), 425, 8);
  EXPECT_EQ(parse_json(read_text_file(dir / "lens_report.json"), "lens_report.json").at("views").size(), 10u);
}

TEST(BoardsCommand, ErrorsNameTheProblem) {
  const TempDir dir;
  for (const char* path : {"boards/a/1.png", "boards/b/1.png", "alone/a/1.png"}) {
    fs::create_directories(fs::path(dir / path).parent_path());
    save_image(Image(PixelFamily::kRgb, 64, 48), dir / path);
  }
  const auto expect_failure = [&](const std::string& options, const std::vector<std::string>& facts) {
    test::expect_outcome(run_program("lf-calibrate", "boards --square 0.03 --out rig.json " + options, dir.path()), 1,
                         mentions(facts));
    EXPECT_FALSE(fs::exists(dir / "rig.json"));
  };
  expect_failure("boards --board 9x6", {"no picture", "9x6", "--board"});
  expect_failure("boards --board 9x6 --charuco 5X5_100", {"no picture", "ChArUco", "5X5_100", "--inverted"});
  expect_failure("boards --board 9x6 --charuco 5X5", {"--board 9x6", "dictionary 5X5"});
  expect_failure("boards --board 9", {"--board 9", "inner corners"});
  expect_failure("alone --board 9x6", {"alone", "fewer than two cameras"});
  expect_failure("nowhere --board 9x6", {"nowhere", "not a folder"});
  EXPECT_NE(run_program("lf-calibrate", "boards boards --board 9x6 --out rig.json", dir.path()).status, 0);
  save_rig(make_grid_rig({1, 2, 0.1, 60, 64, 48}), dir / "two.json");
  expect_failure("boards --board 9x6 --prior two.json", {"cam_00_00", "neither a video", "nor images"});
}

// Three cameras with clocks of their own film a moving board.
TEST(BoardsCommand, EstimatesTimesInVideos) {
  const TempDir dir;
  const Rig truth = three_cameras();
  const CalibrationBoard board = kCharuco;
  const test::Print print = test::print_of(board);
  constexpr double kLate[] = {0, 0.03, -0.7};  // seconds
  fs::create_directories(dir / "boards");
  for (size_t i = 0; i < truth.cameras.size(); i++) {
    const Camera& camera = truth.cameras[i];
    cv::VideoWriter film(dir / "boards" + "/" + camera.name + ".avi", cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, cv::Size(camera.width, camera.height));
    ASSERT_TRUE(film.isOpened());
    const test::PrintCamera print_camera(camera.lens, camera.width, camera.height);
    for (int n = 0; n < 60; n++) {
      const double t = n / 10.0 + kLate[i] + 3;
      const Quat turn = glm::angleAxis(0.5 * std::sin(0.9 * t), Vec3(1, 0, 0)) *
                        glm::angleAxis(0.5 * std::sin(1.3 * t + 1), Vec3(0, 1, 0)) *
                        glm::angleAxis(0.7 * std::sin(0.7 * t), Vec3(0, 0, 1));
      const Vec3 at(0.06 * std::sin(1.1 * t), 0.05 * std::sin(0.8 * t + 1), 0.5 + 0.12 * std::sin(0.6 * t));
      const Vec3 middle(board.corner(board.num_corners() - 1) / 2.0, 0);
      const Quat inverse = glm::conjugate(camera.pose.orientation);
      const Pose camera_from_board{camera.pose.camera_from_world(at - turn * middle), inverse * turn};
      const Image image = print_camera.photograph(print, board.square, camera_from_board);
      cv::Mat picture(camera.height, camera.width, CV_8UC3);
      for (int y = 0; y < camera.height; y++)
        for (int x = 0; x < camera.width; x++)
          for (int c = 0; c < 3; c++) picture.at<cv::Vec3b>(y, x)[c] = image.pixel(x, y)[2 - c];
      film.write(picture);
    }
  }
  const std::string command =
      "boards boards --board 8x5 --square 0.03 --charuco 5X5_100 --marker 0.7 --instants 25 --reach 2 --out rig.json "
      "--json boards.json";
  test::expect_outcome(run_program("lf-calibrate", command, dir.path()), 0,
                       testing::AllOf(mentions("rig.json: 3 of 3 cameras"), mentions("clocks")));
  const Rig found = load_rig(dir / "rig.json");
  EXPECT_LT(position_error(found, truth), 4e-3);
  for (const size_t i : {1, 2})
    EXPECT_NEAR(found.cameras[i].time_offset - found.cameras[0].time_offset, kLate[i], 2e-3) << i;
  const json report = parse_json(read_text_file(dir / "boards.json"), "boards.json");
  EXPECT_LT(report["cameras"][2]["time_offset_sigma_ms"], 2);
  EXPECT_TRUE(report["cameras"][2]["readout_ms"].is_number());
  test::expect_outcome(run_program("lf-calibrate", "report boards.json --out report.html", dir.path()), 0);
  EXPECT_MENTIONS(read_text_file(dir / "report.html"), "Clock offsets");
}

// The stereo pair of OpenCV's documentation, and OpenCV's own calibration of these pictures.
const fs::path kSamples = "/usr/share/doc/opencv-doc/examples/data";

struct StereoResult {
  double rms = 0, baseline = 0, focal = 0;  // pixels, squares, pixels of the left camera
};
StereoResult calibrate_with_opencv(const std::string& folder) {
  const cv::Size size(9, 6);
  std::vector<cv::Point3f> board;
  for (int i = 0; i < 54; i++) board.emplace_back(i % 9, i / 9, 0);
  std::vector<std::vector<cv::Point3f>> boards;
  std::vector<std::vector<cv::Point2f>> corners[2];
  for (int n = 1; n <= 14; n++) {
    std::vector<cv::Point2f> both[2];
    bool found = n != 10;
    for (int side = 0; side < 2 && found; side++) {
      const cv::Mat image = cv::imread(format_text("%s/%s/%02d.jpg", folder.c_str(), side == 0 ? "left" : "right", n),
                                       cv::IMREAD_GRAYSCALE);
      found = cv::findChessboardCorners(image, size, both[side]);
      if (found)
        cv::cornerSubPix(image, both[side], cv::Size(5, 5), cv::Size(-1, -1),
                         {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.001});
    }
    if (!found) continue;
    boards.push_back(board);
    for (int side = 0; side < 2; side++) corners[side].push_back(both[side]);
  }
  cv::Mat matrices[2], distortions[2], turn, shift;
  const int flags = cv::CALIB_FIX_ASPECT_RATIO | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K3;
  for (int side = 0; side < 2; side++) {
    matrices[side] = cv::Mat::eye(3, 3, CV_64F);
    std::vector<cv::Mat> turns, shifts;
    cv::calibrateCamera(boards, corners[side], cv::Size(640, 480), matrices[side], distortions[side], turns, shifts,
                        flags);
  }
  StereoResult result;
  result.rms = cv::stereoCalibrate(boards, corners[0], corners[1], matrices[0], distortions[0], matrices[1],
                                   distortions[1], cv::Size(640, 480), turn, shift, cv::noArray(), cv::noArray(),
                                   flags | cv::CALIB_USE_INTRINSIC_GUESS);
  result.baseline = cv::norm(shift);
  result.focal = matrices[0].at<double>(0, 0);
  return result;
}

TEST(BoardsCommand, AgreesWithOpenCvOnItsStereoSamples) {
  if (!fs::exists(kSamples / "right01.jpg")) GTEST_SKIP() << "needs Debian's opencv-doc: " << kSamples;
  const TempDir dir;
  for (const std::string side : {"left", "right"}) {
    fs::create_directories(fs::path(dir / "boards") / side);
    for (int n = 1; n <= 14; n++)
      if (n != 10)
        fs::copy_file(kSamples / format_text("%s%02d.jpg", side.c_str(), n),
                      fs::path(dir / "boards") / side / format_text("%02d.jpg", n));
  }
  const StereoResult peer = calibrate_with_opencv(dir / "boards");
  test::expect_outcome(
      run_program("lf-calibrate", "boards boards --board 9x6 --square 1 --out rig.json --json boards.json", dir.path()),
      0, mentions("rig.json: 2 of 2 cameras"));
  const json report = parse_json(read_text_file(dir / "boards.json"), "boards.json");
  const Rig rig = load_rig(dir / "rig.json");
  const double baseline = glm::length(rig.cameras[0].pose.position - rig.cameras[1].pose.position);
  std::printf("baseline %.4f squares, f %.2f px, rms %.3f px of inliers, %.3f px of all; OpenCV: %.4f, %.2f, %.3f\n",
              baseline, rig.cameras[0].lens.fx(), report["inliers"]["rms_px"].get<double>(),
              report["rms_px"].get<double>(), peer.baseline, peer.focal, peer.rms);
  EXPECT_NEAR(baseline, peer.baseline, 1e-3 * peer.baseline);
  EXPECT_NEAR(rig.cameras[0].lens.fx(), peer.focal, 5e-3 * peer.focal);
  // OpenCV minimises the RMS of all corners. The Cauchy loss here fits the good corners better.
  EXPECT_LT(report["inliers"]["rms_px"], peer.rms);
  EXPECT_LT(report["rms_px"], 1.3 * peer.rms);
}

// Four webcams that look inward, 1280x720. Caliscope's result is in camera_array.toml: distances of the cameras in
// metres. Its films need a decoder for MPEG-4, which OpenCV has.
const fs::path kWebcams = fs::path(LF_SOURCE_ROOT) / "../shared/data/webcams/calibration/extrinsic";

TEST(BoardsCommand, CalibratesFourWebcams) {
  if (!fs::exists(kWebcams)) GTEST_SKIP() << kWebcams << " is not there";
  const TempDir dir;
  fs::create_directories(dir / "boards");
  for (int camera = 0; camera < 4; camera++) {
    const std::string name = "cam_" + std::to_string(camera);
    cv::VideoCapture film((kWebcams / (name + ".mp4")).string(), cv::CAP_FFMPEG);
    if (!film.isOpened()) GTEST_SKIP() << "OpenCV cannot decode " << name << ".mp4";
    constexpr double kRate = 6;  // frames per second; timestamps.csv
    cv::VideoWriter copy(dir / "boards" + "/" + name + ".avi", cv::CAP_OPENCV_MJPEG,
                         cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), kRate, cv::Size(1280, 720));
    copy.set(cv::VIDEOWRITER_PROP_QUALITY, 100);
    cv::Mat picture;
    while (film.read(picture)) copy.write(picture);
  }
  test::expect_outcome(
      run_program("lf-calibrate",
                  "boards boards --board 3x4 --square 0.054 --charuco 4X4_1000 --marker 0.75 --inverted --out rig.json "
                  "--json boards.json",
                  dir.path()),
      0, testing::AllOf(mentions("rig.json: 4 of 4 cameras"), mentions("clocks")));
  const json report = parse_json(read_text_file(dir / "boards.json"), "boards.json");
  std::printf("rms of inliers %.3f px, median %.3f px, outliers %d of %d\n", report["inliers"]["rms_px"].get<double>(),
              report["median_px"].get<double>(), report["outliers"].get<int>(), report["observations"].get<int>());
  const Rig rig = load_rig(dir / "rig.json");
  for (size_t i = 0; i < 4; i++)
    std::printf("camera %zu: f %.1f px, rms %.3f px, offset %+.1f ms, readout %.1f +-%.1f ms\n", i,
                rig.cameras[i].lens.fx(), report["cameras"][i]["rms_px"].get<double>(),
                1e3 * rig.cameras[i].time_offset, report["cameras"][i]["readout_ms"].get<double>(),
                report["cameras"][i]["readout_sigma_ms"].get<double>());
  // Camera 1 is late by three frames. Without time offsets, its distances are 5 to 6 % larger than Caliscope's.
  EXPECT_NEAR(rig.cameras[0].time_offset - rig.cameras[1].time_offset, 0.106, 0.015);
  constexpr double kDistances[] = {1.149, 0.533, 0.417, 0.953, 1.438, 0.616};
  int pair = 0;
  for (size_t a = 0; a < 4; a++)
    for (size_t b = a + 1; b < 4; b++, pair++) {
      const double distance = glm::length(rig.cameras[a].pose.position - rig.cameras[b].pose.position);
      std::printf("cameras %zu and %zu: %.4f m, Caliscope %.3f m\n", a, b, distance, kDistances[pair]);
      const double share = a == 1 || b == 1 ? 0.025 : 0.055;
      EXPECT_NEAR(distance, kDistances[pair], share * kDistances[pair]);
    }
  EXPECT_LT(report["median_px"], 0.45);
}

}  // namespace
}  // namespace lf
