// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

void write(const TempDir& dir) {
  dir.write("points.dat", "1 2 nan\n3 4 nan\n1 1 nan\n 5 6.5 7\n 8 9 10\n1 1 1\n");
  dir.write("IdMat.dat", "1 1 0\n1 1 1\n");
  dir.write("Res.dat", "64 48\n32 24\n");
}

void expect_error(const TempDir& dir, const std::string& part) {
  try {
    load_multicamselfcal(dir.path(), 0);
    FAIL() << "no error: " << part;
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr(part));
  }
}

TEST(MultiCamSelfCal, TracksAndLenses) {
  const TempDir dir;
  write(dir);
  for (const int i : {1, 2})
    dir.write("cam" + std::to_string(i) + ".rad",
              "K11 = 50\nK12 = 0\nK13 = 31\nK22 = 51\nK23 = 23\nkc1 = -0.1\nkc2 = 0.02\nkc3 = 0\nkc4 = 0\n");
  const MultiCamSelfCal input = load_multicamselfcal(dir.path(), 1);
  EXPECT_EQ(input.tracks.num_positions, 3u);
  ASSERT_EQ(input.tracks.observations.size(), 5u);
  EXPECT_EQ(input.tracks.observations[3].pixel, Vec2(5.5, 8));  // Matlab counts from 1
  EXPECT_EQ(input.tracks.cameras[1].width, 32);
  ASSERT_TRUE(input.lenses);
  EXPECT_EQ(input.lenses->cameras[0].lens.fy(), 51);
  EXPECT_EQ(input.lenses->cameras[0].lens.cx(), 30);
  EXPECT_EQ(input.lenses->cameras[0].lens.k1(), -0.1);
}

TEST(MultiCamSelfCal, ErrorsNameThePlace) {
  const TempDir dir;
  expect_error(dir, "points.dat: can't be read");
  write(dir);
  dir.write("IdMat.dat", "1 1 1\n1 1 1\n");
  expect_error(dir, "points.dat: camera 0, position 2: not a number");
  dir.write("IdMat.dat", "1 1\n1 1\n");
  expect_error(dir, "IdMat.dat: must have 2 rows of 3 columns");
  dir.write("IdMat.dat", "1 x 1\n");
  expect_error(dir, "IdMat.dat: line 1: not a number: \" x 1\"");
  write(dir);
  dir.write("cam.rad", "K11 = 1\n");
  expect_error(dir, "1 files *.rad for 2 cameras");
}

}  // namespace

}  // namespace lf
