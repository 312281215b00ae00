// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/maths.h"

namespace lf {

// Reads the whole of a file. Throws Error naming it.
std::string read_text_file(const std::string& path);
// Replaces the file as a whole: a reader sees the old text or the new one. Throws Error naming it.
void write_text_file(const std::string& text, const std::string& path);

// Whether the text is valid UTF-8: JSON can hold no other.
bool is_utf8(const std::string& text);

// Parses JSON; `name` stands for the file in messages. Throws Error with line and column, and with the place
// ("cameras[3].params[0]") where the error is inside a value, such as a number that no double can hold.
nlohmann::json parse_json(const std::string& text, const std::string& name);

// A value inside a JSON file that knows its place there, so that every wrong one is reported as "FILE: PLACE: what".
// Refers to the parsed file: valid as long as that is. All functions throw Error where the value is not as asked for.
class JsonValue {
 public:
  JsonValue(const nlohmann::json& root, const std::string& file) : value_(&root), file_(&file) {}
  JsonValue(const nlohmann::json&, const std::string&&) = delete;
  JsonValue(const nlohmann::json&&, const std::string&) = delete;

  [[noreturn]] void fail(const std::string& what) const;
  // Throws Error for a place inside this value: fail_inside("params[0]: must be positive").
  [[noreturn]] void fail_inside(const std::string& place_and_what) const;
  const std::string& file() const { return *file_; }

  // The value must be an object: at() gives a member that must be there, find() one that may be.
  JsonValue at(const char* key) const;
  std::optional<JsonValue> find(const char* key) const;
  // The value must be an array, of exactly `count` elements where that is given.
  std::vector<JsonValue> elements() const;
  std::vector<JsonValue> elements(size_t count) const;

  bool flag() const;
  double number() const;  // finite
  int64_t integer(int64_t least, int64_t most) const;
  std::string text() const;  // no NUL: C functions would cut paths and properties there
  std::string name() const;  // at most 200 bytes and no control characters, for file names and messages
  Vec3 vec3() const;
  Quat unit_quaternion() const;  // [w, x, y, z], unit norm within kUnitTolerance; kept as it is

  // The value must be an object whose "format" and "version" are these.
  void require_format(const std::string& format, int version) const;

 private:
  JsonValue(const nlohmann::json& value, const std::string* file, std::string place)
      : value_(&value), file_(file), place_(std::move(place)) {}
  void require_object() const;

  const nlohmann::json* value_;
  const std::string* file_;
  std::string place_;
};

}  // namespace lf
