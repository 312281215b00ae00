// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/json_value.h"

#include <nlohmann/json.hpp>

#include "support/expect_error.h"
#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(ParseJson, SyntaxErrorsNameLineAndPlace) {
  const InvalidText cases[] = {
      {"", {"f.json", "JSON", "line 1", "column 1"}},
      {"hello", {"f.json", "JSON", "line 1"}},
      {"{\"a\": [1, {\"b\": tru}]}", {"f.json", "a[1].b", "JSON", "line 1", "column 20"}},
      {"{\"a\": [1,\n 2", {"f.json", "a[2]", "JSON", "line 2"}},
      {"{\"a\": {\"b\": [0, 0, 1e999]}}", {"f.json", "a.b[2]", "overflow", "1e999"}},
      {"{\"a\": [0, NaN]}", {"f.json", "a[1]", "JSON"}},
      {"{\"a\": 1} x", {"f.json", "JSON"}},
      {"{\"a\": {\"b\": 1}, \"c\": \"\xff\"}", {"f.json: c:", "JSON"}},
      {"{\"a\": [{\"k1\": 0.1, \"k2\": 0, \"k1\": 0.9}]}", {"f.json", "a[0].k1", "twice"}},
  };
  for (const auto& c : cases) EXPECT_ERROR(parse_json(c.text, "f.json"), c.facts);
  EXPECT_ERROR(parse_json(std::string(100000, '['), "f.json"), "nested too deeply");
  EXPECT_LT(text_of_error([] { parse_json("[" + std::string(1000000, '9') + "]", "f.json"); }).size(), 400u);
}

// A parser that looked back at all elements took seconds for ten thousand elements; this many took many minutes.
TEST(ParseJson, ParsesLongArraysInLinearTime) {
  std::string text = "{\"a\": [";
  constexpr size_t kElements = 200000;
  for (size_t i = 0; i < kElements; i++) text += i > 0 ? ",{\"b\": [1]}" : "{\"b\": [1]}";
  const nlohmann::json root = parse_json(text + "], \"a2\": {\"\": 3}, \"c\": 2}", "f.json");
  EXPECT_EQ(root["a"].size(), kElements);
  EXPECT_EQ(root["a"].back(), nlohmann::json({{"b", {1}}}));
  EXPECT_EQ(root["a2"][""], 3);
  EXPECT_EQ(root["c"], 2);
}

TEST(JsonValue, ErrorsNameTheProblemAndThePlace) {
  const std::string name = "f.json";
  const nlohmann::json root = parse_json(R"({"o": {"n": 1.5, "s": "x", "i": 7, "big": 18446744073709551615, "z": null,
      "v": [1, 2, 3], "w": [1, 2], "whole": 1080.0, "huge": 1e300, "q": [1, 0, 0, 0.01], "l": [0, "x", 0]}})",
                                         name);
  const JsonValue o = JsonValue(root, name).at("o");
  EXPECT_EQ(o.at("n").number(), 1.5);
  EXPECT_EQ(o.at("i").number(), 7);
  EXPECT_EQ(o.at("i").integer(0, 7), 7);
  EXPECT_EQ(o.at("s").text(), "x");
  EXPECT_EQ(o.at("s").name(), "x");
  const nlohmann::json longest = std::string(200, 'x'), longer = std::string(201, 'x');
  EXPECT_EQ(JsonValue(longest, name).name().size(), 200u);
  EXPECT_ERROR(JsonValue(longer, name).name(), "f.json", "200 bytes", "201");
  EXPECT_EQ(o.at("v").vec3(), Vec3(1, 2, 3));
  EXPECT_FALSE(o.find("none"));

  EXPECT_ERROR(o.at("none"), "f.json: o:", "none", "missing");
  EXPECT_ERROR(o.at("n").find("x"), "f.json", "o.n", "object", "number");
  EXPECT_ERROR(o.at("s").number(), "f.json", "o.s", "finite", "number", "string");
  EXPECT_ERROR(o.at("z").number(), "f.json", "o.z", "finite", "number", "null");
  EXPECT_ERROR(o.at("n").integer(0, 7), "f.json", "o.n", "integer", "1.5");
  EXPECT_EQ(o.at("whole").integer(0, 2000), 1080) << "whole numbers may be written as floats";
  EXPECT_ERROR(o.at("whole").integer(0, 7), "f.json", "o.whole", "0 to 7", "1080.0");
  EXPECT_ERROR(o.at("huge").integer(INT64_MIN, INT64_MAX), "f.json", "o.huge");
  EXPECT_ERROR(o.at("i").integer(0, 6), "f.json", "o.i", "0 to 6", "7");
  EXPECT_ERROR(o.at("big").integer(0, 6), "f.json", "o.big", "0 to 6", "18446744073709551615");
  EXPECT_ERROR(o.at("n").text(), "f.json", "o.n", "string", "number");
  EXPECT_ERROR(o.at("s").elements(), "f.json", "o.s", "array", "string");
  EXPECT_ERROR(o.at("w").vec3(), "f.json", "o.w", "3 elements", "2");
  EXPECT_ERROR(o.at("l").vec3(), "f.json", "o.l[1]", "finite", "number", "string");
  EXPECT_ERROR(o.at("q").unit_quaternion(), "f.json", "o.q", "quaternion");
}

TEST(TextFile, RoundTripsAndReplacesFiles) {
  const TempDir dir;
  const std::string path = dir / "file.txt";
  write_text_file("first, and longer", path);
  const std::string text("a\0b\r\n\xff", 6);
  write_text_file(text, path);
  EXPECT_EQ(read_text_file(path), text);
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
  write_text_file("", path);
  EXPECT_EQ(read_text_file(path), "");
}

TEST(TextFile, ErrorsNameTheFile) {
  const TempDir dir;
  EXPECT_ERROR(read_text_file(dir / "no_such_file"), "no_such_file", "No such file");
  EXPECT_ERROR(read_text_file(dir.path()), "read", "folder");
  EXPECT_ERROR(read_text_file(dir.write("wide.yml", "\xff\xfe{")), "wide.yml", "UTF-16");
}

}  // namespace
}  // namespace lf
