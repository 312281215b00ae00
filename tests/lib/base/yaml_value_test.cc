// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/yaml_value.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"

namespace lf {
namespace {

using nlohmann::json;

TEST(YamlValue, SaysWhatTheJsonSays) {
  const json value = parse_yaml(
      "%YAML:1.0\n---\na: 1\nb: [1., -.5, +2.5e-03, 1e3]\nc:\n- x: 'no'\n- [a b, \"7\", true, ~, .nan, inf]\n"
      "d: !!opencv-matrix\n   rows: 3\n",
      "x.yaml");
  EXPECT_EQ(value, json::parse(R"({"a": 1, "b": [1.0, -0.5, 0.0025, 1000.0],
    "c": [{"x": "no"}, ["a b", "7", true, null, ".nan", "inf"]], "d": {"rows": 3}})"));
  EXPECT_TRUE(value["a"].is_number_integer());
  EXPECT_TRUE(parse_yaml("", "x.yaml").is_null());
}

TEST(YamlValue, ErrorsNameFileAndLine) {
  EXPECT_ERROR(parse_yaml("a: 1\nb: [1, 2\n", "x.yaml"), "x.yaml: line 3: not valid YAML: ");
  EXPECT_ERROR(parse_yaml("a: 1\nb: caf\xe9\n", "x.yaml"), "x.yaml: line 2: not valid YAML: no text in UTF-8");
  EXPECT_ERROR(parse_yaml("a: 1\na: 2\n", "x.yaml"), "x.yaml: line 2: not valid YAML: \"a\" is there twice");
  EXPECT_ERROR(parse_yaml("a: &x 1\nb: *x\n", "x.yaml"), "line 2: not valid YAML: aliases are not read");
  EXPECT_ERROR(parse_yaml("[a, b]: 1\n", "x.yaml"), "a key must be a word");
  EXPECT_ERROR(parse_yaml(std::string(100, '[') + std::string(100, ']'), "x.yaml"), "nested too deeply");
}

TEST(YamlValue, NumbersAreNumbersToEveryReader) {
  EXPECT_EQ(yaml_number(400), "400.0");
  EXPECT_EQ(yaml_number(1e-9), "1.0e-09");
  EXPECT_EQ(yaml_number(-0.1), "-0.1");
  EXPECT_EQ(yaml_number(1.5e300), "1.5e+300");
}

}  // namespace
}  // namespace lf
