// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/rig_report.h"

#include "image/image.h"
#include "rig/rig.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

// Each text is "error: ..." or "warning: ...".
std::vector<std::string> check(const Rig& rig) {
  std::vector<std::string> texts;
  for (const RigFinding& finding : check_rig(rig))
    texts.push_back((finding.severity == RigFinding::Severity::kError ? "error: " : "warning: ") + finding.text);
  return texts;
}

class CheckRig : public testing::Test {
 protected:
  void SetUp() override {
    rig_ = make_grid_rig({2, 3, 0.1, 60, 8, 6});
    rig_.directory = dir_.path();
    for (Camera& camera : rig_.cameras) {
      camera.image = camera.name + ".png";
      save_image(Image(PixelFamily::kRgb, 8, 6), rig_.resolve(camera.image));
    }
  }
  TempDir dir_;
  Rig rig_;
};

TEST_F(CheckRig, GoodRigHasNoFindings) { EXPECT_THAT(check(rig_), IsEmpty()); }

TEST_F(CheckRig, NamesBadImages) {
  std::filesystem::remove(dir_ / "cam_00_01.png");
  save_image(Image(PixelFamily::kRgb, 6, 8), dir_ / "cam_00_02.png");
  dir_.write("cam_01_00.png", "not a picture");
  EXPECT_THAT(check(rig_), ElementsAre(mentions("error", "cameras[1].image", dir_ / "cam_00_01.png", "no such"),
                                       mentions("error", "cameras[2].image", dir_ / "cam_00_02.png", "6x8", "8x6"),
                                       mentions("error: cameras[3].image:", dir_ / "cam_01_00.png", "image", "read")));
}

TEST_F(CheckRig, NamesMissingSources) {
  dir_.write("film.mkv", "");
  const std::string long_name(300, 'a');
  const std::string sources[] = {"film.mkv",      "none.mkv", "frame_%03d.png", "none/frame_%03d.png",
                                 "rtsp://host/x", long_name};
  for (size_t i = 0; i < 6; i++) rig_.cameras[i].source = sources[i];
  EXPECT_THAT(check(rig_),
              ElementsAre(mentions("error", "cameras[1].source", dir_ / "none.mkv", "no such"),
                          mentions("error: cameras[2].source:", dir_ / "frame_%03d.png", "no such", "0 or 1"),
                          mentions("error: cameras[3].source:", dir_ / "none/frame_%03d.png", "no such", "0 or 1"),
                          mentions("error", "cameras[5].source", dir_ / long_name, "no such")));
}

TEST_F(CheckRig, HidesThePasswordsOfMistypedSources) {
  rig_.cameras[0].source = "rtsp:/user:s3cret@127.0.0.1/x";
  rig_.cameras[1].source = "user:s3cret@host/x";
  for (const std::string& finding : check(rig_)) EXPECT_THAT(finding, testing::Not(testing::HasSubstr("s3cret")));
  EXPECT_EQ(check(rig_).size(), 2u);
}

TEST_F(CheckRig, WarnsOfSourcesThatNeedTrust) {
  rig_.cameras[0].source = "videotestsrc ! queue";
  rig_.cameras[1].source = "videotestsrc ! filesink location=x";
  rig_.cameras[2].source = "multifile:///tmp/%25s";
  EXPECT_THAT(check(rig_), ElementsAre(mentions("warning", "cameras[1].source", "filesink", "--trust-rig"),
                                       mentions("warning", "cameras[2].source", "multifile", "--trust-rig")));
}

TEST_F(CheckRig, ReadsStillsAndSequencesOfSources) {
  const auto cut = [&](const std::string& name) { fs::resize_file(dir_ / name, fs::file_size(dir_ / name) / 2); };
  for (const char* name : {"a_0.png", "a_1.png", "a_2.png", "b_0.png", "b_2.png", "still.png", "small.png"})
    save_image(Image(PixelFamily::kRgb, 8, name[0] == 's' && name[1] == 'm' ? 5 : 6), dir_ / name);
  cut("a_1.png");
  cut("still.png");
  const char* const sources[] = {"a_%d.png", "b_%d.png", "still.png", "small.png"};
  for (size_t i = 0; i < 4; i++) rig_.cameras[i].source = sources[i];
  EXPECT_THAT(check(rig_), ElementsAre(mentions("warning", "cameras[0].source", dir_ / "a_1.png", "truncated"),
                                       mentions("error", "cameras[1].source", dir_ / "b_1.png", "missing"),
                                       mentions("error", "cameras[2].source", dir_ / "still.png", "damaged PNG"),
                                       mentions("error", "cameras[3].source", dir_ / "small.png", "8x5", "8x6")));
}

TEST_F(CheckRig, WarnsOfCamerasWithoutAPicture) {
  rig_.cameras[4].image = "";
  EXPECT_THAT(check(rig_), ElementsAre(mentions("warning", "cameras[4]", "image", "source")));
  rig_.cameras[2].image = "";
  EXPECT_THAT(check(rig_), ElementsAre(mentions("warning", "cameras[2]", "1 more", "image", "source")));
  for (Camera& camera : rig_.cameras) camera.image = "";
  EXPECT_THAT(check(rig_), ElementsAre(testing::HasSubstr("built-in scene")));
}

TEST_F(CheckRig, WarnsOfCamerasWithTheSameFile) {
  rig_.cameras[2].image = "./" + rig_.cameras[1].image;
  EXPECT_THAT(check(rig_), ElementsAre(testing::AllOf(testing::StartsWith("warning: cameras[2].image: "),
                                                      testing::HasSubstr("cameras[1]"))));
  rig_.cameras[3].image = rig_.cameras[1].image;
  EXPECT_THAT(check(rig_), ElementsAre(testing::HasSubstr("; 1 more"))) << "one finding for all cameras";
  for (Camera& camera : rig_.cameras) camera.source = "rtsp://host/x";
  EXPECT_THAT(check(rig_), IsEmpty()) << "two cameras can have one server";
}

// Files of other programs with values in other units than pixels.
TEST_F(CheckRig, WarnsOfImplausibleLenses) {
  const auto with = [&](const Lens& lens) {
    Rig rig = rig_;
    for (Camera& camera : rig.cameras) {
      camera.image.clear();
      camera.source = "rtsp://host/x";
      camera.width = 320;
      camera.height = 240;
      camera.lens = lens;
    }
    return check(rig);
  };
  const auto finding = [](const std::string& begin, const std::string& value, const std::string& cause) {
    return ElementsAre(mentions(begin + ": cameras[0].params (cam_00_00): ", value, cause, "5 more"));
  };
  EXPECT_THAT(with(Lens::pinhole(387, 159.5, 119.5)), IsEmpty());
  EXPECT_THAT(with(Lens(LensModel::kRadial, {387, 150, 130, -0.15, 0.03})), IsEmpty());
  EXPECT_THAT(with(Lens::pinhole(3.87, 159.5, 119.5)), finding("warning", "3.87 px", "millimetres"));
  EXPECT_THAT(with(Lens::pinhole(387, 0.5, 0.5)), finding("warning", "(0.5, 0.5)", "normalised"));
  EXPECT_THAT(with(Lens::pinhole(1547, 638.5, 478.5)), finding("warning", "(638.5, 478.5)", "1278x958"));
  EXPECT_THAT(with(Lens::pinhole(387, 159.5, 300)), finding("warning", "(159.5, 300)", "off-centre"));
  EXPECT_THAT(with(Lens(LensModel::kSimpleRadial, {387, 159.5, 119.5, -1.6})), finding("warning", "-1.6", "folds"));
  EXPECT_THAT(with(Lens(LensModel::kSimpleRadial, {387, 159.5, 119.5, -30})), finding("error", "-30", "folds"));
  using enum LensModel;
  EXPECT_THAT(with(Lens(kOpenCvFisheye, {76, 76, 159.5, 119.5, 0, 0, 0, 0})), IsEmpty()) << "a circle of 180 degrees";
  EXPECT_THAT(with(Lens(kSimpleRadialFisheye, {90, 159.5, 119.5, -0.3})),
              finding("warning", "SIMPLE_RADIAL_FISHEYE", "folds"));
  EXPECT_THAT(with(Lens(kFullOpenCv, {387, 387, 159.5, 119.5, 0, 0, 0, 0, 0, 9, 0, 0})),
              finding("warning", "FULL_OPENCV", "folds"));
}

TEST_F(CheckRig, WarnsOfTimeOffsetsOfOtherUnits) {
  rig_.cameras[1].time_offset = 0.9;
  EXPECT_THAT(check(rig_), IsEmpty());
  rig_.cameras[2].time_offset = -1000;
  EXPECT_THAT(check(rig_),
              ElementsAre(mentions("warning", "cameras[1].time_offset", "0.9 s", "cameras[2].time_offset", "-1000 s")));
}

TEST_F(CheckRig, WarnsOfEqualNamesAndPlaces) {
  rig_.cameras[3].name = rig_.cameras[1].name;
  rig_.cameras[5].pose.position = rig_.cameras[1].pose.position + Vec3(0, 0, 1e-12);
  EXPECT_THAT(check(rig_), testing::IsSupersetOf({mentions("warning", "cameras[3].name", "cam_00_01", "cameras[1]"),
                                                  mentions("warning", "cameras[5].position", "cameras[1]")}));
}

TEST_F(CheckRig, WarnsOfSlivers) {
  for (Camera& camera : rig_.cameras) camera.pose.position.y *= 0.01;  // heights of 1 % of the sides
  EXPECT_THAT(check(rig_), ElementsAre(mentions("warning", "topology", "4 of 4", "thin")));
}

TEST_F(CheckRig, WarnsOfAMeshWithoutATriangle) {
  for (const std::vector<CameraIndex>& some : {std::vector<CameraIndex>{0}, {0, 1}})
    EXPECT_THAT(check(rig_subset(rig_, some)),
                ElementsAre(mentions("warning", "topology", std::to_string(some.size()), "no triangle")));
}

TEST_F(CheckRig, WarnsIfCamerasLookAlongTheMesh) {
  Rig ring = make_cylinder_rig({2, 12, 0.3, 1.5, true, 60});
  for (Camera& camera : ring.cameras) camera.source = "rtsp://host/x";
  EXPECT_THAT(check(ring), IsEmpty());
  ring.topology = {};
  EXPECT_THAT(check(ring), testing::Contains(mentions("not through", "triangles")));
}

TEST_F(CheckRig, WarnsOfAGridInTheWrongOrder) {
  std::swap(rig_.cameras[0].pose, rig_.cameras[4].pose);
  EXPECT_THAT(check(rig_), testing::Contains(mentions("2x3", "order")));
}

TEST(Summary, MeasuresTheArray) {
  Rig rig = make_grid_rig({2, 3, 0.1, 90, 64, 48});
  rig.cameras[0].image = "x.png";
  rig.cameras[1].source = "rtsp://host/x";
  rig.cameras[2].lens = Lens::pinhole(99, 0, 0);
  rig.cameras[3].width = 32;
  const RigSummary summary = summarize(rig);
  EXPECT_NEAR(glm::length(summary.extent - Vec3(0.2, 0.1, 0)), 0, 1e-15);
  EXPECT_NEAR(summary.baseline, std::sqrt(0.05), 1e-15);
  EXPECT_NEAR(summary.mean_neighbour, 0.1, 1e-15);
  EXPECT_EQ(summary.triangles, 4u);
  EXPECT_EQ(summary.other_faces, 0u);
  EXPECT_EQ(summary.images, 1u);
  EXPECT_EQ(summary.sources, 1u);
  EXPECT_THAT(summary.lenses, ElementsAre(mentions("SIMPLE_PINHOLE", "99 px", "1 camera", "64x48"),
                                          mentions("RADIAL", "24 px", "5 cameras", "32x48", "64x48")));
}

TEST(Summary, NamesTheArrangement) {
  Rig rig = make_grid_rig({2, 3, 0.1, 90, 64, 48});
  EXPECT_EQ(arrangement_text(rig), "grid of 2x3, 0.1 m between neighbouring cameras");
  rig.topology = {};
  EXPECT_EQ(arrangement_text(rig), "irregular arrangement, 0.1 m between neighbouring cameras");
  rig.topology = {Topology::Type::kTriangles, 0, 0, {}};
  EXPECT_EQ(arrangement_text(rig), "row, 0.1 m between neighbouring cameras");
  EXPECT_EQ(arrangement_text(make_grid_rig({1, 3, 0.25, 90, 64, 48})), "row, 0.25 m between neighbouring cameras");
  EXPECT_EQ(arrangement_text(make_grid_rig({1, 1, 0.1, 90, 64, 48})), "");
  rig = make_ring_rig({6, 0.1, 90, 64, 48});
  EXPECT_EQ(arrangement_text(rig), "ring, 0.1 m between neighbouring cameras");
  rig.cameras.pop_back();
  EXPECT_EQ(arrangement_text(rig), "irregular arrangement, 0.1 m between neighbouring cameras") << "a large gap";
  Rig square = make_grid_rig({2, 2, 0.1, 90, 64, 48});
  square.topology = {};
  EXPECT_EQ(arrangement_text(square), "irregular arrangement, 0.1 m between neighbouring cameras");
}

TEST(Summary, SummarisesOneCamera) {
  const RigSummary summary = summarize(make_grid_rig({1, 1, 0.1, 90, 64, 48}));
  EXPECT_EQ(summary.extent, Vec3(0, 0, 0));
  EXPECT_EQ(summary.baseline, 0);
  EXPECT_EQ(summary.mean_neighbour, 0);
  EXPECT_EQ(summary.triangles, 0u);
  EXPECT_EQ(summary.other_faces, 1u);
}

}  // namespace
}  // namespace lf
