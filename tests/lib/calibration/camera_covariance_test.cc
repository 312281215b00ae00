// SPDX-License-Identifier: LGPL-2.1-or-later
#include "calibration/camera_covariance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace lf {
namespace {

std::optional<CameraCovariance> parse(const std::string& text) {
  const std::string name = "rig.json";
  const nlohmann::json root = parse_json(text, name);
  return parse_camera_covariance(JsonValue(root, name));
}

TEST(CameraCovariance, WhatIsWrittenIsReadAgain) {
  const CameraCovariance covariance{{"f", "cx"}, {4, 1, 1, 2}};
  const nlohmann::json camera = {{"covariance", nlohmann::json::parse(to_json(covariance).dump())}};
  const auto again = parse(camera.dump());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->parameters, covariance.parameters);
  EXPECT_EQ(again->matrix, covariance.matrix);
  EXPECT_EQ(again->index_of("cx"), 1u);
  EXPECT_EQ(again->index_of("k1"), std::nullopt);
}

TEST(CameraCovariance, NoneIsNone) {
  EXPECT_FALSE(parse("{}"));
  EXPECT_FALSE(parse(R"({"covariance": {}})"));
}

TEST(CameraCovariance, ErrorsNameThePlace) {
  const auto expect_error = [](const std::string& parameters, const std::string& matrix, const std::string& part) {
    try {
      parse(R"({"covariance": {"parameters": )" + parameters + R"(, "matrix": )" + matrix + "}}");
      FAIL() << "no error: " << part;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), testing::HasSubstr(part));
    }
  };
  expect_error(R"(["f", "zoom"])", "[[1, 0], [0, 1]]", "covariance.parameters[1]: \"zoom\" is not");
  expect_error(R"(["f", "f"])", "[[1, 0], [0, 1]]", "comes twice");
  expect_error(R"(["f", "cx"])", "[[1, 0], [0]]", "covariance.matrix[1]: must have 2");
  expect_error(R"(["f", "cx"])", "[[1, 0], [0, -1]]", "variance is negative");
  expect_error(R"(["f", "cx"])", "[[1, 0.5], [0, 1]]", "not symmetric");
  expect_error(R"(["f", "cx"])", "[[1, 2], [2, 1]]", "correlation above 1");
}

}  // namespace
}  // namespace lf
