// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/photographs.h"
#include "support/run_program.h"

namespace lf {
namespace {

class LfBench : public testing::Test {
 protected:
  void SetUp() override {
    Rig rig = scene_rig(5, 5, 160, 120);
    test::save_photographs(rig, folder_, 0.5, 1);
  }
  Outcome run(const std::string& arguments) const {
    return run_program("lf-bench", "--seconds 0.02 " + arguments, folder_.path());
  }
  static std::vector<double> figures(const std::string& page, const std::string& name) {
    std::istringstream lines(page);
    std::vector<double> out;
    for (std::string line; out.empty() && std::getline(lines, line);) {
      if (line.rfind(name + "  ", 0) != 0) continue;
      std::istringstream words(line.substr(name.size()));
      for (double figure; words >> figure;) out.push_back(figure);
    }
    return out;
  }
  TempDir folder_;
};

TEST_F(LfBench, NamesTheRenderer) {
  const Outcome gl = run("--rig rig.json --held-out 0 --renderer gl");
  ASSERT_EQ(gl.status, 0) << gl.output;
  EXPECT_THAT(gl.output, HasSubstr("\ndrawn by gl: "));
  EXPECT_LE(figures(gl.output, "16-bit sums, focal surface").at(3), 1);
  EXPECT_THAT(run("--rig rig.json --held-out 0 --renderer auto").output, HasSubstr("\ndrawn by auto: "));
  EXPECT_THAT(run("--rig rig.json --held-out 0").output, Not(HasSubstr("drawn by")));
}

TEST_F(LfBench, ReportsSpeedBytesErrorAndQuality) {
  const Outcome outcome = run("--rig rig.json --held-out 2 --size 200x150");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_THAT(outcome.output, mentions("25 cameras", "200x150"));
  for (const std::string focus : {"one focal plane", "focal surface"}) {
    const auto sums = figures(outcome.output, "16-bit sums, " + focus),
               jpeg = figures(outcome.output, "JPEG 90, " + focus);
    ASSERT_EQ(sums.size(), 5u) << outcome.output;  // ms, views per second, bytes, maximum error, PSNR
    ASSERT_EQ(jpeg.size(), 5u) << outcome.output;
    EXPECT_GT(sums[0], 0);
    EXPECT_NEAR(sums[0] * sums[1], 1000, 0.05 * 1000 + sums[0]) << "two digits";
    EXPECT_GE(sums[2], 2 * 1.5 * 200 * 150);
    EXPECT_LT(jpeg[2], sums[2] / 4);
    EXPECT_LE(sums[3], 1);
    EXPECT_GE(sums[4], 55);
    EXPECT_LT(jpeg[4], sums[4]);
    EXPECT_GT(jpeg[4], 35);
  }
  const auto mean = figures(outcome.output, "mean");
  ASSERT_EQ(mean.size(), 4u) << outcome.output;
  EXPECT_GT(mean[2], mean[0] + 2) << "the surface over the plane, dB";
  EXPECT_GT(mean[3], mean[1]);
  EXPECT_LE(std::count(outcome.output.begin(), outcome.output.end(), '\n'), 40);
}

TEST_F(LfBench, ErrorsNameTheOptionOrTheFile) {
  EXPECT_THAT(run("--rig rig.json --size 200").output, mentions("--size 200", "WIDTHxHEIGHT"));
  EXPECT_THAT(run("--rig nowhere.json").output, HasSubstr("nowhere.json"));
  save_rig(scene_rig(2, 2, 40, 30), folder_ / "bare.json");
  test::expect_outcome(run("--rig bare.json"), 1, mentions("rig", "image"));
}

}  // namespace
}  // namespace lf
