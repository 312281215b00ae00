// SPDX-License-Identifier: LGPL-2.1-or-later

#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

using nlohmann::json;

json good_rig() {
  json rig = json::parse(R"({"format": "lightfield-rig", "version": 1, "cameras": [],
    "topology": {"type": "grid", "rows": 2, "columns": 2, "note": "kept"}, "provenance": {"tool": "x", "n": [1, 2]}})");
  for (const int id : {10, 3, 7, 5})
    rig["cameras"].push_back({{"id", id},
                              {"name", "cam"},
                              {"width", 320},
                              {"height", 240},
                              {"model", "RADIAL"},
                              {"params", {400, 159.5, 119.5, -0.1, 0.01}},
                              {"position", {id / 3.0, 0, 1e6 / 7}},
                              {"orientation", {1, 0, 0, 0}},
                              {"image", "cam.png"},
                              {"sticker", {{"numbers", {1, 1, id}}}}});
  rig["cameras"][1]["source"] = "v4l2:///dev/video0";
  rig["cameras"][1]["time_offset"] = -0.0125;
  rig["cameras"][1]["colour"] = {{"black", {4, 5.5, -1}},
                                 {"gamma", 2.25},
                                 {"matrix", {1.1, 0, 0, 0.01, 1, -0.02, 0, 0, 0.9}},
                                 {"vignetting", {-0.3, 0.05}},
                                 {"chart", "kept"}};
  return rig;
}

Rig parse(const json& rig) { return parse_rig(rig.dump(), "r.json"); }

void expect_same(const Camera& camera, const Camera& expected) {
  EXPECT_EQ(camera.id, expected.id);
  EXPECT_EQ(camera.name, expected.name);
  EXPECT_EQ(camera.width, expected.width);
  EXPECT_EQ(camera.height, expected.height);
  EXPECT_EQ(camera.lens, expected.lens);
  EXPECT_EQ(camera.pose, expected.pose);
  EXPECT_EQ(camera.image, expected.image);
  EXPECT_EQ(camera.source, expected.source);
  EXPECT_EQ(camera.time_offset, expected.time_offset);
  EXPECT_EQ(camera.colour, expected.colour);
}

TEST(RigJson, ReadsEveryMember) {
  const Rig rig = parse_rig(good_rig().dump(), "r.json", "folder");
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_EQ(rig.directory, "folder");
  const Camera& camera = rig.cameras[1];
  expect_same(camera, {.id = 3,
                       .name = "cam",
                       .width = 320,
                       .height = 240,
                       .lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.1, 0.01}),
                       .pose = {{1, 0, 1e6 / 7}, {1, 0, 0, 0}},
                       .image = "cam.png",
                       .source = "v4l2:///dev/video0",
                       .time_offset = -0.0125,
                       .colour = ColourModel{.black = {4, 5.5, -1},
                                             .gamma = 2.25,
                                             .matrix = {1.1, 0, 0, 0.01, 1, -0.02, 0, 0, 0.9},
                                             .vignetting = {-0.3, 0.05}}});
  EXPECT_EQ(rig.cameras[0].source, "");
  EXPECT_EQ(rig.cameras[0].colour, std::nullopt);
  EXPECT_EQ(rig.topology.rows, 2);
  EXPECT_EQ(rig.topology.columns, 2);
}

TEST(RigJson, ReadsTheOtherTopologies) {
  json rig = good_rig();
  rig["topology"] = {{"type", "delaunay"}};
  EXPECT_EQ(parse(rig).topology.type, Topology::Type::kDelaunay);
  rig["topology"] = {{"type", "triangles"}, {"triangles", {{0, 1, 2}, {1, 3, 2}}}};
  EXPECT_EQ(parse(rig).topology.triangles, (std::vector<std::array<CameraIndex, 3>>{{0, 1, 2}, {1, 3, 2}}));
  rig["topology"] = {{"type", "triangles"}, {"triangles", json::array()}};
  EXPECT_TRUE(parse(rig).topology.triangles.empty()) << "one and two cameras have none";
}

TEST(RigJson, AcceptsTinyAndLargeImages) {
  for (const int size : {1, 8192, kMaxImageSize}) {
    json rig = good_rig();
    rig["cameras"][0]["width"] = rig["cameras"][0]["height"] = size;
    EXPECT_EQ(parse(rig).cameras[0].width, size);
  }
}

TEST(RigJson, RoundTripsToTheLastBit) {
  const TempDir dir;
  Rig rig = parse(good_rig());
  rig.cameras[0].pose.position = {1 / 3.0, 5e-324, -1.7976931348623157e308};
  rig.cameras[1].pose.orientation = glm::normalize(Quat(0.1, -0.2, 0.3, 0.4));
  rig.cameras[2].lens = Lens(LensModel::kOpenCv, {1e3 / 7, 1e3 / 11, 0.1, 0.2, 1e-17, 1 / 3.0, -1 / 7.0, 1e-5});
  rig.cameras[3].id = UINT32_MAX;
  rig.cameras[3].name = "quote \" and \u00fc";
  EXPECT_EQ(rig.focus_distance, 0);
  rig.focus_distance = 7 / 3.0;
  for (const Topology& topology :
       {rig.topology, Topology{}, Topology{Topology::Type::kTriangles, 0, 0, {{0, 1, 2}, {3, 2, 1}}}}) {
    rig.topology = topology;
    save_rig(rig, dir / "rig.json");
    const Rig back = load_rig(dir / "rig.json");
    EXPECT_EQ(back.hash(), rig.hash());
    EXPECT_EQ(back.directory, dir.path());
    EXPECT_EQ(back.focus_distance, rig.focus_distance);
    for (size_t i = 0; i < rig.cameras.size(); i++) expect_same(back.cameras[i], rig.cameras[i]);
    EXPECT_EQ(back.topology.type, topology.type);
    EXPECT_EQ(back.topology.triangles, topology.triangles);
  }
}

TEST(RigJson, KeepsUnknownKeysByCameraId) {
  const json original = good_rig();
  Rig rig = rig_subset(parse(original), {2, 1});
  rig.cameras[0].image = "";
  rig.cameras[0].width = 99;
  const json saved = json::parse(rig_to_json(rig, &original));
  EXPECT_EQ(saved["provenance"], original["provenance"]);
  EXPECT_EQ(saved["topology"]["note"], "kept");
  EXPECT_FALSE(saved["topology"].contains("rows")) << "known keys come from the rig only";
  ASSERT_EQ(saved["cameras"].size(), 2u);
  EXPECT_EQ(saved["cameras"][0]["id"], 7);
  EXPECT_EQ(saved["cameras"][0]["sticker"], original["cameras"][2]["sticker"]);
  EXPECT_EQ(saved["cameras"][1]["sticker"], original["cameras"][1]["sticker"]);
  EXPECT_EQ(saved["cameras"][0]["width"], 99);
  EXPECT_FALSE(saved["cameras"][0].contains("image"));
}

TEST(RigJson, KeepsUnknownKeysOfColours) {
  const json original = good_rig();
  Rig rig = parse(original);
  EXPECT_EQ(json::parse(rig_to_json(rig, &original))["cameras"][1]["colour"], original["cameras"][1]["colour"]);
  rig.cameras[1].colour.reset();
  EXPECT_FALSE(json::parse(rig_to_json(rig, &original))["cameras"][1].contains("colour"));
}

TEST(RigJson, ColourHasDefaultsAndDoesNotAffectTheHash) {
  json file = good_rig();
  const uint64_t hash = parse(file).hash();
  file["cameras"][0]["colour"] = json::object();
  EXPECT_EQ(parse(file).cameras[0].colour, ColourModel());
  EXPECT_TRUE(parse(file).has_colour());
  file["cameras"][0]["colour"] = {{"gamma", 2}};
  EXPECT_EQ(parse(file).hash(), hash);
}

TEST(RigJson, ErrorsNameThePlace) {
  // Patches, merged into the good file; null removes a key.
  const InvalidText files[] = {
      {R"({"format": null})", {"\"format\"", "missing"}},
      {R"({"format": 7})", {"format", "string"}},
      {R"({"format": "lightfield-views"})", {"format", "lightfield-rig", "lightfield-views"}},
      {R"({"version": null})", {"\"version\"", "missing"}},
      {R"({"version": 2})", {"version", "1 to 1", "2"}},
      {R"({"version": "1"})", {"version", "integer", "string"}},
      {R"({"cameras": null})", {"\"cameras\"", "missing"}},
      {R"({"cameras": []})", {"cameras", "one camera"}},
      {R"({"cameras": {"0": 1}})", {"cameras:", "array", "object"}},
      {R"({"cameras": [[]]})", {"cameras[0]", "object", "array"}},
      {R"({"topology": null})", {"\"topology\"", "missing"}},
      {R"({"focus_distance": "far"})", {"focus_distance", "number", "string"}},
      {R"({"focus_distance": 0})", {"focus_distance", "more than 0"}},
      {R"({"topology": "grid"})", {"topology", "object", "string"}},
      {R"({"topology": {"type": null}})", {"topology", "type", "missing"}},
      {R"({"topology": {"type": "hexagons"}})", {"topology.type", "grid", "triangles", "delaunay"}},
      {R"({"topology": {"rows": null}})", {"topology", "\"rows\"", "missing"}},
      {R"({"topology": {"rows": 0}})", {"topology.rows", "1 to 65535", "0"}},
      {R"({"topology": {"rows": 3}})", {"topology", "3 rows", "2 columns", "4 cameras"}},
      {R"({"topology": {"rows": 65535, "columns": 65535}})", {"topology", "65535 rows", "65535 columns"}},
      {R"({"topology": {"columns": 2.5}})", {"topology.columns", "integer", "2.5"}},
      {R"({"topology": {"type": "triangles"}})", {"topology", "\"triangles\"", "missing"}},
      {R"({"topology": {"type": "triangles", "triangles": [[0, 1, 2], [1, 2, 4]]}})",
       {"topology.triangles[1][2]", "0 to 3", "4"}},
      {R"({"topology": {"type": "triangles", "triangles": [[0, -1, 2]]}})",
       {"topology.triangles[0][1]", "0 to 3", "-1"}},
      {R"({"topology": {"type": "triangles", "triangles": [[0, 1]]}})", {"topology.triangles[0]", "3 elements", "2"}},
      {R"({"topology": {"type": "triangles", "triangles": [[0, 1, 1]]}})",
       {"topology.triangles[0]", "different cameras"}},
      {R"({"topology": {"type": "triangles", "triangles": [0, 1, 2]}})", {"topology.triangles[0]", "array"}},
  };
  for (const InvalidText& c : files) {
    json file = good_rig();
    file.merge_patch(json::parse(c.text));
    EXPECT_ERROR(parse(file), "r.json:");
    EXPECT_ERROR(parse(file), c.facts);
  }
}

TEST(RigJson, ErrorsNameTheCameraAndItsMember) {
  // Patches, merged into cameras[3].
  const InvalidText cases[] = {
      {R"({"id": null})", {"cameras[3]", "\"id\"", "missing"}},
      {R"({"id": "3"})", {"cameras[3].id", "integer", "string"}},
      {R"({"id": -1})", {"cameras[3].id", "0 to 4294967295", "-1"}},
      {R"({"id": 4294967296})", {"cameras[3].id", "0 to 4294967295", "4294967296"}},
      {R"({"id": 7})", {"cameras[3].id", "7", "cameras[2]"}},
      {R"({"name": null})", {"cameras[3]", "\"name\"", "missing"}},
      {R"({"name": 1})", {"cameras[3].name", "string", "number"}},
      {R"({"name": ".profile\u0000"})", {"cameras[3].name", "NUL"}},
      {R"({"name": "\u001b[31mred"})", {"cameras[3].name", "control characters"}},
      {R"({"name": "\u009b31mred"})", {"cameras[3].name", "control characters"}},
      {R"({"source": "a\u0000b.mkv"})", {"cameras[3].source", "NUL"}},
      {R"({"width": null})", {"cameras[3]", "\"width\"", "missing"}},
      {R"({"width": 0})", {"cameras[3].width", "1 to 16384", "0"}},
      {R"({"width": 16385})", {"cameras[3].width", "1 to 16384", "16385"}},
      {R"({"width": true})", {"cameras[3].width", "integer", "boolean"}},
      {R"({"height": 1000.5})", {"cameras[3].height", "integer", "1000.5"}},
      {R"({"model": null})", {"cameras[3]", "\"model\"", "missing"}},
      {R"({"model": "FOV"})", {"cameras[3].model", "unknown", "FOV"}},
      {R"({"params": null})", {"cameras[3]", "\"params\"", "missing"}},
      {R"({"params": [400, 1, 1]})", {"cameras[3].params", "RADIAL", "5 numbers", "3"}},
      {R"({"params": ["NaN", 1, 1, 0, 0]})", {"cameras[3].params[0]", "finite", "number", "string"}},
      {R"({"params": [400, 1, null, 0, 0]})", {"cameras[3].params[2]", "finite", "number", "null"}},
      {R"({"params": [0, 1, 1, 0, 0]})", {"cameras[3].params[0]", "positive"}},
      {R"({"position": null})", {"cameras[3]", "\"position\"", "missing"}},
      {R"({"position": 0})", {"cameras[3].position", "array", "number"}},
      {R"({"position": [0, 0, 0, 0]})", {"cameras[3].position", "3 elements", "4"}},
      {R"({"position": [0, null, 0]})", {"cameras[3].position[1]", "finite", "number", "null"}},
      {R"({"orientation": null})", {"cameras[3]", "\"orientation\"", "missing"}},
      {R"({"orientation": [1, 0, 0]})", {"cameras[3].orientation", "4 elements", "3"}},
      {R"({"orientation": [1, 0, 0, "nan"]})", {"cameras[3].orientation[3]", "finite", "number"}},
      {R"({"orientation": [0, 0, 0, 0]})", {"cameras[3].orientation", "quaternion", "unit norm"}},
      {R"({"orientation": [1.000002, 0, 0, 0]})", {"cameras[3].orientation", "quaternion"}},
      {R"({"image": 5})", {"cameras[3].image", "string", "number"}},
      {R"({"source": []})", {"cameras[3].source", "string", "array"}},
      {R"({"time_offset": "late"})", {"cameras[3].time_offset", "finite", "number", "string"}},
      {R"({"colour": 1})", {"cameras[3].colour", "object", "number"}},
      {R"({"colour": {"black": [1, 2]}})", {"cameras[3].colour.black", "3 elements", "2"}},
      {R"({"colour": {"black": [1, 2, 65]}})", {"cameras[3].colour.black[2]", "-64 to 64"}},
      {R"({"colour": {"gamma": 0}})", {"cameras[3].colour.gamma", "0.5 to 5"}},
      {R"({"colour": {"gamma": [2, 2, 2]}})", {"cameras[3].colour.gamma", "finite", "number", "array"}},
      {R"({"colour": {"matrix": [1, 0, 0]}})", {"cameras[3].colour.matrix", "9 elements", "3"}},
      {R"({"colour": {"matrix": [1, 0, 0, 0, 1, 0, 0, 0, 5]}})", {"cameras[3].colour.matrix[8]", "-4 to 4"}},
      {R"({"colour": {"matrix": [1, 0, 0, 0, 1, 0, 0, 0, 0]}})", {"cameras[3].colour.matrix", "determinant"}},
      {R"({"colour": {"vignetting": [-1, 0]}})", {"cameras[3].colour.vignetting", "0.25 to 2.5"}},
  };
  for (const InvalidText& c : cases) {
    json file = good_rig();
    file["cameras"][3].merge_patch(json::parse(c.text));
    EXPECT_ERROR(parse(file), "r.json:");
    EXPECT_ERROR(parse(file), c.facts);
  }
}

TEST(RigJson, SyntaxErrorsNameLineAndPlace) {
  const std::string text = good_rig().dump(1);
  EXPECT_ERROR(parse_rig(text.substr(0, text.size() - 10), "r.json"), "r.json: ");
  EXPECT_ERROR(parse_rig(text.substr(0, text.find("\"height\"")), "r.json"), "r.json", "cameras[0]", "JSON", "line");
  EXPECT_ERROR(parse_rig("P6 320 240 255", "r.json"), "r.json", "JSON", "line 1");
  EXPECT_ERROR(parse_rig("", "r.json"), "r.json", "JSON");
  EXPECT_ERROR(parse_rig("[]", "r.json"), "r.json", "object", "array");
  std::string infinite = text;
  infinite.replace(infinite.find("159.5"), 5, "1e999");
  EXPECT_ERROR(parse_rig(infinite, "r.json"), "r.json", "cameras[0].params[1]", "JSON", "overflow");
  EXPECT_ERROR(load_rig(testing::TempDir() + "no_such_rig.json"), "no_such_rig.json", "read");
}

TEST(RigJson, NamesTheImporterOfAForeignFile) {
  const std::pair<const char*, const char*> files[] = {
      {R"({"fl_x": 5, "frames": [{"transform_matrix": []}]})", "lf-rig import nerf"},
      {"%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n", "lf-rig import opencv"},
      {"cam0:\n  camera_model: pinhole\n", "lf-rig import kalibr"},
      {"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 PINHOLE 4 3 5 5 2 1\n", "lf-rig import colmap"}};
  for (const auto& [text, command] : files) EXPECT_ERROR(parse_rig(text, "x"), "x:", "rig file");
  for (const auto& [text, command] : files) EXPECT_ERROR(parse_rig(text, "x"), command);
}

TEST(RigJson, RefusesMoreTrianglesThanASurfaceHas) {
  json file = good_rig();
  const size_t cameras = file["cameras"].size();
  const json most(2 * cameras, {0, 1, 2}), more(2 * cameras + 1, {0, 1, 2});
  file["topology"] = {{"type", "triangles"}, {"triangles", most}};
  EXPECT_EQ(parse(file).topology.triangles.size(), 2 * cameras);
  file["topology"]["triangles"] = more;
  EXPECT_ERROR(parse(file), "r.json", "topology.triangles", std::to_string(2 * cameras));
}

TEST(RigJson, NewFileWithAPasswordIsPrivate) {
  const TempDir dir;
  const mode_t mask = umask(022);
  const auto mode_after = [&](const std::string& name, const std::string& source) {
    Rig rig = parse(good_rig());
    rig.cameras[0].source = source;
    save_rig(rig, dir / name);
    struct stat status;
    return stat((dir / name).c_str(), &status) == 0 ? status.st_mode & 0777 : 0;
  };
  EXPECT_EQ(mode_after("plain.json", "rtsp://host/stream"), 0644u);
  EXPECT_EQ(mode_after("secret.json", "rtsp://user:password@host/stream"), 0600u);
  EXPECT_EQ(mode_after("plain.json", "rtsp://user:password@host/stream"), 0644u) << "a file keeps its mode";
  umask(mask);
}

TEST(RigJson, RefusesTooManyCameras) {
  json file = good_rig();
  for (uint32_t i = 4; i <= kMaxCameras; i++) file["cameras"].push_back(7);
  EXPECT_ERROR(parse(file), "r.json", "cameras", "65535 cameras", "65536");
}

// File names may be arbitrary bytes.
TEST(RigJson, WritesOnlyUtf8) {
  const Rig good = parse(good_rig());
  for (std::string Camera::*member : {&Camera::name, &Camera::image, &Camera::source}) {
    Rig rig = good;
    rig.cameras[1].*member = "caf\xe9";
    EXPECT_ERROR(rig_to_json(rig), "cameras[1]", "caf\\ufffd", "UTF-8");
  }
}

TEST(RigJson, ReadsTheRealRigs) {
  const std::filesystem::path data = std::filesystem::path(LF_SOURCE_ROOT) / "../shared/data";
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "needs ../shared/data";
  EXPECT_EQ(load_rig(data / "chess/rig.json").cameras.size(), 64u);
  const Rig toys = load_rig(data / "toys/rig.json");
  EXPECT_EQ(subsample_grid(toys, 2).cameras.size(), 64u);
  EXPECT_EQ(parse_rig(rig_to_json(toys), "toys").hash(), toys.hash());
}

TEST(CameraControls, RoundTripThroughARigFile) {
  const Rig rig = make_grid_rig({1, 3, 0.1, 60, 8, 6});
  json text = json::parse(rig_to_json(rig));
  const std::map<uint32_t, Controls> controls = {{0, {{"exposure", 0.01}, {"white_balance", std::nullopt}}},
                                                 {2, {{"gain", -3}}}};
  put_controls(controls, text);
  EXPECT_EQ(text["cameras"][0]["controls"], (json{{"exposure", 0.01}, {"white_balance", "auto"}}));
  EXPECT_FALSE(text["cameras"][1].contains("controls"));
  const std::string saved = rig_to_json(parse_rig(text.dump(), "r"), &text);
  EXPECT_EQ(parse_controls(json::parse(saved), "r"), controls) << "preserved by loading and saving";
  put_controls({{2, {}}}, text);
  EXPECT_EQ(parse_controls(text, "r").count(2), 0u);
}

TEST(CameraControls, ErrorsNameThePlace) {
  const Rig rig = make_grid_rig({1, 2, 0.1, 60, 8, 6});
  json text = json::parse(rig_to_json(rig));
  for (const json& value : {json("full"), json(nullptr), json::array(), json(true)}) {
    text["cameras"][1]["controls"] = {{"gain", value}};
    EXPECT_ERROR(parse_controls(text, "r.json"), "r.json", "cameras[1].controls.gain", "finite", "auto");
  }
  text["cameras"][1]["controls"] = 3;
  EXPECT_ERROR(parse_controls(text, "r.json"), "r.json", "cameras[1].controls", "object");
  EXPECT_TRUE(parse_controls(json::parse("[]"), "r").empty());
  EXPECT_TRUE(parse_controls(json::parse("{\"cameras\": [1, {}]}"), "r").empty());
}

TEST(SwapDevices, SwapsOnlyPropertiesOfTheDevice) {
  Rig rig = make_grid_rig({1, 3, 0.1, 60, 8, 6});
  rig.cameras[0].source = "v4l2:///dev/video0";
  rig.cameras[0].time_offset = 0.01;
  rig.cameras[2].width = 16;
  json text = json::parse(rig_to_json(rig));
  text["cameras"][2]["covariance"] = {1, 2};
  swap_devices(text, 0, 2);
  const Rig swapped = parse_rig(text.dump(), "r");
  Camera &first = rig.cameras[0], &last = rig.cameras[2];
  std::swap(first.source, last.source);
  std::swap(first.time_offset, last.time_offset);
  std::swap(first.width, last.width);
  for (size_t i = 0; i < 3; i++) expect_same(swapped.cameras[i], rig.cameras[i]);
  EXPECT_TRUE(text["cameras"][0].contains("covariance"));
  EXPECT_FALSE(text["cameras"][2].contains("covariance"));
  const json before = text;
  swap_devices(text, 1, 1);
  EXPECT_EQ(text, before);
  EXPECT_ERROR(swap_devices(text, 0, 9), "camera 9");
}

}  // namespace
}  // namespace lf
