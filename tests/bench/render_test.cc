// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs bench-render on pictures that are too small for meaningful timings.

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

class BenchRender : public testing::Test {
 protected:
  static constexpr const char* kTiny = "--sizes 64x48 --cameras 4 --repeats 1 ";

  Outcome run(const std::string& arguments) const {
    return run_program("../tests/bench/bench-render", arguments, folder_.path());
  }
  nlohmann::json rows(const std::string& arguments) const {
    test::expect_outcome(run(kTiny + arguments + " --json rows.json"), 0);
    return nlohmann::json::parse(read_text_file(folder_ / "rows.json"))["rows"];
  }

  TempDir folder_;
};

TEST_F(BenchRender, RowsHaveAllFieldsAndSensibleErrors) {
  const nlohmann::json all = rows("");
  std::set<std::string> renderers;
  for (const nlohmann::json& row : all) {
    for (const char* field :
         {"renderer", "codec", "quality", "width", "height", "cameras", "threads", "ns_per_output_pixel", "fps",
          "bytes_per_view", "max_error", "psnr_reference_db", "psnr_truth_db", "ssim_truth", "ratio_to_opencv",
          "distortion", "family", "scene", "pareto"})
      EXPECT_TRUE(row.contains(field)) << field;
    const std::string renderer = row["renderer"];
    renderers.insert(renderer);
    EXPECT_EQ(row["width"], 64);
    EXPECT_EQ(row["height"], 48);
    EXPECT_EQ(row["cameras"], 4);
    EXPECT_EQ(row["threads"], 1);
    EXPECT_GT(row["ns_per_output_pixel"], 0);
    EXPECT_NEAR(row["fps"].get<double>() * row["ns_per_output_pixel"].get<double>() * 64 * 48, 1e9, 1e3);
    EXPECT_GT(row["bytes_per_view"], 0);
    EXPECT_GT(row["ratio_to_opencv"], 0);
    EXPECT_EQ(row["codec"] == "raw", row["quality"].is_null());
    if (renderer == "simd" && row["codec"] == "raw") {
      EXPECT_TRUE(row["default"]);
      EXPECT_LE(row["max_error"], 2);
      EXPECT_GE(row["psnr_reference_db"], 50);
    }
    if (renderer == "opencv") {  // ignores distortion, so its picture differs
      EXPECT_EQ(row["distortion"], row["max_error"].is_null());
    }
    if (renderer == "opencv" && row["distortion"] == false && row["codec"] == "raw") {
      EXPECT_LE(row["max_error"], 10);
    }
    if (row["scene"] == "checkerboard" || row["max_error"].is_null()) {
      EXPECT_TRUE(row["psnr_truth_db"].is_null());
    } else {
      EXPECT_GT(row["psnr_truth_db"], 15);
      EXPECT_GT(row["ssim_truth"], 0.2);
    }
  }
  EXPECT_THAT(renderers, testing::IsSupersetOf({"opencv", "simd"}));
}

TEST_F(BenchRender, ThreadCountsAreSeparateRowsWithTheSamePicture) {
  int rows_of_two = 0;
  const nlohmann::json all = rows("--threads 1,2");
  for (const nlohmann::json& row : all) {
    if (row["threads"] == 1) continue;
    EXPECT_EQ(row["renderer"], "simd");
    EXPECT_GT(row["ns_per_output_pixel"], 0);
    for (const nlohmann::json& other : all)
      if (other["threads"] == 1 && other["renderer"] == "simd" && other["codec"] == row["codec"] &&
          other["scene"] == row["scene"] && other["distortion"] == row["distortion"]) {
        EXPECT_EQ(row["max_error"], other["max_error"]);
        rows_of_two++;
      }
  }
  EXPECT_GE(rows_of_two, 2);
}

TEST_F(BenchRender, QualitiesAreSeparateRowsAndCostBytes) {
  double bytes_of_30 = 0, bytes_of_90 = 0;
  for (const nlohmann::json& row : rows("--qualities 30,90"))
    if (row["renderer"] == "opencv" && row["codec"] == "jpeg" && row["scene"] == "natural")
      (row["quality"] == 30 ? bytes_of_30 : bytes_of_90) = row["bytes_per_view"];
  EXPECT_GT(bytes_of_30, 0);
  EXPECT_GT(bytes_of_90, 1.3 * bytes_of_30);
}

TEST_F(BenchRender, PrintsParetoPointsAndGoals) {
  test::expect_outcome(run(std::string(kTiny) + "--acceptance"), 0,
                       testing::AllOf(mentions("natural", "4 cameras", "64x48", "distorted"), HasSubstr("default"),
                                      mentions("64 cameras", "raw", "OpenCV")));
}

TEST_F(BenchRender, NumericsAreWithinTheirBounds) {
  const Outcome outcome = run("numerics");
  EXPECT_EQ(outcome.status, 0);
  for (const char* text :
       {"float", "simd I420 grid sum", "simd RGB exact", "eye at a camera", "a million metres away", "slivers"})
    EXPECT_THAT(outcome.output, HasSubstr(text));
  EXPECT_THAT(outcome.output, testing::Not(HasSubstr("BEYOND")));
}

// The document must explain every term in the table's words.
TEST_F(BenchRender, ErrorBudgetMatchesItsDocument) {
  const Outcome outcome = run("budget");
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  std::istringstream lines(read_text_file(LF_SOURCE_ROOT "/docs/reference/error-budget.md"));
  int terms = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("| ", 0) != 0 || line.rfind("| term", 0) == 0 || line.rfind("| ---", 0) == 0) continue;
    EXPECT_THAT(outcome.output, HasSubstr(line.substr(2, line.find(" |", 2) - 2)));
    terms++;
  }
  EXPECT_EQ(terms + 3, std::count(outcome.output.begin(), outcome.output.end(), '\n')) << outcome.output;
}

TEST_F(BenchRender, ComparesTheRandomAccessCameras) {
  const Outcome outcome = run("--sizes 64x48 --cameras 4 --repeats 1 access");
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  for (const char* kind : {"self ", "warp ", "pixels "})
    EXPECT_THAT(outcome.output, HasSubstr(std::string("\n") + kind));
}

TEST_F(BenchRender, RendersOnceForAProfiler) {
  EXPECT_EQ(run("once 'simd i420'").status, 0);
  EXPECT_THAT(run("once nothing").output, HasSubstr("simd i420"));
}

TEST_F(BenchRender, WritesPlotsOrNamesTheMissingPackage) {
  const Outcome outcome = run("--sizes 64x48,96x64 --cameras 4 --repeats 1 --plots plots");
  if (std::system("gnuplot --version >/dev/null 2>&1") != 0) {
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.output, HasSubstr("apt-get install gnuplot-nox"));
    return;
  }
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  for (const char* name : {"plots/time-error.png", "plots/bytes-error.png", "plots/scaling.png"})
    EXPECT_GT(std::filesystem::file_size(folder_ / name), 10000u) << name;
}

TEST_F(BenchRender, ErrorsNameTheOption) {
  for (const char* bad : {"--sizes 64", "--sizes 64x48x3", "--sizes 1x1", "--cameras 3", "--qualities 0"}) {
    test::expect_outcome(run(bad), 1, HasSubstr(std::string(bad).substr(0, std::string(bad).find(' '))));
  }
  EXPECT_THAT(run(std::string(kTiny) + "--json /nowhere/x.json").output, HasSubstr("/nowhere/x.json"));
}

}  // namespace
}  // namespace lf
