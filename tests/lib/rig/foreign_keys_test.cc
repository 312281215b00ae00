// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/foreign_keys.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"

namespace lf {
namespace {

using nlohmann::json;

std::vector<std::string> check(const char* text, const std::set<std::string_view>& known = {"cameras", "fx"}) {
  return check_foreign_keys(json::parse(text), "f.json", known);
}

TEST(ForeignKeys, RefusesKeysThatChangeTheMeaningOfOthers) {
  for (const char* member :
       {R"("is_fisheye": true)", R"("fisheye_model": 1)", R"("equirectangular": true)", R"("latlong": 1)",
        R"("sk_x": 0.5)", R"("skew": -2)", R"("xi": 0.9)", R"("k3": 1e-9)", R"("rolling_shutter": [0, 0, 0, 0.1])",
        R"("Rolling_Shutter_Time": 0.01)", R"("line_delay": 2e-5)", R"("transform_matrix_start": [[1]])",
        R"("from_mitsuba": true)", R"("ftheta_p1": 0.1)", R"("camera_model": "OPENCV_FISHEYE")",
        R"("distortion_model": "equidistant")", R"("model_type": "MEI")", R"("orthographic": true)"}) {
    const std::string file = std::string(R"({"cameras": [{"fx": 1}, {)") + member + "}]}";
    const std::string error = text_of_error([&] { check(file.c_str()); });
    EXPECT_EQ(error.find("f.json: cameras[1]."), 0u) << member << ": " << error;
    EXPECT_NE(error.find("a rig cannot hold"), std::string::npos) << member << ": " << error;
    // Within a value that no importer reads, too.
    const std::string inside = std::string(R"({"settings": {"lens": {)") + member + "}}}";
    EXPECT_ERROR(check(inside.c_str()), "f.json: settings.lens.");
  }
}

TEST(ForeignKeys, NeutralValuesChangeNothing) {
  EXPECT_TRUE(check(R"({"cameras": [{"is_fisheye": false, "sk_x": 0, "skew": 0.0, "xi": null, "k3": 0, "k4": 0.0,
      "rolling_shutter": [0, 0, 0, 0], "equirectangular": "", "distortion_model": "none", "camera_model": "PINHOLE",
      "lens_model": "Brown", "shutter": "global"}]})",
                    {"cameras", "is_fisheye", "sk_x", "skew", "xi", "k3", "k4", "rolling_shutter", "equirectangular",
                     "distortion_model", "camera_model", "lens_model", "shutter"})
                  .empty());
}

TEST(ForeignKeys, ListsWhatWasNotRead) {
  EXPECT_TRUE(check(R"({"cameras": [{"fx": 1}]})").empty());
  EXPECT_EQ(check(R"({"zeta": 1, "cameras": [{"fx": 1, "mask": "a"}, {"mask": {"inner": 1}}]})"),
            std::vector<std::string>{"keys that were not read: mask (2 times), zeta"});
  std::string many = R"({"cameras": 0)";
  for (int i = 10; i < 40; i++) many += ", \"x" + std::to_string(i) + "\": 1";
  const std::vector<std::string> notes = check((many + "}").c_str());
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("x10, x11"), std::string::npos) << notes[0];
  EXPECT_NE(notes[0].find("and 18 more"), std::string::npos) << notes[0];
}

}  // namespace
}  // namespace lf
