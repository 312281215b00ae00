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

// Reads a whole file. Throws Error with the file's name.
std::string read_text_file(const std::string& path);
// Replaces a file atomically. Throws Error with the file's name.
void write_text_file(const std::string& text, const std::string& path);

bool is_utf8(const std::string& text);

// Parses JSON. `name` is the name of the file in error messages. Throws Error with line and column. If a value is
// invalid, such as a number beyond the range of double, the error names the place ("cameras[3].params[0]").
nlohmann::json parse_json(const std::string& text, const std::string& name);

// A value in a JSON file, together with its path in the file, so that error messages have the form "FILE: PLACE:
// problem". It refers to the parsed file, which must outlive this object. All functions throw Error if the value has
// another type or is out of range.
class JsonValue {
 public:
  JsonValue(const nlohmann::json& root, const std::string& file) : value_(&root), file_(&file) {}
  JsonValue(const nlohmann::json&, const std::string&&) = delete;
  JsonValue(const nlohmann::json&&, const std::string&) = delete;

  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_inside(const std::string& place_and_what) const;
  const std::string& file() const { return *file_; }

  // Return a member of an object. at() throws Error if the member is missing; find() returns nullopt.
  JsonValue at(const char* key) const;
  std::optional<JsonValue> find(const char* key) const;
  // Return the elements of an array. Throws Error unless the array has exactly `count` elements, if given.
  std::vector<JsonValue> elements() const;
  std::vector<JsonValue> elements(size_t count) const;

  bool flag() const;
  double number() const;  // finite
  int64_t integer(int64_t least, int64_t most) const;
  std::string text() const;  // without NUL characters, which would truncate paths and properties in C functions
  std::string name() const;  // for file names and messages: at most 200 bytes, no control characters
  Vec3 vec3() const;
  Quat unit_quaternion() const;  // [w, x, y, z] with unit norm, within kUnitTolerance; not normalised

  // Checks the kind of a file. Throws Error unless the value is an object with this "format" and "version".
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
