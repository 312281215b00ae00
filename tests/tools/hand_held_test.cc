// SPDX-License-Identifier: LGPL-2.1-or-later
// Hand-held photographs, rendered with the default focal surface. The surface must never be worse than the plane.
// ../shared/data/kettle: renders the view of each camera without this camera and compares.
// ../shared/data/fern: views with a photograph, two of them outside the hull of the cameras.

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

const fs::path kKettle = fs::path(LF_SOURCE_ROOT) / "../shared/data/kettle";
const fs::path kFern = fs::path(LF_SOURCE_ROOT) / "../shared/data/fern";
constexpr double kMinCompared = 5;    // minimum coverage of an image, in percent
constexpr double kSlack = 0.1;        // dB

// Returns the PSNR in dB at the position of an excluded camera, or nullopt if the coverage is too low.
std::optional<double> held_out_psnr(const TempDir& dir, uint32_t id, const char* focus) {
  const std::string arguments = " --held-out-camera " + std::to_string(id) + " --focus " + focus;
  const Outcome outcome = run_program("lf-show", "difference --rig rig.json --out d.png" + arguments, dir.path());
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  double psnr = 0, ssim = 0, compared = 0;
  int most = 0;
  const size_t begin = outcome.output.find("left out:");  // after the progress of slow machines
  if (begin == std::string::npos ||
      std::sscanf(outcome.output.c_str() + begin, "left out: PSNR %lf dB, SSIM %lf, at most %d of 255, %lf %% compared",
                  &psnr, &ssim, &most, &compared) != 4 ||
      compared < kMinCompared)
    return std::nullopt;
  return psnr;
}

TEST(HandHeld, SurfaceIsNeverWorseThanThePlane) {
  if (!fs::exists(kKettle)) GTEST_SKIP() << "needs ../shared/data/kettle";
  const TempDir dir;
  ASSERT_EQ(
      run_program("lf-rig", "import colmap --undistorted '" + fs::canonical(kKettle).string() + "' --out rig.json",
                  dir.path())
          .status,
      0);
  double sum = 0, worst = 100, best = -100;
  size_t compared = 0, better = 0;
  for (const Camera& camera : load_rig(dir / "rig.json").cameras) {
    const auto plane = held_out_psnr(dir, camera.id, "plane"), surface = held_out_psnr(dir, camera.id, "surface");
    if (!plane || !surface) continue;
    const double gain = *surface - *plane;
    EXPECT_GE(gain, -kSlack) << camera.name;
    compared++, better += gain > kSlack, sum += gain, worst = std::min(worst, gain), best = std::max(best, gain);
    std::printf("%s: %.2f dB on the plane, %+.2f through the surface\n", camera.name.c_str(), *plane, gain);
  }
  std::printf("%zu compared, %zu better; %+.2f dB in the mean, %+.2f to %+.2f\n", compared, better,
              sum / static_cast<double>(compared), worst, best);
  EXPECT_GE(compared, 20u);
  EXPECT_GE(better, compared / 3);
}

// Returns the PSNR in dB of the covered views of the fern, by name.
std::map<std::string, double> render_fern(const TempDir& dir, const std::string& options) {
  const std::string data = "'" + fs::canonical(kFern).string();
  test::expect_outcome(run_program("lf-render",
                                   "--rig " + data + "/rig.json' --views " + data + "/views.json' --truth " + data +
                                       "/truth' --out out --json table.json " + options,
                                   dir.path()),
                       0);
  std::map<std::string, double> found;
  const nlohmann::json table = nlohmann::json::parse(read_text_file(dir / "table.json"));
  for (const nlohmann::json& view : table["views"])
    if (100 * view["coverage"].get<double>() >= kMinCompared) found[view["name"]] = view["psnr_db"];
  return found;
}

TEST(HandHeld, FindsTheSurfaceOfAFernWithDefaults) {
  if (!fs::exists(kFern)) GTEST_SKIP() << "needs ../shared/data/fern";
  const TempDir dir;
  const std::map<std::string, double> found = render_fern(dir, "");
  ASSERT_TRUE(found.contains("v08"));
  EXPECT_GE(found.at("v08"), 20.5) << "18.6 dB on the plane";
  // Outside the hull, only the nearest cameras contribute.
  const std::map<std::string, double> plane = render_fern(dir, "--nearest-cameras 4 --focus plane"),
                                      surface = render_fern(dir, "--nearest-cameras 4");
  for (const char* view : {"v00", "v08", "v16"}) {
    ASSERT_TRUE(plane.contains(view) && surface.contains(view)) << view;
    EXPECT_GT(surface.at(view), plane.at(view) + 1) << view;
  }
}

}  // namespace
}  // namespace lf
