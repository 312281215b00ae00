// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"
#include "base/text.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

void write(const TempDir& dir) {
  dir.write("points.dat", "1 2 nan\n3 4 nan\n1 1 nan\n 5 6.5 7\n 8 9 10\n1 1 1\n");
  dir.write("IdMat.dat", "1 1 0\n1 1 1\n");
  dir.write("Res.dat", "64 48\n32 24\n");
}

TEST(MultiCamSelfCal, TracksAndLenses) {
  const TempDir dir;
  write(dir);
  for (const int i : {1, 2})
    dir.write("cam" + std::to_string(i) + ".rad",
              "K11 = 50\nK12 = 0\nK13 = 31\nK22 = 51\nK23 = 23\nkc1 = -0.1\nkc2 = 0.02\nkc3 = 0\nkc4 = 0\n");
  const MultiCamSelfCal input = load_multicamselfcal(dir.path(), 1);
  EXPECT_EQ(input.tracks.num_positions, 3u);
  ASSERT_EQ(input.tracks.observations.size(), 5u);
  EXPECT_EQ(input.tracks.observations[3].pixel, Vec2(5.5, 8));  // Matlab counts from 1
  EXPECT_EQ(input.tracks.cameras[1].width, 32);
  ASSERT_TRUE(input.lenses);
  EXPECT_EQ(input.lenses->cameras[0].lens.fy(), 51);
  EXPECT_EQ(input.lenses->cameras[0].lens.cx(), 30);
  EXPECT_EQ(input.lenses->cameras[0].lens.k1(), -0.1);
}

TEST(MultiCamSelfCal, ErrorsNameThePlace) {
  const TempDir dir;
  EXPECT_ERROR(load_multicamselfcal(dir.path(), 0), "points.dat", "read");
  write(dir);
  dir.write("IdMat.dat", "1 1 1\n1 1 1\n");
  EXPECT_ERROR(load_multicamselfcal(dir.path(), 0), "points.dat", "camera 0", "position 2", "number");
  dir.write("IdMat.dat", "1 1\n1 1\n");
  EXPECT_ERROR(load_multicamselfcal(dir.path(), 0), "IdMat.dat", "2 rows", "3 columns");
  dir.write("IdMat.dat", "1 x 1\n");
  EXPECT_ERROR(load_multicamselfcal(dir.path(), 0), "IdMat.dat", "line 1", "number", "\" x 1\"");
  write(dir);
  dir.write("cam.rad", "K11 = 1\n");
  EXPECT_ERROR(load_multicamselfcal(dir.path(), 0), "1 files", "*.rad", "2 cameras");
}

std::string file_with(const std::string& bar, const std::string& positions) {
  return R"({"format": "lightfield-tracks", "version": 1, "bar": )" + bar + R"(,
    "cameras": [{"id": 7, "width": 320, "height": 240}, {"id": 9, "width": 320, "height": 240}],
    "positions": [)" +
         positions + "]}";
}

TEST(TracksJson, RoundTrips) {
  const Tracks tracks = parse_tracks(
      file_with("true", R"({"observations": [[9, 1.25, -0.5, 1], [7, 3, 4, 0]]}, {"observations": []})"), "t.json");
  EXPECT_EQ(tracks.num_positions, 2u);
  ASSERT_EQ(tracks.observations.size(), 2u);
  EXPECT_EQ(tracks.observations[0].camera, 1u);
  EXPECT_EQ(tracks.observations[0].light, 1u);
  EXPECT_EQ(tracks.observations[0].pixel, Vec2(1.25, -0.5));
  const std::string text = tracks_to_json(tracks);
  EXPECT_EQ(tracks_to_json(parse_tracks(text, "again")), text);
}

TEST(TracksJson, ErrorsNameThePlace) {
  const auto parse = [](const std::string& bar, const std::string& observations) {
    return parse_tracks(file_with(bar, R"({"observations": [)" + observations + "]}"), "t.json");
  };
  EXPECT_ERROR(parse("false", "[8, 1, 2]"), "t.json", "positions[0].observations[0][0]", "8");
  EXPECT_ERROR(parse("false", "[7, 1]"), "positions[0].observations[0]:", "3");
  EXPECT_ERROR(parse("true", "[7, 1, 2, 2]"), "positions[0].observations[0][3]", "0");
  EXPECT_ERROR(parse("1", ""), "bar", "true", "false");
  EXPECT_ERROR(parse("false", "[7, 1, 2], [7, 1, 2]"), "camera 7", "twice");
  EXPECT_ERROR(parse("false", "[7, 900, 2]"), "outside", "camera 7");
}

TEST(LightDetections, RoundTrip) {
  LightDetections sights;
  sights.bar = true;
  sights.cameras = {{7, 320, 240, {{0, {}}, {0.0333, {{{12.34567, 200.5}, 0.0123, 801.25}, {{3, 4}, 0.5, 20}}}}},
                    {2, 640, 480, {}}};
  const LightDetections back = parse_light_detections(light_detections_to_json(sights), "tracks.json").value();
  EXPECT_TRUE(back.bar);
  ASSERT_EQ(back.cameras.size(), 2u);
  EXPECT_EQ(back.cameras[1].width, 640);
  ASSERT_EQ(back.cameras[0].frames.size(), 2u);
  EXPECT_TRUE(back.cameras[0].frames[0].sights.empty());
  EXPECT_EQ(back.cameras[0].frames[1].time, 0.0333);
  const LightDetection& sight = back.cameras[0].frames[1].sights[0];
  EXPECT_NEAR(sight.pixel.x, 12.34567, 1e-4);
  EXPECT_NEAR(sight.sigma, 0.0123, 1e-9);
  EXPECT_NEAR(sight.brightness, 801.25, 0.1);
}

TEST(LightDetections, TracksWithPositionsAreNullopt) {
  EXPECT_FALSE(
      parse_light_detections(R"({"format": "lightfield-tracks", "version": 1, "cameras": [], "positions": []})", "t"));
}

TEST(LightDetections, ErrorsNameThePlace) {
  const auto parse = [](const std::string& cameras) {
    return parse_light_detections(R"({"format": "lightfield-tracks", "version": 1, "cameras": [)" + cameras + "]}",
                                  "t.json");
  };
  const std::string size = R"({"id": 1, "width": 320, "height": 240, "frames": )";
  EXPECT_ERROR(parse(size + "[[0, [1, 2, 0.1]]]}"), "t.json: cameras[0].frames[0][1]: ");
  EXPECT_ERROR(parse(size + "[[0, [1, 2, 0, 5]]]}"), "frames[0][1][2]", "positive");
  EXPECT_ERROR(parse(size + "[[0, [900, 2, 1, 5]]]}"), "outside", "image");
  EXPECT_ERROR(parse(size + "[[1], [1]]}"), "frames[1][0]", "previous frame");
  EXPECT_ERROR(parse(size + "[[]]}"), "frames[0]", "begin", "time");
  EXPECT_ERROR(parse(size + "[]}, " + size + "[]}"), "cameras[1].id", "1", "twice");
  EXPECT_ERROR(parse(R"({"id": 1, "width": 320, "height": 240})"), "frames");
}

}  // namespace
}  // namespace lf
