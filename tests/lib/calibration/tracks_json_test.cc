// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace lf {
namespace {

using testing::HasSubstr;

std::string file_with(const std::string& bar, const std::string& positions) {
  return R"({"format": "lightfield-tracks", "version": 1, "bar": )" + bar + R"(,
    "cameras": [{"id": 7, "width": 320, "height": 240}, {"id": 9, "width": 320, "height": 240}],
    "positions": [)" +
         positions + "]}";
}

TEST(TracksJson, WhatIsWrittenIsReadAgain) {
  const Tracks tracks = parse_tracks(
      file_with("true", R"({"observations": [[9, 1.25, -0.5, 1], [7, 3, 4, 0]]}, {"observations": []})"), "t.json");
  EXPECT_EQ(tracks.num_positions, 2u);
  ASSERT_EQ(tracks.observations.size(), 2u);
  EXPECT_EQ(tracks.observations[0].camera, 1u);
  EXPECT_EQ(tracks.observations[0].light, 1u);
  EXPECT_EQ(tracks.observations[0].pixel, Vec2(1.25, -0.5));
  const std::string text = tracks_to_json(tracks);
  EXPECT_EQ(tracks_to_json(parse_tracks(text, "again")), text);
}

TEST(TracksJson, ErrorsNameThePlace) {
  const auto expect_error = [](const std::string& text, const std::string& part) {
    try {
      parse_tracks(text, "t.json");
      FAIL() << "no error: " << part;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), HasSubstr(part));
    }
  };
  expect_error(file_with("false", R"({"observations": [[8, 1, 2]]})"), "t.json: positions[0].observations[0][0]: 8 is");
  expect_error(file_with("false", R"({"observations": [[7, 1]]})"), "positions[0].observations[0]: must have 3");
  expect_error(file_with("true", R"({"observations": [[7, 1, 2, 2]]})"), "positions[0].observations[0][3]: must be 0");
  expect_error(file_with("1", ""), "bar: must be true or false");
  expect_error(file_with("false", R"({"observations": [[7, 1, 2], [7, 1, 2]]})"), "camera 7 sees the same light twice");
  expect_error(file_with("false", R"({"observations": [[7, 900, 2]]})"), "far outside of camera 7's image");
}

}  // namespace
}  // namespace lf
