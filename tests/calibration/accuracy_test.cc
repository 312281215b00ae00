// SPDX-License-Identifier: LGPL-2.1-or-later
// How near to the best possible: 8x8 cameras, 100 places, 0.2 pixels of noise, over seeds (LF_SEEDS, 20 without).
#include <cstdio>
#include <cstdlib>

#include <gtest/gtest.h>

#include "calibration/accuracy.h"

namespace lf::sim {
namespace {

const char* const kSeeds = std::getenv("LF_SEEDS");

int seeds() { return kSeeds ? std::atoi(kSeeds) : 20; }

Errors run(const char* name, const Study& study) {
  Errors errors;
  for (int seed = 1; seed <= seeds(); seed++) {
    const int before = errors.converged;
    add_run(study, static_cast<uint64_t>(seed), errors);
    if (errors.converged == before) std::printf("%s: seed %d did not converge\n", name, seed);
  }
  std::printf("%-22s error/bound: position %.3f rotation %.3f focal %.3f; inside 95 %%: %.3f %.3f %.3f\n", name,
              errors.ratio(Errors::kPosition), errors.ratio(Errors::kRotation), errors.ratio(Errors::kFocal),
              errors.share_inside(Errors::kPosition), errors.share_inside(Errors::kRotation),
              errors.share_inside(Errors::kFocal));
  std::printf(
      "%-22s rms: %.3f mm, %.3f mrad, f %.3f px; transfer %.4f px at 1.5 m; slowest %.2f s; %d of %d converged\n", "",
      errors.rms(Errors::kPosition) * 1e3, errors.rms(Errors::kRotation) * 1e3, errors.rms(Errors::kFocal),
      errors.transfer(), errors.seconds, errors.converged, errors.runs);
  return errors;
}

void expect_good(const Errors& errors, double transfer) {
  EXPECT_EQ(errors.converged, errors.runs);
  // Cameras of one array err together: few seeds scatter more than their number of cameras says.
  const bool many = errors.runs >= 500;
  for (const auto q : {Errors::kPosition, Errors::kRotation, Errors::kFocal}) {
    EXPECT_LE(errors.ratio(q), 1.1) << q;
    EXPECT_GE(errors.share_inside(q), many ? 0.93 : 0.9) << q;
    EXPECT_LE(errors.share_inside(q), many ? 0.97 : 0.99) << q;
  }
  EXPECT_LE(errors.transfer(), transfer);
}

TEST(Accuracy, OneLightAndLensesMeasuredBefore) { expect_good(run("one light, lenses known", {}), 0.05); }

TEST(Accuracy, ABarAndNoLensKnown) {
  Study study;
  study.path.bar = 0.3, study.prior = false;
  if (!kSeeds) study.distortion = DistortionModel{2, true};  // as is chosen by evidence, in half the time
  expect_good(run("a bar, no lens known", study), 0.05);
}

TEST(Accuracy, AThirdMissedAndManyMistaken) {
  Study study;
  study.path.missed = 0.3, study.path.outliers = 0.15;
  expect_good(run("30 % missed, 15 % wrong", study), 0.08);  // of 60 % of the observations
}

}  // namespace
}  // namespace lf::sim
