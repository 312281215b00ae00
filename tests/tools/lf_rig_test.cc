// SPDX-License-Identifier: LGPL-2.1-or-later
// The program as people use it: its files, its output, its exit status.
#include <sys/resource.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "gst/sanitizer.h"
#include "image/image.h"
#include "rig/exchange.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Outcome lf_rig(const std::string& arguments, const std::string& directory = ".") {
  return run_program("lf-rig", arguments, directory);
}

#define EXPECT_SUCCESS(outcome)         \
  do {                                  \
    const Outcome o = (outcome);        \
    EXPECT_EQ(o.status, 0) << o.output; \
  } while (false)
#define EXPECT_FAILURE(outcome, text)       \
  do {                                      \
    const Outcome o = (outcome);            \
    EXPECT_EQ(o.status, 1) << o.output;     \
    EXPECT_THAT(o.output, HasSubstr(text)); \
  } while (false)

const fs::path kData = fs::path(LF_SOURCE_ROOT) / "../shared/data";

// A rig of 3x3 cameras with images in a folder beside it.
void write_rig(const TempDir& dir) {
  ASSERT_EQ(lf_rig("new --grid 3x3 --pitch 0.1 --fov 60 --width 8 --height 6 --out plain.json", dir.path()).status, 0);
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

TEST(LfRig, NewMakesARigThatInfoDescribes) {
  const TempDir dir;
  EXPECT_SUCCESS(lf_rig("new --grid 4x5 --pitch 0.05 --fov 60 --out rig.json", dir.path()));
  const Rig rig = load_rig(dir / "rig.json");
  EXPECT_EQ(rig.cameras.size(), 20u);
  EXPECT_EQ(rig.cameras[0].width, 640);
  const Outcome info = lf_rig("info rig.json", dir.path());
  EXPECT_EQ(info.status, 0);
  char hash[20];
  std::snprintf(hash, sizeof(hash), "%016llx", static_cast<unsigned long long>(rig.hash()));
  const std::vector<std::string> texts = {
      "20 (0 with an image", hash,     "grid of 4x5", "24 triangles",
      "0.2 x 0.15 x 0 m",    "0.25 m", "0.05 m",      "RADIAL, f 415.692 px, 20 cameras of 640x480"};
  for (const std::string& text : texts) EXPECT_THAT(info.output, HasSubstr(text));
}

TEST(LfRig, NewMakesCylinders) {
  const TempDir dir;
  EXPECT_SUCCESS(lf_rig("new --inward 12 --radius 2 --pitch 0.3 --fov 60 --out in.json", dir.path()));
  EXPECT_SUCCESS(lf_rig("new --outward 6 --rows 3 --radius 0.2 --pitch 0.3 --fov 60 --out out.json", dir.path()));
  EXPECT_EQ(load_rig(dir / "in.json").cameras.size(), 24u);
  EXPECT_EQ(load_rig(dir / "out.json").cameras.size(), 18u);
  EXPECT_SUCCESS(lf_rig("check in.json", dir.path()));
  EXPECT_FAILURE(lf_rig("new --inward 12 --pitch 0.3 --fov 60 --out no.json", dir.path()), "radius: must be positive");
  EXPECT_FAILURE(lf_rig("new --grid 2x2 --radius 1 --pitch 1 --fov 60 --out no.json", dir.path()),
                 "--radius: of --arc");
}

TEST(LfRig, NewRefusesNonsense) {
  const TempDir dir;
  const std::string rest = " --out rig.json";
  for (const char* grid : {"0x4", "4", "x", "4x", "4x4x4", "-1x4", "4X4", "99999999999x1"})
    EXPECT_FAILURE(lf_rig(std::string("new --pitch 1 --fov 60 --grid=") + grid + rest, dir.path()), "--grid");
  EXPECT_FAILURE(lf_rig("new --grid 2x2 --pitch 0 --fov 60" + rest, dir.path()), "pitch: must be positive");
  EXPECT_FAILURE(lf_rig("new --grid 2x2 --pitch 1 --fov 180" + rest, dir.path()), "fov_y: must be between");
  EXPECT_FAILURE(lf_rig("new --grid 2x2 --pitch 1 --fov 60 --out none/rig.json", dir.path()),
                 "none/rig.json: can't be written");
  EXPECT_NE(lf_rig("new --grid 2x2 --pitch wide --fov 60" + rest, dir.path()).status, 0);
  EXPECT_NE(lf_rig("new --grid 2x2", dir.path()).status, 0);
  EXPECT_NE(lf_rig("", dir.path()).status, 0);
  EXPECT_FALSE(fs::exists(dir / "rig.json"));
}

TEST(LfRig, CheckFailsOnErrorsAlone) {
  const TempDir dir;
  write_rig(dir);
  EXPECT_SUCCESS(lf_rig("check in/rig.json", dir.path()));
  const Outcome warned = lf_rig("check plain.json", dir.path());
  EXPECT_EQ(warned.status, 0);
  EXPECT_THAT(warned.output, HasSubstr("warning: cameras[0] and 8 more have neither an image nor a source"));
  fs::remove(dir / "in/images/cam_01_01.png");
  EXPECT_FAILURE(lf_rig("check in/rig.json", dir.path()), "in/rig.json: error: cameras[4].image: ");
  dir.write("broken.json", "{\"format\": \"lightfield-rig\",\n \"version\": 1, \"cameras\": [{\"id\": 0,");
  EXPECT_FAILURE(lf_rig("check broken.json", dir.path()),
                 "lf-rig: broken.json: cameras[0]: not valid JSON: parse error at line 2");
  EXPECT_FAILURE(lf_rig("check none.json", dir.path()), "none.json: can't be read: No such file or directory");
}

// Processor time of all programs that have been run and have ended, seconds.
double seconds_of_programs() {
  struct rusage usage {};
  getrusage(RUSAGE_CHILDREN, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

// With all pairs of cameras, each of these takes minutes.
TEST(LfRig, TheLargestRigsTakeSeconds) {
  const TempDir dir;
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
      EXPECT_EQ(lf_rig(std::string(command) + " rig.json >/dev/null", dir.path()).status, 0) << name;
      EXPECT_LT(seconds_of_programs() - before, test::kKeepsFreedMemory ? 200 : 20) << command << ", " << name;
    }
  }
}

TEST(LfRig, RefusesFilesThatNeverEnd) {
  const TempDir dir;
  write_rig(dir);
  fs::create_symlink("/dev/zero", dir / "zero.json");
  ASSERT_EQ(mkfifo((dir / "fifo.json").c_str(), 0600), 0);
  for (const std::string name : {"zero.json", "fifo.json"}) {
    EXPECT_FAILURE(lf_rig("info " + name, dir.path()), name + ": can't be read: it is not a regular file");
    for (const char* format : {"nerf", "kalibr", "opencv"})
      EXPECT_FAILURE(lf_rig(std::string("import ") + format + " " + name + " --out o.json", dir.path()),
                     "it is not a regular file");
  }
  Rig rig = load_rig(dir / "in/rig.json");
  rig.cameras[0].image = "../zero.json";
  rig.cameras[1].image = "../fifo.json";
  save_rig(rig, dir / "in/rig.json");
  EXPECT_FAILURE(lf_rig("check in/rig.json", dir.path()), "zero.json: not a file");
}

TEST(LfRig, SubsetKeepsGridPathsAndUnknownKeys) {
  const TempDir dir;
  write_rig(dir);
  fs::create_directories(dir / "some/where");
  EXPECT_SUCCESS(lf_rig("subset in/rig.json --every 2 --out some/where/sub.json", dir.path()));
  Rig sub = load_rig(dir / "some/where/sub.json");
  EXPECT_EQ(sub.cameras.size(), 4u);
  EXPECT_EQ(sub.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(sub.cameras[1].image, "../../in/images/cam_00_02.png");
  EXPECT_EQ(sub.cameras[0].source, "../../in/film_%03d.png");
  EXPECT_SUCCESS(lf_rig("check some/where/sub.json", dir.path()));

  EXPECT_SUCCESS(lf_rig("subset in/rig.json --cameras 1,4-5,8 --out sub.json", dir.path()));
  sub = load_rig(dir / "sub.json");
  ASSERT_EQ(sub.cameras.size(), 4u);
  EXPECT_EQ(sub.topology.type, Topology::Type::kDelaunay);
  EXPECT_EQ(sub.cameras[1].id, 4u);
  EXPECT_EQ(sub.cameras[0].source, "v4l2:///dev/video3");
  const nlohmann::json saved = nlohmann::json::parse(read_text_file(dir / "sub.json"));
  EXPECT_EQ(saved["provenance"]["by"], "hand");
  EXPECT_EQ(saved["cameras"][1]["note"], "centre");
  EXPECT_SUCCESS(lf_rig("check sub.json", dir.path()));

  EXPECT_FAILURE(lf_rig("subset in/rig.json --cameras 7-9 --out x.json", dir.path()),
                 "\"7-9\": the rig has no camera with id 9");
  EXPECT_FAILURE(lf_rig("subset sub.json --every 2 --out x.json", dir.path()), "topology is not a grid");
  EXPECT_NE(lf_rig("subset in/rig.json --out x.json", dir.path()).status, 0);
  EXPECT_NE(lf_rig("subset in/rig.json --every 2 --cameras 1 --out x.json", dir.path()).status, 0);
  EXPECT_FALSE(fs::exists(dir / "x.json"));
}

TEST(LfRig, ColmapThereAndBack) {
  const TempDir dir;
  write_rig(dir);
  const Outcome written = lf_rig("export colmap in/rig.json model", dir.path());
  EXPECT_EQ(written.status, 0);
  EXPECT_THAT(written.output, HasSubstr("note: the topology of the rig is not kept"));
  EXPECT_THAT(written.output, HasSubstr("model: 9 images, maximum error "));
  EXPECT_SUCCESS(lf_rig("import colmap model --images in --grid 3x3 --out back.json", dir.path()));
  const Rig rig = load_rig(dir / "in/rig.json"), back = load_rig(dir / "back.json");
  EXPECT_LE(max_reprojection_error(rig, back, 1), 1e-9);
  EXPECT_EQ(back.topology.type, Topology::Type::kGrid);
  EXPECT_EQ(back.cameras[0].image, "in/images/cam_00_00.png");
  EXPECT_SUCCESS(lf_rig("check back.json", dir.path()));
  EXPECT_FAILURE(lf_rig("import colmap in --out x.json", dir.path()), "in/cameras.txt: can't be read");
}

TEST(LfRig, OtherFormatsThereAndBack) {
  const TempDir dir;
  write_rig(dir);
  const Rig rig = load_rig(dir / "in/rig.json");
  const std::pair<std::string, std::string> formats[] = {
      {"opencv", ""}, {"kalibr", ""}, {"nerf", ""}, {"stanford", " --f 5.1961524227066320"}};
  for (const auto& [format, options] : formats) {
    EXPECT_SUCCESS(lf_rig("export " + format + " in/rig.json there_" + format, dir.path()));
    EXPECT_SUCCESS(lf_rig("import " + format + " there_" + format + options + " --out back.json", dir.path()));
    EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "back.json"), 1), 1e-9) << format;
    if (format != "kalibr") EXPECT_SUCCESS(lf_rig("check back.json", dir.path()));
  }
  EXPECT_FAILURE(lf_rig("import kalibr in/rig.json --out x.json", dir.path()), "in/rig.json: key \"cam0\" is missing");
}

TEST(LfRig, NamesOfTheStanfordArchiveAreInTheUnitThatIsAskedFor) {
  const TempDir dir;
  write_rig(dir);
  const Rig rig = load_rig(dir / "in/rig.json");
  EXPECT_SUCCESS(lf_rig("export stanford in/rig.json there --unit 0.01", dir.path()));
  const std::string import = "import stanford there --f 5.1961524227066320 --out back.json";
  EXPECT_SUCCESS(lf_rig(import + " --unit 0.01", dir.path()));
  EXPECT_LE(max_reprojection_error(rig, load_rig(dir / "back.json"), 1), 1e-9);
  const double pitch = glm::distance(rig.cameras[0].pose.position, rig.cameras[1].pose.position);
  EXPECT_SUCCESS(lf_rig(import, dir.path()));
  const Rig smaller = load_rig(dir / "back.json");
  EXPECT_NEAR(glm::distance(smaller.cameras[0].pose.position, smaller.cameras[1].pose.position), pitch / 10, 1e-9);
}

// Hand-held photographs: the files are undistorted ones, of sizes and under names of their own.
TEST(LfRig, ImportsTheKettle) {
  if (!fs::exists(kData / "kettle")) GTEST_SKIP() << "needs ../shared/data/kettle";
  const TempDir dir;
  const std::string import = "import colmap '" + fs::canonical(kData / "kettle").string() + "' --out rig.json";
  EXPECT_FAILURE(lf_rig(import, dir.path()), "20.23.45.jpg: is 1250x937, its camera 3 in cameras.txt 1280x960");
  const Outcome outcome = lf_rig(import + " --undistorted", dir.path());
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.output, HasSubstr("28 image files have other names than in images.txt"));
  const Rig rig = load_rig(dir / "rig.json");
  ASSERT_EQ(rig.cameras.size(), 28u);
  const Camera& camera = rig.cameras[0];
  EXPECT_EQ(camera.name, "2021-05-19 20.23.45");
  EXPECT_EQ(camera.lens, Lens(LensModel::kPinhole, {1061.37, 1061.37, (1250 - 1) / 2.0, (937 - 1) / 2.0}));
  EXPECT_SUCCESS(lf_rig("check rig.json", dir.path()));
}

TEST(LfRig, ChecksTheRealRigs) {
  if (!fs::exists(kData)) GTEST_SKIP() << "needs ../shared/data";
  for (const char* name : {"chess", "toys"}) {
    const Outcome outcome = lf_rig("check '" + (kData / name / "rig.json").string() + "'");
    EXPECT_EQ(outcome.status, 0) << outcome.output;
    EXPECT_THAT(outcome.output, HasSubstr("0 errors, 0 warnings"));
  }
}

}  // namespace
}  // namespace lf
