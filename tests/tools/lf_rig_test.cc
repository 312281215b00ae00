// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/resource.h>
#include <sys/stat.h>

#include <gst/gst.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "common/codecs.h"
#include "image/image.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "support/process.h"
#include "support/run_program.h"
#include "support/temp_dir.h"
#include "support/tiff_file.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using test::expect_outcome;

const fs::path kData = fs::path(LF_SOURCE_ROOT) / "../shared/data";

class LfRig : public testing::Test {
 protected:
  Outcome lf_rig(const std::string& arguments) const { return run_program("lf-rig", arguments, dir.path()); }
  void write_rig() const {
    ASSERT_EQ(lf_rig("new --grid 3x3 --pitch 0.1 --fov 60 --width 8 --height 6 --out plain.json").status, 0);
    Rig rig = load_rig(dir / "plain.json");
    fs::create_directories(dir / "in/images");
    for (Camera& camera : rig.cameras) {
      camera.image = "images/" + camera.name + ".png";
      save_image(Image(PixelFamily::kRgb, 8, 6), dir / "in/images/" + camera.name + ".png");
    }
    rig.cameras[0].source = "film_%03d.png";
    save_image(Image(PixelFamily::kRgb, 8, 6), dir / "in/film_000.png");
    rig.cameras[1].source = "v4l2:///dev/video3";
    nlohmann::json original = {{"provenance", {{"by", "hand"}}}, {"cameras", {{{"id", 4}, {"note", "centre"}}}}};
    save_rig(rig, dir / "in/rig.json", &original);
  }

  const TempDir dir;
};

TEST_F(LfRig, NewMakesAGrid) {
  expect_outcome(lf_rig("new --grid 4x5 --pitch 0.05 --fov 60 --out rig.json"), 0);
  const Rig rig = load_rig(dir / "rig.json");
  EXPECT_EQ(rig.cameras.size(), 20u);
  EXPECT_EQ(rig.cameras[0].width, 640);
  const Outcome info = lf_rig("info rig.json");
  EXPECT_EQ(info.status, 0);
  char hash[20];
  std::snprintf(hash, sizeof(hash), "%016llx", static_cast<unsigned long long>(rig.hash()));
  const std::vector<std::string> texts = {"20 (0 with",       hash,         "grid of 4x5", "24 triangles",
                                          "0.2 x 0.15 x 0 m", "0.25 m",     "0.05 m",      "RADIAL",
                                          "415.692 px",       "20 cameras", "640x480"};
  for (const std::string& text : texts) EXPECT_THAT(info.output, HasSubstr(text));
}

TEST_F(LfRig, NewMakesCylinders) {
  expect_outcome(lf_rig("new --inward 12 --radius 2 --pitch 0.3 --fov 60 --out in.json"), 0);
  expect_outcome(lf_rig("new --outward 6 --rows 3 --radius 0.2 --pitch 0.3 --fov 60 --out out.json"), 0);
  EXPECT_EQ(load_rig(dir / "in.json").cameras.size(), 24u);
  EXPECT_EQ(load_rig(dir / "out.json").cameras.size(), 18u);
  expect_outcome(lf_rig("check in.json"), 0);
  expect_outcome(lf_rig("new --inward 12 --pitch 0.3 --fov 60 --out no.json"), 1, mentions("radius", "positive"));
  expect_outcome(lf_rig("new --grid 2x2 --radius 1 --pitch 1 --fov 60 --out no.json"), 1,
                 mentions("--radius", "--arc"));
}

TEST_F(LfRig, NewRefusesInvalidOptions) {
  const std::string rest = " --out rig.json";
  for (const char* grid : {"0x4", "4", "x", "4x", "4x4x4", "-1x4", "4X4", "99999999999x1"})
    expect_outcome(lf_rig(std::string("new --pitch 1 --fov 60 --grid=") + grid + rest), 1, HasSubstr("--grid"));
  expect_outcome(lf_rig("new --grid 2x2 --pitch 0 --fov 60" + rest), 1, mentions("pitch", "positive"));
  expect_outcome(lf_rig("new --grid 2x2 --pitch 1 --fov 180" + rest), 1, HasSubstr("fov_y"));
  expect_outcome(lf_rig("new --grid 2x2 --pitch 1 --fov 60 --out none/rig.json"), 1,
                 mentions("none/rig.json", "written"));
  EXPECT_NE(lf_rig("new --grid 2x2 --pitch wide --fov 60" + rest).status, 0);
  EXPECT_NE(lf_rig("new --grid 2x2").status, 0);
  EXPECT_NE(lf_rig("").status, 0);
  EXPECT_FALSE(fs::exists(dir / "rig.json"));
}

TEST_F(LfRig, CheckFailsOnlyOnErrors) {
  write_rig();
  expect_outcome(lf_rig("check in/rig.json"), 0);
  expect_outcome(lf_rig("check plain.json"), 0, mentions("warning", "cameras[0]", "8 more", "image", "source"));
  fs::remove(dir / "in/images/cam_01_01.png");
  expect_outcome(lf_rig("check in/rig.json"), 1, HasSubstr("in/rig.json: error: cameras[4].image: "));
  dir.write("broken.json", "{\"format\": \"lightfield-rig\",\n \"version\": 1, \"cameras\": [{\"id\": 0,");
  expect_outcome(lf_rig("check broken.json"), 1, mentions("lf-rig", "broken.json", "cameras[0]", "JSON", "line 2"));
  expect_outcome(lf_rig("check none.json"), 1, mentions("none.json", "No such file"));
}

// The live elements and lf-rig check must agree about stills.
TEST_F(LfRig, CheckNamesUndecodableStills) {
  write_rig();
  Rig rig = load_rig(dir / "in/rig.json");
  rig.cameras[4].image = "images/cam.tif";
  save_tiff(Image(PixelFamily::kRgb, 8, 6), dir / "in/images/cam.tif");
  save_rig(rig, dir / "in/rig.json");
  if (still_decoding_problem(dir / "in/images/cam.tif").empty())
    expect_outcome(lf_rig("check in/rig.json"), 0);
  else
    expect_outcome(lf_rig("check in/rig.json"), 1,
                   AllOf(HasSubstr("error: cameras[4].image: "), HasSubstr("JPEG or PNG")));
}

TEST_F(LfRig, CheckComparesImagesWithTheGeometry) {
  const Rig scene = scene_rig(2, 3, 160, 120);
  for (const bool is_sequence : {false, true}) {
    Rig right = scene, mirrored = scene;
    for (size_t i = 0; i < scene.cameras.size(); i++) {
      const Camera& camera = scene.cameras[i];
      const std::string name = camera.name + "_000.png";
      if (!is_sequence) save_image(render_scene({160, 120, camera.lens, camera.pose}, 0, 1), dir / name);
      for (Camera* c : {&right.cameras[i], &mirrored.cameras[i / 3 * 3 + 2 - i % 3]})
        (is_sequence ? c->source : c->image) = is_sequence ? camera.name + "_%03d.png" : name;
    }
    save_rig(right, dir / "right.json");
    save_rig(mirrored, dir / "mirrored.json");
    expect_outcome(lf_rig("check right.json"), 0, mentions("right.json", "0 errors", "0 warnings"));
    expect_outcome(lf_rig("check mirrored.json"), 0, mentions("mirrored.json", "warning: cameras:", "fit"));
  }
}

// Returns the processor time of all finished child processes, in seconds.
double seconds_of_programs() {
  struct rusage usage {};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

// Comparing all pairs of cameras would take minutes for each command.
TEST_F(LfRig, TheLargestRigsTakeSeconds) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(0, 1);
  const std::pair<const char*, std::function<Vec3(int)>> places[] = {
      {"random", [&](int) { return Vec3(number(random), number(random), 0); }},
      {"a line", [](int i) { return Vec3(0, 1e-3 * i, 0); }},
      {"a ring", [](int i) { return Vec3(std::cos(1e-4 * i), std::sin(1e-4 * i), 0); }},
      {"one place", [](int) { return Vec3(0); }},
  };
  for (const auto& [name, place] : places) {
    Rig rig = make_grid_rig({1, 65535, 0.1, 60, 8, 6});
    rig.topology = {};
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      rig.cameras[i].name = std::to_string(i);
      rig.cameras[i].pose.position = place(static_cast<int>(i));
    }
    save_rig(rig, dir / "rig.json");
    for (const char* command : {"info", "check"}) {
      const double before = seconds_of_programs();
      EXPECT_EQ(lf_rig(std::string(command) + " rig.json >/dev/null").status, 0) << name;
      EXPECT_LT(seconds_of_programs() - before, test::kKeepsFreedMemory ? 200 : 20) << command << ", " << name;
    }
  }
}

TEST_F(LfRig, RefusesEndlessFiles) {
  write_rig();
  fs::create_symlink("/dev/zero", dir / "zero.json");
  ASSERT_EQ(mkfifo((dir / "fifo.json").c_str(), 0600), 0);
  for (const std::string name : {"zero.json", "fifo.json"}) {
    expect_outcome(lf_rig("info " + name), 1, mentions(name, "regular file"));
    for (const char* format : {"nerf", "kalibr", "opencv"})
      expect_outcome(lf_rig(std::string("import ") + format + " " + name + " --out o.json"), 1,
                     HasSubstr("regular file"));
  }
  Rig rig = load_rig(dir / "in/rig.json");
  rig.cameras[0].image = "../zero.json";
  rig.cameras[1].image = "../fifo.json";
  save_rig(rig, dir / "in/rig.json");
  expect_outcome(lf_rig("check in/rig.json"), 1, mentions("zero.json", "not a file"));
}

TEST_F(LfRig, SubsetKeepsGridPathsAndUnknownKeys) {
  write_rig();
  fs::create_directories(dir / "some/where");
  expect_outcome(lf_rig("subset in/rig.json --every 2 --out some/where/sub.json"), 0);
  Rig sub = load_rig(dir / "some/where/sub.json");
  EXPECT_EQ(sub.cameras.size(), 4u);
  EXPECT_EQ(sub.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(sub.cameras[1].image, "../../in/images/cam_00_02.png");
  EXPECT_EQ(sub.cameras[0].source, "../../in/film_%03d.png");
  expect_outcome(lf_rig("check some/where/sub.json"), 0);

  expect_outcome(lf_rig("subset in/rig.json --cameras 1,4-5,8 --out sub.json"), 0);
  sub = load_rig(dir / "sub.json");
  ASSERT_EQ(sub.cameras.size(), 4u);
  EXPECT_EQ(sub.topology.type, Topology::Type::kDelaunay);
  EXPECT_EQ(sub.cameras[1].id, 4u);
  EXPECT_EQ(sub.cameras[0].source, "v4l2:///dev/video3");
  const nlohmann::json saved = nlohmann::json::parse(read_text_file(dir / "sub.json"));
  EXPECT_EQ(saved["provenance"]["by"], "hand");
  EXPECT_EQ(saved["cameras"][1]["note"], "centre");
  expect_outcome(lf_rig("check sub.json"), 0);

  expect_outcome(lf_rig("subset in/rig.json --cameras 7-9 --out x.json"), 1, mentions("7-9", "id 9"));
  expect_outcome(lf_rig("subset sub.json --every 2 --out x.json"), 1, mentions("topology", "grid"));
  EXPECT_NE(lf_rig("subset in/rig.json --out x.json").status, 0);
  EXPECT_NE(lf_rig("subset in/rig.json --every 2 --cameras 1 --out x.json").status, 0);
  EXPECT_FALSE(fs::exists(dir / "x.json"));
}

TEST_F(LfRig, ColmapRoundTrip) {
  write_rig();
  expect_outcome(lf_rig("export colmap in/rig.json model"), 0,
                 AllOf(mentions("note", "topology"), mentions("model", "9 images", "error")));
  expect_outcome(lf_rig("import colmap model --images in --grid 3x3 --out back.json"), 0);
  const Rig rig = load_rig(dir / "in/rig.json"), back = load_rig(dir / "back.json");
  EXPECT_LE(max_reprojection_error(rig, back, 1), 1e-9);
  EXPECT_EQ(back.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(back.cameras[0].image, "in/images/cam_00_00.png");
  expect_outcome(lf_rig("check back.json"), 0);
  expect_outcome(lf_rig("import colmap in --out x.json"), 1, mentions("in: ", "cameras.txt", "read"));

  expect_outcome(lf_rig("export colmap in/rig.json model --binary"), 1,
                 mentions("model/cameras.txt", "another folder"));
  expect_outcome(lf_rig("export colmap in/rig.json binary --binary --rig-id 7"), 0, mentions("9 images", "error"));
  expect_outcome(lf_rig("import colmap binary --images in --frame 1 --grid 3x3 --out binary.json"), 0);
  EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "binary.json"), 1), 1e-9);
  expect_outcome(lf_rig("import colmap binary --rig-id 7 --out array.json"), 0, HasSubstr("9 cameras"));
  expect_outcome(lf_rig("export colmap in/rig.json binary --binary"), 1, mentions("binary/rigs.bin"));
}

TEST_F(LfRig, OtherFormatsRoundTrip) {
  write_rig();
  const Rig rig = load_rig(dir / "in/rig.json");
  const std::string depths = " --focus-near 0.5 --focus-far 30";
  const struct {
    std::string format, export_options, import_options;
    bool has_images;
  } formats[] = {{"opencv", "", "", true},     {"kalibr", "", "", false},
                 {"nerf", "", "", true},       {"stanford", "", " --f 5.1961524227066320", true},
                 {"caliscope", "", "", false}, {"hci", "", "", true},
                 {"llff", depths, "", true},   {"miv", depths, "", false},
                 {"mrcal", "", "", false}};
  for (const auto& [format, export_options, import_options, has_images] : formats) {
    expect_outcome(lf_rig("export " + format + " in/rig.json there_" + format + export_options), 0);
    expect_outcome(lf_rig("import " + format + " there_" + format + import_options + " --out back.json"), 0);
    EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "back.json"), 1), 1e-9) << format;
    if (has_images) expect_outcome(lf_rig("check back.json"), 0);
  }
  expect_outcome(lf_rig("export miv in/rig.json there --focus-near 2 --focus-far 1"), 1, HasSubstr("--focus-far"));
  expect_outcome(lf_rig("import kalibr in/rig.json --out x.json"), 1, mentions("in/rig.json", "\"cam0\"", "missing"));
}

// The output must not replace the imported file, which may be the only copy of a calibration.
TEST_F(LfRig, InputsAreNotOverwritten) {
  write_rig();
  const auto read = [&](const std::string& name) { return read_text_file(dir / name); };
  for (const std::string format : {"nerf", "kalibr", "opencv"}) {
    expect_outcome(lf_rig("export " + format + " in/rig.json there"), 0);
    const std::string before = read("there");
    expect_outcome(lf_rig("import " + format + " there --out there"), 1, mentions("there", "not a rig"));
    expect_outcome(lf_rig("import " + format + " there --out ./in/../there"), 1, HasSubstr("not a rig"));
    EXPECT_EQ(read("there"), before) << format;
    for (int i = 0; i < 2; i++) expect_outcome(lf_rig("import " + format + " there --out back.json"), 0);
    const std::string rig = read("in/rig.json");
    expect_outcome(lf_rig("export " + format + " in/rig.json in/rig.json"), 1, HasSubstr("in/rig.json: "));
    EXPECT_EQ(read("in/rig.json"), rig) << format;
  }
  expect_outcome(lf_rig("export colmap in/rig.json model"), 0);
  const std::string images = read("model/images.txt");
  expect_outcome(lf_rig("import colmap model --images in --out model/images.txt"), 1, HasSubstr("model/images.txt"));
  EXPECT_EQ(read("model/images.txt"), images);
  expect_outcome(lf_rig("import colmap model --images in --out model/rig.json"), 0);
  expect_outcome(lf_rig("import colmap model --images in --out in/images/cam_00_00.png"), 1, HasSubstr("cam_00_00"));
}

// A focal length in millimetres.
TEST_F(LfRig, ImportWarnsOfImpossibleLenses) {
  dir.write("t.json", R"({"w": 320, "h": 240, "fl_x": 3.87, "frames": [{"transform_matrix":
      [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})");
  expect_outcome(lf_rig("import nerf t.json --out rig.json"), 0,
                 AllOf(HasSubstr("rig.json: warning: cameras[0].params"), HasSubstr("3.87 px")));
}

TEST_F(LfRig, StanfordNamesUseTheRequestedUnit) {
  write_rig();
  const Rig rig = load_rig(dir / "in/rig.json");
  expect_outcome(lf_rig("export stanford in/rig.json there --scale 0.01"), 0);
  const std::string import = "import stanford there --f 5.1961524227066320 --out back.json";
  expect_outcome(lf_rig(import + " --scale 0.01"), 0);
  EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "back.json"), 1), 1e-9);
  const double pitch = glm::distance(rig.cameras[0].pose.position, rig.cameras[1].pose.position);
  expect_outcome(lf_rig(import), 0);
  const Rig smaller = load_rig(dir / "back.json");
  EXPECT_NEAR(glm::distance(smaller.cameras[0].pose.position, smaller.cameras[1].pose.position), pitch / 10, 1e-9);
}

TEST_F(LfRig, ImportsOneFrameOfColmap) {
  dir.write("model/cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  dir.write("model/images.txt", "1 1 0 0 0 0 0 0 1 0.png\n\n2 1 0 0 0 1 0 0 1 1.png\n\n");
  dir.write("model/frames.txt", "5 1 1 0 0 0 0 0 0 1 CAMERA 1 1\n6 1 1 0 0 0 1 0 0 1 CAMERA 1 2\n");
  expect_outcome(lf_rig("import colmap model --frame 6 --out rig.json"), 0, mentions("rig.json", "1 camera"));
  EXPECT_EQ(load_rig(dir / "rig.json").cameras.at(0).id, 2u);
  expect_outcome(lf_rig("import colmap model --frame 7 --out rig.json"), 1, mentions("frame 7", "5", "6"));
  dir.write("model/rigs.txt", "4 2 IMU 1 CAMERA 1 1 1 0 0 0 0 0 3\n");
  expect_outcome(lf_rig("import colmap model --rig-id 4 --out rig.json"), 0, mentions("rig.json", "1 camera"));
  EXPECT_EQ(load_rig(dir / "rig.json").cameras.at(0).pose.position, Vec3(0, 0, -3));
  expect_outcome(lf_rig("import colmap model --rig-id 4 --frame 6 --out rig.json"), 1, mentions("--rig-id", "--frame"));
}

// The format tells no unit for NeRF, and metres for Kalibr; a file can have millimetres in spite of that.
TEST_F(LfRig, ScaleIsTheLengthOfAUnit) {
  write_rig();
  const Rig rig = load_rig(dir / "in/rig.json");
  for (const char* format : {"nerf", "kalibr"}) {
    expect_outcome(lf_rig(std::string("export ") + format + " in/rig.json there"), 0);
    const bool has_unit = std::string_view(format) == "kalibr";
    for (const std::string& import : {std::string("import there"), std::string("import ") + format + " there"}) {
      const Outcome plain = lf_rig(import + " --out back.json");
      expect_outcome(plain, 0, HasSubstr("back.json: irregular"));
      EXPECT_EQ(plain.output.find("does not tell its unit") == std::string::npos, has_unit) << plain.output;
      EXPECT_EQ(plain.output.find("--scale") == std::string::npos, has_unit) << plain.output;
      const Outcome scaled = lf_rig(import + " --scale 2.5 --out back.json");
      expect_outcome(scaled, 0, HasSubstr("back.json: irregular arrangement, 0.25 m between neighbouring cameras\n"));
      const Rig back = load_rig(dir / "back.json");
      for (size_t i = 0; i < rig.cameras.size(); i++)
        EXPECT_LT(glm::distance(back.cameras[i].pose.position, 2.5 * rig.cameras[i].pose.position), 1e-9);
    }
  }
  for (const char* scale : {"0", "-1"})
    expect_outcome(lf_rig(std::string("import there --out no.json --scale ") + scale), 1, HasSubstr("--scale"));
}

TEST_F(LfRig, WritesAContactSheet) {
  const Rig scene = scene_rig(2, 3, 160, 120);
  Rig rig = scene;
  for (Camera& camera : rig.cameras) {
    camera.image = camera.name + ".png";
    save_image(render_scene({160, 120, camera.lens, camera.pose}, 0, 1), dir / camera.image);
  }
  save_rig(rig, dir / "rig.json");
  expect_outcome(lf_rig("export opencv rig.json cameras.yaml"), 0);
  const std::pair<std::string, int> commands[] = {
      {"check rig.json --sheet sheet.png", 2},
      {"import cameras.yaml --out back.json --sheet sheet.png", 2},
      {"import opencv cameras.yaml --out back.json --sheet sheet.png", 2},
      {"check plain.json --sheet sheet.png", 1}};  // without pictures, there are only the plans
  expect_outcome(lf_rig("new --grid 3x3 --pitch 0.1 --fov 60 --width 8 --height 6 --out plain.json"), 0);
  for (const auto& [command, rows] : commands) {
    expect_outcome(lf_rig(command), 0, HasSubstr("sheet.png: contact sheet of"));
    const Image sheet = load_image(dir / "sheet.png");
    EXPECT_EQ(sheet.width(), 1008) << command;
    EXPECT_EQ(sheet.height(), 88 + rows * 406) << command;
    std::set<std::array<uint8_t, 3>> colours;
    for (int x = 16; x < 1000; x++)
      colours.insert({sheet.pixel(x, 200)[0], sheet.pixel(x, 200)[1], sheet.pixel(x, 200)[2]});
    EXPECT_GT(colours.size(), rows == 2 ? 100u : 2u) << command;
    fs::remove(dir / "sheet.png");
  }
  const double distance = load_rig(dir / "back.json").focus_distance;
  EXPECT_TRUE(distance > 1.5 && distance < 4) << distance;  // with images of the built-in scene
  expect_outcome(lf_rig("check rig.json --sheet sheet.txt"), 1, mentions("--sheet sheet.txt", ".png"));
  expect_outcome(lf_rig("import cameras.yaml --out no.json --sheet sheet"), 1, mentions("--sheet sheet", ".png"));
  EXPECT_FALSE(fs::exists(dir / "no.json"));
}

TEST_F(LfRig, ImportsCaliscopeWithUndistortedVideos) {
  dir.write("camera_array.toml",
            "[cameras.1]\nsize = [640, 480]\nmatrix = [[600, 0, 320], [0, 601, 240], [0, 0, 1]]\n"
            "distortions = [0.1, 0, 0, 0, 0.02]\nrotation = [0, 0, 0]\ntranslation = [0, 0, 1]\n");
  const std::string import = "import caliscope camera_array.toml --out rig.json";
  expect_outcome(lf_rig(import), 0, mentions("rig.json", "1 camera"));
  const Lens distorted = load_rig(dir / "rig.json").cameras.at(0).lens;
  EXPECT_EQ(distorted, Lens(LensModel::kFullOpenCv, {600, 601, 320, 240, 0.1, 0, 0, 0, 0.02}));
  expect_outcome(lf_rig(import + " --undistorted"), 0, mentions("rig.json", "1 camera"));
  EXPECT_EQ(load_rig(dir / "rig.json").cameras.at(0).lens, Lens(LensModel::kPinhole, {600, 601, 320, 240}));
}

TEST_F(LfRig, ImportFindsTheFormat) {
  write_rig();
  const Rig rig = load_rig(dir / "in/rig.json");
  expect_outcome(lf_rig("export colmap in/rig.json scene/sparse/0"), 0);
  fs::create_directories(dir / "scene/images");
  fs::rename(dir / "in/images", dir / "scene/images/images");
  expect_outcome(lf_rig("import scene --out scene/rig.json"), 0,
                 AllOf(mentions("colmap: 9 cameras from scene/sparse/0/images.txt, images in scene/images"),
                       mentions("scene/rig.json", "irregular", "0.1 m", "unit")));
  const std::string found = read_text_file(dir / "scene/rig.json");
  expect_outcome(lf_rig("import colmap scene/sparse/0 --images scene/images --out scene/rig.json"), 0);
  EXPECT_EQ(read_text_file(dir / "scene/rig.json"), found);

  // The rig file in the same folder does not make the format ambiguous, but the files of another program do.
  expect_outcome(lf_rig("import scene --out scene/rig.json"), 0);
  dir.write("scene/transforms.json", "{}");
  expect_outcome(lf_rig("import scene --out x.json"), 1,
                 mentions("\"lf-rig import colmap scene/sparse/0 --images scene/images\"",
                          "\"lf-rig import nerf scene/transforms.json\""));
  expect_outcome(lf_rig("import scene/transforms.json --out x.json"), 1,
                 mentions("scene/transforms.json: ", "frames", "shows the format nerf"));
  expect_outcome(lf_rig("import scene/rig.json --out x.json"), 1, mentions("scene/rig.json", "already a rig file"));
  expect_outcome(lf_rig("import scene/images --out x.json"), 1, mentions("scene/images: ", "poses_bounds.npy"));
  expect_outcome(lf_rig("import scene --out scene/transforms.json"), 1, HasSubstr("not a rig file"));
  expect_outcome(lf_rig("import --out x.json colmap scene/sparse/0 --out x.json"), 1, mentions("colmap", "--out"));
  EXPECT_FALSE(fs::exists(dir / "x.json"));

  for (const char* format : {"kalibr", "nerf", "opencv"}) {
    expect_outcome(lf_rig(std::string("export ") + format + " plain.json chain"), 0);
    expect_outcome(lf_rig("import chain --out back.json"), 0,
                   HasSubstr(std::string(format) + ": 9 cameras from chain"));
    EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "back.json"), 1), 1e-9) << format;
  }
}

TEST_F(LfRig, ImportDescribesTheArrangement) {
  write_rig();
  expect_outcome(lf_rig("export colmap in/rig.json model"), 0);
  expect_outcome(lf_rig("import colmap model --images in --grid 3x3 --out back.json"), 0,
                 mentions("back.json: grid of 3x3, 0.1 m between neighbouring cameras", "unit"));
  expect_outcome(lf_rig("new --line 4 --pitch 0.25 --fov 60 --out row.json"), 0);
  expect_outcome(lf_rig("export kalibr row.json chain.yaml"), 0);
  expect_outcome(lf_rig("import kalibr chain.yaml --out back.json"), 0,
                 HasSubstr("back.json: row, 0.25 m between neighbouring cameras\n"));
}

TEST_F(LfRig, ListsTheCommandsIfNoneIsGiven) {
  const auto formats = mentions("lf-rig import:", "caliscope", "colmap", "deepview", "hci", "kalibr", "llff", "miv",
                                "mrcal", "nerf", "opencv", "stanford", "technicolor");
  expect_outcome(lf_rig("import 'my model' --grid 2x2 --out rig.json"), 1,
                 AllOf(formats, HasSubstr("\"lf-rig import colmap 'my model' --grid 2x2 --out rig.json\""),
                       HasSubstr("lf-rig import --help")));
  for (const char* arguments : {"", " model", " --out rig.json"})
    expect_outcome(lf_rig(std::string("import") + arguments), 1,
                   mentions("import: needs PATH and --out", "caliscope", "stanford", "lf-rig import --help"));
  expect_outcome(lf_rig("import model --out rig.json"), 1, mentions("model", "No such file"));
  expect_outcome(lf_rig("import --f=1 model"), 1, HasSubstr("lf-rig import stanford --f=1 model"));
  expect_outcome(lf_rig("import colmpa model --out rig.json"), 1,
                 HasSubstr("lf-rig import colmap model --out rig.json"));
  expect_outcome(lf_rig("export rig.json model"), 1, mentions("lf-rig export", "colmap"));
  expect_outcome(lf_rig("chek rig.json"), 1, HasSubstr("\"lf-rig check rig.json\""));
  expect_outcome(lf_rig("--grid 2x2 --fov 60 --out rig.json"), 1,
                 HasSubstr("\"lf-rig new --grid 2x2 --fov 60 --out rig.json\""));
  expect_outcome(lf_rig("rig.json"), 1, mentions("lf-rig", "new", "info", "check", "subset"));
  expect_outcome(lf_rig("check"), 1, mentions("lf-rig", "RIG"));
}

// Hand-held photographs: the files are undistorted, with different sizes and names.
TEST_F(LfRig, ImportsTheKettle) {
  if (!fs::exists(kData / "kettle")) GTEST_SKIP() << "needs ../shared/data/kettle";
  const std::string import = "import colmap '" + fs::canonical(kData / "kettle").string() + "' --out rig.json";
  expect_outcome(lf_rig(import), 1, mentions("20.23.45.jpg", "1250x937", "model", "camera 3", "1280x960"));
  expect_outcome(lf_rig(import + " --undistorted"), 0, mentions("28", "names", "model"));
  const Rig rig = load_rig(dir / "rig.json");
  ASSERT_EQ(rig.cameras.size(), 28u);
  const Camera& camera = rig.cameras[0];
  EXPECT_EQ(camera.name, "2021-05-19 20.23.45");
  EXPECT_NEAR(rig.focus_distance, 12.8, 0.5);  // the kettle begins at 8.7
  EXPECT_EQ(camera.lens, Lens(LensModel::kPinhole, {1061.37, 1061.37, (1250 - 1) / 2.0, (937 - 1) / 2.0}));
  expect_outcome(lf_rig("check rig.json"), 0);
  const auto unit = [this](const char* name) { return parse_json(read_text_file(dir / name), name).value("unit", ""); };
  EXPECT_EQ(unit("rig.json"), "unknown");
  expect_outcome(lf_rig("subset rig.json --cameras 1-4 --out part.json"), 0);
  EXPECT_EQ(unit("part.json"), "unknown");
  expect_outcome(lf_rig(import + " --undistorted --scale 0.02"), 0);
  EXPECT_EQ(unit("rig.json"), "");
}

TEST_F(LfRig, ChecksTheRealRigs) {
  if (!fs::exists(kData)) GTEST_SKIP() << "needs ../shared/data";
  for (const char* name : {"chess", "toys"}) {
    expect_outcome(lf_rig("check '" + (kData / name / "rig.json").string() + "'"), 0,
                   mentions("0 errors", "0 warnings"));
  }
}

}  // namespace
}  // namespace lf
