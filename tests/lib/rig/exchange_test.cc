// SPDX-License-Identifier: LGPL-2.1-or-later

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "image/image.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/expect_error.h"
#include "support/rigs.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

using nlohmann::json;

TEST(Exchange, ReportsLossesWithTheirSize) {
  Rig rig = mixed_rig();
  EXPECT_TRUE(describe_export(rig, rig, {}).notes.empty());
  EXPECT_LT(describe_export(rig, rig, {}).max_error, 1e-9);
  rig.topology = {Topology::Type::kGrid, 1, 5, {}};
  rig.cameras[1].source = "rtsp://host/1";
  rig.cameras[1].time_offset = 0.1;
  EXPECT_EQ(describe_export(rig, rig, {}).notes.size(), 3u);
  EXPECT_EQ(describe_export(rig, rig, {false, false, false}).notes.size(), 6u);
  Rig other = rig;
  other.cameras[0].lens = Lens::pinhole(400, 160.5, 119.5);
  EXPECT_NEAR(describe_export(rig, other, {}).max_error, 1, 1e-9);
  EXPECT_ERROR(throw_camera_error(rig.cameras[1], "no"), "camera 19: no");
}

// Every format with every lens: the error is below the bound in docs/reference/rig-formats.md, or the export fails.
TEST(Exchange, FormatsRoundTripEveryLensTheyHold) {
  using enum LensModel;
  enum Kind { kCentred, kPerspective, kPlain, kK3, kRational, kFisheye, kPrism };
  const std::pair<Lens, Kind> lenses[] = {
      {Lens(kSimplePinhole, {400, 159.5, 119.5}), kCentred},
      {Lens(kPinhole, {400, 410, 160, 118}), kPerspective},
      {Lens(kSimpleRadial, {400, 159.5, 119.5, -0.1}), kPlain},
      {Lens(kRadial, {386.73880838315351, 159.5, 119.5, -0.15, 0.03}), kPlain},
      {Lens(kOpenCv, {400, 410, 160, 118, -0.15, 0.03, 1e-3, -2e-3}), kPlain},
      {Lens(kFullOpenCv, {400, 410, 160, 118, -0.15, 0.03, 1e-3, -2e-3, 0.01}), kK3},
      {Lens(kFullOpenCv, {400, 410, 160, 118, -0.15, 0.03, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.001}), kRational},
      {Lens(kOpenCvFisheye, {200, 210, 160, 118, 0.05, -0.01, 2e-3, -1e-4}), kFisheye},
      {Lens(kSimpleRadialFisheye, {200, 160, 118, 0.05}), kFisheye},
      {Lens(kRadialFisheye, {200, 160, 118, 0.05, -0.01}), kFisheye},
      {Lens(kThinPrismFisheye, {200, 210, 160, 118, 0.05, -0.01, 1e-3, -2e-3, 2e-3, -1e-4, 1e-4, 2e-4}), kPrism}};
  const struct {
    const char* name;
    RigExport (*write)(const Rig&, const std::string&);
    RigImport (*read)(const std::string&);
    std::set<Kind> kinds;
  } formats[] = {{"caliscope",
                  export_caliscope,
                  [](const std::string& path) { return import_caliscope(path); },
                  {kCentred, kPerspective, kPlain, kK3, kFisheye}},
                 {"colmap",
                  [](const Rig& rig, const std::string& path) { return export_colmap(rig, path); },
                  [](const std::string& path) { return import_colmap(path); },
                  {kCentred, kPerspective, kPlain, kK3, kRational, kFisheye, kPrism}},
                 {"colmap --binary",
                  [](const Rig& rig, const std::string& path) { return export_colmap(rig, path, {.binary = true}); },
                  [](const std::string& path) {
                    RigImport result = import_colmap(path);  // in the order of the ids
                    std::ranges::reverse(result.rig.cameras);
                    return result;
                  },
                  {kCentred, kPerspective, kPlain, kK3, kRational, kFisheye, kPrism}},
                 {"kalibr", export_kalibr, import_kalibr, {kCentred, kPerspective, kPlain, kFisheye}},
                 {"llff",
                  [](const Rig& rig, const std::string& path) { return export_llff(rig, path, 0.5, 30); },
                  [](const std::string& path) { return import_llff(path); },
                  {kCentred}},
                 {"miv",
                  [](const Rig& rig, const std::string& path) { return export_miv(rig, path, 0.5, 30); },
                  import_miv,
                  {kCentred, kPerspective}},
                 {"mrcal", export_mrcal, import_mrcal, {kCentred, kPerspective, kPlain, kK3, kRational}},
                 {"nerf", export_nerf, import_nerf, {kCentred, kPerspective, kPlain, kK3, kFisheye}},
                 {"opencv",
                  export_opencv_yaml,
                  [](const std::string& path) { return import_opencv_yaml(path); },
                  {kCentred, kPerspective, kPlain, kK3, kRational, kFisheye}}};
  constexpr double kBound = 1e-10;  // pixels
  for (const auto& [name, write, read, kinds] : formats) {
    const TempDir dir;
    for (const Camera& camera : mixed_rig().cameras)
      save_image(Image(PixelFamily::kRgb, camera.width, camera.height), dir / camera.image);
    double worst = 0;
    for (const auto& [lens, kind] : lenses) {
      SCOPED_TRACE(std::string(name) + " " + std::string(lens_model_name(lens.model())));
      Rig rig = mixed_rig();
      rig.directory = dir.path();
      for (Camera& camera : rig.cameras) camera.lens = lens;
      if (!kinds.contains(kind)) {
        EXPECT_ERROR(write(rig, dir / "file"), "camera 20");
        continue;
      }
      const RigExport result = write(rig, dir / "file");
      const Rig back = read(dir / "file").rig;
      worst = std::max({worst, result.max_error, max_reprojection_error(rig, back, 1)});
    }
    EXPECT_LE(worst, kBound) << name;
    RecordProperty(name, format_text("%.2g px", worst));
  }
}

TEST(Exchange, KeepsNamesAndDepthsWhereTheFormatHasThem) {
  const TempDir dir;
  Rig rig = make_grid_rig({1, 3, 0.1, 60, 8, 6});
  rig.directory = dir.path();
  for (size_t i = 0; i < 3; i++) {
    rig.cameras[i].name = "view " + std::to_string(5 * i);  // in natural order
    rig.cameras[i].image = std::to_string(i) + ".png";
    save_image(Image(PixelFamily::kRgb, 8, 6), dir / rig.cameras[i].image);
  }
  const RigExport result = export_mrcal(rig, dir / "mrcal");
  EXPECT_THAT(result.notes, ElementsAre(mentions("topology"), mentions("images")));
  EXPECT_EQ(import_mrcal(dir / "mrcal").rig.cameras[2].name, "view 10");
  // LLFF sorts names by their bytes: "view 10" precedes "view 5".
  EXPECT_THAT(export_llff(rig, dir / "llff", 0.5, 30).notes, Contains(mentions("names")));
  const RigImport llff = import_llff(dir / "llff");
  EXPECT_EQ(llff.rig.cameras[1].name, "camera_00001");
  EXPECT_EQ(depth_note(llff), "the scene is from 0.5 to 30 units away (focus-near, focus-far)");
  export_miv(rig, dir / "miv.json", 0.5, 30);
  const RigImport miv = import_miv(dir / "miv.json");
  EXPECT_EQ(miv.rig.cameras[2].name, "view 10");
  EXPECT_EQ(depth_note(miv), "the scene is from 0.5 to 30 m away (focus-near, focus-far)");

  rig.cameras[1].name = "view 0";
  EXPECT_ERROR(export_miv(rig, dir / "miv.json", 0.5, 30), "miv.json", "sourceCameraNames[1]", "twice");
  EXPECT_THAT(export_mrcal(rig, dir / "again").notes, Contains(mentions("names")));
  EXPECT_ERROR(export_mrcal(rig, dir / "mrcal"), dir / "mrcal", "other cameras");
  rig.cameras[2].image.clear();
  EXPECT_ERROR(export_llff(rig, dir / "new", 0.5, 30), "camera 2", "no image");
  rig.cameras[2].name.clear();
  EXPECT_ERROR(export_miv(rig, dir / "miv.json", 0.5, 30), "camera 2", "no name");
}

TEST(Exchange, ScalesAllLengths) {
  RigImport import;
  import.rig = make_grid_rig({2, 2, 0.1, 60, 8, 6});
  EXPECT_EQ(depth_note(import), "");
  const Rig before = import.rig;
  import.has_unit = false;
  import.near = 2;
  EXPECT_EQ(depth_note(import), "the scene begins 2 units away (focus-near)");
  import.far = 30;
  scale_lengths(import, 0.5);
  EXPECT_EQ(depth_note(import), "the scene is from 1 to 15 m away (focus-near, focus-far)");
  for (size_t i = 0; i < 4; i++) {
    EXPECT_EQ(import.rig.cameras[i].pose.position, 0.5 * before.cameras[i].pose.position);
    EXPECT_EQ(import.rig.cameras[i].lens, before.cameras[i].lens);
  }
  EXPECT_ERROR(scale_lengths(import, HUGE_VAL), "camera 0", "too large");
}

TEST(ReprojectionError, MeasuresEachKindOfDifferenceInPixels) {
  Rig rig = test::camera_grid(1, 1, 0, 320, 240, 400);
  rig.cameras[0].lens = Lens(LensModel::kRadial, {400, 159.5, 119.5, -0.15, 0.03});
  rig.cameras[0].pose = {{1e6, -2, 3}, glm::normalize(Quat(0.9, 0.1, -0.2, 0.3))};
  EXPECT_LE(max_reprojection_error(rig, rig, 1), 1e-11);
  Rig other = rig;
  other.cameras[0].lens = Lens(LensModel::kRadial, {400, 159.5, 119.75, -0.15, 0.03});
  EXPECT_NEAR(max_reprojection_error(rig, other, 1), 0.25, 1e-9);

  other = rig;  // the corner moves by 0.5 % of its (distorted) radius of 200 px and a little more
  other.cameras[0].lens = Lens(LensModel::kRadial, {402, 159.5, 119.5, -0.15, 0.03});
  EXPECT_NEAR(max_reprojection_error(rig, other, 1), 1, 1e-9);

  other = rig;  // 1 mm sideways at 2 m: 400 * 0.0005 px at the centre, less towards the corners (barrel distortion)
  other.cameras[0].pose.position += 0.001 * rig.cameras[0].pose.right();
  EXPECT_NEAR(max_reprojection_error(rig, other, 2), 0.2, 1e-6);

  other = rig;  // half a turn: no common points
  other.cameras[0].pose.orientation = rig.cameras[0].pose.orientation * Quat(0, 0, 1, 0);
  EXPECT_EQ(max_reprojection_error(rig, other, 1), std::numeric_limits<double>::infinity());
  EXPECT_EQ(max_reprojection_error(rig, Rig{}, 1), std::numeric_limits<double>::infinity());
}

TEST(OpenCvTerms, SelectsTheSimplestModel) {
  using enum LensModel;
  EXPECT_EQ(lens_from_opencv({5, 5, 2, 1}, {}), Lens(kSimplePinhole, {5, 2, 1}));
  EXPECT_EQ(lens_from_opencv({5, 6, 2, 1}, {0, 0, 0, 0}), Lens(kPinhole, {5, 6, 2, 1}));
  EXPECT_EQ(lens_from_opencv({5, 5, 2, 1}, {0.1}), Lens(kSimpleRadial, {5, 2, 1, 0.1}));
  EXPECT_EQ(lens_from_opencv({5, 5, 2, 1}, {0, 0.1}), Lens(kRadial, {5, 2, 1, 0, 0.1}));
  EXPECT_EQ(lens_from_opencv({5, 6, 2, 1}, {0.1}), Lens(kOpenCv, {5, 6, 2, 1, 0.1, 0, 0, 0}));
  EXPECT_EQ(lens_from_opencv({5, 5, 2, 1}, {0, 0, 0, 0.1}), Lens(kOpenCv, {5, 5, 2, 1, 0, 0, 0, 0.1}));
  EXPECT_ERROR(lens_from_opencv({0, 5, 2, 1}, {}), "focal length", "positive");
}

TEST(OpenCvTerms, TransformsInvertAndCompose) {
  const Rig rig = mixed_rig();
  const RigidTransform a = camera_from_world(rig.cameras[0].pose), b = camera_from_world(rig.cameras[1].pose);
  const Vec3 x(1, 2, 3);
  EXPECT_LT(glm::length(a(x) - rig.cameras[0].pose.camera_from_world(x)), 1e-12);
  EXPECT_LT(glm::length((b * a.inverse())(a(x)) - b(x)), 1e-12);
  const Pose back = pose_of_camera_from_world(a);
  EXPECT_LT(glm::length(back.world_from_camera(a(x)) - x), 1e-12);
}

TEST(OpenCvTerms, RotationsHaveAnglesAndVectors) {
  std::vector<Mat3> rotations;
  for (const double x : {-3.1, -0.4, 0.0, 1e-9, M_PI / 2, M_PI})
    for (const double y : {-M_PI / 2, -1.2, 0.0, 1e-9, M_PI / 2 - 1e-9})
      for (const double z : {-2.5, 0.0, M_PI}) rotations.push_back(rotation_from_euler({x, y, z}));
  for (const Mat3& rotation : rotations)
    for (const Mat3& again :
         {rotation_from_euler(euler_from_rotation(rotation)), rotation_from_vector(vector_from_rotation(rotation))})
      for (int i = 0; i < 3; i++) EXPECT_LT(glm::length(again[i] - rotation[i]), 2e-15);
}

TEST(OpenCvTerms, RoundedRotationsAreCorrectedAndOthersRefused) {
  const std::string file = "x.json";
  const auto parse = [&](const char* text) {
    const json root = parse_json(text, file);
    return parse_rigid_transform(JsonValue(root, file));
  };
  const RigidTransform motion = parse("[[0.8, -0.6, 0, 1], [0.6001, 0.8, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]");
  const Mat3 square = glm::transpose(motion.rotation) * motion.rotation;
  for (int c = 0; c < 3; c++)
    for (int r = 0; r < 3; r++) EXPECT_NEAR(square[c][r], c == r, 1e-14);
  EXPECT_NEAR(motion.rotation[0][1], 0.6, 1e-4);
  EXPECT_EQ(motion.translation, Vec3(1, 2, 3));
  EXPECT_ERROR(parse("[[1, 0, 0, 1], [0, 1, 0, 2]]"), "x.json", "3 or 4", "rows");
  EXPECT_ERROR(parse("[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"), "x.json: [0]: must ");
  EXPECT_ERROR(parse("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]]"), "rotation");
  EXPECT_ERROR(parse("[[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]"), "rotation");
  EXPECT_ERROR(parse("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]"), "[3]:", "[0, 0, 0, 1]");
}

std::vector<std::string> check(const std::string& text, const std::set<std::string_view>& known = {"cameras", "fx"}) {
  return check_foreign_keys(json::parse(text), "f.json", known);
}

TEST(ForeignKeys, RefusesKeysThatChangeTheMeaningOfOthers) {
  for (const std::string member :
       {R"("is_fisheye": true)", R"("fisheye_model": 1)", R"("equirectangular": true)", R"("latlong": 1)",
        R"("sk_x": 0.5)", R"("skew": -2)", R"("xi": 0.9)", R"("k3": 1e-9)", R"("rolling_shutter": [0, 0, 0, 0.1])",
        R"("Rolling_Shutter_Time": 0.01)", R"("line_delay": 2e-5)", R"("transform_matrix_start": [[1]])",
        R"("from_mitsuba": true)", R"("ftheta_p1": 0.1)", R"("camera_model": "OPENCV_FISHEYE")",
        R"("distortion_model": "equidistant")", R"("model_type": "MEI")", R"("orthographic": true)"}) {
    EXPECT_ERROR(check(R"({"cameras": [{"fx": 1}, {)" + member + "}]}"), "f.json: cameras[1].", "cannot be imported")
        << member;
    // Also inside a value that no importer reads.
    EXPECT_ERROR(check(R"({"settings": {"lens": {)" + member + "}}}"), "f.json: settings.lens.") << member;
  }
}

TEST(ForeignKeys, SupportedKeysAndModelsAreTheImportersTask) {
  const auto check_with = [](const std::string& member, const std::set<std::string_view>& supported) {
    return check_foreign_keys(json::parse("{" + member + "}"), "f.json", {"k3", "camera_model"}, supported);
  };
  EXPECT_TRUE(check_with(R"("k3": 0.1, "camera_model": "OPENCV_FISHEYE")", {"k3", "opencv_fisheye"}).empty());
  EXPECT_ERROR(check_with(R"("k3": 0.1, "camera_model": "OPENCV_FISHEYE")", {"k3"}), "camera_model", "imported");
  EXPECT_ERROR(check_with(R"("k3": 0.1, "k4": 0.1)", {"k3"}), "k4", "imported");
}

TEST(LensFromOpenCv, HasTheSimplestModel) {
  const PinholeParams pinhole{400, 410, 320, 240};
  const std::vector<double> all = {0.1, 0.2, 0.003, 0.004, 0.5, 0.6, 0.7, 0.8};
  const Lens full = lens_from_opencv(pinhole, all);
  EXPECT_EQ(full, Lens(LensModel::kFullOpenCv, {400, 410, 320, 240, 0.1, 0.2, 0.003, 0.004, 0.5, 0.6, 0.7, 0.8}));
  EXPECT_EQ(opencv_terms(full), all);
  EXPECT_EQ(lens_from_opencv(pinhole, {0, 0, 0, 0, 0.5}).model(), LensModel::kFullOpenCv);
  EXPECT_EQ(lens_from_opencv(pinhole, {0.1, 0, 0, 0, 0, 0, 0, 0}).model(), LensModel::kOpenCv);
  EXPECT_EQ(lens_from_opencv(pinhole, std::vector<double>(14, 0)).model(), LensModel::kPinhole);
  std::vector<double> tilted(14, 0);
  tilted[12] = 0.01;
  EXPECT_ERROR(lens_from_opencv(pinhole, tilted), "term 12", "tilt", "undistort");
  const Lens fisheye = lens_from_opencv_fisheye(pinhole, {0.1, 0.2, 0.3, 0.4});
  EXPECT_EQ(fisheye, Lens(LensModel::kOpenCvFisheye, {400, 410, 320, 240, 0.1, 0.2, 0.3, 0.4}));
  EXPECT_EQ(opencv_terms(fisheye), (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  EXPECT_ERROR(lens_from_opencv_fisheye(pinhole, {0.1}), "k1, k2, k3 and k4");
  EXPECT_ERROR(opencv_terms(Lens(LensModel::kThinPrismFisheye, {1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0})),
               "THIN_PRISM_FISHEYE");
}

TEST(ForeignKeys, NeutralValuesChangeNothing) {
  EXPECT_TRUE(check(R"({"cameras": [{"is_fisheye": false, "sk_x": 0, "skew": 0.0, "xi": null, "k3": 0, "k4": 0.0,
      "rolling_shutter": [0, 0, 0, 0], "equirectangular": "", "distortion_model": "none", "camera_model": "PINHOLE",
      "lens_model": "Brown", "shutter": "global"}]})",
                    {"cameras", "is_fisheye", "sk_x", "skew", "xi", "k3", "k4", "rolling_shutter", "equirectangular",
                     "distortion_model", "camera_model", "lens_model", "shutter"})
                  .empty());
}

TEST(ForeignKeys, ListsUnreadKeys) {
  EXPECT_TRUE(check(R"({"cameras": [{"fx": 1}]})").empty());
  EXPECT_THAT(check(R"({"zeta": 1, "cameras": [{"fx": 1, "mask": "a"}, {"mask": {"inner": 1}}]})"),
              ElementsAre(mentions("not read", "mask (2 times)", "zeta")));
  std::string many = R"({"cameras": 0)";
  for (int i = 10; i < 40; i++) many += ", \"x" + std::to_string(i) + "\": 1";
  EXPECT_THAT(check(many + "}"), ElementsAre(mentions("x10, x11", "and 18 more")));
}
TEST(YamlValue, EqualsTheJson) {
  const json value = parse_yaml(
      "%YAML:1.0\n---\na: 1\nb: [1., -.5, +2.5e-03, 1e3]\nc:\n- x: 'no'\n- [a b, \"7\", true, ~, .nan, inf]\n"
      "d: !!opencv-matrix\n   rows: 3\n",
      "x.yaml");
  EXPECT_EQ(value, json::parse(R"({"a": 1, "b": [1.0, -0.5, 0.0025, 1000.0],
    "c": [{"x": "no"}, ["a b", "7", true, null, ".nan", "inf"]], "d": {"rows": 3}})"));
  EXPECT_TRUE(value["a"].is_number_integer());
  EXPECT_TRUE(parse_yaml("", "x.yaml").is_null());
}

TEST(YamlValue, ErrorsNameFileAndLine) {
  EXPECT_ERROR(parse_yaml("a: 1\nb: [1, 2\n", "x.yaml"), "x.yaml", "line 3", "YAML");
  EXPECT_ERROR(parse_yaml("a: 1\nb: caf\xe9\n", "x.yaml"), "x.yaml", "line 2", "YAML", "UTF-8");
  EXPECT_ERROR(parse_yaml("a: 1\na: 2\n", "x.yaml"), "x.yaml", "line 2", "YAML", "\"a\"", "twice");
  EXPECT_ERROR(parse_yaml("a: &x 1\nb: *x\n", "x.yaml"), "line 2", "aliases");
  EXPECT_ERROR(parse_yaml("[a, b]: 1\n", "x.yaml"), "key", "plain word");
  EXPECT_ERROR(parse_yaml(std::string(100, '[') + std::string(100, ']'), "x.yaml"), "nested too deeply");
}

TEST(YamlValue, NumbersAreNumbersForEveryReader) {
  EXPECT_EQ(yaml_number(400), "400.0");
  EXPECT_EQ(yaml_number(1e-9), "1.0e-09");
  EXPECT_EQ(yaml_number(-0.1), "-0.1");
  EXPECT_EQ(yaml_number(1.5e300), "1.5e+300");
}

TEST(RigExchange, NamesKeysThatOnlyRigFilesHold) {
  Rig rig = mixed_rig();
  nlohmann::json file = nlohmann::json::parse(rig_to_json(rig));
  EXPECT_EQ(lost_keys_note(file), "");
  rig.cameras[1].colour = ColourModel();
  rig.focus_distance = 2;
  file = nlohmann::json::parse(rig_to_json(rig));
  file["cameras"][2]["covariance"] = {1, 2};
  EXPECT_MENTIONS(lost_keys_note(file), "colour, covariance, focus_distance");
}

}  // namespace
}  // namespace lf
