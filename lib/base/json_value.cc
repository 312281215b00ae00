// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/json_value.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/terminal_text.h"
#include "base/text.h"

namespace lf {
namespace {

using nlohmann::json;

constexpr size_t kMaxJsonDepth = 64;  // deeper than all our formats; limits the recursion of printing

std::string join(const std::string& place, const std::string& key) { return place.empty() ? key : place + "." + key; }
std::string join(const std::string& place, size_t index) { return place + "[" + std::to_string(index) + "]"; }

// Removes the prefix "[json.exception.parse_error.101] " of nlohmann's messages. Truncates the rest, which repeats the
// offending token and may have megabytes.
std::string without_tag(const std::string& what) {
  constexpr size_t kMost = 300;
  const size_t end = what.find("] ");
  const std::string text = what.rfind("[json.", 0) == 0 && end != std::string::npos ? what.substr(end + 2) : what;
  return text.size() > kMost ? text.substr(0, kMost) + "..." : text;
}

// Builds the value while the parser reads the text, and throws Error with the place where the parser stopped.
class JsonBuilder : public nlohmann::json_sax<json> {
 public:
  explicit JsonBuilder(const std::string& name) : name_(name) {}
  json root;

  bool null() override { return put(nullptr); }
  bool boolean(bool value) override { return put(value); }
  bool number_integer(int64_t value) override { return put(value); }
  bool number_unsigned(uint64_t value) override { return put(value); }
  bool number_float(double value, const std::string&) override { return put(value); }
  bool string(std::string& value) override { return put(std::move(value)); }
  bool binary(json::binary_t& value) override { return put(std::move(value)); }
  bool start_object(size_t) override { return open(json::object()); }
  bool start_array(size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(std::string& key) override {
    Level& level = levels_.back();
    level.key = std::move(key);
    if (level.value->contains(level.key)) throw Error(name_ + ": " + place() + "the key appears twice in this object");
    return true;
  }
  bool parse_error(size_t, const std::string&, const json::exception& e) override {
    throw Error(name_ + ": " + place() + "not valid JSON: " + without_tag(e.what()));
  }

 private:
  struct Level {
    json* value;
    std::string key = {};
  };

  // Returns for example "a[2].b: ", or "" at the top level.
  std::string place() const {
    std::string place;
    for (size_t i = 0; i < levels_.size(); i++) {
      const Level& level = levels_[i];
      const bool is_open = i + 1 < levels_.size();  // a child is open and already in the array
      if (level.value->is_array())
        place = join(place, level.value->size() - is_open);
      else if (!level.key.empty())
        place = join(place, level.key);
    }
    return place.empty() ? "" : place + ": ";
  }
  json* add(json value) {
    if (levels_.empty()) return &(root = std::move(value));
    Level& level = levels_.back();
    if (level.value->is_array()) return &level.value->emplace_back(std::move(value));
    return &((*level.value)[level.key] = std::move(value));
  }
  void element_done() {
    if (!levels_.empty()) levels_.back().key.clear();
  }
  bool put(json value) {
    add(std::move(value));
    element_done();
    return true;
  }
  bool open(json value) {
    if (levels_.size() > kMaxJsonDepth) throw Error(name_ + ": " + place() + "nested too deeply");
    levels_.push_back({add(std::move(value))});
    return true;
  }
  bool close() {
    levels_.pop_back();
    element_done();
    return true;
  }

  const std::string& name_;
  std::vector<Level> levels_;
};

}  // namespace

std::string read_text_file(const std::string& path) {
  std::string text = read_file(path);
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
    throw Error(path + ": is a UTF-16 text; save the file as UTF-8");
  return text;
}

void write_text_file(const std::string& text, const std::string& path) {
  AtomicFileWriter file(path);
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
  JsonBuilder builder(name);
  json::sax_parse(text, &builder);
  return std::move(builder.root);
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
  constexpr double kExact = 9007199254740992;  // 2^53: larger doubles may represent several integers
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
  std::string text = value_->get<std::string>();
  if (text.find('\0') != text.npos) fail("has a character NUL (\\u0000)");
  return text;
}

std::string JsonValue::name() const {
  constexpr size_t kMost = 200;  // file names have at most 255 bytes
  std::string name = text();
  if (name.size() > kMost)
    fail("must have at most " + std::to_string(kMost) + " bytes, has " + std::to_string(name.size()));
  if (has_control_characters(name)) fail("has control characters");
  return name;
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
