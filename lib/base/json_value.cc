// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/json_value.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/file.h"

namespace lf {
namespace {

using nlohmann::json;

constexpr int kMaxJsonDepth = 64;  // nothing in our formats is deeper; printing what is read recurses

std::string join(const std::string& place, const std::string& key) { return place.empty() ? key : place + "." + key; }
std::string join(const std::string& place, size_t index) { return place + "[" + std::to_string(index) + "]"; }

// Follows the parser, to say where it was when it stopped.
class PlaceTracker {
 public:
  void follow(json::parse_event_t event, const json& parsed) {
    using Event = json::parse_event_t;
    switch (event) {
      case Event::object_start:
      case Event::array_start: levels_.push_back({event == Event::array_start}); break;
      case Event::object_end:
      case Event::array_end:
        levels_.pop_back();
        value_done();
        break;
      case Event::key: levels_.back().key = parsed.get<std::string>(); break;
      case Event::value: value_done(); break;
    }
  }
  std::string place() const {
    std::string place;
    for (const Level& level : levels_) {
      if (level.is_array)
        place = join(place, level.count);
      else if (!level.key.empty())
        place = join(place, level.key);
    }
    return place;
  }

 private:
  struct Level {
    bool is_array;
    size_t count = 0;
    std::string key;
  };
  void value_done() {
    if (levels_.empty()) return;
    levels_.back().count++;
    levels_.back().key.clear();
  }
  std::vector<Level> levels_;
};

// nlohmann's messages begin with "[json.exception.parse_error.101] ".
// They repeat the token that they stopped at, which may have megabytes.
std::string without_tag(const std::string& what) {
  constexpr size_t kMost = 300;
  const size_t end = what.find("] ");
  const std::string text = what.rfind("[json.", 0) == 0 && end != std::string::npos ? what.substr(end + 2) : what;
  return text.size() > kMost ? text.substr(0, kMost) + "..." : text;
}

}  // namespace

std::string read_text_file(const std::string& path) { return read_file(path); }

void write_text_file(const std::string& text, const std::string& path) {
  FileReplacement file(path);
  file.write(text);
  file.commit();
}

bool is_utf8(const std::string& text) {
  try {
    json(text).dump();
    return true;
  } catch (const json::type_error&) {
    return false;
  }
}

json parse_json(const std::string& text, const std::string& name) {
  PlaceTracker tracker;
  const auto at_place = [&] { return tracker.place().empty() ? "" : tracker.place() + ": "; };
  try {
    return json::parse(text, [&](int depth, json::parse_event_t event, json& parsed) {
      if (depth > kMaxJsonDepth) throw Error(name + ": " + at_place() + "nested too deeply");
      tracker.follow(event, parsed);
      return true;
    });
  } catch (const json::exception& e) {
    throw Error(name + ": " + at_place() + "not valid JSON: " + without_tag(e.what()));
  }
}

void JsonValue::fail(const std::string& what) const {
  throw Error(*file_ + ": " + (place_.empty() ? "" : place_ + ": ") + what);
}

void JsonValue::fail_inside(const std::string& place_and_what) const {
  throw Error(*file_ + ": " + join(place_, place_and_what));
}

void JsonValue::require_object() const {
  if (!value_->is_object()) fail(std::string("must be an object, is ") + value_->type_name());
}

JsonValue JsonValue::at(const char* key) const {
  std::optional<JsonValue> member = find(key);
  if (!member) fail(std::string("key \"") + key + "\" is missing");
  return *member;
}

std::optional<JsonValue> JsonValue::find(const char* key) const {
  require_object();
  const auto it = value_->find(key);
  if (it == value_->end()) return std::nullopt;
  return JsonValue(*it, file_, join(place_, key));
}

std::vector<JsonValue> JsonValue::elements() const {
  if (!value_->is_array()) fail(std::string("must be an array, is ") + value_->type_name());
  std::vector<JsonValue> elements;
  elements.reserve(value_->size());
  for (const json& element : *value_) elements.push_back(JsonValue(element, file_, join(place_, elements.size())));
  return elements;
}

std::vector<JsonValue> JsonValue::elements(size_t count) const {
  std::vector<JsonValue> all = elements();
  if (all.size() != count) fail("must have " + std::to_string(count) + " elements, has " + std::to_string(all.size()));
  return all;
}

bool JsonValue::flag() const {
  if (!value_->is_boolean()) fail(std::string("must be true or false, is ") + value_->type_name());
  return value_->get<bool>();
}

double JsonValue::number() const {
  if (!value_->is_number()) fail(std::string("must be a finite number, is ") + value_->type_name());
  const double number = value_->get<double>();
  if (!is_finite(number)) fail("must be a finite number");
  return number;
}

int64_t JsonValue::integer(int64_t least, int64_t most) const {
  // Many programs write whole numbers as floats (1080.0).
  constexpr double kExact = 9007199254740992;  // 2^53: beyond it a double may stand for several integers
  const auto out_of_range = [&] {
    fail("must be " + std::to_string(least) + " to " + std::to_string(most) + ", is " + value_->dump());
  };
  int64_t number = 0;
  if (value_->is_number_float()) {
    const double real = value_->get<double>();
    if (!is_finite(real) || std::trunc(real) != real) fail("must be an integer, is " + value_->dump());
    if (std::abs(real) > kExact) out_of_range();
    number = static_cast<int64_t>(real);
  } else if (value_->is_number_integer()) {
    if (value_->is_number_unsigned() && value_->get<uint64_t>() > static_cast<uint64_t>(INT64_MAX)) out_of_range();
    number = value_->get<int64_t>();
  } else {
    fail(std::string("must be an integer, is ") + value_->type_name());
  }
  if (number < least || number > most) out_of_range();
  return number;
}

std::string JsonValue::text() const {
  if (!value_->is_string()) fail(std::string("must be a string, is ") + value_->type_name());
  return value_->get<std::string>();
}

Vec3 JsonValue::vec3() const {
  const std::vector<JsonValue> v = elements(3);
  return {v[0].number(), v[1].number(), v[2].number()};
}

Quat JsonValue::unit_quaternion() const {
  const std::vector<JsonValue> v = elements(4);
  const Quat q(v[0].number(), v[1].number(), v[2].number(), v[3].number());
  const double norm = glm::length(q);
  if (!(std::abs(norm - 1) <= kUnitTolerance))
    fail("must be a quaternion (w, x, y, z) of unit norm, its norm is " + json(norm).dump());
  return q;
}

void JsonValue::require_format(const std::string& format, int version) const {
  const JsonValue found = at("format");
  if (found.text() != format) found.fail("must be \"" + format + "\", is \"" + found.text() + "\"");
  at("version").integer(version, version);
}

}  // namespace lf
