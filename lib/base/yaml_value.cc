// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/yaml_value.h"

#include <charconv>
#include <sstream>
#include <vector>

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/number_text.h"

namespace lf {
namespace {

using nlohmann::json;

constexpr size_t kMaxYamlDepth = 64;  // as in JSON files

json scalar(const std::string& text) {
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (text.size() > 1 && *begin == '+') begin++;
  int64_t integer = 0;
  if (const auto [rest, error] = std::from_chars(begin, end, integer); error == std::errc() && rest == end)
    return integer;
  double number = 0;
  const bool has_digit = text.find_first_of("0123456789") != std::string::npos;  // not "inf" and "nan"
  if (const auto [rest, error] = std::from_chars(begin, end, number); has_digit && error == std::errc() && rest == end)
    return number;
  if (text == "true" || text == "false") return text == "true";
  if (text.empty() || text == "~" || text == "null") return nullptr;
  return text;
}

// Builds the value as the parser walks the text.
class Builder : public YAML::EventHandler {
 public:
  json root;

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { put(mark, nullptr); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { fail(mark, "aliases are not read"); }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t, const std::string& value) override {
    if (!is_utf8(value)) fail(mark, "no text in UTF-8");
    if (is_key()) {
      levels_.back().key = value;
      levels_.back().has_key = true;
      if (levels_.back().value->contains(value)) fail(mark, "\"" + value + "\" is there twice");
    } else {
      put(mark, tag == "!" ? json(value) : scalar(value));  // "!": in quotes
    }
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    open(mark, json::array());
  }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    open(mark, json::object());
  }
  void OnSequenceEnd() override { levels_.pop_back(); }
  void OnMapEnd() override { levels_.pop_back(); }

 private:
  struct Level {
    json* value;
    std::string key = {};
    bool has_key = false;
  };

  [[noreturn]] static void fail(const YAML::Mark& mark, const std::string& what) {
    throw YAML::ParserException(mark, what);
  }
  bool is_key() const { return !levels_.empty() && levels_.back().value->is_object() && !levels_.back().has_key; }
  json* put(const YAML::Mark& mark, json value) {
    if (levels_.empty()) return &(root = std::move(value));
    if (is_key()) fail(mark, "a key must be a word");
    Level& level = levels_.back();
    level.has_key = false;
    if (level.value->is_array()) return &level.value->emplace_back(std::move(value));
    return &((*level.value)[level.key] = std::move(value));
  }
  void open(const YAML::Mark& mark, json value) {
    if (levels_.size() >= kMaxYamlDepth) fail(mark, "nested too deeply");
    levels_.push_back({put(mark, std::move(value))});
  }

  std::vector<Level> levels_;
};

}  // namespace

json parse_yaml(const std::string& text, const std::string& name) {
  Builder builder;
  try {
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    parser.HandleNextDocument(builder);
  } catch (const YAML::Exception& e) {
    const std::string line = e.mark.is_null() ? "" : "line " + std::to_string(e.mark.line + 1) + ": ";
    throw Error(name + ": " + line + "not valid YAML: " + e.msg);
  }
  return std::move(builder.root);
}

std::string yaml_number(double value) {
  std::string text = number_text(value);
  if (text.find('.') == std::string::npos) text.insert(std::min(text.find('e'), text.size()), ".0");
  return text;
}

}  // namespace lf
