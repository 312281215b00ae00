// SPDX-License-Identifier: LGPL-2.1-or-later
// Real photographs of a kettle, taken by hand from anywhere (../shared/data/kettle): each camera is left out in turn and
// compared with what the others make of its place. A focal surface may be worse nowhere than the plane.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "rig/rig_json.h"
#include "support/run_program.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;

const fs::path kKettle = fs::path(LF_SOURCE_ROOT) / "../shared/data/kettle";
constexpr double kLeastCompared = 5;  // percent of a picture that must be covered for its figure to count
constexpr double kSlack = 0.1;        // dB

// PSNR in dB at the place of a camera that is left out; nothing where the others cover too little of its picture.
std::optional<double> left_out(const TempDir& dir, uint32_t id, const char* focus) {
  const std::string arguments = " --left-out " + std::to_string(id) + " --focus " + focus;
  const Outcome outcome = run_program("lf-show", "difference --rig rig.json --out d.png" + arguments, dir.path());
  EXPECT_EQ(outcome.status, 0) << outcome.output;
  double psnr = 0, ssim = 0, compared = 0;
  int most = 0;
  if (std::sscanf(outcome.output.c_str(), "left out: PSNR %lf dB, SSIM %lf, at most %d of 255, %lf %% compared", &psnr,
                  &ssim, &most, &compared) != 4 ||
      compared < kLeastCompared)
    return std::nullopt;
  return psnr;
}

TEST(HandHeld, ASurfaceIsNowhereWorseThanThePlane) {
  if (!fs::exists(kKettle)) GTEST_SKIP() << "needs ../shared/data/kettle";
  const TempDir dir;
  ASSERT_EQ(run_program("lf-rig",
                        "import colmap --undistorted '" + fs::canonical(kKettle).string() + "' --out rig.json", dir.path())
                .status,
            0);
  double sum = 0, worst = 100, best = -100;
  size_t compared = 0, better = 0;
  for (const Camera& camera : load_rig(dir / "rig.json").cameras) {
    const auto plane = left_out(dir, camera.id, "plane"), surface = left_out(dir, camera.id, "surface");
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

}  // namespace
}  // namespace lf
