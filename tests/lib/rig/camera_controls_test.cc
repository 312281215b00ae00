// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/camera_controls.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "rig/rig_json.h"
#include "support/expect_error.h"

namespace lf {
namespace {

using nlohmann::json;

TEST(CameraControls, GoIntoARigFileAndComeBack) {
  const Rig rig = make_grid_rig({1, 3, 0.1, 60, 8, 6});
  json text = json::parse(rig_to_json(rig));
  const std::map<uint32_t, Controls> controls = {{0, {{"exposure", 0.01}, {"white_balance", std::nullopt}}},
                                                 {2, {{"gain", -3}}}};
  put_controls(controls, text);
  EXPECT_EQ(text["cameras"][0]["controls"], (json{{"exposure", 0.01}, {"white_balance", "auto"}}));
  EXPECT_FALSE(text["cameras"][1].contains("controls"));
  const std::string saved = rig_to_json(parse_rig(text.dump(), "r"), &text);
  EXPECT_EQ(parse_controls(json::parse(saved), "r"), controls) << "a rig that is read and saved keeps them";
  put_controls({{2, {}}}, text);
  EXPECT_EQ(parse_controls(text, "r").count(2), 0u);
}

TEST(CameraControls, ErrorsNameThePlace) {
  const Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  json text = json::parse(rig_to_json(rig));
  const char* wrong = "r.json: cameras[1].controls.gain: must be a finite number or \"auto\"";
  for (const json& value : {json("full"), json(nullptr), json::array(), json(true)}) {
    text["cameras"][1]["controls"] = {{"gain", value}};
    EXPECT_ERROR(parse_controls(text, "r.json"), wrong);
  }
  text["cameras"][1]["controls"] = 3;
  EXPECT_ERROR(parse_controls(text, "r.json"), "r.json: cameras[1].controls: must be an object");
  EXPECT_TRUE(parse_controls(json::parse("[]"), "r").empty());
  EXPECT_TRUE(parse_controls(json::parse("{\"cameras\": [1, {}]}"), "r").empty());
}

}  // namespace
}  // namespace lf
