// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/light_sights.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"

namespace lf {
namespace {

TEST(LightSights, ARoundTripKeepsThem) {
  LightSights sights;
  sights.bar = true;
  sights.cameras = {{7, 320, 240, {{0, {}}, {0.0333, {{{12.34567, 200.5}, 0.0123, 801.25}, {{3, 4}, 0.5, 20}}}}},
                    {2, 640, 480, {}}};
  const auto back = parse_light_sights(light_sights_to_json(sights), "tracks.json");
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->bar);
  ASSERT_EQ(back->cameras.size(), 2u);
  EXPECT_EQ(back->cameras[1].width, 640);
  ASSERT_EQ(back->cameras[0].frames.size(), 2u);
  EXPECT_TRUE(back->cameras[0].frames[0].sights.empty());
  EXPECT_EQ(back->cameras[0].frames[1].time, 0.0333);
  const Sight& sight = back->cameras[0].frames[1].sights[0];
  EXPECT_NEAR(sight.pixel.x, 12.34567, 1e-4);
  EXPECT_NEAR(sight.sigma, 0.0123, 1e-9);
  EXPECT_NEAR(sight.brightness, 801.25, 0.1);
}

TEST(LightSights, TracksWithPositionsAreNone) {
  EXPECT_FALSE(
      parse_light_sights(R"({"format": "lightfield-tracks", "version": 1, "cameras": [], "positions": []})", "t"));
}

TEST(LightSights, MistakesAreNamedWithTheirPlace) {
  const auto parse = [](const std::string& cameras) {
    return parse_light_sights(R"({"format": "lightfield-tracks", "version": 1, "cameras": [)" + cameras + "]}",
                              "t.json");
  };
  const std::string size = R"({"id": 1, "width": 320, "height": 240, "frames": )";
  EXPECT_ERROR(parse(size + "[[0, [1, 2, 0.1]]]}"), "t.json: cameras[0].frames[0][1]: ");
  EXPECT_ERROR(parse(size + "[[0, [1, 2, 0, 5]]]}"), "frames[0][1][2]: must be positive");
  EXPECT_ERROR(parse(size + "[[0, [900, 2, 1, 5]]]}"), "is far outside of the camera's image");
  EXPECT_ERROR(parse(size + "[[1], [1]]}"), "frames[1][0]: must be later than that of the frame before");
  EXPECT_ERROR(parse(size + "[[]]}"), "frames[0]: must begin with its time");
  EXPECT_ERROR(parse(size + "[]}, " + size + "[]}"), "cameras[1].id: 1 comes twice");
  EXPECT_ERROR(parse(R"({"id": 1, "width": 320, "height": 240})"), "frames");
}

}  // namespace
}  // namespace lf
